"""Feedback as tests write it: what a person said of a result, and what it changes."""

from typing import Any

from models.feedback_records import FeedbackDraft, ModelChange
from models.records import UnknownPageDraft


def draft(
    result_id: str,
    request: Any = "sender",
    *,
    key: str | None = None,
    found: str | None = "letter",
    verified: str | None = "letter",
    zones: int = 10,
    wrong: int = 1,
    sample: Any = "the page",
    unknown: Any = None,
) -> FeedbackDraft:
    """A feedback that says `request`."""
    return FeedbackDraft(
        result_id=result_id,
        key=key,
        request={"labels": {"z1": request}},
        report={"wrong": wrong, "of": zones},
        found_class=found,
        verified_class=verified,
        zones=zones,
        wrong_zones=wrong,
        class_wrong=found != verified,
        sample=None if sample is None else {"page": sample, "label": request},
        unknown_page=None if unknown is None else UnknownPageDraft({"n": unknown}, bound=3, ttl_s=1000),
    )


def change(name: str, expected: int | None = 1, n: int = 2) -> ModelChange:
    return ModelChange(name, {"n": n}, expected)
