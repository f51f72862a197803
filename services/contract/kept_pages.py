"""Kept photos: what is kept of a page, and what a later answer may change."""

import io
import json
import zipfile
from dataclasses import dataclass
from typing import Literal, NotRequired, TypedDict

from services.contract.rectify import (
    Corners,
    Crop,
    Illumination,
    Origin,
    PageKind,
    PrintedWord,
    Rotation,
    TypesetPage,
)

MOST_BOUND_PAGES = 200
"""Of one file of kept pages."""


PHOTO, WORDS = "photo", "words.json"
"""Names in the file of a kept page: of its photo, and of what a page of a PDF prints, if its file says that."""


class OrientationJson(TypedDict):
    """`Orientation`: how the page was turned."""

    rotation_deg: int
    mirrored: bool
    photo_rotation_deg: float | None
    confidence: float | None


class PaperJson(TypedDict):
    """The size of the paper, as `RectifyResult` has it."""

    width_mm: float | None
    height_mm: float | None
    dpi: float | None
    aspect: float | None
    reason: str


class SizeJson(TypedDict):
    """Pixels of a photo."""

    width: int
    height: int


class FlatJson(TypedDict):
    """`RectifyResult` without picture and text: what is read of it again."""

    photo: SizeJson
    orientation: OrientationJson
    corners: list[list[float]]
    page: PaperJson | None


class OptionsJson(TypedDict):
    """Of `RectifyParameters`: what a page that is analysed again is analysed by."""

    kind: PageKind
    upright: bool
    focal_length_px: float | None
    illumination: Illumination
    crop: Crop
    paper: str
    language: str | None
    camera: str | None
    margin: float


class WishJson(TypedDict, total=False):
    """What a person has said of a page: `PageWish` without corners."""

    rotate: Rotation | str
    margin: float
    illumination: Illumination
    crop: Crop


class WordOfTextJson(TypedDict):
    """A read word."""

    text: str
    box: list[float]
    confidence: float
    line: NotRequired[int | None]


class LineOfTextJson(TypedDict):
    """A read line."""

    words: list[WordOfTextJson]


class BlockOfTextJson(TypedDict):
    """A read block."""

    lines: list[LineOfTextJson]
    kind: Literal["heading", "text"]
    level: int


class ReadTextJson(TypedDict):
    """The text of a view of `width` x `height` pixels."""

    width: int
    height: int
    language: str
    blocks: list[BlockOfTextJson]
    cut: NotRequired[bool]


class KeptTextJson(TypedDict):
    """A text, and the part of the photo that was read."""

    part: dict[str, str | float]
    read: ReadTextJson


class KeptPageJson(TypedDict):
    """What is known of a kept page.

    `answer` is that of its first time, made by `options`; `wish` what the person has said since, `shown` the last
    answer. `text` is there where it was read. The server adds the bundle's `bytes` and the file's `name`.
    """

    answer: FlatJson
    options: OptionsJson
    wish: WishJson
    rotation_found: int
    stretch: list[float]
    is_document: bool
    print_turn: NotRequired[Rotation | None]
    dpi: float | None
    format: Literal["jpeg", "png", "webp", "tiff", "heic"]
    text: NotRequired[KeptTextJson]
    bytes: NotRequired[int]
    name: NotRequired[str | None]
    shown: NotRequired[FlatJson]


@dataclass(frozen=True, slots=True)
class KeptPage:
    """A page as it is kept.

    `bundle` is a file of its photo, of how its views are drawn, and of its last picture.
    """

    bundle: bytes
    document: KeptPageJson

    def origin(self) -> Origin:
        """That of its picture."""
        turn = self.document.get("print_turn")
        if turn is not None:
            return self._typeset(turn)
        return "page" if self.document["is_document"] else "photo"

    def _typeset(self, turn: Rotation) -> TypesetPage:
        with zipfile.ZipFile(io.BytesIO(self.bundle)) as archive:
            if WORDS not in archive.namelist():
                return TypesetPage(turn)
            kept = json.loads(archive.read(WORDS))
        words = (PrintedWord(text, (x0, y0, x1, y1), line) for text, (x0, y0, x1, y1), line in kept["words"])
        return TypesetPage(turn, tuple(words), kept["has_pictures"])

    def photo(self) -> bytes:
        """The photo: an image file."""
        with zipfile.ZipFile(io.BytesIO(self.bundle)) as archive:
            return archive.read(PHOTO)


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
    """In which language kept pages are read; None: the worker's default."""

    language: str | None = None
    is_wanted: bool = True
    """False: the text is not wanted, and the language need only be one that is installed."""


@dataclass(frozen=True, slots=True)
class RenderedPage:
    """What a later answer changes of a kept page: its `document`, and its `bundle` where it was analysed again."""

    document: KeptPageJson
    bundle: bytes = b""
