"""Measurement of zones from a client on the page's image."""

from dataclasses import replace

import numpy as np

from services.arrays import GrayImage
from services.layout.page import Page, Zone
from services.layout.segmentation.appearance import InkMarks, mark_ink, measure_appearance
from services.layout.segmentation.components import Indices
from services.layout.segmentation.frame import PrintedPage, analyse_print
from services.layout.segmentation.measures import (
    zone_alignment,
    zone_font_size,
    zone_line_spacing,
    zone_weight,
)
from services.layout.segmentation.text_lines import Line, find_lines


def measure_zones(gray: GrayImage, page: Page) -> Page:
    """`page` with what its zones lack, from the ink in their boxes: the appearance of all zones, and of text zones
    lines, font size, spacing, weight and alignment.

    What a zone has stays, as do its box, kind, text and label; a zone without ink stays as it is.

    Parameters
    ----------
    gray : (H, W) uint8, the page's image; zones whose boxes lie outside of it are not changed.
    """

    known = ("lines", "font_size", "line_spacing", "weight", "alignment")
    if all(
        zone.appearance is not None
        and (zone.kind != "text" or all(getattr(zone, each) is not None for each in known))
        for zone in page.zones
    ):
        return page
    printed = analyse_print(gray)
    if printed is None:
        return page
    found = [_lines_in(zone, printed) if zone.kind == "text" else [] for zone in page.zones]
    boxes = np.array([line.box for lines in found for line in lines]).reshape(-1, 4)
    column = (float(boxes[:, 0].min()), float(boxes[:, 2].max())) if len(boxes) else (0.0, 0.0)
    zones = (
        _measured(zone, lines, printed, column) if lines else zone
        for zone, lines in zip(page.zones, found, strict=True)
    )
    marks = mark_ink(printed)
    return replace(page, zones=tuple(_with_own_appearance(marks, zone) for zone in zones))


def _with_own_appearance(marks: InkMarks, zone: Zone) -> Zone:
    if zone.appearance is not None:
        return zone
    return replace(zone, appearance=measure_appearance(marks, zone.box))


def _lines_in(zone: Zone, printed: PrintedPage) -> list[Line]:
    boxes = printed.components.boxes
    x, y = ((boxes[:, :2] + boxes[:, 2:]) / 2).T
    sx, sy = printed.frame.scale
    x0, y0, x1, y1 = zone.box
    inside = (x0 <= x * sx) & (x * sx <= x1) & (y0 <= y * sy) & (y * sy <= y1)
    glyphs: Indices = np.flatnonzero(inside & printed.kinds.glyphs)
    return _one_per_row(find_lines(printed.levelled, glyphs)) if len(glyphs) else []


def _one_per_row(lines: list[Line]) -> list[Line]:
    """Of pieces side by side in a row the widest; from the top down."""
    rows: list[Line] = []
    for line in sorted(lines, key=lambda each: each.baseline):
        if rows and line.baseline - rows[-1].baseline < 0.5 * max(line.em, rows[-1].em):
            rows[-1] = max(rows[-1], line, key=lambda each: each.width)
        else:
            rows.append(line)
    return rows


def _measured(zone: Zone, lines: list[Line], printed: PrintedPage, column: tuple[float, float]) -> Zone:
    scale = printed.frame.mean_scale
    em = zone_font_size(lines)
    spacing = zone_line_spacing(lines)
    return replace(
        zone,
        lines=len(lines) if zone.lines is None else zone.lines,
        font_size=em * scale if zone.font_size is None else zone.font_size,
        line_spacing=(None if spacing is None else spacing * scale)
        if zone.line_spacing is None
        else zone.line_spacing,
        weight=zone_weight(lines) if zone.weight is None else zone.weight,
        alignment=zone_alignment(lines, column, em) if zone.alignment is None else zone.alignment,
    )
