"""Font sizes of the zones of a page: the em, measured or estimated, and its class against the page's body text."""

from typing import Literal

import numpy as np

from services.layout.page import Page, Zone

_LEADING = 1.2
"""Distance of baselines over em: the usual setting of print; the median of typeset title pages is 1.2."""
LINE_HEIGHT = 0.9
"""Height of a single line's ink over em, ascender to descender; the median of typeset title pages."""
_BODY_TOLERANCE = 0.05
"""Zones whose sizes differ by no more than this share count as one size; the steps of print are 10 %."""
_MEASURED_RANGE = (0.93, 1.075)
"""A measured size within this range of the body's is normal: half a step of print to either side."""
_ESTIMATED_RANGE = (0.75, 1.3)
"""The range for a size estimated from the box, which varies by a fifth with ascenders and descenders."""


FontClass = Literal["small", "normal", "large"]
"""Table 5.1's classes of 5.6.1: smaller than the page's body text, alike, larger."""


def estimate_font_size(zone: Zone) -> float | None:
    """Em of a zone's print in pixels: measured, else from the distance or number of its lines.

    None when `zone` is no text, or its number of lines is unknown (from `lines` or `text`).
    """
    if zone.kind != "text":
        return None
    if zone.font_size is not None:
        return zone.font_size if zone.font_size > 0 else None
    if zone.line_spacing is not None and zone.line_spacing > 0:
        return zone.line_spacing / _LEADING
    lines = _count_lines(zone)
    if lines == 0:
        return None
    height_px = zone.box[3] - zone.box[1]
    return height_px / ((lines - 1) * _LEADING + LINE_HEIGHT)


def body_font_size(page: Page) -> float | None:
    """Em in pixels in which most of the page is set; None where no zone's size is known.

    The size that has most text (lines times width of the box) within `body_tolerance` of it; of the zones
    within it, the weighted median.
    """
    sized = [(estimate_font_size(zone), zone) for zone in page.zones]
    sizes = np.array([size for size, _ in sized if size is not None])
    if sizes.size == 0:
        return None
    weights = np.array([_amount(zone) for size, zone in sized if size is not None])
    order = np.argsort(sizes)
    sizes, weights = sizes[order], weights[order]
    total = np.concatenate([[0.0], np.cumsum(weights)])
    ratio = 1.0 + _BODY_TOLERANCE
    first = np.searchsorted(sizes, sizes / ratio, side="left")
    last = np.searchsorted(sizes, sizes * ratio, side="right")
    best = int(np.argmax(total[last] - total[first]))
    start, end = int(first[best]), int(last[best])
    half = (total[start] + total[end]) / 2
    return float(sizes[min(int(np.searchsorted(total, half, side="left")) - 1, end - 1)])


def measure_font_classes(page: Page) -> list[FontClass | None]:
    """Class of every zone's font size relative to the page's body; None where its size is not known."""

    body = body_font_size(page)
    return [_font_class(zone, body) for zone in page.zones]


def _font_class(zone: Zone, body: float | None) -> FontClass | None:
    size = estimate_font_size(zone)
    if size is None or body is None:
        return None
    least, most = _ESTIMATED_RANGE if zone.font_size is None else _MEASURED_RANGE
    if size < least * body:
        return "small"
    return "large" if size > most * body else "normal"


def _count_lines(zone: Zone) -> int:
    if zone.lines is not None:
        return max(0, zone.lines)
    return len(zone.text.splitlines())


def _amount(zone: Zone) -> float:
    """How much text a zone holds: the length of its lines together, at least."""
    return max(1, _count_lines(zone)) * (zone.box[2] - zone.box[0])
