"""Pages and their zones, as plain values that are ready for JSON: no arrays."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

Box = tuple[float, float, float, float]
"""(x0, y0, x1, y1) in pixels of the page, x1 > x0 and y1 > y0."""
Kind = Literal["text", "figure", "rule", "noise"]
Alignment = Literal["left", "right", "centre", "justified"]

KINDS: tuple[Kind, ...] = get_args(Kind)
ALIGNMENTS: tuple[Alignment, ...] = get_args(Alignment)


class InvalidLayout(ValueError):
    """A page, a zone or a model is invalid; `field` names the part, as in `zones[3].box`."""

    def __init__(self, detail: str, field: str | None = None) -> None:
        super().__init__(detail, field)
        self.detail = detail
        self.field = field


@dataclass(frozen=True, slots=True)
class ZoneWord:
    """A word that OCR read: its text, box in pixels of the page, confidence 0-1, and the row of its zone's text."""

    text: str
    box: Box
    confidence: float
    line: int


@dataclass(frozen=True, slots=True)
class InkAppearance:
    """How the ink of a zone looks.

    `density` is the share of its box that is ink; `size` the mean height of its components by their ink, as a
    multiple of the page's glyph height, and `size_spread` the standard deviation of its binary logarithm; `stroke`
    the mean width of strokes over that of the page's print; `slant` how far strokes lean to the right by height;
    `regularity` the share of components that stand on one baseline with a neighbour.
    """

    density: float
    size: float
    size_spread: float
    stroke: float
    slant: float
    regularity: float


@dataclass(frozen=True, slots=True)
class Zone:
    """One homogeneous region of a page; None for values that were not measured.

    `font_size` is the em of its print and `line_spacing` the distance of its baselines, in pixels; `weight` the
    stroke width as a share of the font size; `content` the confidence, 0-1, that it has a content feature
    (Table 5.1). `label` is the logical label where it is known, None for none of the model's.
    `appearance` is that of its ink. `words` are those of `text` where OCR read it, in their order; of a figure, which
    has no text of its own, those that are printed within it. `pieces` are the boxes of the zones of segmentation that
    it was put together from; none where it is one of these.
    """

    id: str
    box: Box
    kind: Kind = "text"
    lines: int | None = None
    font_size: float | None = None
    line_spacing: float | None = None
    weight: float | None = None
    alignment: Alignment | None = None
    appearance: InkAppearance | None = None
    text: str = ""
    content: Mapping[str, float] = field(default_factory=dict)
    label: str | None = None
    words: tuple[ZoneWord, ...] = ()
    pieces: tuple[Box, ...] = ()

    @property
    def text_confidence(self) -> float | None:
        """Mean confidence of the words by their length, None where OCR read none."""
        letters = sum(len(word.text) for word in self.words)
        return sum(len(word.text) * word.confidence for word in self.words) / letters if letters else None


@dataclass(frozen=True, slots=True)
class Page:
    """A segmented page of `width` x `height` pixels, its zones in reading order if that is known.

    `loose` are words that were read and are in no zone: signs that stand alone (the sign of a currency, %), and what
    segmentation lost. Tables are made of all words.
    """

    width: float
    height: float
    zones: tuple[Zone, ...]
    loose: tuple[ZoneWord, ...] = ()


def is_finite_number(value: Any) -> bool:
    """Whether `value` is a finite JSON number (True and False are not numbers)."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number of JSON may be larger than any float
        return False
