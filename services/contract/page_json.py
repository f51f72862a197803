"""Pages with all that was measured on them, as JSON: what server and workers exchange and the store keeps.

`services.layout.exchange.page_json` writes and reads them; it has the meaning of every key.
"""

from collections.abc import Mapping, Sequence
from typing import NotRequired, TypedDict


class ZoneJson(TypedDict):
    """One zone; values that were not measured are missing."""

    id: str
    box: list[float]
    label: str | None
    kind: str
    lines: NotRequired[int]
    font_size: NotRequired[float]
    line_spacing: NotRequired[float]
    weight: NotRequired[float]
    alignment: NotRequired[str]
    appearance: NotRequired[Mapping[str, float]]
    pieces: NotRequired[list[list[float]]]
    text: NotRequired[str]
    content: NotRequired[Mapping[str, float]]
    printed: NotRequired[list[list[str | float]]]


class GivenZoneJson(TypedDict):
    """A zone of a person, drawn on a page or with another label or text."""

    id: NotRequired[str]
    box: Sequence[float]
    label: NotRequired[str | None]
    text: NotRequired[str]
    kind: NotRequired[str]


class PageJson(TypedDict):
    """A page; boxes are in its pixels. `loose` are words in no zone, as `printed` of a zone."""

    width: float
    height: float
    zones: list[ZoneJson]
    loose: NotRequired[list[list[str | float]]]


class SampleJson(PageJson):
    """A labelled page, for learning.

    `found` is its second view: the zones that segmentation finds in its image, with the verified labels.
    `segmentation` names the segmentation that looked at its image.
    """

    found: NotRequired[PageJson]
    segmentation: NotRequired[str]
