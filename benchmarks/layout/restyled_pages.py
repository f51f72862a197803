"""Publications in any number: the labelled pages of a class in another publication's style."""

from dataclasses import replace

import numpy as np

from services.layout.page import Box, Page, Zone
from services.layout.pipeline import content_features

KNOTS = (0.0, 0.15, 0.3, 0.5, 0.75, 1.0)
"""Heights of a page between which a style stretches it evenly."""
MOVABLE = 0.45
"""Zones that are narrower than this share of the page may stand elsewhere across it."""


def restyled(page: Page, style: int) -> Page:
    """`page` as publication `style` would have set it; style 0 leaves it as it is.

    A style stretches parts of the page's height by 0.6 to 1.5, its width by 0.85 to 1.08 (a quarter of the styles
    mirror it), and decides for each label, whatever the page: font size (deviation 0.15 octaves), alignment of narrow
    zones, whether it is set in capitals, and whether it is left out.
    """
    if style == 0:
        return page
    rng = np.random.default_rng([7, style])
    heights = np.concatenate([[0.0], np.cumsum(np.diff(KNOTS) * rng.uniform(0.6, 1.5, len(KNOTS) - 1))])
    heights /= heights[-1]
    margin, squeeze, mirrored = rng.uniform(-0.05, 0.06), rng.uniform(0.85, 1.08), rng.random() < 0.25

    def across(x: float) -> float:
        share = 0.5 + (x / page.width - 0.5) * squeeze + margin
        return float(np.clip(1 - share if mirrored else share, 0.01, 0.99) * page.width)

    def along(y: float) -> float:
        return float(np.interp(y / page.height, KNOTS, heights) * page.height)

    zones = []
    for zone in page.zones:
        x0, y0, x1, y1 = zone.box
        left, right = sorted((across(x0), across(x1)))
        box = left, along(y0), max(right, left + 2.0), max(along(y1), along(y0) + 2.0)
        moved = _restyled_zone(zone, box, page.width, style)
        if moved is not None:
            zones.append(moved)
    return content_features().measure_page(replace(page, zones=tuple(zones)))


def _restyled_zone(zone: Zone, box: Box, page_width: float, style: int) -> Zone | None:
    """The zone by what the style says of its label; None where it is left out."""
    rng = np.random.default_rng([style, *(zone.label or "-").encode()])
    font, capitals, is_left_out = 2 ** rng.normal(0, 0.15), rng.random() < 0.15, rng.random() < 0.08
    alignment = rng.choice(["kept", "kept", "left", "right", "centre"])
    if is_left_out and zone.label not in (None, "body", "title"):
        return None
    left, top, right, bottom = box
    width = right - left
    if width < MOVABLE * page_width:
        places = {"left": 0.12 * page_width, "right": 0.88 * page_width - width}
        left = places.get(alignment, left if alignment == "kept" else 0.5 * (page_width - width))
    return replace(
        zone,
        box=(left, top, left + width, bottom),
        font_size=None if zone.font_size is None else zone.font_size * font,
        text=zone.text.upper() if capitals else zone.text,
        content={},
    )
