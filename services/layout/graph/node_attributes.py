"""Attributes of nodes (5.3): measurements of a zone, and the cost functions of differences.

A new attribute is an entry of `NUMERIC_ATTRIBUTES`; matching and learning need not know of it, and a model that
was made without it gives it no cost.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.layout.graph.font_sizes import body_font_size, estimate_font_size
from services.layout.page import Page

Values = NDArray[np.float64]
CostFunction = Callable[[Values, Values, Values], Values]
"""(values, expected values, variances), which broadcast -> costs: negative log likelihoods but for a constant
that is the same for all expected values."""


def robust_difference(values: Values, expected: Values, variances: Values) -> Values:
    """Student's t with four degrees of freedom: squared difference by the weight 1 / variance, bounded in its growth.

    It is what a normal attribute predicts whose variance is known from a few samples only.
    """
    return np.asarray(2.5 * np.log1p((values - expected) ** 2 / (4 * variances)) + 0.5 * np.log(variances))


@dataclass(frozen=True, slots=True)
class ZoneMeasures:
    """Measurements of N zones of a page, from which attributes are computed; NaN for unknown values.

    `boxes` (N, 4) are shares of the page's width and height, within `FARTHEST`; `font_ratios` em over the page's
    body em; `density` to `regularity` those of `Appearance`; `words`, `letters`, `capitals`, `digits` counts in the
    text, NaN for all zones of a page that was not read.
    """

    boxes: Values
    lines: Values
    font_ratios: Values
    stroke_weights: Values
    words: Values
    letters: Values
    capitals: Values
    digits: Values
    characters: Values
    density: Values
    size: Values
    size_spread: Values
    stroke: Values
    slant: Values
    regularity: Values


def describe_zones(page: Page) -> ZoneMeasures:
    """Measures of all zones of `page`."""
    zones = page.zones
    boxes = np.array([zone.box for zone in zones], dtype=np.float64).reshape(-1, 4)
    boxes = np.clip(boxes / np.array([page.width, page.height, page.width, page.height]), *FARTHEST)
    body = body_font_size(page)
    fonts = np.array([estimate_font_size(zone) or np.nan for zone in zones], dtype=np.float64)
    weights = np.array([zone.weight or np.nan for zone in zones], dtype=np.float64)
    texts = [zone.text[:LONGEST_TEXT] for zone in zones]
    read = any(text.strip() for text in texts)

    def counted(count: Callable[[str], int]) -> Values:
        return np.array([count(text) if read else np.nan for text in texts], dtype=np.float64)

    def appearance(name: str) -> Values:
        looks = (zone.appearance for zone in zones)
        return np.array([np.nan if each is None else getattr(each, name) for each in looks], dtype=np.float64)

    with np.errstate(all="ignore"):
        usual_weight = np.nanmedian(weights) if np.isfinite(weights).any() else np.nan
    return ZoneMeasures(
        boxes=boxes,
        lines=np.array([np.nan if zone.lines is None else zone.lines for zone in zones], dtype=np.float64),
        font_ratios=fonts / (body or np.nan),
        stroke_weights=weights / usual_weight,
        words=counted(lambda text: len(text.split())),
        letters=counted(lambda text: sum(map(str.isalpha, text))),
        capitals=counted(lambda text: sum(map(str.isupper, text))),
        digits=counted(lambda text: sum(map(str.isdigit, text))),
        characters=counted(len),
        density=appearance("density"),
        size=appearance("size"),
        size_spread=appearance("size_spread"),
        stroke=appearance("stroke"),
        slant=appearance("slant"),
        regularity=appearance("regularity"),
    )


FARTHEST = (-1.0, 2.0)
"""Boxes are clipped to this range, so that attributes stay within the limits of a model."""

LONGEST_TEXT = 4000
"""Characters of a zone that are counted; a full page has about 4000."""


@dataclass(frozen=True, slots=True)
class NumericAttribute:
    """One number of a zone.

    `measure` gives it for all zones (N,), NaN where unknown, which costs nothing. `background` is its mean and
    standard deviation over zones of any page, `spread` the standard deviation within one component that is
    expected without samples; `scale` is its weight among the attributes until there are enough samples.
    """

    name: str
    measure: Callable[[ZoneMeasures], Values]
    background: tuple[float, float]
    spread: float
    scale: float
    cost: CostFunction = robust_difference


def _gaps(measures: ZoneMeasures) -> tuple[Values, Values]:
    """White space above and below each zone up to the next zone over or under it, 1 where none does."""
    x0, y0, x1, y1 = measures.boxes.T
    over = np.minimum(x1[:, None], x1) - np.maximum(x0[:, None], x0) > 0
    np.fill_diagonal(over, False)
    slack = 0.3 * (y1 - y0)[:, None]
    above = np.where(over & (y1 <= y0[:, None] + slack), y1, -np.inf).max(axis=1, initial=-np.inf)
    below = np.where(over & (y0 >= y1[:, None] - slack), y0, np.inf).min(axis=1, initial=np.inf)
    gap_above = np.where(np.isfinite(above), np.maximum(y0 - above, 0.0), 1.0)
    gap_below = np.where(np.isfinite(below), np.maximum(below - y1, 0.0), 1.0)
    return gap_above, gap_below


def _beside(measures: ZoneMeasures) -> Values:
    """Number of zones next to each zone, on a common row of the page."""
    y0, y1 = measures.boxes[:, 1], measures.boxes[:, 3]
    shared = np.minimum(y1[:, None], y1) - np.maximum(y0[:, None], y0) > 0
    return np.asarray(np.minimum(shared.sum(axis=1) - 1.0, 5.0))


def order_from_top(boxes: Values) -> NDArray[np.intp]:
    """Place of each box (N, 4) when they are sorted by their upper, then their left edge.

    Boxes with the same upper left corner are sorted by size; equal boxes keep the order of the zones.
    """
    x0, y0, x1, y1 = boxes.T
    place = np.empty(len(boxes), dtype=np.intp)
    place[np.lexsort((x1, y1, x0, y0))] = np.arange(len(boxes))
    return place


def _from_top(measures: ZoneMeasures) -> Values:
    return order_from_top(measures.boxes).astype(np.float64)


def _share(part: Values, whole: Values) -> Values:
    return part / np.maximum(whole, 1.0)


def _log2(values: Values) -> Values:
    return np.asarray(np.log2(np.maximum(values, 1e-6)))


def _aspect(measures: ZoneMeasures) -> Values:
    """Binary logarithm of the share of the page's width over that of its height: figures along its edge are tall."""
    x0, y0, x1, y1 = measures.boxes.T
    return _where_seen(measures, np.log2(np.maximum(x1 - x0, 1e-4) / np.maximum(y1 - y0, 1e-4)))


