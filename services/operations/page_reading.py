"""The text of a flat page: OCR on its flat-fielded picture, in the reading order of page segmentation."""

import math
from contextlib import AbstractContextManager
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from services.arrays import RgbImage
from services.contract.answers.page_text import PageWord, ReadText
from services.contract.images import Encoding, TextFormat
from services.deadline import answered_within, time_left_s
from services.errors import InvalidOption
from services.imaging.channels import luminance
from services.imaging.rulings import cells_of_grids
from services.layout.page import Page, Zone
from services.layout.pipeline import segment_read_page
from services.layout.segmentation.reading_order import reading_order
from services.notices import Notice
from services.ocr.engine import OcrEngine, Word
from services.ocr.languages import language_tag
from services.ocr.printed_words import NOT_KNOWN, PrintedWords
from services.ocr.tesseract import default_language, installed_languages
from services.ocr.word_trust import probability_right
from services.operations.reader import ocr_engine
from services.text.alto import write_alto_pages
from services.text.arrangement import Region, arrange_words, with_blocks
from services.text.hocr import write_hocr
from services.text.page_text import PageText
from services.text.photo_places import locate_boxes
from services.text.plain import write_markdown, write_plain_text
from services.text.ruled_tables import read_tables

READING_BEGINS = 0.55
"""Typical progress before a page is read, if it is."""
LIMIT_S = 8.0
"""Processor time after which no more of a page is read. A page of tables takes 2 to 4 s. Of wall time 12 s cut such
pages where four processes shared a processor."""
SHARE_OF_TIME = 0.7
"""Of the time that is left to the request when reading begins. What follows takes a fifth of a usual reading, but must
have enough where reading is cut."""
READING_CUT = Notice(
    "reading-cut",
    f"The page was not read to its end within {LIMIT_S:g} s of processor time, or within the time of the request: the "
    "text holds what was read until then. Send a part of the page.",
)
LEAST_HELD = 0.5
"""Least share of a page's words in its text zones. It was 0.13 on a dark photo whose zones were wrong."""


def reading_engine(language: str | None) -> tuple[OcrEngine, str]:
    """The engine that reads pages in `language` (None: the default), and that language.

    Raises
    ------
    InvalidOption
        When no OCR engine or no language data is installed.
    """
    check_installed(language)
    engine = ocr_engine(language)
    if engine is None:
        raise InvalidOption(
            "text: no OCR engine is installed on this server, so pages cannot be read; send text=false, and ask for "
            "an image or json.",
            "text",
        )
    return engine, language or default_language()


def check_installed(language: str | None) -> None:
    """Raise `InvalidOption`, with the installed languages, unless all of `language` are (None: the default).

    Raises
    ------
    InvalidOption
    """
    if language is None:
        return
    installed = installed_languages()
    missing = [name for name in language.split("+") if name not in installed]
    if missing:
        meant = [name.lower() for name in missing if name.lower() in installed]
        hint = f" Did you mean {meant[0]!r}?" if meant else ""
        raise InvalidOption(
            f"language: {', '.join(missing)} is not installed on this server; installed are "
            f"{', '.join(installed) or 'none'}.{hint}",
            "language",
        )


def read_flat_page(
    image: RgbImage,
    engine: OcrEngine,
    language: str,
    mesh: NDArray[np.float64] | None = None,
    printed: PrintedWords = NOT_KNOWN,
) -> PageText:
    """The text of a flat page.

    Parameters
    ----------
    image
        (H, W, 3) RGB, at full resolution.
    engine
        Reads the page.
    language
        What the engine reads.
    mesh
        (rows, columns, 2): the photo points of the page, as `RectifyResult.mesh`; None if there is no single photo.
    printed
        The words that the page's file says are on it.
    """
    height, width = image.shape[:2]
    with read_in_time():
        page, words, cut = segment_read_page(image, engine, LIMIT_S, printed)
    # An engine's box may have no extent, or end outside of the picture.
    words = [word for word in words if word.box[2] > word.box[0] and word.box[3] > word.box[1]]
    tables = read_tables(words, cells_of_grids(luminance(image)))
    blocks = with_blocks(arrange_words(tables.others, _believable_regions(page, words)), tables.blocks)
    text = PageText(width, height, language, blocks, cut=cut)
    if mesh is None:
        return text
    return replace(text, places=locate_boxes(mesh, width, height, [word.box for word in text.words]))


def read_in_time() -> AbstractContextManager[None]:
    """Within the block reading ends before the time of the request does, as on a very busy machine.

    A text in part is more than a refusal.
    """
    return answered_within(SHARE_OF_TIME * time_left_s())


def _believable_regions(page: Page, words: list[Word]) -> list[Region]:
    """Zones of segmentation with words; none where they miss most words, so that the words are arranged by rows alone.

    A dark photo with much desk in view can be taken for light print on dark ground. Its zones are then bits of the
    paper between letters.
    """
    # Zones of `/layout` keep the order in which samples were measured.
    order = reading_order([zone.box for zone in page.zones], heads_first=True)
    zones = [
        page.zones[index] for index in order if page.zones[index].kind == "text" or page.zones[index].words
    ]
    held = sum(len(zone.words) for zone in zones)
    return [_region(zone) for zone in zones] if held >= LEAST_HELD * len(words) else []


def _region(zone: Zone) -> Region:
    return Region(zone.box, zone.font_size, tuple(word.box for word in zone.words))


def describe_text(text: PageText) -> ReadText:
    """The `text` of an answer."""
    places = text.places or (None,) * len(text.words)
    lines = [number for number, line in enumerate(text.lines) for _ in line.words]
    return ReadText(
        language=text.language,
        confidence=None if text.confidence is None else round(text.confidence, 4),
        words=[
            PageWord(
                text=word.text,
                confidence=round(probability_right(word.confidence), 4),
                box=rounded_box(word.box),
                photo=place,
                line=line,
            )
            for word, place, line in zip(text.words, places, lines, strict=True)
        ],
    )


def rounded_box(box: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    """The box with hundredths of a pixel."""
    x0, y0, x1, y1 = box
    return round(x0, 2), round(y0, 2), round(x1, 2), round(y1, 2)


def write_text(pages: list[PageText], text_format: TextFormat, encoding: Encoding, dpi: float) -> bytes:
    """The text of the pages as a file; `dpi` is their resolution."""
    if text_format == "txt":
        return write_plain_text(pages)
    if text_format == "markdown":
        return write_markdown(pages)
    tag = language_tag(pages[0].language) if pages else ""
    if text_format == "alto":
        return write_alto_pages(pages, encoding.title, tag)
    assert math.isfinite(dpi)
    return write_hocr(pages, encoding.title, tag, dpi)
