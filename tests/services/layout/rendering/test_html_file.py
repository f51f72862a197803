"""HTML of labelled pages: elements in reading order, valid for a strict parser, nothing of the page is markup."""

import base64
from collections.abc import Sequence
from typing import Any, get_args
from xml.etree.ElementTree import Element

import html5lib
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.contract.html import HtmlElement
from services.layout.rendering.html_elements import choose_element
from services.layout.rendering.html_file import HtmlPicture, HtmlZone, write_html
from services.layout.rendering.html_table import HtmlTable

PICTURE = HtmlPicture(b"\xff\xd8 not shown", 40, 30)
HOSTILE = (
    "</p><script>alert(1)</script><img src=x onerror=\"alert('2')\">&lt;b&gt;<!-- ]]> --> "
    "& \"' \0\x85\ufdd0\ud800"
)


def parsed(file: bytes) -> Element:
    """The tree of a file; a strict parser refuses whatever is no valid HTML."""
    root: Element = html5lib.HTMLParser(strict=True, namespaceHTMLElements=False).parse(file)
    assert file.startswith(b"<!DOCTYPE html>")
    return root


def written(*pages: Sequence[HtmlZone], title: str = "", language: str = "") -> Element:
    return parsed(write_html(pages, title, language))


def main_of(*zones: HtmlZone) -> Element:
    main = written(zones).find("body/main")
    assert main is not None
    return main


def shape(element: Element) -> list[Any]:
    """Tag and content of the children."""
    return [(child.tag, shape(child) or child.text) for child in element]


def zone(element: HtmlElement, text: str = "", label: str | None = "a label", **other: Any) -> HtmlZone:
    return HtmlZone("z1", label, element, text, **other)


def test_elements_follow_the_labels() -> None:
    main = main_of(
        zone("header", "Volume 3\nMay"),
        zone("h1", "On the shape\nof pa-\nper"),
        zone("address", "Ann Smith\n12 Main Street"),
        zone("p", "A date, ", date="1998-03-03"),
        zone("none", "left out"),
        zone("p", ""),
        zone("pre", "if x:\n  return\n"),
        zone("img", "A logo", picture=PICTURE),
        zone("h2", "", picture=PICTURE),
    )
    assert shape(main) == [
        ("header", [("br", None)]),
        ("h1", "On the shape of paper"),
        ("address", [("br", None)]),
        ("p", [("time", "A date,")]),
        ("pre", "if x:\n  return"),
        ("img", None),
        ("h2", [("img", None)]),
    ]
    assert main[0].text == "Volume 3"
    assert main[0][0].tail == "May"
    assert main[3][0].get("datetime") == "1998-03-03"
    image = main[5]
    assert (image.get("alt"), image.get("width"), image.get("height")) == ("A logo", "40", "30")
    assert image.get("src") == "data:image/jpeg;base64," + base64.b64encode(PICTURE.body).decode()
    assert main[6][0].get("alt") == "a label"
    assert (main[1].get("data-zone"), main[1].get("data-label")) == ("z1", "a label")


def test_captions_are_inside_of_their_figures() -> None:
    figure, caption = zone("figure", "", "figure", picture=PICTURE), zone("figcaption", "Figure 1.")
    framed = ("figure", [("img", None), ("figcaption", "Figure 1.")])
    assert shape(main_of(figure, caption)) == [framed]
    assert shape(main_of(caption, figure)) == [framed]
    assert shape(main_of(caption, zone("p", "Text."), figure)) == [
        ("p", "Figure 1."),
        ("p", "Text."),
        ("figure", [("img", None)]),
    ]
    assert shape(main_of(figure, caption, caption)) == [framed, ("p", "Figure 1.")]
    assert shape(main_of(zone("figure", "", "figure"))) == [("figure", "[figure]")]


