"""Text files of pages: plain text, Markdown, hOCR, ALTO."""

import re
from xml.etree import ElementTree

import pytest

from services.layout.exchange.limits import ExchangeLimits
from services.layout.exchange.zones_file import read_zones_file
from services.ocr.engine import Word
from services.ocr.word_trust import probability_right
from services.text.alto import write_alto_pages
from services.text.hocr import write_hocr
from services.text.page_text import PageText, ReadLine, TextBlock
from services.text.plain import write_markdown, write_plain_text
from tests.services.text.pages import line, page

XHTML = "{http://www.w3.org/1999/xhtml}"
LETTER = page(line(100, "Dear", "Mr.", "Smith,"), line(150, "1.5", "<b>", "&c."), heading="Invoice")


def test_plain_text_has_lines_blocks_and_page_breaks() -> None:
    text = write_plain_text([LETTER, page(line(100, "Größe", "日本", "語"))]).decode()
    assert text == "Invoice\n\nDear Mr. Smith,\n1.5 <b> &c.\n\fGröße 日本語\n"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("plain", "words"), "plain words"),
        (("#", "no", "heading"), r"\# no heading"),
        (("-", "no", "list"), r"\- no list"),
        (("1.", "no", "list"), r"1\. no list"),
        (("2.5", "percent"), "2.5 percent"),
        (("a*b*c", "d_e", "[x]", "`y`"), r"a\*b\*c d\_e \[x\] \`y\`"),
        (("<script>",), r"\<script\>"),
        (("---",), r"\---"),
    ],
)
def test_markdown_shows_the_characters_of_the_page(words: tuple[str, ...], expected: str) -> None:
    assert write_markdown([page(line(100, *words))]).decode() == expected + "\n"


def test_markdown_has_headings_and_joins_divided_words() -> None:
    divided = page(line(100, "a", "recti-"), line(150, "fied", "page"), heading="Title")
    assert write_markdown([divided]).decode() == "# Title\n\na rectified page\n"
    # A hyphen before a capital, and one after a digit, are of the word.
    kept = page(line(100, "the", "Smith-"), line(150, "Jones", "2-"), line(200, "pages"))
    assert write_markdown([kept]).decode() == "the Smith- Jones 2- pages\n"


def test_hocr_is_well_formed_and_has_every_box() -> None:
    root = ElementTree.fromstring(write_hocr([LETTER, LETTER], 'A "title" <&>', "en", 299.6))
    assert root.findtext(f"{XHTML}head/{XHTML}title") == 'A "title" <&>'
    parts = list(root.iter())
    sheets = [part for part in parts if part.get("class") == "ocr_page"]
    assert sheets[1].get("title") == "bbox 0 0 850 1100; ppageno 1; scan_res 300 300"
    words = [part for part in parts if part.get("class") == "ocrx_word"]
    assert [part.text for part in words] == [word.text for word in (*LETTER.words, *LETTER.words)]
    assert words[1].get("title") == f"bbox 100 100 180 130; x_wconf {100 * probability_right(0.9):.0f}"
    names = [part.get("id") for part in parts if part.get("id")]
    assert len(set(names)) == len(names)


def test_text_that_xml_cannot_hold_is_left_out() -> None:
    bad = PageText(10, 10, "eng", (TextBlock((ReadLine((Word("a\x00\x0bb", (1, 1, 5, 5), 0.5),)),)),))
    for file in (write_hocr([bad], "\x01", "", 300.0), write_alto_pages([bad], "\x02.jpg", "")):
        assert re.search(r"\bab\b", "".join(ElementTree.fromstring(file).itertext())) or b'"ab"' in file


def test_alto_is_read_again_with_its_zones_and_words() -> None:
    file = write_alto_pages([LETTER], "photo.jpg", "en")
    read = read_zones_file(file, ExchangeLimits())
    assert (read.width, read.height) == (850, 1100)
    assert [zone.text for zone in read.zones] == ["Invoice", "Dear Mr. Smith,\n1.5 <b> &c."]
    assert read.zones[1].box == (100, 100, 380, 180)
    root = ElementTree.fromstring(file)
    strings = [part for part in root.iter() if part.tag.endswith("}String")]
    assert (strings[2].get("CONTENT"), strings[2].get("HPOS")) == ("Mr.", "200")
    assert float(strings[2].get("WC") or 0.0) == pytest.approx(probability_right(0.9), abs=1e-4)
