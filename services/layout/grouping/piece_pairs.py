"""Pieces of zones, and how probably two neighbours with one label are pieces of one zone."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.layout.graph.font_sizes import LINE_HEIGHT
from services.layout.model.layout_model import PieceStatistics
from services.layout.page import Box, Page, Zone

REACH_ALONG = 3.2
"""Largest gap of neighbours down the page: pieces are no farther apart than lines in double spacing."""
_REACH_ACROSS = 8.0
"""Largest gap of neighbours in a row: a logo and the address to its right."""
_FOREIGN_SHARE = 0.3
"""Two zones are no neighbours if a zone with another label lies by more than this share between them."""
_MOST_STEP = 0.7
"""Larger values of the features count as these: steps of size and weight (natural logarithms), ..."""
_MOST_EDGE = 10.0
"""... distances of edges and centres, ..."""
_MOST_PITCH = 8.0
"""... and the gap over the space between the lines of the pieces."""
_USUAL_PITCH = 2.0
"""Assumed where neither piece has two lines."""


Values = NDArray[np.float64]
Places = NDArray[np.intp]

PAIR_FEATURES = (
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
"""What is measured of two pieces; `pair_features` has their order."""

PAIR_WEIGHTS = (-1.311, -0.296, -0.1, 2.013, -0.568, 0.05, 0.346, -0.338, -0.955, -0.915, 2.2)
"""Log odds for each feature, as `python -m benchmarks layout_joins` learns them. What a class adds for its labels
(`PieceStatistics.joining`) is about these."""


MOST_ZONES = 300
"""Zones of pages with more are not put together: looking for pairs takes time with the square of their number. A
crowded page of print has 100."""


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """N pieces of a page: zones, and zones put together.

    `boxes` (N, 4) in ems of the page's print; `lines` (N,), 0 where unknown; `sizes`, `weights` natural logarithms of
    em and stroke weight and `spaces` white space between lines in ems, NaN where unknown; `others` are pieces that are
    no text, `solid` ones text or figures. `labels` (N,) number the labels, -1 for null.
    """

    boxes: Values
    lines: Values
    sizes: Values
    weights: Values
    spaces: Values
    others: NDArray[np.bool_]
    solid: NDArray[np.bool_]
    labels: Places

    def taken(self, places: Places | slice) -> "Pieces":
        """Those at `places`."""
        return Pieces(*(getattr(self, name)[places] for name in self.__slots__))

    def with_room(self, more: int) -> "Pieces":
        """These, with room for `more` that `put` fills; room has the label -2, which no piece has."""
        grown = Pieces(
            *(
                np.concatenate([values, np.zeros((more, *values.shape[1:]), values.dtype)])
                for values in (getattr(self, name) for name in self.__slots__)
            )
        )
        grown.labels[len(self.labels) :] = -2
        return grown

    def put(self, place: int, first: int, second: int) -> None:
        """Fill `place` with two pieces put together, with the print of the one that has more lines."""
        larger = first if self.lines[first] >= self.lines[second] else second
        for name in ("sizes", "weights", "spaces", "labels"):
            values = getattr(self, name)
            values[place] = values[larger]
        self.boxes[place] = _hulls(self.boxes[[first]], self.boxes[[second]])[0]
        self.lines[place] = self.lines[first] + self.lines[second]
        self.others[place] = self.others[first] and self.others[second]
        self.solid[place] = self.solid[first] or self.solid[second]


def describe_pieces(zones: Sequence[Zone], em: float) -> tuple[Pieces, list[str]]:
    """The zones as pieces, and the labels by their numbers; `em` of the page's print in pixels."""

    named = list(dict.fromkeys(zone.label for zone in zones if zone.label is not None))
    number = {label: place for place, label in enumerate(named)}

    def known(values: list[float | None]) -> Values:
        return np.array([np.nan if value is None else value for value in values], np.float64)

    pieces = Pieces(
        boxes=np.array([zone.box for zone in zones], np.float64).reshape(-1, 4) / em,
        lines=np.array([zone.lines or 0 for zone in zones], np.float64),
        sizes=np.log(known([zone.font_size or None for zone in zones])),
        weights=np.log(known([zone.weight or None for zone in zones])),
        spaces=known(
            [
                zone.line_spacing / em - LINE_HEIGHT * (zone.font_size or em) / em
                if zone.line_spacing and (zone.lines or 0) > 1
                else None
                for zone in zones
            ]
        ),
        others=np.array([zone.kind != "text" for zone in zones], bool),
        solid=np.array([zone.kind in ("text", "figure") for zone in zones], bool),
        labels=np.array([-1 if zone.label is None else number[zone.label] for zone in zones], np.intp),
    )
    return pieces, named


