"""Labelled pages; requests and responses of /layout/models/{name}/samples."""

from collections.abc import Mapping
from datetime import datetime
from typing import Any, Literal

from pydantic import BaseModel, Field

from services.contract.answers.layout import Appearance
from services.contract.answers.page import Answer, Warning


class PageZone(BaseModel):
    """One region of a labelled page; a property that is absent or null was not measured."""

    id: str | int
    box: tuple[float, float, float, float] = Field(
        description="x0, y0, x1, y1 in pixels of the page, x0 < x1, y0 < y1."
    )
    label: str | None = Field(default=None, description="null: no label of the model.")
    kind: Literal["text", "figure", "rule", "noise"] | None = None
    lines: int | None = Field(default=None, ge=0)
    font_size: float | None = Field(default=None, ge=0, description="Em, pixels.")
    line_spacing: float | None = Field(default=None, ge=0, description="Pixels from baseline to baseline.")
    weight: float | None = Field(default=None, ge=0, description="Stroke width as a share of the font size.")
    alignment: Literal["left", "right", "centre", "justified"] | None = None
    appearance: Appearance | None = None
    text: str | None = None
    content: dict[str, float] | None = Field(
        default=None, description="Content features, each with a confidence 0-1."
    )
    pieces: list[tuple[float, float, float, float]] | None = Field(
        default=None, description="Boxes of the zones of segmentation that it was put together from."
    )


class PageBody(BaseModel):
    """A labelled page: a response of /layout with corrected labels. At least one zone has a label.

    Other keys are ignored.
    """

    width: float = Field(gt=0, description="Pixels.")
    height: float = Field(gt=0, description="Pixels.")
    zones: list[PageZone] = Field(min_length=1)


def without_words(page: Mapping[str, Any]) -> dict[str, Any]:
    """A stored page as answers show it: words that no zone has are kept for tables only, as those of zones are."""
    return {key: value for key, value in page.items() if key != "loose"}


class SampleReceipt(Answer):
    """A sample that was stored."""

    id: str
    model: str
    zones: int = Field(ge=1)
    labels: dict[str, int] = Field(description="Number of zones with each label.")
    warnings: list[Warning] = Field(
        default=[],
        exclude_if=lambda warnings: not warnings,
        description="`block-left-out`: a block of `zones_file` that could not be read. Absent: none.",
    )


class SampleSummary(Answer):
    """A stored sample, without its zones."""

    id: str
    zones: int
    labels: dict[str, int]
    created: datetime


class SampleList(Answer):
    """Samples of a model, oldest first."""

    model: str
    samples: list[SampleSummary]


class Sample(Answer):
    """A stored sample, with all measured properties. Its page can be sent to POST .../samples unchanged."""

    id: str
    model: str
    created: datetime
    width: float
    height: float
    zones: list[PageZone]
    found: PageBody | None = Field(
        default=None,
        description="The same page with the zones that segmentation found in its image, each with the label of the "
        "verified zones that cover it; the model learns from both. null: no image, or the zones are the same.",
    )
    segmentation: str | None = Field(
        default=None,
        description="Name of the segmentation that looked at the image; null: no image, or an early one.",
    )
