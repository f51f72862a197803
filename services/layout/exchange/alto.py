"""ALTO (Analyzed Layout and Text Object, loc.gov/standards/alto): versions 2 to 4 read, 4.4 written.

Blocks are tagged with their logical labels (`TAGREFS` of a LayoutTag whose LABEL is the label).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from typing import cast
from xml.etree.ElementTree import Element, SubElement

from services.layout.exchange.item_cells import table_of_zone
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
from services.layout.exchange.xml_writing import (
    SOFTWARE,
    XSI,
    Names,
    clean,
    decimal,
    document,
    ordered,
    turned_note,
    union_box,
    zone_lines,
)
from services.layout.page import Box, InvalidLayout, Kind, Page, Zone
from services.layout.recognition.results import Recognition, RecognizedZone
from services.layout.tables.item_table import ItemTable
from services.notices import Notice

NAMESPACE = "http://www.loc.gov/standards/alto/ns-v4#"
SCHEMA = "http://www.loc.gov/standards/alto/v4/alto-4-4.xsd"
SCHEMA_VERSION = "4.4"

_KINDS: Mapping[str, Kind] = {
    "TextBlock": "text",
    "Illustration": "figure",
    "GraphicalElement": "rule",
    "ComposedBlock": "figure",
}
_BLOCK_OF: Mapping[Kind, str] = {
    "text": "TextBlock",
    "figure": "Illustration",
    "noise": "Illustration",
    "rule": "GraphicalElement",
}
_NOISE = "noise"
"""TYPE of the Illustrations that are noise; ALTO has no element for it."""
_SPACES = ("TopMargin", "LeftMargin", "RightMargin", "BottomMargin", "PrintSpace")
_LABEL_TAGS = ("LayoutTag", "StructureTag", "OtherTag")
"""Tags that label blocks: the nearest counts, and OtherTags (kraken, eScriptorium) where there is no other."""
_NO_LABELS = ("language", "script")
"""What TYPE or DESCRIPTION of tags begins with that say in what a block is written, not what it is (kraken)."""
_HYPHENS = ("-", "\u00ac", "\u00ad", "\u2010", "\u2011", "\u2e17")
_PRINTED_FIGURE = "printed-figure"
"""TYPE of our figures with print within them: an Illustration holds no words."""
_TABLE = "table"
"""TYPE of tables of items; their cells are blocks of their own."""
_WHOLE = (_TABLE, _PRINTED_FIGURE)
"""What the TYPE of ComposedBlocks that are one zone begins with: tables (ABBYY, PRImA), figures of ours. It is free by
the schema."""
_LONGEST_REFERENCES = 10_000
"""Characters of TAGREFS; they are read for every block in a block."""
_ALIGNMENTS = {"Left": "left", "Right": "right", "Center": "centre", "Block": "justified"}
_MEASURES = ("lines", "font_size", "weight")
"""Fields of a Zone without an attribute in ALTO. They become OtherTags: TYPE is the name, LABEL the value."""
_ID = "id"
"""TYPE of the OtherTag with the zone's id, if that is not a valid XML name."""


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
            zone["alignment"] = _ALIGNMENTS.get(style.get("ALIGN", ""))
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
    if block.tag == "Illustration" and block.get("TYPE") == _NOISE:
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
            if element == "OtherTag" and type_ in _MEASURES:
                told[type_] = number(label)
            elif element == "OtherTag" and type_ == _ID:
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


