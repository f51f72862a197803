"""Proposals as a worker makes them of documents: what cannot be read is left out."""

from typing import Any, cast

from services.contract.answers.proposals import LookedAt
from services.contract.layout import LayoutSettings
from services.contract.layout_models import PageDocument
from services.contract.page_json import SampleJson
from services.layout.exchange.page_json import page_to_document
from services.operations.layout_discovery import propose_classes
from services.progress import progress_to
from tests.services.layout.samples import labelled_page

SETTINGS = LayoutSettings()


def stored(name: str, seed: int) -> PageDocument:
    return PageDocument(f"{name}{seed}", cast(SampleJson, page_to_document(labelled_page(name, seed))))


def test_pages_that_cannot_be_read_are_left_out() -> None:
    pages = [stored("fax", seed) for seed in range(3)]
    empty = PageDocument("empty", {"width": 10, "height": 10, "zones": []})
    broken: Any = {"width": -1}
    damaged = PageDocument("damaged", broken)
    told = propose_classes(
        [damaged, *pages, empty], {"memo": [damaged, stored("memo", 0)], "none": [empty]}, SETTINGS
    )
    (group,) = told.new_classes
    assert group.pages == ["fax0", "fax1", "fax2"]
    assert told.looked_at == LookedAt(unknown_pages=3, models=1, samples=1)
    assert told.merges == told.splits == []


def test_a_page_that_is_sent_again_is_no_second_one() -> None:
    first, second = (stored("fax", seed) for seed in range(2))
    again = [PageDocument(f"again{copy}", first.document) for copy in range(3)]
    told = propose_classes([first, *again, second], {}, SETTINGS)
    assert told.new_classes == []
    assert told.looked_at.unknown_pages == 2


def test_samples_with_a_found_page_are_seen_in_both_views() -> None:
    samples = []
    for seed in range(4):
        page = stored("memo", seed)
        samples.append(PageDocument(page.id, {**page.document, "found": page.document}))
    halves = {"a": samples[:4], "b": [stored("memo", seed) for seed in range(4, 8)]}
    (merge,) = propose_classes([], halves, SETTINGS).merges
    assert merge.models == ["a", "b"]
    assert merge.fit >= 0.7


def test_progress_rises() -> None:
    told: list[tuple[str, float]] = []
    with progress_to(lambda stage, fraction: told.append((stage, fraction))):
        propose_classes([], {"a": [stored("memo", 0)], "b": [stored("fax", 0)]}, SETTINGS)
    fractions = [fraction for _, fraction in told]
    assert fractions == sorted(fractions)
    assert [stage for stage, _ in told] == ["unknown_pages", "samples", "samples", "pairs_of_classes"]
