"""Reading of an image that nobody has turned: where it reads badly as it lies, it is turned and read again."""

import time
from dataclasses import dataclass, replace

from services.arrays import RgbImage
from services.contract.rectify import Origin, TypesetPage
from services.imaging.channels import luminance
from services.layout.pipeline import read_all, readable
from services.notices import Notice
from services.ocr.engine import OcrEngine, Word, mean_confidence
from services.ocr.lost_print import with_lost_print
from services.ocr.printed_words import NOT_KNOWN, PrintedWords
from services.ocr.softer_reading import improved, read_best, read_within
from services.operations.page_reading import LIMIT_S, READING_CUT, read_in_time
from services.rectify.results import Orientation
from services.rectify.view.orientation import estimate_orientation
from services.rectify.view.turned_image import apply_orientation
from services.text.printed_places import printed_on_page

READS_WELL = 0.6
"""Mean confidence of words from which on a page lies as it reads: upright pages have 0.75 to 0.95, others 0.0 to 0.45.
So does print in a language that the engine is not told, whose direction is then looked for in vain."""
MANY_LETTERS = 3
"""From so many letters on a word is wider than high where its line lies."""


@dataclass(frozen=True, slots=True, eq=False)
class UprightReading:
    """An `image` (H, W, 3) as it was read, its `words`, None without an engine, and how it was turned for that.

    `orientation` is None where nothing was read.
    """

    image: RgbImage
    words: list[Word] | None
    orientation: Orientation | None = None
    notices: tuple[Notice, ...] = ()


def read_as_it_lies(
    image: RgbImage, engine: OcrEngine | None, printed: PrintedWords = NOT_KNOWN
) -> UprightReading:
    """The reading of an image that is upright."""
    if engine is None:
        return UprightReading(image, None)
    with read_in_time():
        words, cut = read_all(luminance(image), engine, LIMIT_S, printed)
    return UprightReading(image, words, notices=_left_unread(cut))


def read_upright(image: RgbImage, engine: OcrEngine | None, origin: Origin = "photo") -> UprightReading:
    """The reading of an image, turned if it reads better so, or as its `origin` says."""
    if engine is None:
        return UprightReading(image, None)
    if isinstance(origin, TypesetPage) and origin.words:
        return _read_typeset(image, engine, origin)
    even, ends_s = readable(luminance(image)), time.process_time() + LIMIT_S
    with read_in_time():
        words, cut = read_within(even, engine, LIMIT_S)
        confidence = mean_confidence(words)
        if confidence >= READS_WELL and not _lies_sideways(words):
            found = Orientation(0, False, confidence)
        else:
            found = estimate_orientation(even, engine)
        if found.rotation_deg or found.mirrored:
            even, ends_s = apply_orientation(even, found), time.process_time() + LIMIT_S
            words, cut = read_best(even, engine, LIMIT_S)
            words = with_lost_print(even, words, engine, ends_s)
            cut |= time.process_time() >= ends_s
            image = apply_orientation(image, found)
            return UprightReading(image, words, found, (_turned(found), *_left_unread(cut)))
        if not cut:
            words, cut = improved(even, engine, words, limit_s=LIMIT_S)
        words = with_lost_print(even, words, engine, ends_s)
        cut |= time.process_time() >= ends_s
    return UprightReading(image, words, found, _left_unread(cut))


def _read_typeset(image: RgbImage, engine: OcrEngine, origin: TypesetPage) -> UprightReading:
    """The reading of a page whose file says how it is turned, and its words."""
    found = Orientation(origin.turn, False, None)
    printed = printed_on_page(origin, (image.shape[1], image.shape[0]), origin.turn)
    read = read_as_it_lies(apply_orientation(image, found), engine, printed)
    turned = (_turned(found),) if origin.turn else ()
    return replace(read, orientation=found, notices=(*turned, *read.notices))


def _left_unread(cut: bool) -> tuple[Notice, ...]:
    return (READING_CUT,) if cut else ()


def _lies_sideways(words: list[Word]) -> bool:
    """Whether most words run down or up the page: an engine may read them all the same."""
    boxes = [word.box for word in words if len(word.text) >= MANY_LETTERS]
    return sum(y1 - y0 > x1 - x0 for x0, y0, x1, y1 in boxes) > len(boxes) / 2


def _turned(orientation: Orientation) -> Notice:
    flipped = "flipped left to right, then " if orientation.mirrored else ""
    return Notice(
        "page-turned",
        f"the image does not read as it lies: it was {flipped}turned by {orientation.rotation_deg} degrees clockwise, "
        "and places are those in the turned image (`orientation`).",
    )
