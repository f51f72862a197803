"""Rating of closed curves as boundaries of a sheet."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Points
from services.imaging.node_grid import take_values
from services.sheet.outline.corners import split_sides
from services.sheet.outline.edges import EdgePoints, outward_normals, resample_closed, smooth_closed
from services.sheet.outline.reduced_photo import ReducedPhoto

UNSEEN_CORNERS = 0.5
"""Share of known corners where none is in view."""


# Weights of the evidence for a curve; colours are CIE Lab.
BORDER_PX = 2.5
"""Of the reduced photo: nearer to its border a curve is out of view."""
OUT_OF_VIEW = 0.35
"""Score of a piece out of view, in full edges."""
CONCAVITY = 4.0
"""Weight of the share of the convex hull that the curve leaves out."""
EVIDENCE = (8.7, 3.2, 3.8, 8.1)
"""Weights of `outline_features`: logistic regression on outlines of 54 real and 36 simulated photos, with and
without characters; of those above 0.95, 99 % were right, of 0.5-0.8 58 %, below 0.2 none."""
PRIOR = -17.2
CREASED = 0.03
"""Of the hull's area: what creased sheets leave out."""
LASTING = 9
"""An edge keeps its contrast over this many of 200 points."""
MISFIT = 5.0
"""Weight of the distance from four smooth sides, beyond ..."""
CREASE_MISFIT = 0.01
"""... what creases make of it."""
MOST_MISFIT = 0.06
FALSE_PRINT = 0.1
"""Share of the characters outside that may be texture of a desk; what lies outside beyond it counts."""
AREA = 0.35
"""Weight of the logarithm of the area: of two good curves the outer one is the sheet."""


def rate_curve(
    reduced: ReducedPhoto,
    characters: Points,
    curve: Points,
    least_share: float = 0.0,
    *,
    of_view: bool = False,
) -> float:
    """Rating of a curve (N, 2) on the reduced photo; curves of one photo are compared by it.

    `characters` (N, 2) are the sheet's, on the reduced photo. A curve is rated as if it held `least_share` of the photo
    at least; what is out of view says nothing if its edge is that `of_view`.
    """
    points = smooth_closed(resample_closed(curve, 200), 3)
    normals = outward_normals(points, 3)
    x0, y0, x1, y1 = reduced.window
    b = BORDER_PX
    shown = (
        (points[:, 0] > x0 + b) & (points[:, 0] < x1 - b) & (points[:, 1] > y0 + b) & (points[:, 1] < y1 - b)
    )
    inner = _ring(reduced.colors, points, normals, (-4.0, -3.0, -2.0))
    outer = _ring(reduced.colors, points, normals, (2.0, 3.0, 4.0))
    # The step has a direction in colour space that lasts along an edge; in a texture it changes.
    difference = np.linalg.norm(smooth_closed(inner - outer, LASTING), axis=1)
    strength = difference**2 / (difference**2 + reduced.contrast**2)
    rating = float(strength[shown].mean()) if of_view and shown.any() else None
    if rating is None:
        rating = float(np.where(shown, strength, OUT_OF_VIEW).mean())
    corners = split_sides(points, shown)
    misfit = MOST_MISFIT if corners is None else min(corners.misfit, MOST_MISFIT)
    rating -= MISFIT * max(misfit - CREASE_MISFIT, 0.0)
    flat = points.astype(np.float32)
    area = float(cv2.contourArea(flat))
    hull = max(float(cv2.contourArea(cv2.convexHull(flat))), 1e-9)
    rating -= CONCAVITY * max(1 - area / hull - CREASED, 0.0)
    whole = float((x1 - x0) * (y1 - y0))
    rating += AREA * float(np.log(max(area, least_share * whole, 1.0) / whole))
    if len(characters):
        some = characters[:: max(len(characters) // 100, 1)]
        lost = 1.0 - float(_inside(points, some).mean())
        rating -= max(lost - FALSE_PRINT, 0.0)
    return rating


def _inside(polygon: Points, points: Points) -> NDArray[np.bool_]:
    """Which `points` (N, 2) lie within `polygon` (M, 2): rays to the right cross its edges an odd number of times."""
    x, y = points[:, :1], points[:, 1:]
    ahead = np.roll(polygon, -1, axis=0)
    spans = (polygon[:, 1] > y) != (ahead[:, 1] > y)
    rise = np.where(ahead[:, 1] == polygon[:, 1], 1.0, ahead[:, 1] - polygon[:, 1])
    crossing = polygon[:, 0] + (y - polygon[:, 1]) * (ahead[:, 0] - polygon[:, 0]) / rise
    return np.asarray((spans & (crossing > x)).sum(axis=1) % 2 == 1)


def _ring(colors: Floats, points: Points, normals: Points, offsets: tuple[float, ...]) -> Floats:
    """Mean colours (N, 3) next to a curve at `offsets` along its normals."""
    at = (points[:, None] + np.array(offsets)[None, :, None] * normals[:, None]).astype(np.float32)
    found = take_values(colors, at, cv2.INTER_LINEAR, cv2.BORDER_REPLICATE)
    return np.asarray(found.mean(axis=1))


def outline_features(
    sides: Sequence[EdgePoints],
    located: Points,
    rating: float,
    *,
    of_view: bool = False,
    goes_on: bool = False,
) -> Floats:
    """Features (4,) that separate right outlines from wrong ones.

    Shares of what is in view on which an edge is seen, on all sides and on the worst one; the share of corners that
    are known, `of_view` of those in view; the candidate's rating. Of a sheet that `goes_on` beyond the photo at two
    opposite sides no corner is in view: that is half of the evidence.
    """
    shown = np.concatenate([side.shown for side in sides])
    seen = np.concatenate([side.seen for side in sides])
    # A side that is mostly out of view says nothing by its ends, nor by its corners.
    in_view = np.array([side.shown.mean() > 0.5 for side in sides])
    worst = [float(side.seen[side.shown].mean()) for side, k in zip(sides, in_view, strict=True) if k]
    seen_of_shown = float(seen[shown].mean()) if shown.any() else 0.0
    known = np.isfinite(located[:, 0])
    count = int((known | (in_view & np.roll(in_view, 1))).sum()) if of_view else 4
    corners = int(known.sum()) / max(count, 1) if count or not goes_on else UNSEEN_CORNERS
    return np.array([seen_of_shown, min(worst, default=0.0), corners, rating])


def rate_outline(
    sides: Sequence[EdgePoints],
    located: Points,
    rating: float,
    *,
    of_view: bool = False,
    goes_on: bool = False,
) -> float:
    """Probability, 0-1, that an outline is the sheet's; `rating` is its candidate's.

    Of two outlines the better one has more corners. Whether it is right, the corners `of_view` tell.
    """
    z = (
        float(np.dot(EVIDENCE, outline_features(sides, located, rating, of_view=of_view, goes_on=goes_on)))
        + PRIOR
    )
    return float(1 / (1 + np.exp(-z)))
