"""PAGE-XML (Page Analysis and Ground-truth Elements), 2019-07-15 and its forerunners: read.

Where labels and measures are is said where they are written (`page_xml`).
"""

from collections.abc import Callable, Iterable, Mapping
from typing import cast
from xml.etree.ElementTree import Element

from services.layout.exchange.limits import ExchangeLimits
from services.layout.exchange.page_json import BlockJson, page_of_blocks
from services.layout.exchange.page_xml import MEASURES
from services.layout.exchange.page_xml_custom import read_custom
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
from services.layout.page import InvalidLayout, Kind, Page
from services.notices import Notice

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
    custom = read_custom(region.get("custom", ""))
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
    measured = {name: number(own[key]) for key, name in MEASURES.items() if key in own}
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
        number(read_custom(part.get("custom", "")).get("readingOrder", {}).get("index")) for part in listed
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
