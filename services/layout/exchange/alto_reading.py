"""ALTO (Analyzed Layout and Text Object, loc.gov/standards/alto): versions 2 to 4 read.

Labels are those of tags (`alto` says how they are written).
"""

from collections.abc import Callable, Iterator, Mapping
from typing import cast
from xml.etree.ElementTree import Element

from services.layout.exchange.alto import ALIGNMENTS, ID_TAG, MEASURES, NOISE, PRINTED_FIGURE, TABLE
from services.layout.exchange.limits import ExchangeLimits
from services.layout.exchange.page_json import BlockJson, page_of_blocks
from services.layout.exchange.xml_reading import (
    FIELD,
    children,
    hull_of,
    in_reading_order,
    measure_lines,
    number,
    polygon_box,
)
from services.layout.page import InvalidLayout, Kind, Page
from services.notices import Notice

_KINDS: Mapping[str, Kind] = {
    "TextBlock": "text",
    "Illustration": "figure",
    "GraphicalElement": "rule",
    "ComposedBlock": "figure",
}
_SPACES = ("TopMargin", "LeftMargin", "RightMargin", "BottomMargin", "PrintSpace")
_LABEL_TAGS = ("LayoutTag", "StructureTag", "OtherTag")
"""Tags that label blocks: the nearest counts, and OtherTags (kraken, eScriptorium) where there is no other."""
_NO_LABELS = ("language", "script")
"""What TYPE or DESCRIPTION of tags begins with that say in what a block is written, not what it is (kraken)."""
_HYPHENS = ("-", "\u00ac", "\u00ad", "\u2010", "\u2011", "\u2e17")
_WHOLE = (TABLE, PRINTED_FIGURE)
"""What the TYPE of ComposedBlocks that are one zone begins with: tables (ABBYY, PRImA), figures of ours. It is free by
the schema."""
_LONGEST_REFERENCES = 10_000
"""Characters of TAGREFS; they are read for every block in a block."""


def page_of_alto(
    root: Element,
    limits: ExchangeLimits,
    warn: Callable[[Notice], None],
    pixels: tuple[float, float] | None = None,
) -> Page:
    """Page of an ALTO document with one page, its zones in its reading order.

    The order comes from ReadingOrder, else from IDNEXT, else from the document. `pixels`, width and height of the
    page's image, is needed when the file measures in tenths of a millimetre or 1/1200 inch, or has no size of the page
    or of its PrintSpace. A block that cannot be read is left out; `warn` gets a warning that names it. Raises
    `InvalidLayout`; `zones[i]` counts the blocks from 0 in document order.
    """
    layout = next(children(root, "Layout"), None) if root.tag == "alto" else None
    pages = [] if layout is None else list(children(layout, "Page"))
    if len(pages) != 1:
        raise InvalidLayout(f"Send ALTO with one page in its Layout; this file has {len(pages)}.", FIELD)
    page = pages[0]
    width, height, scale_x, scale_y = _scale(root, page, pixels)
    tags = _tags(root)
    blocks = list(_blocks(page, ()))
    styles = {style.get("ID", ""): style for style in root.iter("ParagraphStyle")}
    zones = []
    for index, (block, inherited) in enumerate(blocks):
        zone = _zone_document(block, index, inherited, tags)
        box, (size, spacing) = (
            zone["box"],
            measure_lines([_box(line) for line in children(block, "TextLine")]),
        )
        if box is not None:
            zone["box"] = [box[0] * scale_x, box[1] * scale_y, box[2] * scale_x, box[3] * scale_y]
        if size is not None and zone["font_size"] is None:
            zone["font_size"] = size * scale_y
        for style in (styles[name] for name in block.get("STYLEREFS", "").split() if name in styles):
            spacing = number(style.get("LINESPACE")) or spacing
            zone["alignment"] = ALIGNMENTS.get(style.get("ALIGN", ""))
        zone["line_spacing"] = None if spacing is None else spacing * scale_y
        zones.append(zone)
    found, places = page_of_blocks((width, height), zones, limits, warn)
    elements = [blocks[place][0] for place in places]
    order = in_reading_order(elements, "ID", _order(root, elements))
    return Page(found.width, found.height, tuple(found.zones[index] for index in order))


