"""The text of a kept page: read once, and kept until the page shows another part of its photo."""

import zlib
from dataclasses import asdict, dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from services.arrays import RgbImage
from services.contract.kept_pages import KeptPageJson, PageReading, ReadTextJson
from services.contract.rectify import Crop, Origin, TypesetPage
from services.ocr.engine import Word
from services.ocr.printed_words import NOT_KNOWN
from services.operations.page_reading import check_installed, read_flat_page, reading_engine
from services.operations.replies import to_json_ready
from services.text.page_text import PageText, ReadLine, TextBlock
from services.text.photo_places import locate_boxes
from services.text.printed_places import printed_in_view


@dataclass(frozen=True, slots=True)
class ShownPart:
    """What a view shows: a text that was read on one view holds for all views of the same part.

    `plan` is a checksum of how the views are drawn: other corners make another one. The look does not count: letters
    are the same in colour and in black and white.
    """

    crop: Crop
    margin: float
    turn: int
    plan: int


def shown_part(crop: Crop, margin: float, turn: int, plan: bytes) -> ShownPart:
    """The part that is shown by these options and a packed `ViewPlan`."""
    return ShownPart(crop, margin, turn, zlib.crc32(plan))


def keep_text(document: KeptPageJson, part: ShownPart, text: PageText) -> None:
    """Put the text of a view of `part` into the document of a kept page; places in the photo are found again."""
    read = cast(ReadTextJson, to_json_ready(asdict(replace(text, places=()))))
    document["text"] = {"part": asdict(part), "read": read}


def wanted_reading(reading: PageReading | None) -> PageReading | None:
    """The reading, where the text is wanted.

    Raises
    ------
    InvalidOption
        When nothing is read, and its language is not installed.
    """
    if reading is None or reading.is_wanted:
        return reading
    check_installed(reading.language)
    return None


def kept_text(document: KeptPageJson, part: ShownPart, reading: PageReading) -> PageText | None:
    """The text that is kept of `part` in this language, without places; None where it was not read.

    Raises
    ------
    InvalidOption
        When no OCR engine or no language data is installed.
    """
    _, language = reading_engine(reading.language)
    kept = document.get("text")
    if kept is None or kept["part"] != asdict(part) or kept["read"]["language"] != language:
        return None
    return _opened(kept["read"])


def text_of(
    document: KeptPageJson,
    part: ShownPart,
    view: RgbImage,
    reading: PageReading,
    mesh: NDArray[np.float64],
    origin: Origin,
) -> PageText:
    """The text of a `view` (H, W, 3) of `part`: what is kept of it, else it is read, or its file says it (`origin`).

    `mesh` (rows, columns, 2) has the photo points of the view. Raises what `kept_text` raises.
    """
    text = kept_text(document, part, reading)
    height, width = view.shape[:2]
    if text is None:
        printed = NOT_KNOWN
        if isinstance(origin, TypesetPage):
            photo = document["answer"]["photo"]
            printed = printed_in_view(origin, (photo["width"], photo["height"]), mesh, (width, height))
        return read_flat_page(view, *reading_engine(reading.language), mesh, printed)
    text = text.resized(width, height)
    return replace(text, places=locate_boxes(mesh, width, height, [word.box for word in text.words]))


def _box(sides: list[float]) -> tuple[float, float, float, float]:
    x0, y0, x1, y1 = sides
    return x0, y0, x1, y1


def _opened(read: ReadTextJson) -> PageText:
    """The text that `keep_text` has put away; JSON has made lists of its tuples."""
    blocks = tuple(
        TextBlock(
            tuple(
                ReadLine(
                    tuple(
                        Word(word["text"], _box(word["box"]), word["confidence"], word.get("line"))
                        for word in line["words"]
                    )
                )
                for line in block["lines"]
            ),
            block["kind"],
            block["level"],
        )
        for block in read["blocks"]
    )
    return PageText(
        read["width"], read["height"], read["language"], blocks, places=(), cut=read.get("cut", False)
    )
