"""PAGE-XML (Page Analysis and Ground-truth Elements), 2019-07-15: read, also its forerunners, and written.

S. Pletschacher and A. Antonacopoulos, The PAGE format framework, ICPR 2010; schema at primaresearch.org. The
logical label is in `custom="structure {type:...;}"`, where most tools expect it. Values without an attribute in PAGE
(lines and sizes in pixels, the zone's own id) are in `custom="zone {...}"`.
"""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import UTC, datetime
from typing import cast
from xml.etree.ElementTree import Element, SubElement

from services.layout.exchange.item_cells import table_of_zone
from services.layout.exchange.limits import ExchangeLimits
from services.layout.exchange.page_json import BlockJson, page_of_blocks
from services.layout.exchange.xml_reading import (
    FIELD,
    box_of,
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
from services.layout.page import Box, InvalidLayout, Kind, Page, ZoneWord
from services.layout.recognition.results import Recognition, RecognizedZone
from services.layout.tables.item_table import ItemTable
from services.notices import Notice

NAMESPACE = "http://schema.primaresearch.org/PAGE/gts/pagecontent/2019-07-15"

_KINDS: Mapping[str, Kind] = {
    "TextRegion": "text",
    "MathsRegion": "text",
    "ImageRegion": "figure",
    "LineDrawingRegion": "figure",
    "GraphicRegion": "figure",
    "TableRegion": "figure",
    "ChartRegion": "figure",
    "MapRegion": "figure",
    "ChemRegion": "figure",
    "MusicRegion": "figure",
    "AdvertRegion": "figure",
    "UnknownRegion": "figure",
    "CustomRegion": "figure",
    "SeparatorRegion": "rule",
    "NoiseRegion": "noise",
    "FrameRegion": "figure",  # until 2010
}
_CONTAINERS = {"AdvertRegion", "UnknownRegion", "CustomRegion"}
"""Regions that are replaced by their inner regions. In other regions, inner regions are parts, as the cells of a
table."""
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
_MEASURES = {"lines": "lines", "fontSize": "font_size", "lineSpacing": "line_spacing", "weight": "weight"}
"""Properties of `zone {...}` and the fields of a Zone that they hold."""
_CUSTOM_GROUP = re.compile(r"(?<![\w-])([\w-]+)\s*\{([^{}]*)\}")
_LONGEST_CUSTOM = 10_000
_TO_ESCAPE = re.compile(r"[\\{}:;,\s]")
_ESCAPED = re.compile(r"\\u([0-9a-fA-F]{4})")


def page_of_page_xml(
    root: Element,
    limits: ExchangeLimits,
    warn: Callable[[Notice], None],
    pixels: tuple[float, float] | None = None,
) -> Page:
    """Page of a PAGE-XML document, its zones in its reading order, else by `readingOrder` of `custom`, else in document
    order.

    Coords become their bounding boxes; where a region has none, they are those of its parts. The label is
    `structure {type:...;}` of `custom`, else PAGE's own `type` (except `other`). Font size and line spacing come from
    the boxes of the lines if the file does not have them. `pixels`, width and height of the page's image, are needed
    when the file has no size of the page. A region that cannot be read is left out; `warn` gets a warning that names
    it. Raises `InvalidLayout`; `zones[i]` counts the regions from 0 in document order.
    """
    page = next(children(root, "Page"), None) if root.tag == "PcGts" else None
    if page is None:
        raise InvalidLayout("The file is no PAGE-XML: it has no Page in a PcGts.", FIELD)
    dpi = _resolution(page)
    regions = _regions(page)
    blocks = [_zone_document(region, index, dpi) for index, region in enumerate(regions)]
    found, places = page_of_blocks(_size(page, pixels), blocks, limits, warn)
    kept = [regions[place] for place in places]
    references = _references(page)
    if references:
        order = in_reading_order(kept, "id", references)
    else:
        order = [kept.index(region) for region in _in_custom_order(kept)]
    return Page(found.width, found.height, tuple(found.zones[index] for index in order))


def _size(page: Element, pixels: tuple[float, float] | None) -> tuple[float | None, float | None]:
    """Width and height of the page: its own, else those of its image, else as far as PrintSpace or Border reach."""
    width, height = number(page.get("imageWidth")), number(page.get("imageHeight"))
    if width and height:
        return width, height
    reach = pixels or next(
        (tuple(box[2:]) for part in children(page, "PrintSpace", "Border") if (box := _coords_box(part))),
        (None, None),
    )
    return width or reach[0], height or reach[1]


def _regions(parent: Element) -> list[Element]:
    """The regions that become zones, in document order; read_xml has bounded the depth."""
    found: list[Element] = []
    for region in children(parent, *_KINDS):
        inner = _regions(region) if region.tag in _CONTAINERS else []
        found += inner or [region]
    return found


def _references(page: Element) -> list[str]:
    """Ids of regions as ReadingOrder names them; the groups of an ordered group by their index."""
    reading_order = next(children(page, "ReadingOrder"), None)
    return [] if reading_order is None else _group_references(reading_order)


def _group_references(group: Element) -> list[str]:
    members = sorted(group, key=lambda member: number(member.get("index")) or 0.0)
    found: list[str] = []
    for member in members:
        reference = member.get("regionRef")
        found += [reference] if reference else []
        found += _group_references(member)
    return found


def _zone_document(region: Element, index: int, dpi: float | None) -> BlockJson:
    custom = _read_custom(region.get("custom", ""))
    own = custom.get("zone", {})
    lines = _in_custom_order(children(region, "TextLine"))
    style = next(children(region, "TextStyle"), None)
    points = number(None if style is None else style.get("fontSize"))
    size, spacing = measure_lines([_coords_box(line) for line in lines])
    zone: BlockJson = {
        "id": own.get("id") or region.get("id") or f"region-{index + 1}",
        "box": _part_box(region),
        "kind": _KINDS[region.tag],
        "label": _label(region, custom),
        "lines": len(lines) or None,
        "font_size": points * dpi / 72.0 if points and dpi else size,
        "line_spacing": spacing,
        "alignment": _alignment(region.get("align")),
        "text": _text(region),
    }
    measured = {name: number(own[key]) for key, name in _MEASURES.items() if key in own}
    return cast(BlockJson, {**zone, **measured})


def _coords_box(region: Element) -> list[float] | None:
    coords = next(children(region, "Coords"), None)
    if coords is None:
        return None
    if "points" in coords.attrib:
        return polygon_box(coords.attrib["points"])
    corners = [
        (number(point.get("x")), number(point.get("y"))) for point in children(coords, "Point")
    ]  # until 2010
    known = [(x, y) for x, y in corners if x is not None and y is not None]
    return (
        box_of([x for x, _ in known], [y for _, y in known]) if known and len(known) == len(corners) else None
    )


def _part_box(part: Element) -> list[float] | None:
    """Box of a region or line: of its Coords, else of its Baseline or of the parts in it."""
    own = _coords_box(part)
    if own is not None:
        return own
    baseline = next(children(part, "Baseline"), None)
    inner = [_part_box(each) for each in children(part, "TextLine", "Word", "Glyph", "TableCell", *_KINDS)]
    return hull_of([*inner, None if baseline is None else polygon_box(baseline.get("points", ""))])


def _in_custom_order(parts: Iterable[Element]) -> list[Element]:
    """The parts by the index that `readingOrder {index:...;}` of their `custom` names, where all of them have one."""
    listed = list(parts)
    places = [
        number(_read_custom(part.get("custom", "")).get("readingOrder", {}).get("index")) for part in listed
    ]
    if None in places:
        return listed
    return [part for _, part in sorted(zip(places, listed, strict=True), key=lambda each: each[0] or 0.0)]


def _label(region: Element, custom: dict[str, dict[str, str]]) -> str | None:
    label = custom.get("structure", {}).get("type")
    if label or "zone" in custom:  # files of this module have labels in `structure` only
        return label or None
    own = region.get("type")
    return None if own == "other" else own or None


def _alignment(align: str | None) -> str | None:
    return {"justify": "justified", "left": "left", "right": "right", "centre": "centre"}.get(align or "")


def _text(element: Element) -> str:
    """Text of a region: its own transcription, else that of its lines (words), or of the cells and regions in it."""
    equivalents = sorted(
        children(element, "TextEquiv"), key=lambda equivalent: number(equivalent.get("index")) or 0.0
    )
    own = next(filter(None, map(_transcription, equivalents)), "")
    if own:
        return own
    between = " " if element.tag == "TextLine" else "\n"
    inner = _in_custom_order(children(element, "TextLine", "Word", "TableCell", *_KINDS))
    return between.join(filter(None, map(_text, inner)))


def _transcription(equivalent: Element) -> str:
    """Its Unicode, else its PlainText; blank ones count as none."""
    texts = (text.text or "" for name in ("Unicode", "PlainText") for text in children(equivalent, name))
    return next((text for text in texts if text.strip()), "")


def _resolution(page: Element) -> float | None:
    """Pixels per inch, where the page says it."""
    resolution = number(page.get("imageYResolution"))
    if not resolution or resolution < 0:
        return None
    return {"PPI": resolution, "PPCM": resolution * 2.54}.get(page.get("imageResolutionUnit", ""))


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
        attributes["custom"] = _write_custom({"class": chosen})
    element = SubElement(root, "Page", attributes)

    names = Names()
    zones = ordered(recognition)
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
                    "custom": _write_custom({"structure": structure}),
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
        key: decimal(value) for key, field in _MEASURES.items() if (value := getattr(zone, field)) is not None
    }
    structure = {} if label is None else {"type": label, "score": decimal(labelled.confidence)}
    attributes["custom"] = _write_custom({"structure": structure, "zone": own})
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


def _write_custom(groups: Mapping[str, Mapping[str, str]]) -> str:
    return " ".join(
        f"{name} {{" + " ".join(f"{key}:{_escape(value)};" for key, value in properties.items()) + "}"
        for name, properties in groups.items()
        if properties or name == "zone"
    )


def _read_custom(custom: str) -> dict[str, dict[str, str]]:
    """`name {key:value; ...} ...`; of groups of one name the last counts."""
    groups: dict[str, dict[str, str]] = {}
    for match in _CUSTOM_GROUP.finditer(custom[:_LONGEST_CUSTOM]):
        pairs = (part.partition(":") for part in match[2].split(";"))
        groups[match[1]] = {key.strip(): _unescape(value.strip()) for key, found, value in pairs if found}
    return groups


def _escape(value: str) -> str:
    return _TO_ESCAPE.sub(lambda match: f"\\u{ord(match[0]):04x}", clean(value))


def _unescape(value: str) -> str:
    return _ESCAPED.sub(lambda match: chr(int(match[1], 16)), value)
