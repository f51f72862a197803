"""Neighbouring zones with one label, and the probability that they are pieces of one zone."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from services.layout.page import Box, Page, Zone

PIECE_FEATURES = (
    "gap-along",
    "gap-across",
    "font-step",
    "weight-step",
    "nearest-edges",
    "centres",
    "left-edges",
    "figures",
    "lines",
    "pitch",
    "constant",
)
"""What is measured of a pair of pieces; `piece_features` has their order."""

USUAL_WEIGHTS = (-1.05, -0.09, 0.72, 2.87, -0.15, 0.07, 0.38, 1.77, -0.69, -0.48, 1.64)
"""Log odds for each feature: a logistic regression on 2423 pairs of zones that segmentation found on title pages of
three publications, letters, memos and fax sheets; each set weighs the root of its number of pairs. On a set that is
left out 65 to 93 % of the pairs are decided correctly."""


MOST_ZONES = 300
"""Zones of pages with more are not put together: looking for pairs takes time with the square of their number. A
crowded page of print has 100."""


@dataclass(frozen=True, slots=True)
class PairParameters:
    """Lengths in ems of the page's print."""

    reach_along: float = 3.2
    """Largest gap of neighbours down the page: pieces are no farther apart than lines in double spacing."""
    reach_across: float = 8.0
    """Largest gap of neighbours in a row: a logo and the address to its right."""
    foreign_share: float = 0.3
    """Two zones are no neighbours if a zone with another label lies by more than this share between them."""
    most_gap: float = 3.0
    """Larger values of the features count as these: gaps along ..."""
    most_gap_across: float = 6.0
    """... and across,"""
    most_step: float = 0.7
    """steps of size and weight (natural logarithms),"""
    most_edge: float = 10.0
    """distances of edges and centres,"""
    most_pitch: float = 8.0
    """and the gap over the space between the lines of the pieces."""
    usual_pitch: float = 2.0
    """Assumed where neither piece has two lines."""
    line_height: float = 0.9
    """Height of a line's ink over its em."""


def print_size(page: Page) -> float:
    """Median em of the page's zones in pixels; a seventieth of its height where none is known."""
    sizes = [zone.font_size for zone in page.zones if zone.font_size]
    return float(np.median(sizes)) if sizes else page.height / 70


def neighbours_of(index: int, zones: Sequence[Zone | None], em: float) -> list[int]:
    """Zones with the label of `zones[index]` that are near it, with none of another label between them.

    Zones that are None are not there any more. Rules and noise lie between no zones.
    """
    p = PairParameters()
    own = zones[index]
    if own is None or own.label is None:
        return []
    present = [number for number, zone in enumerate(zones) if zone is not None]
    boxes = np.array([zone.box for zone in zones if zone is not None])
    same = np.array([zone.label == own.label for zone in zones if zone is not None])
    solid = np.array([zone.kind in ("text", "figure") for zone in zones if zone is not None])
    x0, y0, x1, y1 = own.box
    across = np.maximum(np.maximum(boxes[:, 0] - x1, x0 - boxes[:, 2]), 0.0)
    along = np.maximum(np.maximum(boxes[:, 1] - y1, y0 - boxes[:, 3]), 0.0)
    near = same & (across <= p.reach_across * em) & (along <= p.reach_along * em)
    areas = np.maximum(np.prod(boxes[:, 2:] - boxes[:, :2], axis=1), 1e-9)
    foreign = ~same & solid
    found = []
    for place in np.flatnonzero(near):
        other = present[int(place)]
        if other == index:
            continue
        hull = np.array(joined_box(own.box, tuple(boxes[place])))
        sides = np.minimum(boxes[:, 2:], hull[2:]) - np.maximum(boxes[:, :2], hull[:2])
        inside = np.prod(np.maximum(sides, 0.0), axis=1) / areas
        if not np.any(foreign & (inside > p.foreign_share)):
            found.append(other)
    return found


def piece_features(first: Zone, second: Zone, em: float) -> NDArray[np.float64]:
    """`PIECE_FEATURES` of two zones, in any order; `em` of the page's print in pixels."""
    p = PairParameters()
    upper, lower = (first, second) if first.box[1] <= second.box[1] else (second, first)
    a, b = np.array(upper.box) / em, np.array(lower.box) / em
    across, along = max(a[0] - b[2], b[0] - a[2], 0.0), max(b[1] - a[3], 0.0)
    left, right = abs(a[0] - b[0]), abs(a[2] - b[2])
    centres = abs(a[0] + a[2] - b[0] - b[2]) / 2
    edges = np.log1p(np.minimum([min(left, right, centres), centres, left], p.most_edge))
    spaces = [
        zone.line_spacing / em - p.line_height * (zone.font_size or em) / em
        for zone in (upper, lower)
        if zone.line_spacing and (zone.lines or 0) > 1
    ]
    pitch = along / max(min(spaces), 0.15) if spaces else p.usual_pitch
    return np.array(
        [
            min(along, p.most_gap),
            min(across, p.most_gap_across),
            _step(upper.font_size, lower.font_size, p.most_step),
            _step(upper.weight, lower.weight, p.most_step),
            *edges,
            float(upper.kind != "text") + float(lower.kind != "text"),
            np.log(max(upper.lines or 1, lower.lines or 1)),
            np.log1p(min(pitch, p.most_pitch)),
            1.0,
        ]
    )


def piece_probability(first: Zone, second: Zone, em: float, joining: Mapping[str, float]) -> float:
    """Probability that two zones with one label are pieces of one zone.

    `joining` has log odds that a class has learned for its labels; a label that is missing has the usual ones.
    """
    odds = float(piece_features(first, second, em) @ USUAL_WEIGHTS)
    return float(expit(odds + joining.get(first.label or "", 0.0)))


def joined_box(first: Box, second: Box) -> Box:
    """The box round two boxes."""
    return (
        min(first[0], second[0]),
        min(first[1], second[1]),
        max(first[2], second[2]),
        max(first[3], second[3]),
    )


def _step(first: float | None, second: float | None, most: float) -> float:
    return min(abs(float(np.log(first / second))), most) if first and second else 0.0