def _margin(measures: ZoneMeasures) -> Values:
    """Binary logarithm of the distance of each zone from the nearest edge of the page."""
    x0, y0, x1, y1 = measures.boxes.T
    inner = np.maximum(np.minimum(np.minimum(x0, y0), 1 - np.maximum(x1, y1)), 0.0)
    return _where_seen(measures, _log2(0.01 + inner))


def _where_seen(measures: ZoneMeasures, values: Values) -> Values:
    """`values` of zones whose ink was seen, NaN for others: drawn boxes without an image are labelled worse by them."""
    return np.asarray(np.where(np.isnan(measures.density), np.nan, values))


def _edge(index: int) -> Callable[[ZoneMeasures], Values]:
    return lambda measures: measures.boxes[:, index]


NUMERIC_ATTRIBUTES: tuple[NumericAttribute, ...] = (
    NumericAttribute("left", _edge(0), (0.26, 0.18), 0.03, 0.15),
    NumericAttribute("right", _edge(2), (0.66, 0.22), 0.07, 0.15),
    NumericAttribute("centre", lambda m: (m.boxes[:, 0] + m.boxes[:, 2]) / 2, (0.46, 0.17), 0.035, 0.15),
    NumericAttribute("top", _edge(1), (0.43, 0.28), 0.035, 0.15),
    NumericAttribute("bottom", _edge(3), (0.5, 0.28), 0.045, 0.15),
    NumericAttribute("middle", lambda m: (m.boxes[:, 1] + m.boxes[:, 3]) / 2, (0.47, 0.28), 0.04, 0.15),
    NumericAttribute("width", lambda m: m.boxes[:, 2] - m.boxes[:, 0], (0.4, 0.23), 0.05, 0.2),
    NumericAttribute("height", lambda m: _log2(m.boxes[:, 3] - m.boxes[:, 1]), (-4.8, 1.3), 0.42, 0.12),
    NumericAttribute("lines", lambda m: np.log2(1 + m.lines), (1.6, 1.1), 0.25, 0.12),
    NumericAttribute("font", lambda m: _log2(m.font_ratios), (0.0, 0.35), 0.06, 0.4),
    NumericAttribute("stroke-weight", lambda m: _log2(m.stroke_weights), (0.1, 0.3), 0.12, 0.25),
    NumericAttribute("words", lambda m: np.log2(1 + m.words), (3.2, 2.0), 0.5, 0.2),
    NumericAttribute("capitals", lambda m: _share(m.capitals, m.letters), (0.2, 0.25), 0.05, 0.35),
    NumericAttribute("digits", lambda m: _share(m.digits, m.characters), (0.06, 0.12), 0.03, 0.35),
    NumericAttribute(
        "printed", lambda m: np.where(np.isnan(m.words), np.nan, np.sign(m.words)), (0.95, 0.22), 0.07, 0.35
    ),
    NumericAttribute("gap-above", lambda m: _log2(0.002 + _gaps(m)[0]), (-5.5, 2.2), 0.4, 0.3),
    NumericAttribute("gap-below", lambda m: _log2(0.002 + _gaps(m)[1]), (-5.5, 2.2), 0.4, 0.3),
    NumericAttribute("beside", _beside, (0.8, 1.0), 0.3, 0.15),
    NumericAttribute("from-top", _from_top, (7.5, 5.0), 1.0, 0.2),
    NumericAttribute("from-bottom", lambda m: len(m.boxes) - 1 - _from_top(m), (7.5, 5.0), 1.6, 0.2),
    NumericAttribute("rank", lambda m: _from_top(m) / max(1, len(m.boxes) - 1), (0.5, 0.3), 0.06, 0.15),
    NumericAttribute("aspect", _aspect, (2.8, 2.0), 0.8, 0.2),
    NumericAttribute("margin", _margin, (-3.0, 0.94), 0.35, 0.2),
    NumericAttribute("density", lambda m: _log2(m.density), (-1.95, 0.77), 0.45, 0.2),
    NumericAttribute("size", lambda m: _log2(m.size), (0.42, 1.0), 0.3, 0.2),
    NumericAttribute("size-spread", lambda m: m.size_spread, (0.48, 0.38), 0.17, 0.2),
    NumericAttribute("stroke", lambda m: _log2(m.stroke), (0.07, 0.56), 0.18, 0.2),
    NumericAttribute("slant", lambda m: m.slant, (0.02, 0.2), 0.12, 0.2),
    NumericAttribute("regularity", lambda m: m.regularity, (0.76, 0.33), 0.12, 0.2),
)

APPEARANCE_ATTRIBUTES = (
    "aspect",
    "margin",
    "density",
    "size",
    "size-spread",
    "stroke",
    "slant",
    "regularity",
)
"""What tells handwriting, stamps and dirt from print; of no use to compare classes."""
