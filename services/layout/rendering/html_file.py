"""Labelled pages as one HTML file: semantic elements in reading order, pictures embedded.

The structure is that of Fig. 5.2 of the dissertation. The file needs nothing else and runs no script.
"""

import base64
import re
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement, tostring

from services.contract.html import HtmlElement
from services.layout.rendering.html_table import HtmlTable, write_table
from services.layout.values.typed_value import plain_text
from services.text.flowing import join_lines

_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
"""Content-Security-Policy of the file, wherever it is opened."""
_STYLE = """
body { margin: 2em auto; max-width: 45em; padding: 0 1em; font: 1rem/1.5 Georgia, serif; color: #111; }
h1, h2, h3 { line-height: 1.2; }
address { font-style: normal; margin: 1em 0; }
header, footer, aside { color: #555; font-size: 0.875em; margin: 1em 0; }
figure { margin: 1.5em 0; }
img { display: block; max-width: 100%; height: auto; }
figcaption { font-size: 0.875em; margin-top: 0.5em; }
pre { overflow-x: auto; }
table { border-collapse: collapse; margin: 1em 0; }
th, td { border-bottom: 1px solid #bbb; padding: 0.2em 0.8em 0.2em 0; text-align: left; vertical-align: top; }
section + section { border-top: 1px solid #bbb; margin-top: 3em; padding-top: 2em; }
"""
_NONCHARACTERS = "".join(chr(plane << 16 | last) for plane in range(17) for last in (0xFFFE, 0xFFFF))
_NOT_HTML = re.compile(f"[^\t\n -~\u00a0-\ud7ff\ue000-\ufdcf\ufdf0-\U0010ffff]|[{_NONCHARACTERS}]")
"""Controls, surrogates and noncharacters, which HTML does not allow."""
_HEADINGS = ("h1", "h2", "h3", "h4", "h5", "h6")
_MARKER = re.compile(
    r"^(?:[-*\u2022\u2023\u2013\u2043\u25aa\u25cf\u25e6]\s+|\(?(\d{1,6})[.)]\s+|\(?[A-Za-z][.)]\s+)"
)
"""What an item of a list begins with."""


@dataclass(frozen=True, slots=True)
class HtmlPicture:
    """A part of the page: a JPEG file and its size in pixels."""

    body: bytes
    width: int
    height: int


@dataclass(frozen=True, slots=True)
class HtmlZone:
    """A zone and its element. `date` is that of its text (YYYY-MM-DD).

    `picture` is the content of `figure` and `img`, and of other elements without a text, lists and `pre` excepted. A
    zone that is a `table` is written as one.
    """

    id: str
    label: str | None
    element: HtmlElement
    text: str
    date: str | None = None
    picture: HtmlPicture | None = None
    table: HtmlTable | None = None


def write_html(pages: Sequence[Sequence[HtmlZone]], title: str, language: str) -> bytes:
    """One HTML5 file in UTF-8 of the zones of pages, each page in reading order.

    Parameters
    ----------
    pages
        Zones of each page. Several pages become a section each.
    title
        Of the document, if no heading has text.
    language
        BCP 47 tag of the text; empty if it is unknown.
    """
    html = Element("html", {"lang": language} if language else {})
    head = SubElement(html, "head")
    head.text = "\n"
    _add(head, "meta", charset="utf-8")
    _add(head, "meta", **{"http-equiv": "Content-Security-Policy", "content": _POLICY})
    _add(head, "meta", name="viewport", content="width=device-width, initial-scale=1")
    _add(head, "title").text = _first_heading(pages) or _flow(title) or "Page"
    _add(head, "style").text = _STYLE
    body = _add(html, "body")
    main = _add(body, "main")
    main.text = "\n"
    for number, zones in enumerate(pages, 1):
        place = _add(main, "section", **{"aria-label": f"Page {number}"}) if len(pages) > 1 else main
        place.text = "\n"
        _write_page(place, zones)
    text: str = tostring(html, encoding="unicode", method="html")
    return f"<!DOCTYPE html>\n{text}\n".encode()


def _first_heading(pages: Sequence[Sequence[HtmlZone]]) -> str:
    texts = (_flow(zone.text) for page in pages for zone in page if zone.element in _HEADINGS)
    return next((text for text in texts if text), "")


