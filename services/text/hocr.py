"""hOCR 1.2 (Breuel, "The hOCR microformat for OCR workflow and results"), as well-formed XHTML."""

from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from services.layout.exchange.xml_writing import SOFTWARE, clean
from services.ocr.word_trust import probability_right
from services.text.page_text import Box, PageText, ReadLine, union_box

_NAMESPACE = "http://www.w3.org/1999/xhtml"
_DOCTYPE = (
    b'<?xml version="1.0" encoding="UTF-8"?>\n'
    b'<!DOCTYPE html PUBLIC "-//W3C//DTD XHTML 1.0 Transitional//EN" '
    b'"http://www.w3.org/TR/xhtml1/DTD/xhtml1-transitional.dtd">\n'
)


def write_hocr(pages: Sequence[PageText], title: str, tag: str, dpi: float) -> bytes:
    """The pages as one hOCR file.

    Parameters
    ----------
    pages
        Text of the pages in their order. Boxes are whole pixels of the flat page.
    title
        Of the document.
    tag
        Language as BCP 47 tag (`en`); empty if it is unknown.
    dpi
        Resolution of the flat pages.
    """
    html = Element("html", {"xmlns": _NAMESPACE} | ({"xml:lang": tag, "lang": tag} if tag else {}))
    head = SubElement(html, "head")
    SubElement(head, "title").text = clean(title)
    SubElement(head, "meta", {"http-equiv": "Content-Type", "content": "text/html;charset=utf-8"})
    SubElement(head, "meta", {"name": "ocr-system", "content": SOFTWARE})
    capabilities = "ocr_page ocr_carea ocr_par ocr_line ocrx_word ocrp_wconf"
    SubElement(head, "meta", {"name": "ocr-capabilities", "content": capabilities})
    body = SubElement(html, "body")
    for number, page in enumerate(pages, 1):
        _write_page(body, page, number, dpi)
    indent(html, " ")
    return _DOCTYPE + bytes(tostring(html, encoding="UTF-8")) + b"\n"


def _write_page(body: Element, page: PageText, number: int, dpi: float) -> None:
    size = f"bbox 0 0 {page.width} {page.height}; ppageno {number - 1}; scan_res {round(dpi)} {round(dpi)}"
    element = _part(body, "div", "ocr_page", f"page_{number}", size)
    lines = words = 0
    for order, block in enumerate(page.blocks, 1):
        box = _bbox(block.box)
        area = _part(element, "div", "ocr_carea", f"block_{number}_{order}", box)
        paragraph = _part(area, "p", "ocr_par", f"par_{number}_{order}", box)
        if any(line.right_to_left for line in block.lines):
            paragraph.set("dir", "rtl")
        for line in block.lines:
            lines += 1
            row = _part(paragraph, "span", "ocr_line", f"line_{number}_{lines}", _line_title(line))
            for word in line.words:
                words += 1
                title = f"{_bbox(word.box)}; x_wconf {round(100 * probability_right(word.confidence))}"
                _part(row, "span", "ocrx_word", f"word_{number}_{words}", title).text = clean(word.text)


def _line_title(line: ReadLine) -> str:
    _, top, _, bottom = union_box([word.box for word in line.words])
    return f"{_bbox(line.box)}; x_size {bottom - top:.1f}"


def _part(parent: Element, element: str, kind: str, name: str, title: str) -> Element:
    return SubElement(parent, element, {"class": kind, "id": name, "title": title})


def _bbox(box: Box) -> str:
    return "bbox " + " ".join(str(round(edge)) for edge in box)
