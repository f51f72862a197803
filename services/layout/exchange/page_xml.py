"""PAGE-XML (Page Analysis and Ground-truth Elements), 2019-07-15: written (`page_xml_reading` reads).

S. Pletschacher and A. Antonacopoulos, The PAGE format framework, ICPR 2010; schema at primaresearch.org. The
logical label is in `custom="structure {type:...;}"`, where most tools expect it. Values without an attribute in PAGE
(lines and sizes in pixels, the zone's own id) are in `custom="zone {...}"`.
"""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from xml.etree.ElementTree import Element, SubElement

from services.layout.exchange.item_cells import outside_cells, table_of_zone
from services.layout.exchange.page_xml_custom import write_custom
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
from services.layout.page import Box, Kind, ZoneWord
from services.layout.recognition.results import Recognition, RecognizedZone
from services.layout.tables.item_table import ItemTable

NAMESPACE = "http://schema.primaresearch.org/PAGE/gts/pagecontent/2019-07-15"

_REGION_OF: Mapping[Kind, str] = {
    "text": "TextRegion",
    "figure": "ImageRegion",
    "rule": "SeparatorRegion",
    "noise": "NoiseRegion",
}
_TEXT_TYPES = {
    **{name: name for name in ("paragraph", "heading", "caption", "header", "footer", "page-number")},
    **{
        name: name
        for name in ("drop-capital", "credit", "floating", "signature-mark", "catch-word", "marginalia")
    },
    **{
        name: name
        for name in ("footnote", "footnote-continued", "endnote", "TOC-entry", "list-label", "other")
    },
    "body": "paragraph",
    "title": "heading",
    "section-title": "heading",
    "author": "credit",
    "margin-note": "marginalia",
}
"""Labels of the enumeration TextTypeSimpleType, and synonyms of them."""
_GRAPHIC_TYPES = {
    **{name: name for name in ("logo", "letterhead", "decoration", "frame", "stamp", "signature", "barcode")},
    "handwriting": "handwritten-annotation",
}
"""Labels of GraphicsTypeSimpleType. Figures with such a label are GraphicRegions."""
_ALIGNMENTS = {"justified": "justify"}
MEASURES = {"lines": "lines", "fontSize": "font_size", "lineSpacing": "line_spacing", "weight": "weight"}
"""Properties of `zone {...}` and the fields of a Zone that they hold."""


def write_page_xml(recognition: Recognition, file_name: str, created: datetime, turned_deg: int = 0) -> bytes:
    """The recognition as PAGE-XML 2019-07-15, the page being that of the image `file_name`.

    `created` is a time with its zone. Boxes are rounded to whole pixels, as the schema demands. Text in zones of
    another kind is put into an inner TextRegion. The page's `custom` has the class and its probability. Where the page
    is that of the image turned clockwise by `turned_deg`, a comment says so.
    """
    page = recognition.page
    width, height = max(1, round(page.width)), max(1, round(page.height))
    root = Element(
        "PcGts",
        {
            "xmlns": NAMESPACE,
            "xmlns:xsi": XSI,
            "xsi:schemaLocation": f"{NAMESPACE} {NAMESPACE}/pagecontent.xsd",
        },
    )
    metadata = SubElement(root, "Metadata")
    SubElement(metadata, "Creator").text = SOFTWARE
    for name in ("Created", "LastChange"):
        SubElement(metadata, name).text = created.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    if turned_deg:
        SubElement(metadata, "Comments").text = turned_note(turned_deg)
    attributes = {"imageFilename": clean(file_name), "imageWidth": str(width), "imageHeight": str(height)}
    if recognition.chosen is not None:
        chosen = {"name": recognition.chosen.name, "probability": decimal(recognition.chosen.probability)}
        attributes["custom"] = write_custom({"class": chosen})
    element = SubElement(root, "Page", attributes)

    names = Names()
    zones = outside_cells(ordered(recognition), recognition.tables)
    ids = [names.give(zone.zone.id) for zone in zones]
    if zones:
        group = SubElement(
            SubElement(element, "ReadingOrder"), "OrderedGroup", {"id": names.give("reading-order")}
        )
        for index, name in enumerate(ids):
            SubElement(group, "RegionRefIndexed", {"index": str(index), "regionRef": name})
    left = list(recognition.tables)
    for name, zone in zip(ids, zones, strict=True):
        table = table_of_zone(zone.zone.box, left)
        if table is None:
            _write_region(element, zone, name, (width, height), names)
        else:
            left.remove(table)
            _write_table(element, table, name, (width, height), names)
    for table in left:
        _write_table(element, table, names.give("table"), (width, height), names)
    return document(root)


