"""ALTO 4.4 (loc.gov/standards/alto) with the place of every word; /layout writes labelled zones by its own module."""

from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement

from services.layout.exchange.alto import begin_alto
from services.layout.exchange.xml_writing import clean, decimal, document
from services.ocr.word_trust import probability_right
from services.text.page_text import Box, PageText, TextBlock, needs_space


def write_alto_pages(pages: Sequence[PageText], image_name: str, tag: str) -> bytes:
    """The pages as one ALTO file in pixels of the flat pages.

    `image_name` is the name of the upload, `tag` the language as BCP 47 tag (empty: unknown). Blocks follow each other
    in reading order.
    """
    root = begin_alto(image_name, "reading", "optical character recognition of the flat page")
    layout = SubElement(root, "Layout")
    for number, page in enumerate(pages, 1):
        size = {"WIDTH": str(page.width), "HEIGHT": str(page.height)}
        attributes = {"ID": f"page-{number}", "PHYSICAL_IMG_NR": str(number), **size, "PROCESSING": "reading"}
        if page.confidence is not None:
            attributes["PC"] = decimal(round(page.confidence, 4))
        element = SubElement(layout, "Page", attributes)
        space = SubElement(element, "PrintSpace", {"ID": f"space-{number}", "HPOS": "0", "VPOS": "0", **size})
        for order, block in enumerate(page.blocks, 1):
            _write_block(space, block, f"block-{number}-{order}", tag)
    return document(root)


def _write_block(space: Element, block: TextBlock, name: str, tag: str) -> None:
    language = {"LANG": tag} if tag else {}
    element = SubElement(space, "TextBlock", {"ID": name, **_place(block.box), **language})
    for row, line in enumerate(block.lines, 1):
        attributes = {"ID": f"{name}-line-{row}", **_place(line.box)}
        text_line = SubElement(element, "TextLine", attributes)
        for order, word in enumerate(line.words):
            before = line.words[order - 1] if order else None
            if before is not None and needs_space(before.text, word.text):
                SubElement(text_line, "SP")
            string = {"ID": f"{name}-line-{row}-word-{order + 1}", **_place(word.box)}
            string |= {
                "CONTENT": clean(word.text),
                "WC": decimal(round(probability_right(word.confidence), 4)),
            }
            SubElement(text_line, "String", string)


def _place(box: Box) -> dict[str, str]:
    x0, y0, x1, y1 = box
    return {
        "HPOS": decimal(x0),
        "VPOS": decimal(y0),
        "WIDTH": decimal(x1 - x0),
        "HEIGHT": decimal(y1 - y0),
    }