def test_lists() -> None:
    assert shape(main_of(zone("ul", "- one\n- two that\ngoes on\n"), zone("ul", "\u2022 three"))) == [
        ("ul", [("li", "one"), ("li", "two that goes on"), ("li", "three")])
    ]
    main = main_of(zone("ol", "3. three\n4) four"), zone("ol", "plain", "another label"))
    assert shape(main) == [("ol", [("li", "three"), ("li", "four")]), ("ol", [("li", "plain")])]
    assert [item.get("value") for item in main[0]] == ["3", "4"]


def test_pages_are_sections_and_the_file_names_its_language() -> None:
    root = written([zone("p", "one"), zone("h2", "Report")], [zone("p", "two")], title="scan", language="de")
    assert root.get("lang") == "de"
    assert root.findtext("head/title") == "Report"
    sections = root.findall("body/main/section")
    assert [section.get("aria-label") for section in sections] == ["Page 1", "Page 2"]
    assert written([zone("p", "one")], title="scan <1>").findtext("head/title") == "scan <1>"
    assert written([]).findtext("head/title") == "Page"
    assert written([zone("p", "שלום")]).find("body/main/p[@dir='auto']") is not None


@pytest.mark.parametrize("element", get_args(HtmlElement))
def test_nothing_of_the_page_is_markup(element: HtmlElement) -> None:
    hostile = HtmlZone(HOSTILE, HOSTILE, element, HOSTILE)
    root = written([hostile], [zone("figure", HOSTILE, HOSTILE, picture=PICTURE)], title=HOSTILE)
    assert root.findall(".//script") == []
    assert {name for each in root.iter() for name in each.attrib} <= {
        "charset", "http-equiv", "content", "name", "aria-label", "data-zone", "data-label", "src", "alt", "width",
        "height",
    }  # fmt: skip
    policy = root.find("head/meta[@http-equiv]")
    assert policy is not None
    assert "default-src 'none'" in str(policy.get("content"))
    if element not in ("none", "ul", "ol", "pre"):
        kept = "".join(root.find("body/main/section").itertext()).split()  # type: ignore[union-attr]
        assert kept == HOSTILE.replace("\0", "").split("\x85")[0].split()


@given(st.text(), st.text(), st.sampled_from(get_args(HtmlElement)))
def test_any_text_makes_a_valid_file(text: str, label: str, element: HtmlElement) -> None:
    parsed(write_html([[HtmlZone(text, label, element, text)]], text, ""))


@pytest.mark.parametrize(
    ("kind", "label", "element"),
    [
        ("text", "title", "h1"),
        ("text", "Section Title", "h2"),
        ("text", "invoice_title", "h1"),
        ("text", "receiver", "address"),
        ("text", "body", "p"),
        ("text", None, "p"),
        ("text", "figure", "figure"),
        ("figure", "title", "figure"),
        ("figure", None, "figure"),
        ("rule", None, "none"),
        ("noise", "title", "none"),
    ],
)
def test_elements_by_default(kind: Any, label: str | None, element: HtmlElement) -> None:
    assert choose_element(kind, label, {}) == element
    if label is not None:
        assert choose_element(kind, label, {label: "aside"}) == "aside"


def test_a_table_has_a_header_and_cells_and_none_of_it_is_markup() -> None:
    table = HtmlTable(("item", "amount"), ("Item & more", None), [["Oak\nplaned", "4.50"], ["", HOSTILE]])
    main = main_of(zone("p", "Item", None, table=table))
    [element] = main
    assert (element.tag, element.get("data-zone")) == ("table", "z1")
    heads = [(head.text, head.get("scope"), head.get("data-label")) for head in element.iter("th")]
    assert heads == [("Item & more", "col", "item"), ("amount", "col", "amount")]
    cells = [["".join(cell.itertext()) for cell in row.iter("td")] for row in element.iter("tr")][1:]
    assert cells[0] == ["Oakplaned", "4.50"]
    assert len(list(element.iter("br"))) == 1
    assert "<script>alert(1)</script>" in cells[1][1]
    assert next(main.iter("script"), None) is None