def _scale(
    root: Element, page: Element, pixels: tuple[float, float] | None
) -> tuple[float | None, float | None, float, float]:
    """Width and height of the page in pixels, and pixels per unit along x and y."""
    unit = next((element.text or "" for element in root.iter("MeasurementUnit")), "pixel").strip()
    width, height = number(page.get("WIDTH")), number(page.get("HEIGHT"))
    if unit == "pixel" and pixels is not None and not (width and height):
        return pixels[0], pixels[1], 1.0, 1.0
    if not (width and height):
        space = next((box for part in children(page, "PrintSpace") if (box := _own_box(part))), None)
        width, height = (width, height) if space is None else (width or space[2], height or space[3])
    if unit == "pixel":
        return width, height, 1.0, 1.0
    if pixels is None:
        raise InvalidLayout(
            f"The file measures in {unit[:20]!a}; send the page's image with it, or ALTO in pixels.", FIELD
        )
    if not (width and height and min(width, height) > 0):
        raise InvalidLayout(
            "The Page has no WIDTH and HEIGHT, which give the size of a pixel in its unit.", FIELD
        )
    return pixels[0], pixels[1], pixels[0] / width, pixels[1] / height


def _tags(root: Element) -> dict[str, tuple[str, str, str]]:
    """Element name, TYPE and LABEL of every tag, by its ID; without those that name a language or a script."""
    return {
        tag.get("ID", ""): (tag.tag, tag.get("TYPE", ""), tag.get("LABEL", ""))
        for tags in children(root, "Tags")
        for tag in tags
        if not any(tag.get(name, "").lower().startswith(_NO_LABELS) for name in ("TYPE", "DESCRIPTION"))
    }


def _blocks(parent: Element, inherited: tuple[str, ...]) -> Iterator[tuple[Element, tuple[str, ...]]]:
    """The blocks that become zones, with the TAGREFS of those they are in, outermost first.

    A table is one zone with all its contents. The depth of the recursion is that of the file, which is bounded.
    """
    for element in parent:
        if element.tag in _SPACES:
            yield from _blocks(element, inherited)
        elif element.tag in _KINDS:
            references = (*inherited, element.get("TAGREFS", "")[:_LONGEST_REFERENCES])
            is_whole = element.get("TYPE", "").lower().startswith(_WHOLE)
            holds_blocks = next(children(element, *_KINDS), None) is not None
            if element.tag == "ComposedBlock" and holds_blocks and not is_whole:
                yield from _blocks(element, references)
            else:
                yield element, references


def _order(root: Element, blocks: list[Element]) -> list[str]:
    reading_order = next(children(root, "ReadingOrder"), None)
    if reading_order is not None:
        return [name for element in reading_order.iter() for name in element.get("REF", "").split()]
    following = {block.get("ID", ""): block.get("IDNEXT", "") for block in blocks}
    order: dict[str, None] = {}
    continued = set(following.values())
    for start in [name for name in following if name not in continued]:
        name = start
        while name in following and name not in order:
            order[name] = None
            name = following[name]
    return list(order)


def _zone_document(
    block: Element, index: int, references: tuple[str, ...], tags: dict[str, tuple[str, str, str]]
) -> BlockJson:
    kind = _KINDS[block.tag]
    if block.tag == "Illustration" and block.get("TYPE") == NOISE:
        kind = "noise"
    lines = list(children(block, "TextLine"))
    zone: BlockJson = {
        "id": block.get("ID") or f"block-{index + 1}",
        "box": _box(block),
        "kind": kind,
        "label": None,
        "lines": len(lines) or None,
        "font_size": None,
        "text": "\n".join(_line_text(line) for line in block.iter("TextLine")),
    }
    told: dict[str, float | str | None] = {}
    labels: dict[int, str] = {}
    for depth, names in enumerate(references):
        for element, type_, label in (tags[name] for name in names.split() if name in tags):
            if element == "OtherTag" and type_ in MEASURES:
                told[type_] = number(label)
            elif element == "OtherTag" and type_ == ID_TAG:
                told[type_] = label
            elif element in _LABEL_TAGS:
                labels[2 * depth + (element != "OtherTag")] = label
    zone["label"] = labels[max(labels)] or None if labels else None
    return cast(BlockJson, {**zone, **told})


def _box(element: Element) -> list[float] | None:
    """From HPOS, VPOS, WIDTH and HEIGHT, else the Shape, else the lines and words in it."""
    own = _own_box(element)
    if own is not None:
        return own
    for shape in children(element, "Shape"):
        for polygon in children(shape, "Polygon"):
            return polygon_box(polygon.get("POINTS", ""))
    return hull_of(map(_box, children(element, "TextLine", "String")))


def _own_box(element: Element) -> list[float] | None:
    x, y = number(element.get("HPOS")), number(element.get("VPOS"))
    width, height = number(element.get("WIDTH")), number(element.get("HEIGHT"))
    if x is None or y is None or width is None or height is None or min(width, height) < 0:
        return None
    return [x, y, x + max(width, 1.0), y + max(height, 1.0)]


def _line_text(line: Element) -> str:
    """The words of a line, with the hyphen at its end where the last word does not have it."""
    text = " ".join(word.get("CONTENT", "") for word in children(line, "String"))
    hyphen = "".join(each.get("CONTENT", "") for each in children(line, "HYP"))
    return text if text.endswith(_HYPHENS) else text + hyphen
