"""How much a closed curve looks like a sheet's boundary."""

from dataclasses import dataclass

import cv2
import numpy as np

from services.arrays import Floats, Points
from services.sheet.outline.corners import Corners
from services.sheet.outline.edges import EdgePoints, outward_normals, resample_closed, smooth_closed
from services.sheet.outline.reduced_photo import ReducedPhoto


@dataclass(frozen=True, slots=True)
class ScoringParameters:
    """Weights of what is seen of a curve; colours are CIE Lab's."""

    contrast: float = 8.0
    border_px: float = 2.5
    """Of the reduced photo: nearer to its border a curve is out of view."""
    out_of_view: float = 0.35
    """What a piece out of view counts for, in full edges."""
    concavity: float = 4.0
    """Weight of the share of the convex hull that the curve leaves out."""
    area: float = 0.15
    """Weight of the logarithm of the area: of two good curves the outer one is the sheet."""


def rate_curve(reduced: ReducedPhoto, curve: Points, p: ScoringParameters) -> float:
    """Rating of a curve (N, 2) on the reduced photo; curves of one photo are compared by it."""
    points = smooth_closed(resample_closed(curve, 200), 3)
    normals = outward_normals(points, 3)
    x0, y0, x1, y1 = reduced.window
    b = p.border_px
    shown = (
        (points[:, 0] > x0 + b) & (points[:, 0] < x1 - b) & (points[:, 1] > y0 + b) & (points[:, 1] < y1 - b)
    )
    inner = _ring(reduced.colors, points, normals, (-4.0, -3.0, -2.0))
    outer = _ring(reduced.colors, points, normals, (2.0, 3.0, 4.0))
    difference = np.linalg.norm(inner - outer, axis=1)
    strength = difference**2 / (difference**2 + p.contrast**2)
    edge = float(np.where(shown, strength, p.out_of_view).mean())
    flat = points.astype(np.float32)
    area = cv2.contourArea(flat)
    hull = max(cv2.contourArea(cv2.convexHull(flat)), 1e-9)
    photo = (x1 - x0) * (y1 - y0)
    return float(edge - p.concavity * (1 - area / hull) + p.area * np.log(max(area, 1.0) / photo))


def _ring(colors: Floats, points: Points, normals: Points, offsets: tuple[float, ...]) -> Floats:
    """Mean colours (N, 3) beside a curve at `offsets` along its normals."""
    at = (points[:, None] + np.array(offsets)[None, :, None] * normals[:, None]).astype(np.float32)
    found = cv2.remap(colors, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found.mean(axis=1))


def rate_outline(edge: EdgePoints, corners: Corners, located: Points, p: ScoringParameters) -> float:
    """Probability, 0-1, that an outline is the sheet's."""
    seen = float(edge.seen[edge.shown].mean()) if edge.shown.any() else 0.0
    shown = float(edge.shown.mean())
    known = float(np.isfinite(located[:, 0]).mean())
    z = 8 * (seen - 0.8) + 3 * (shown - 0.7) + 2 * (known - 0.7) - 40 * (corners.misfit - 0.04)
    return float(1 / (1 + np.exp(-z)))
