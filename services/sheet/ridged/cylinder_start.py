"""A sheet that is bent one way, between its four sides: a cylinder in closed form.

Two opposite sides are straight: they are rulings, and meet in the rulings' vanishing point. A half plane through the
camera and along the rulings cuts the sheet in one of them. The angle between this ruling's two ends shows how far away
it is, because all rulings are equally long; so the half planes' angles and these distances are polar coordinates of the
sheet's cross-section, whose length is the sheet's width.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from services.arrays import Floats, Points, Vector
from services.geometry.homographies import transform_points
from services.sheet.ridged.mesh import LEAST_ROWS, SheetMesh
from services.sheet.ridged.start import MOST_ROWS, measure_bow

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


# When two sides are rulings, and how the curves and the focal length are found.
STRAIGHTER = 0.4
"""Of the bow of the bent sides: the largest one of straight sides."""
ORDER = 4
"""Of the polynomial that is a side's bow over t (1 - t)."""
RIDGE = 1e-3
SAMPLES = 121
"""Rulings."""
EVEN = 0.003
"""Deviation of a bent side from a plane at right angles to the rulings, over their length."""
FOCAL_STEPS = 25
FOCAL_REACH = 2.0
"""Of the prior's deviations, and at most a factor of e^0.5: range of focal lengths that are tried."""


@dataclass(frozen=True, slots=True, eq=False)
class _Section:
    """Of rulings (N,): places across them (N, 2), and the height of the first ends; all in lengths of a ruling.

    `across` (2, 3) and `along` (3,) are unit vectors of the camera frame.
    """

    places: Points
    heights: Vector
    across: Floats
    along: Vector

    @property
    def unevenness(self) -> float:
        """RMS distance of the first ends from a plane at right angles to the rulings."""
        return float(self.heights.std())


def cylinder_between_sides(
    corners: Points,
    sides: tuple[Points, ...],
    log_focal: float,
    log_focal_deviation: float,
    cells: int,
) -> SheetMesh | None:
    """Mesh of `cells` columns and about as square cells of a sheet that is bent one way; None where it is not.

    `corners` (4, 2), centred, are clockwise from the page's top left, `sides` the points (N, 2) of top, right, bottom
    and left. The focal length is that near the prior one at which the bent sides lie across the rulings.
    """
    H = cv2.getPerspectiveTransform(SQUARE.astype(np.float32), corners.astype(np.float32)).astype(np.float64)
    if (SQUARE @ H[2, :2] + H[2, 2] <= 0).any() or np.linalg.det(H[:, :2][:2]) <= 0:
        return None
    back = np.linalg.inv(H)
    bows = [_smooth(*measure_bow(back, side, k)) for k, side in enumerate(sides)]
    sizes = [float(np.sqrt(np.mean(bow**2))) for bow in bows]
    down, across = max(sizes[1], sizes[3]), max(sizes[0], sizes[2])
    lengthwise = down > across
    if min(down, across) > STRAIGHTER * max(down, across):
        return None
    t = np.linspace(0, 1, SAMPLES)
    if lengthwise:  # the rulings run along the text: from the left side to the right one
        ends = np.column_stack([bows[3], t]), np.column_stack([1 + bows[1], t])
    else:
        ends = np.column_stack([t, bows[0]]), np.column_stack([t, 1 + bows[2]])
    first, second = (transform_points(H, end) for end in ends)
    reach = min(FOCAL_REACH * log_focal_deviation, 0.5)
    best, focal, least = None, 1.0, np.inf
    for tried in log_focal + reach * np.linspace(-1, 1, FOCAL_STEPS):
        section = _section(first / np.exp(tried), second / np.exp(tried))
        if section is not None:
            cost = (section.unevenness / EVEN) ** 2 + ((tried - log_focal) / log_focal_deviation) ** 2
            if cost < least:
                best, focal, least = section, float(np.exp(tried)), cost
    return None if best is None else _mesh(best, focal, cells, lengthwise=lengthwise)


def _smooth(places: Vector, bow: Vector) -> Vector:
    """The bow of a side at evenly spaced places (N,), a polynomial that is zero at the corners."""

    def terms(t: Vector) -> Floats:
        return (t * (1 - t))[:, None] * np.polynomial.chebyshev.chebvander(2 * t - 1, ORDER)

    A = terms(places)
    weights = np.linalg.solve(A.T @ A + RIDGE * np.eye(A.shape[1]), A.T @ bow)
    return np.asarray(terms(np.linspace(0, 1, SAMPLES)) @ weights)


def _section(first: Points, second: Points) -> _Section | None:
    """Cross-section of the sheet between the ends (N, 2) of its rulings, in coordinates over the focal length.

    The ends that belong together are found here; the first and the last ones do. None where no camera sees that.
    """
    ones = np.ones((len(first), 1))
    top, foot = np.hstack([first, ones]), np.hstack([second, ones])
    along = np.cross(np.cross(top[0], foot[0]), np.cross(top[-1], foot[-1]))
    size = float(np.linalg.norm(along))
    if size < 1e-9:
        return None
    along = along / size
    along = along if (foot - top).sum(axis=0) @ along > 0 else -along
    middle = top[len(top) // 2]
    x = middle - (middle @ along) * along
    x = x / np.linalg.norm(x)
    across = np.stack([x, np.cross(along, x)])
    slopes, angles = [], []
    for ends in (top, foot):
        u, v = across @ ends.T
        angles.append(np.unwrap(np.arctan2(v, u)))
        slopes.append(ends @ along / np.hypot(u, v))
    turn = np.sign(angles[0][-1] - angles[0][0])
    if any((np.diff(turn * each) <= 0).any() for each in angles):
        return None
    angle = np.linspace(angles[0][0], angles[0][-1], SAMPLES)
    before, after = (
        np.interp(turn * angle, turn * each, slope) for each, slope in zip(angles, slopes, strict=True)
    )
    if (after - before <= 1e-6).any():
        return None
    distance = 1 / (after - before)
    places = np.column_stack([distance * np.cos(angle), distance * np.sin(angle)])
    return _Section(places, distance * before, across, along)


def _mesh(section: _Section, focal: float, cells: int, *, lengthwise: bool) -> SheetMesh | None:
    """The sheet with evenly spaced nodes."""
    steps = np.linalg.norm(np.diff(section.places, axis=0), axis=1)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    ratio = float(length[-1]) if lengthwise else 1 / float(length[-1])
    if not 0.05 < ratio < 20:
        return None
    rows = int(np.clip(round(ratio * cells), LEAST_ROWS - 1, MOST_ROWS - 1)) + 1
    bent, straight = (rows, cells + 1) if lengthwise else (cells + 1, rows)
    at = np.linspace(0, length[-1], bent)
    x, y, z = (np.interp(at, length, values) for values in (*section.places.T, section.heights))
    heights = z[:, None] + np.linspace(0, 1, straight)
    nodes = np.column_stack([x, y])[:, None] @ section.across + heights[..., None] * section.along
    if (nodes[..., 2] <= 1e-6).any():
        return None
    if not lengthwise:
        nodes = nodes.transpose(1, 0, 2)
    # Page units: those of the photo at the sheet's middle, where f / Z is one.
    unit = focal / float(np.median(nodes[..., 2]))
    width = unit * (1.0 if lengthwise else float(length[-1]))
    height = unit * (float(length[-1]) if lengthwise else 1.0)
    step = width / cells
    return SheetMesh(nodes * unit, focal, step, height / (rows - 1) / step, (0.0, 0.0))