def _write_page(place: Element, zones: Sequence[HtmlZone]) -> None:
    """Lists of one label that follow each other are one list; a caption is inside of the figure next to it."""
    shown = [zone for zone in zones if zone.element != "none" and (zone.text.strip() or _is_picture(zone))]
    captions = dict(_captions(shown))
    written: dict[int, Element] = {}
    for index, zone in enumerate(shown):
        if zone.element in ("ul", "ol"):
            _write_items(_list_of(place, zone), zone.text)
        elif index not in captions:
            written[index] = _write_zone(place, zone)
    for index, figure in captions.items():
        caption = _add(written[figure], "figcaption", **_marks(shown[index]))
        caption.text = _flow(shown[index].text)


def _is_picture(zone: HtmlZone) -> bool:
    return zone.picture is not None or zone.element in ("figure", "img")


def _captions(zones: Sequence[HtmlZone]) -> Iterator[tuple[int, int]]:
    """Indices of captions and of their figures: the figure before, else the one after, that has no caption yet."""
    taken: set[int] = set()
    for index, zone in enumerate(zones):
        if zone.element != "figcaption":
            continue
        for near in (index - 1, index + 1):
            if 0 <= near < len(zones) and zones[near].element == "figure" and near not in taken:
                taken.add(near)
                yield index, near
                break


def _list_of(place: Element, zone: HtmlZone) -> Element:
    last = place[-1] if len(place) else None
    marks = _marks(zone)
    if last is not None and last.tag == zone.element and last.get("data-label") == marks.get("data-label"):
        return last
    return _add(place, zone.element, **marks)


def _write_items(items: Element, text: str) -> None:
    """An item for every line that begins with a marker; for every line where none does."""
    lines = plain_text(_clean(text)).split("\n")
    marked = any(_MARKER.match(line) for line in lines)
    for line in lines:
        found = _MARKER.match(line)
        if marked and found is None and len(items):
            items[-1].text = join_lines((items[-1].text or "", line))
            continue
        item = _add(items, "li")
        item.text = line if found is None else line[found.end() :]
        if found is not None and found[1] and items.tag == "ol":
            item.set("value", found[1])


def _write_zone(place: Element, zone: HtmlZone) -> Element:
    if zone.table is not None:
        element = _add(place, "table", **_marks(zone))
        write_table(zone.table, element, _clean)
        return element
    if zone.element in ("figure", "img"):
        return _write_figure(place, zone)
    element = _add(place, "p" if zone.element == "figcaption" else zone.element, **_marks(zone))
    if zone.picture is not None:  # what no OCR engine has read
        _write_picture(element, zone.picture, _clean(zone.label or "text"))
    elif zone.element in ("address", "header", "footer"):
        _write_lines(element, plain_text(_clean(zone.text)).split("\n"))
    elif zone.element == "pre":
        element.text = _clean(zone.text).strip("\n")
    elif zone.date is not None:
        SubElement(element, "time", {"datetime": zone.date}).text = _flow(zone.text)
    else:
        element.text = _flow(zone.text)
    if any(unicodedata.bidirectional(character) in ("R", "AL") for character in zone.text):
        element.set("dir", "auto")
    return element


def _write_figure(place: Element, zone: HtmlZone) -> Element:
    """A figure or an image; text that a figure contains is its alternative text, and without a picture its content."""
    text, label = _flow(zone.text), _clean(zone.label or "figure")
    if zone.picture is None:
        figure = _add(place, "p" if zone.element == "img" else "figure", **_marks(zone))
        figure.text = text or f"[{label}]"
        return figure
    alternative = text or label
    if zone.element == "img":
        return _write_picture(place, zone.picture, alternative, **_marks(zone))
    figure = _add(place, "figure", **_marks(zone))
    _write_picture(figure, zone.picture, alternative)
    return figure


def _write_picture(place: Element, picture: HtmlPicture, alternative: str, **marks: str) -> Element:
    source = f"data:image/jpeg;base64,{base64.b64encode(picture.body).decode()}"
    size = {"width": str(picture.width), "height": str(picture.height)}
    return _add(place, "img", src=source, alt=alternative, **size, **marks)


def _write_lines(element: Element, lines: Sequence[str]) -> None:
    element.text = lines[0]
    for line in lines[1:]:
        SubElement(element, "br").tail = line


def _marks(zone: HtmlZone) -> dict[str, str]:
    """Attributes by which a program finds the zone of an element."""
    label = {} if zone.label is None else {"data-label": _clean(zone.label)}
    return {"data-zone": _clean(zone.id), **label}


def _flow(text: str) -> str:
    return join_lines(plain_text(_clean(text)).split("\n"))


def _clean(text: str) -> str:
    return _NOT_HTML.sub("", text.replace("\r\n", "\n").replace("\r", "\n").replace("\f", "\n"))


def _add(parent: Element, tag: str, /, **attributes: str) -> Element:
    element = SubElement(parent, tag, attributes)
    element.tail = "\n"
    return element