def write_alto(recognition: Recognition, file_name: str, created: datetime, turned_deg: int = 0) -> bytes:
    """The recognition as ALTO 4.4 in pixels, the page being that of the image `file_name`.

    `created` is a time with its zone. PAGECLASS is the class. Lines have no position, since it is not measured. ALTO
    allows text in text blocks only, so text in a figure is left out. Where the page is that of the image turned
    clockwise by `turned_deg`, the description of the step says so.
    """
    page = recognition.page
    names = Names()
    zones = ordered(recognition)
    ids = [names.give(zone.zone.id) for zone in zones]
    page_id, space_id, step_id = names.give("page"), names.give("print-space"), names.give("recognition")
    tags = _Tags(names)
    styles: dict[tuple[tuple[str, str], ...], str] = {}

    step = "layout structure recognition" + (f". {turned_note(turned_deg)}" if turned_deg else "")
    root = begin_alto(file_name, step_id, step, created)
    style_list, tag_list = SubElement(root, "Styles"), SubElement(root, "Tags")
    if zones:
        group = SubElement(
            SubElement(root, "ReadingOrder"), "OrderedGroup", {"ID": names.give("reading-order")}
        )
        for name in ids:
            SubElement(group, "ElementRef", {"ID": names.give(f"{name}-place"), "REF": name})
    size = {"HEIGHT": decimal(page.height), "WIDTH": decimal(page.width)}
    attributes = {"ID": page_id, **size, "PHYSICAL_IMG_NR": "1", "PROCESSING": step_id}
    if recognition.chosen is not None:
        attributes["PAGECLASS"] = clean(recognition.chosen.name)
    element = SubElement(SubElement(root, "Layout"), "Page", attributes)
    space = SubElement(element, "PrintSpace", {"ID": space_id, **size, "HPOS": "0", "VPOS": "0"})
    left = list(recognition.tables)
    for name, zone in zip(ids, zones, strict=True):
        block = {"ID": name}
        style = _style(zone.zone)
        if style:
            if style not in styles:
                styles[style] = names.give(f"paragraph-style-{len(styles) + 1}")
                SubElement(style_list, "ParagraphStyle", {"ID": styles[style], **dict(style)})
            block["STYLEREFS"] = styles[style]
        references = tags.of(zone, name)
        if references:
            block["TAGREFS"] = " ".join(references)
        table = table_of_zone(zone.zone.box, left)
        if table is None:
            _write_block(space, zone.zone, block, names)
        else:
            left.remove(table)
            _write_table(space, table, block, names, tags)
    for table in left:
        _write_table(space, table, {"ID": names.give("table")}, names, tags)
    for kind, type_, label, name in tags.given:
        SubElement(tag_list, kind, {"ID": name, "TYPE": type_, "LABEL": label})
    for empty in (part for part in (style_list, tag_list) if len(part) == 0):
        root.remove(empty)
    return document(root)


class _Tags:
    """The tags of a document, each once."""

    def __init__(self, names: Names) -> None:
        self._names = names
        self._ids: dict[tuple[str, str, str], str] = {}

    @property
    def given(self) -> list[tuple[str, str, str, str]]:
        """Element name, TYPE, LABEL and ID of each, labels first."""
        return [(*tag, name) for tag, name in sorted(self._ids.items())]

    def of(self, labelled: RecognizedZone, name: str) -> list[str]:
        """IDs of the tags of a zone whose block is `name`."""
        found = [] if labelled.label is None else [("LayoutTag", "layout", clean(labelled.label))]
        zone = labelled.zone
        measures = {name: getattr(zone, name) for name in _MEASURES}
        if zone.kind == "text" and zone.lines == (len(_lines(zone)) or None):
            del measures["lines"]  # the TextLines contain it
        found += [("OtherTag", name, decimal(value)) for name, value in measures.items() if value is not None]
        found += [] if zone.id == name else [("OtherTag", _ID, clean(zone.id))]
        return [self._id(tag) for tag in found]

    def label(self, label: str) -> str:
        """ID of the tag of a label."""
        return self._id(("LayoutTag", "layout", clean(label)))

    def _id(self, tag: tuple[str, str, str]) -> str:
        if tag not in self._ids:
            wanted = f"{tag[2] if tag[0] == 'LayoutTag' else tag[1]}-tag"
            self._ids[tag] = self._names.give(wanted)
        return self._ids[tag]


