"""Kept photos: what is kept of a page, and what a later answer may change."""

from dataclasses import dataclass, field
from typing import Any, Literal

from services.contract.rectify import Corners, Crop, Illumination, Rotation

MOST_BOUND_PAGES = 200
"""Of one file of kept pages."""


@dataclass(frozen=True, slots=True)
class KeptPage:
    """A page as it is kept.

    `bundle` is a file of its photo, of how its views are drawn, and of its last picture. `document` is JSON: `answer`,
    the page's `RectifyResult` without picture and text; `options`, by which it was made; `text`, where it was read.
    """

    bundle: bytes
    document: dict[str, Any]


@dataclass(frozen=True, slots=True)
class PageWish:
    """What a person says about a kept page; None: as it is.

    `corners` "auto" are to be found again; `rotate` "auto" is the turn that was found.
    """

    corners: Corners | Literal["auto"] | None = None
    rotate: Rotation | str | None = None
    margin: float | None = None
    illumination: Illumination | None = None
    crop: Crop | None = None


@dataclass(frozen=True, slots=True)
class PageReading:
    """That the text of kept pages is wanted, and in which language; None: the worker's default."""

    language: str | None = None


@dataclass(frozen=True, slots=True)
class RenderedPage:
    """What a later answer changes of a kept page: its `document`, and its `bundle` where it was analysed again."""

    document: dict[str, Any] = field(default_factory=dict)
    bundle: bytes = b""
