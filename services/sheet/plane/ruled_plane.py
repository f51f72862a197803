"""The plane of a page without text from its straight print: rules, frames, staves, the lines of tables and grids."""

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, GrayImage, Points, Vector
from services.geometry.focal_prior import FocalPrior
from services.geometry.homographies import from_resized
from services.geometry.photo_frame import PhotoFrame
from services.geometry.vanishing_points import estimate_vanishing_point
from services.imaging.reduction import PRINT_PX, reduce_image
from services.sheet.plane.outline_plane import OutlinePlane, plane_from_lines
from services.sheet.plane.straight_lines import StraightLines
from services.sheet.shape import NoShape

# When straight print is clear enough to show a plane. Lengths are shares of the photo's half diagonal.
MIN_LENGTH = 0.06
"""Shorter segments are strokes of drawings and letters."""
KERNEL_RAD = float(np.deg2rad(3.0))
NEAR_RAD = float(np.deg2rad(20.0))
"""Lines of one family differ by less, at usual tilts."""
LEAST_CROSSING_RAD = float(np.deg2rad(50.0))
"""Two directions at right angles cross at more in a photo that is not taken from very low."""
END_PX = 0.7
"""Deviation of a segment's ends across it."""
FLOOR_RAD = float(np.deg2rad(0.3))
OVERLAP = 6.0
"""A rule has two edges and comes in pieces, which share its error: this many segments count as one."""
MIN_LINES = 4
"""In each of both families."""
MIN_TOTAL = 1.0
MIN_SPREAD = 0.4
"""A family that is spread less across its lines does not show where they converge."""
MIN_SHARE = 0.6
"""Of the length of all segments, that of both families: a drawing has lines of every direction."""
MAX_RESIDUAL_RAD = float(np.deg2rad(0.6))


def plane_from_rules(gray: GrayImage, view: PhotoFrame, prior: FocalPrior) -> OutlinePlane | NoShape:
    """The plane on which the two dominant families of straight lines in `gray` (H, W) are at right angles.

    The photo `gray` has the size of `view`. Its axes are those that are nearest to the photo's.
    """
    starts, ends = find_segments(gray, view)
    angles = np.arctan2(*(ends - starts).T[::-1])
    lengths = np.linalg.norm(ends - starts, axis=1)
    families = _families(angles, lengths)
    if families is None:
        return NoShape("its straight lines do not run along two directions")
    kept = np.zeros(len(lengths), bool)
    for family in families:
        meeting = estimate_vanishing_point(
            0.5 * (starts + ends)[family], angles[family], lengths[family], floor_rad=FLOOR_RAD
        )
        inliers = family[meeting.inliers]
        reach = _spread(starts[inliers], ends[inliers])
        if (
            len(inliers) < MIN_LINES
            or lengths[inliers].sum() < MIN_TOTAL
            or reach < MIN_SPREAD
            or meeting.residual_rad > MAX_RESIDUAL_RAD
        ):
            return NoShape("too few straight lines run along two directions")
        kept[inliers] = True
    if lengths[kept].sum() < MIN_SHARE * lengths.sum():
        return NoShape("its straight lines run along many directions")
    upright = np.zeros(len(lengths), bool)
    upright[families[1]] = True
    deviations = np.hypot(END_PX / view.unit_px, FLOOR_RAD * lengths / np.sqrt(2)) * np.sqrt(OVERLAP)
    return plane_from_lines(StraightLines(starts[kept], ends[kept], deviations[kept], upright[kept]), prior)


def find_segments(gray: GrayImage, view: PhotoFrame) -> tuple[Points, Points]:
    """Both ends (N, 2) of straight segments (von Gioi et al. 2010, "LSD"), in centred unit coordinates."""
    factor = min(1.0, PRINT_PX / max(gray.shape))
    found = cv2.createLineSegmentDetector().detect(reduce_image(gray, factor))[0]
    if found is None:
        return np.zeros((0, 2)), np.zeros((0, 2))
    both = from_resized(np.asarray(found, np.float64).reshape(-1, 2, 2), factor)
    both = view.to_centred(both)
    long = np.linalg.norm(both[:, 1] - both[:, 0], axis=1) >= MIN_LENGTH
    # The border of the photo is not print.
    rim = np.array([view.width, view.height]) / 2 / view.unit_px - 3 / factor / view.unit_px
    inside = (np.abs(both.mean(axis=1)) < rim).all(axis=1)
    return both[long & inside, 0], both[long & inside, 1]


def _families(angles: Vector, lengths: Vector) -> tuple[NDArray[np.intp], NDArray[np.intp]] | None:
    """Rows of the segments that run along the two commonest directions; the more level family first."""
    if len(angles) < 2 * MIN_LINES:
        return None
    first = _mode(angles, lengths)
    away = np.abs(_difference(angles, first))
    across = away > LEAST_CROSSING_RAD
    if not across.any():
        return None
    second = _mode(angles[across], lengths[across])
    near_first, near_second = (np.abs(_difference(angles, mode)) for mode in (first, second))
    one = np.flatnonzero((near_first < NEAR_RAD) & (near_first < near_second))
    other = np.flatnonzero((near_second < NEAR_RAD) & (near_second < near_first))
    if len(one) < MIN_LINES or len(other) < MIN_LINES:
        return None
    return (one, other) if abs(np.cos(first)) > abs(np.cos(second)) else (other, one)


def _mode(angles: Vector, lengths: Vector) -> float:
    density = np.exp(-0.5 * (_difference(angles[:, None], angles[None]) / KERNEL_RAD) ** 2) @ lengths
    return float(angles[int(np.argmax(density))])


def _difference(angles: Vector, reference: Floats | float) -> Vector:
    """Difference of directions modulo pi, in [-pi/2, pi/2)."""
    return np.asarray((angles - reference + np.pi / 2) % np.pi - np.pi / 2)


def _spread(starts: Points, ends: Points) -> float:
    """Distance, across their mean direction, between the outermost of the lines."""
    if len(starts) == 0:
        return 0.0
    way = ends - starts
    doubled = np.sum((way[:, 0] + 1j * way[:, 1]) ** 2)
    direction = 0.5 * np.angle(doubled)
    across = 0.5 * (starts + ends) @ np.array([-np.sin(direction), np.cos(direction)])
    return float(np.ptp(across))
