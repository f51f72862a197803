"""HTML of recognized pages: of one page, or of a document."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from services.arrays import RgbImage
from services.contract.answers.layout import LayoutResult
from services.contract.html import HtmlElement
from services.imaging.codec import encode_image
from services.layout.exchange.item_cells import table_around
from services.layout.page import Box
from services.layout.rendering.html_elements import choose_element
from services.layout.rendering.html_file import HtmlPicture, HtmlZone, write_html
from services.layout.rendering.html_table import HtmlTable
from services.layout.tables.item_table import ItemTable
from services.ocr.languages import language_tag
from services.operations.kept_picture import PICTURE_QUALITY, read_kept_picture
from services.operations.layout_tables import tables_from
from services.operations.reduced_views import reduce_picture, reduced_size

_LONGEST_SIDE_PX = 1600
"""Of an embedded picture; wider than most screens show a text column."""
_MOST_AREA = 2.0
"""Area of all pictures of a page in areas of the page. Zones of other segmenters may overlap; 500 zones of the whole
page would be 500 pictures of it. Later pictures are left out."""


@dataclass(frozen=True, slots=True)
class HtmlPage:
    """The answer about a page, and the picture of its page: pixels, or a JPEG file.

    `elements` has the elements that settings name, by label. A picture may have fewer pixels than the page.
    """

    answer: LayoutResult
    picture: RgbImage | bytes | None = None
    elements: Mapping[str, HtmlElement] = field(default_factory=dict)


def render_html(pages: Sequence[HtmlPage], title: str) -> bytes:
    """The pages as one HTML file; its title is the first heading, and `title` without one."""
    languages = {page.answer.language for page in pages}
    language = languages.pop() if len(languages) == 1 else None
    return write_html([list(_zones(page)) for page in pages], title, language_tag(language or ""))


def _pixels(picture: RgbImage | bytes | None) -> RgbImage | None:
    return read_kept_picture(picture) if isinstance(picture, bytes) else picture


def _zones(page: HtmlPage) -> Iterator[HtmlZone]:
    """Zones in reading order, with the parts of the picture that they need."""
    answer = page.answer
    pixels = _pixels(page.picture)
    # A date may stand in a zone of another label, which is more than the date.
    labels = {zone.id: zone.label for zone in answer.zones}
    dates = {
        zone: found.value
        for found in answer.fields
        if found.type == "date" and found.value and len(found.zones) == 1
        for zone in found.zones
        if labels[zone] == found.label
    }
    left = _MOST_AREA * answer.width * answer.height
    tables, written = tables_from(answer.tables), set()
    for zone in sorted(answer.zones, key=lambda each: each.order):
        if (table := table_around(zone.box, tables)) is not None:
            if table.box not in written:
                written.add(table.box)
                yield HtmlZone(zone.id, zone.label, "p", zone.text or "table", table=_html_table(table))
            continue
        element, text = choose_element(zone.kind, zone.label, page.elements), zone.text
        x0, y0, x1, y1 = zone.box
        picture = None
        needs_picture = element != "none" and (element in ("figure", "img") or not text.strip())
        if needs_picture and pixels is not None and (area := (x1 - x0) * (y1 - y0)) <= left:
            left -= area
            picture = _cut_out(pixels, zone.box, pixels.shape[1] / answer.width)
        if picture is not None and element in ("ul", "ol", "pre", "figcaption"):
            element = "figure"
        yield HtmlZone(zone.id, zone.label, element, text, dates.get(zone.id), picture)


def _html_table(table: ItemTable) -> HtmlTable:
    rows = [["" if cell is None else cell.text for cell in row] for row in table.rows]
    return HtmlTable(table.columns, table.headers, rows)


def _cut_out(pixels: RgbImage, box: Box, scale: float) -> HtmlPicture:
    """The part of the picture in a box of the page, `scale` pixels of the picture being one of the page."""
    height, width = pixels.shape[:2]
    x0, y0 = (
        min(max(int(edge * scale), 0), most - 1) for edge, most in zip(box[:2], (width, height), strict=True)
    )
    x1, y1 = max(x0 + 1, min(width, round(box[2] * scale))), max(y0 + 1, min(height, round(box[3] * scale)))
    part = pixels[y0:y1, x0:x1]
    size = reduced_size(x1 - x0, y1 - y0, _LONGEST_SIDE_PX, _LONGEST_SIDE_PX)
    if size != (x1 - x0, y1 - y0):
        part = reduce_picture(part, *size)
    return HtmlPicture(encode_image(np.ascontiguousarray(part), "jpeg", PICTURE_QUALITY), *size)
