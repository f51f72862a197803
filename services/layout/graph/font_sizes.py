"""Font sizes of the zones of a page: the em, measured or estimated, and its class against the page's body text."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from services.layout.page import Page, Zone

FontClass = Literal["small", "normal", "large"]
"""Table 5.1's classes of 5.6.1: smaller than the page's body text, alike, larger."""


@dataclass(frozen=True, slots=True)
class FontSizeParameters:
    """Ratios to the em or to the body's em."""

    leading: float = 1.2
    """Distance of baselines over em: the usual setting of print; the median of typeset title pages is 1.2."""
    line_height: float = 0.9
    """Height of a single line's ink over em, ascender to descender; the median of typeset title pages."""
    body_tolerance: float = 0.05
    """Zones whose sizes differ by no more than this share count as one size; the steps of print are 10 %."""
    measured_range: tuple[float, float] = (0.93, 1.075)
    """A measured size within this range of the body's is normal: half a step of print to either side."""
    estimated_range: tuple[float, float] = (0.75, 1.3)
    """The range for a size estimated from the box, which varies by a fifth with ascenders and descenders."""


def estimate_font_size(zone: Zone, parameters: FontSizeParameters = FontSizeParameters()) -> float | None:
    """Em of a zone's print in pixels: measured, else from the distance or number of its lines.

    None when `zone` is no text, or its number of lines is unknown (from `lines` or `text`).
    """
    if zone.kind != "text":
        return None
    if zone.font_size is not None:
        return zone.font_size if zone.font_size > 0 else None
    if zone.line_spacing is not None and zone.line_spacing > 0:
        return zone.line_spacing / parameters.leading
    lines = _count_lines(zone)
    if lines == 0:
        return None
    height_px = zone.box[3] - zone.box[1]
    return height_px / ((lines - 1) * parameters.leading + parameters.line_height)


def body_font_size(page: Page, parameters: FontSizeParameters = FontSizeParameters()) -> float | None:
    """Em in pixels in which most of the page is set; None where no zone's size is known.

    The size that has most text (lines times width of the box) within `body_tolerance` of it; of the zones
    within it, the weighted median.
    """
    sized = [(estimate_font_size(zone, parameters), zone) for zone in page.zones]
    sizes = np.array([size for size, _ in sized if size is not None])
    if sizes.size == 0:
        return None
    weights = np.array([_amount(zone) for size, zone in sized if size is not None])
    order = np.argsort(sizes)
    sizes, weights = sizes[order], weights[order]
    total = np.concatenate([[0.0], np.cumsum(weights)])
    ratio = 1.0 + parameters.body_tolerance
    first = np.searchsorted(sizes, sizes / ratio, side="left")
    last = np.searchsorted(sizes, sizes * ratio, side="right")
    best = int(np.argmax(total[last] - total[first]))
    start, end = int(first[best]), int(last[best])
    half = (total[start] + total[end]) / 2
    return float(sizes[min(int(np.searchsorted(total, half, side="left")) - 1, end - 1)])


def measure_font_classes(page: Page) -> list[FontClass | None]:
    """Class of every zone's font size relative to the page's body; None where its size is not known."""
    p = FontSizeParameters()
    body = body_font_size(page, p)
    return [_font_class(zone, body, p) for zone in page.zones]


def _font_class(zone: Zone, body: float | None, parameters: FontSizeParameters) -> FontClass | None:
    size = estimate_font_size(zone, parameters)
    if size is None or body is None:
        return None
    least, most = parameters.estimated_range if zone.font_size is None else parameters.measured_range
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