def print_size(page: Page) -> float:
    """Median em of the page's zones in pixels; a seventieth of its height where none is known."""
    sizes = [zone.font_size for zone in page.zones if zone.font_size]
    return float(np.median(sizes)) if sizes else page.height / 70


def are_neighbours(pieces: Pieces, first: Places, second: Places, zones: Pieces) -> NDArray[np.bool_]:
    """Which pairs (P,) have one label and are near, with none of `zones` that has another label between them.

    Rules and noise lie between no pieces.
    """

    a, b = pieces.boxes[first], pieces.boxes[second]
    gaps = np.maximum(np.maximum(a[:, :2] - b[:, 2:], b[:, :2] - a[:, 2:]), 0.0)
    near: NDArray[np.bool_] = (
        (first != second)
        & (pieces.labels[first] == pieces.labels[second])
        & (pieces.labels[first] >= 0)
        & (gaps[:, 0] <= _REACH_ACROSS)
        & (gaps[:, 1] <= REACH_ALONG)
    )
    found = np.flatnonzero(near)
    solid = np.flatnonzero(zones.solid)
    if len(found) and len(solid):
        boxes = zones.boxes[solid]
        hulls = _hulls(a[found], b[found])
        sides = np.minimum(hulls[:, None, 2:], boxes[:, 2:]) - np.maximum(hulls[:, None, :2], boxes[:, :2])
        areas = np.maximum(np.prod(boxes[:, 2:] - boxes[:, :2], axis=1), 1e-9)
        inside = np.prod(np.maximum(sides, 0.0), axis=2) / areas
        foreign = zones.labels[solid] != pieces.labels[first[found], None]
        near[found] = ~np.any(foreign & (inside > _FOREIGN_SHARE), axis=1)
    return near


def pair_features(pieces: Pieces, first: Places, second: Places) -> Values:
    """`PAIR_FEATURES` (P, 11) of pairs of pieces, each in any order."""

    is_upper = pieces.boxes[first, 1] <= pieces.boxes[second, 1]
    upper, lower = np.where(is_upper, first, second), np.where(is_upper, second, first)
    a, b = pieces.boxes[upper], pieces.boxes[lower]
    across = np.maximum(np.maximum(a[:, 0] - b[:, 2], b[:, 0] - a[:, 2]), 0.0)
    along = np.maximum(b[:, 1] - a[:, 3], 0.0)
    left, right = np.abs(a[:, 0] - b[:, 0]), np.abs(a[:, 2] - b[:, 2])
    centres = np.abs(a[:, 0] + a[:, 2] - b[:, 0] - b[:, 2]) / 2
    space = np.fmin(pieces.spaces[upper], pieces.spaces[lower])
    pitch = np.where(np.isfinite(space), along / np.maximum(np.nan_to_num(space), 0.15), _USUAL_PITCH)

    def edges(distances: Values) -> Values:
        return np.asarray(np.log1p(np.minimum(distances, _MOST_EDGE)))

    def step(values: Values) -> Values:
        return np.asarray(np.nan_to_num(np.minimum(np.abs(values[upper] - values[lower]), _MOST_STEP)))

    return np.column_stack(
        [
            along,
            across,
            step(pieces.sizes),
            step(pieces.weights),
            edges(np.minimum(np.minimum(left, right), centres)),
            edges(centres),
            edges(left),
            pieces.others[upper].astype(float) + pieces.others[lower],
            np.log(np.maximum(np.maximum(pieces.lines[upper], pieces.lines[lower]), 1.0)),
            np.log1p(np.minimum(pitch, _MOST_PITCH)),
            np.ones(len(first)),
        ]
    )


def joining_of(labels: Sequence[str], learned: Mapping[str, PieceStatistics]) -> Values:
    """Log odds (L,) that a class has learned for its labels; 0 for those that it does not know."""
    return np.array([learned[label].joining if label in learned else 0.0 for label in labels], np.float64)


def joined_box(first: Box, second: Box) -> Box:
    """The box round two boxes."""
    return (
        min(first[0], second[0]),
        min(first[1], second[1]),
        max(first[2], second[2]),
        max(first[3], second[3]),
    )


def _hulls(first: Values, second: Values) -> Values:
    """Boxes (P, 4) round pairs of boxes."""
    return np.hstack([np.minimum(first[:, :2], second[:, :2]), np.maximum(first[:, 2:], second[:, 2:])])
