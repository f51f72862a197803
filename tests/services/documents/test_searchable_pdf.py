"""The text layer is found, in order and in its place; PDF/A says what it must."""

import ctypes
import io
import struct

import numpy as np
import pikepdf
import pypdfium2
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import ImageCms

from services.documents.glyphless_font import make_glyphless_font
from services.documents.searchable_pdf import PdfFacts, finish_pdf
from services.imaging.codec import encode_image
from services.imaging.page_files import bind_parts, encode_part
from services.ocr.engine import Word
from services.text.page_text import PageText, ReadLine, TextBlock
from tests.services.text.pages import line, page, word

DPI = 100.0
PICTURE = np.full((1100, 850, 3), 255, np.uint8)
PLAIN = encode_image(PICTURE, "pdf", dpi=DPI)
LETTER = page(line(100, "Dear", "Größe,", "日本"), line(150, "שלום"), line(200, "fin"))


def make(text: PageText | None, version: str = "1.7") -> bytes:
    """A PDF of one page with this text."""
    facts = PdfFacts("A <title> & more", "en", "a-2b" if version == "a-2b" else "1.7")
    return finish_pdf(PLAIN, [text], facts, [DPI])


def boxes_of(pdf: bytes) -> dict[str, tuple[float, float, float, float]]:
    """Box of every word in pixels of the page, as a reader that measures glyphs finds it."""
    text = pypdfium2.PdfDocument(pdf)[0].get_textpage()
    found: dict[str, tuple[float, float, float, float]] = {}
    content = text.get_text_range()
    for each in content.split():
        start = content.index(each)
        edges = np.array([text.get_charbox(start + index) for index in range(len(each))]) * DPI / 72
        found[each] = (
            edges[:, 0].min(),
            1100 - edges[:, 3].max(),
            edges[:, 2].max(),
            1100 - edges[:, 1].min(),
        )
    return found


def test_words_are_found_in_order() -> None:
    text = pypdfium2.PdfDocument(make(LETTER))[0].get_textpage()
    assert text.get_text_range().split() == ["Dear", "Größe,", "日本", "שלום", "fin"]
    assert text.search("Dear Größe").get_next() == (0, 10)
    assert text.search("שלום").get_next() is not None
    assert text.search("absent").get_next() is None


def test_boxes_are_those_of_the_words() -> None:
    boxes = boxes_of(make(LETTER))
    for each in LETTER.words:
        assert boxes[each.text] == pytest.approx(each.box, abs=0.75)


def test_a_low_word_stays_in_its_line() -> None:
    """A dash has a flat box; readers would take it for a line of its own."""
    words = (word("from", 100, 100), word("—", 200, 113, 20, 3), word("to", 240, 100))
    text = PageText(850, 1100, "eng", (TextBlock((ReadLine(words),)),))
    assert pypdfium2.PdfDocument(make(text))[0].get_textpage().get_text_range().strip() == "from — to"


def test_a_word_without_ascenders_keeps_its_rows() -> None:
    words = (word("from", 100, 100, 60, 24), word("me", 200, 107, 30, 12), word("5", 240, 110, 12, 12))
    text = PageText(850, 1100, "eng", (TextBlock((ReadLine(words),)),))
    assert boxes_of(make(text))["me"] == pytest.approx((200, 107, 230, 119), abs=0.75)
    assert boxes_of(make(text))["5"] == pytest.approx((240, 110, 252, 122), abs=0.75)


def test_the_picture_is_what_is_seen() -> None:
    seen = [pypdfium2.PdfDocument(file)[0].render().to_numpy() for file in (PLAIN, make(LETTER))]
    assert np.array_equal(*seen)


@pytest.mark.parametrize("version", ["1.7", "a-2b"])
def test_the_file_is_sound_and_says_what_it_is(version: str) -> None:
    pdf = make(LETTER, version)
    assert pdf == make(LETTER, version)
    with pikepdf.open(io.BytesIO(pdf)) as document:
        assert document.check_pdf_syntax() == []
        assert document.Root.Lang == "en"
        assert document.docinfo["/Title"] == "A <title> & more"
        metadata = document.open_metadata()
        assert metadata["dc:title"] == "A <title> & more"
        assert metadata.pdfa_status == ("2B" if version == "a-2b" else "")
        assert ("/OutputIntents" in document.Root) == (version == "a-2b")
        font = document.pages[0].Resources.Font["/FText"]
        program = font.DescendantFonts[0].FontDescriptor.FontFile2.read_bytes()
        assert program == make_glyphless_font()


def test_the_profile_says_the_day_of_its_standard_not_of_its_making() -> None:
    with pikepdf.open(io.BytesIO(make(LETTER, "a-2b"))) as document:
        profile = document.Root.OutputIntents[0].DestOutputProfile.read_bytes()
    assert struct.unpack(">6H", profile[24:36]) == (1999, 10, 18, 0, 0, 0)
    opened = ImageCms.ImageCmsProfile(io.BytesIO(profile))
    assert "sRGB" in ImageCms.getProfileDescription(opened)


def test_a_page_without_text_gets_no_layer() -> None:
    parts = [encode_part(PICTURE, "pdf", dpi=DPI)] * 3
    pdf = finish_pdf(bind_parts(parts, "pdf"), [None, LETTER, page(line(10))], PdfFacts(), [DPI] * 3)
    texts = [sheet.get_textpage().get_text_range() for sheet in pypdfium2.PdfDocument(pdf)]
    assert [bool(text) for text in texts] == [False, True, False]


def test_the_font_is_read_by_freetype() -> None:
    """pdfium loads the program for a new document; a damaged one gives no font."""
    document = pypdfium2.PdfDocument.new()
    program = make_glyphless_font()
    data = (ctypes.c_ubyte * len(program)).from_buffer_copy(program)
    kind = pypdfium2.raw.FPDF_FONT_TRUETYPE
    assert pypdfium2.raw.FPDFText_LoadFont(document.raw, data, len(program), kind, True)


@given(
    st.lists(
        st.text(st.characters(exclude_categories=["Cs", "Cc", "Z", "Cf"]), min_size=1, max_size=9),
        min_size=1,
        max_size=5,
    )
)
def test_any_text_makes_a_sound_file(texts: list[str]) -> None:
    words = tuple(Word(text, (10.0 * k, 10, 10.0 * k + 8, 20), 0.5) for k, text in enumerate(texts))
    text = PageText(850, 1100, "eng", (TextBlock((ReadLine(words),)),))
    with pikepdf.open(io.BytesIO(make(text))) as document:
        assert document.check_pdf_syntax() == []
