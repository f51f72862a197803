"""ALTO (Analyzed Layout and Text Object, loc.gov/standards/alto): 4.4 written (`alto_reading` reads).

Blocks are tagged with their logical labels (`TAGREFS` of a LayoutTag whose LABEL is the label).
"""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from xml.etree.ElementTree import Element, SubElement

from services.layout.exchange.item_cells import outside_cells, table_of_zone
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
from services.layout.page import Box, Kind, Zone
from services.layout.recognition.results import Recognition, RecognizedZone
from services.layout.tables.item_table import ItemTable

NAMESPACE = "http://www.loc.gov/standards/alto/ns-v4#"
SCHEMA = "http://www.loc.gov/standards/alto/v4/alto-4-4.xsd"
SCHEMA_VERSION = "4.4"

_BLOCK_OF: Mapping[Kind, str] = {
    "text": "TextBlock",
    "figure": "Illustration",
    "noise": "Illustration",
    "rule": "GraphicalElement",
}
NOISE = "noise"
"""TYPE of the Illustrations that are noise; ALTO has no element for it."""
PRINTED_FIGURE = "printed-figure"
"""TYPE of our figures with print within them: an Illustration holds no words."""
TABLE = "table"
"""TYPE of tables of items; their cells are blocks of their own."""
ALIGNMENTS = {"Left": "left", "Right": "right", "Center": "centre", "Block": "justified"}
MEASURES = ("lines", "font_size", "weight")
"""Fields of a Zone without an attribute in ALTO. They become OtherTags: TYPE is the name, LABEL the value."""
ID_TAG = "id"
"""TYPE of the OtherTag with the zone's id, if that is not a valid XML name."""


def write_alto(recognition: Recognition, file_name: str, created: datetime, turned_deg: int = 0) -> bytes:
    """The recognition as ALTO 4.4 in pixels, the page being that of the image `file_name`.

    `created` is a time with its zone. PAGECLASS is the class. Lines have no position, since it is not measured. ALTO
    allows text in text blocks only, so text in a figure is left out. Where the page is that of the image turned
    clockwise by `turned_deg`, the description of the step says so.
    """
    page = recognition.page
    names = Names()
    zones = outside_cells(ordered(recognition), recognition.tables)
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
        measures = {name: getattr(zone, name) for name in MEASURES}
        if zone.kind == "text" and zone.lines == (len(_lines(zone)) or None):
            del measures["lines"]  # the TextLines contain it
        found += [("OtherTag", name, decimal(value)) for name, value in measures.items() if value is not None]
        found += [] if zone.id == name else [("OtherTag", ID_TAG, clean(zone.id))]
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
    names = {alignment: name for name, alignment in ALIGNMENTS.items()}
    align = () if zone.alignment is None else (("ALIGN", names[zone.alignment]),)
    return align + (() if zone.line_spacing is None else (("LINESPACE", decimal(zone.line_spacing)),))


def _lines(zone: Zone) -> list[list[str]]:
    """The words of its text, line by line."""
    return [words for line in clean(zone.text).split("\n") if (words := line.split())]


def _write_block(space: Element, zone: Zone, attributes: dict[str, str], names: Names) -> None:
    place = _place(zone.box)
    if zone.kind == "figure" and zone.words:
        block = SubElement(space, "ComposedBlock", {**attributes, **place, "TYPE": PRINTED_FIGURE})
        within = {"ID": names.give(f"{attributes['ID']}-text"), **place}
        _write_read_lines(SubElement(block, "TextBlock", within), zone)
        return
    block = SubElement(space, _BLOCK_OF[zone.kind], {**attributes, **place})
    if zone.kind == "noise":
        block.set("TYPE", NOISE)
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
    block = SubElement(space, "ComposedBlock", {**attributes, **_place(table.box), "TYPE": TABLE})
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