def begin_alto(file_name: str, step_id: str, step_name: str, created: datetime | None = None) -> Element:
    """The root of a document about the image `file_name`, with its description; the step of its making has an ID."""
    root = Element(
        "alto",
        {
            "xmlns": NAMESPACE,
            "xmlns:xsi": XSI,
            "xsi:schemaLocation": f"{NAMESPACE} {SCHEMA}",
            "SCHEMAVERSION": SCHEMA_VERSION,
        },
    )
    description = SubElement(root, "Description")
    SubElement(description, "MeasurementUnit").text = "pixel"
    SubElement(SubElement(description, "sourceImageInformation"), "fileName").text = clean(file_name)
    step = SubElement(description, "Processing", {"ID": step_id})
    SubElement(step, "processingCategory").text = "contentGeneration"
    if created is not None:
        SubElement(step, "processingDateTime").text = created.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    SubElement(step, "processingStepDescription").text = step_name
    SubElement(SubElement(step, "processingSoftware"), "softwareName").text = SOFTWARE
    return root


def _style(zone: Zone) -> tuple[tuple[str, str], ...]:
    """Attributes of its ParagraphStyle."""
    names = {alignment: name for name, alignment in _ALIGNMENTS.items()}
    align = () if zone.alignment is None else (("ALIGN", names[zone.alignment]),)
    return align + (() if zone.line_spacing is None else (("LINESPACE", decimal(zone.line_spacing)),))


def _lines(zone: Zone) -> list[list[str]]:
    """The words of its text, line by line."""
    return [words for line in clean(zone.text).split("\n") if (words := line.split())]


def _write_block(space: Element, zone: Zone, attributes: dict[str, str], names: Names) -> None:
    place = _place(zone.box)
    if zone.kind == "figure" and zone.words:
        block = SubElement(space, "ComposedBlock", {**attributes, **place, "TYPE": _PRINTED_FIGURE})
        within = {"ID": names.give(f"{attributes['ID']}-text"), **place}
        _write_read_lines(SubElement(block, "TextBlock", within), zone)
        return
    block = SubElement(space, _BLOCK_OF[zone.kind], {**attributes, **place})
    if zone.kind == "noise":
        block.set("TYPE", _NOISE)
    if zone.kind != "text":
        return
    if zone.words:
        _write_read_lines(block, zone)
        return
    for words in _lines(zone):
        _write_words(block, words)


def _write_read_lines(block: Element, zone: Zone) -> None:
    """Lines and words that OCR read, with their places and confidences."""
    for words in zone_lines(zone):
        line = SubElement(block, "TextLine", _place(union_box(words)))
        for index, word in enumerate(words):
            if index:
                SubElement(line, "SP")
            text = {"CONTENT": clean(word.text), "WC": decimal(word.confidence)}
            SubElement(line, "String", {**text, **_place(word.box)})


def _write_table(
    space: Element, table: ItemTable, attributes: dict[str, str], names: Names, tags: _Tags
) -> None:
    """A table as a ComposedBlock whose cells are TextBlocks with the label of their column.

    ALTO has no rows and columns; the ID of a cell names them, from 1.
    """
    block = SubElement(space, "ComposedBlock", {**attributes, **_place(table.box), "TYPE": _TABLE})
    for row, cells in enumerate(table.rows, 1):
        for column, (label, cell) in enumerate(zip(table.columns, cells, strict=True), 1):
            if cell is None:
                continue
            own = {
                "ID": names.give(f"{attributes['ID']}-r{row}-c{column}"),
                "TAGREFS": tags.label(label),
                **_place(cell.box),
            }
            inner = SubElement(block, "TextBlock", own)
            for text in clean(cell.text).split("\n"):
                _write_words(inner, text.split())


def _write_words(block: Element, words: Sequence[str]) -> None:
    """A line of words whose places are not known."""
    if not words:
        return
    line = SubElement(block, "TextLine")
    for index, word in enumerate(words):
        if index:
            SubElement(line, "SP")
        SubElement(line, "String", {"CONTENT": word})


def _place(box: Box) -> dict[str, str]:
    x0, y0, x1, y1 = box
    return {"HEIGHT": decimal(y1 - y0), "WIDTH": decimal(x1 - x0), "HPOS": decimal(x0), "VPOS": decimal(y0)}