def _write_table(page: Element, table: ItemTable, name: str, size: tuple[int, int], names: Names) -> None:
    """A table as a TableRegion whose cells are TextRegions with their rows and columns; their labels as of zones."""
    attributes = {"id": name, "rows": str(len(table.rows)), "columns": str(len(table.columns))}
    region = SubElement(page, "TableRegion", attributes)
    SubElement(region, "Coords", {"points": _points(table.box, *size)})
    for row, cells in enumerate(table.rows):
        for column, (label, cell) in enumerate(zip(table.columns, cells, strict=True)):
            if cell is None:
                continue
            structure = {"type": label, "score": decimal(cell.confidence)}
            inner = SubElement(
                region,
                "TextRegion",
                {
                    "id": names.give(f"{name}-r{row + 1}-c{column + 1}"),
                    "custom": write_custom({"structure": structure}),
                },
            )
            SubElement(inner, "Coords", {"points": _points(cell.box, *size)})
            place = {"rowIndex": str(row), "columnIndex": str(column)}
            SubElement(SubElement(inner, "Roles"), "TableCellRole", place)
            SubElement(SubElement(inner, "TextEquiv"), "Unicode").text = clean(cell.text)


def _write_region(
    page: Element, labelled: RecognizedZone, name: str, size: tuple[int, int], names: Names
) -> None:
    zone, label, points = labelled.zone, labelled.label, _points(labelled.zone.box, *size)
    tag, attributes = _REGION_OF[zone.kind], {"id": name}
    if zone.kind == "text" and label is not None:
        attributes["type"] = _TEXT_TYPES.get(label, "other")
    elif zone.kind == "figure" and label in _GRAPHIC_TYPES:
        tag, attributes["type"] = "GraphicRegion", _GRAPHIC_TYPES[label]
    own = {} if zone.id == name else {"id": zone.id}
    own |= {
        key: decimal(value) for key, field in MEASURES.items() if (value := getattr(zone, field)) is not None
    }
    structure = {} if label is None else {"type": label, "score": decimal(labelled.confidence)}
    attributes["custom"] = write_custom({"structure": structure, "zone": own})
    if zone.kind == "text" and zone.alignment is not None:
        attributes["align"] = _ALIGNMENTS.get(zone.alignment, zone.alignment)

    region = SubElement(page, tag, attributes)
    SubElement(region, "Coords", {"points": points})
    text = clean(zone.text)
    if text or zone.words:
        holder = region
        if zone.kind != "text":
            holder = SubElement(region, "TextRegion", {"id": names.give(f"{name}-text")})
            SubElement(holder, "Coords", {"points": points})
        for number, line in enumerate(zone_lines(zone), 1):
            _write_line(holder, line, f"{name}-line-{number}", size, names)
        if text:
            SubElement(SubElement(holder, "TextEquiv"), "Unicode").text = text


def _write_line(
    holder: Element, words: Sequence[ZoneWord], name: str, size: tuple[int, int], names: Names
) -> None:
    line = SubElement(holder, "TextLine", {"id": names.give(name)})
    SubElement(line, "Coords", {"points": _points(union_box(words), *size)})
    for place, word in enumerate(words, 1):
        element = SubElement(line, "Word", {"id": names.give(f"{name}-word-{place}")})
        SubElement(element, "Coords", {"points": _points(word.box, *size)})
        read = SubElement(element, "TextEquiv", {"conf": decimal(word.confidence)})
        SubElement(read, "Unicode").text = clean(word.text)
    SubElement(SubElement(line, "TextEquiv"), "Unicode").text = clean(" ".join(word.text for word in words))


def _points(box: Box, width: int, height: int) -> str:
    """The box as the schema's polygon of whole pixels, inside the page and never empty."""
    x0 = min(max(round(box[0]), 0), width - 1)
    y0 = min(max(round(box[1]), 0), height - 1)
    x1 = min(max(round(box[2]), x0 + 1), width)
    y1 = min(max(round(box[3]), y0 + 1), height)
    return f"{x0},{y0} {x1},{y0} {x1},{y1} {x0},{y1}"
