"""Samples of an orientation field, and the dense field between them."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Points, Vector
from services.geometry.photo_frame import PhotoFrame
from services.texture_flow.tabulated import TabulatedValues


def angle_difference(a: Vector, b: Vector | float) -> Vector:
    """Signed difference a - b of two directions modulo pi, in [-pi/2, pi/2)."""
    difference = np.asarray(a - b, np.float64)
    # Ten times as fast as the remainder of a division.
    return np.asarray(difference - np.pi * np.floor(difference / np.pi + 0.5))


@dataclass(frozen=True, slots=True, eq=False)
class FlowSamples:
    """Directions measured at points: `points` (N, 2) px, `angles` (N,) rad modulo pi, `weights` (N,) 0-1."""

    points: Points
    angles: Vector
    weights: Vector

    def __len__(self) -> int:
        return len(self.angles)

    def select(self, chosen: NDArray[np.bool_]) -> "FlowSamples":
        """The samples where `chosen` (N,) is true."""
        return FlowSamples(self.points[chosen], self.angles[chosen], self.weights[chosen])

    def centred(self, frame: PhotoFrame) -> "FlowSamples":
        """Samples in photo pixels as samples in the centred unit coordinates of `frame` (directions are the same)."""
        return FlowSamples(frame.to_centred(self.points), self.angles, self.weights)


def mean_deviation(J: Floats, samples: FlowSamples, axis: float) -> float:
    """Mean angle (rad) between `samples`, mapped by `J` (N, 2, 2), and `axis`, the worst tenth left out."""
    tangent = np.stack([np.cos(samples.angles), np.sin(samples.angles)], axis=1)
    t = np.einsum("nij,nj->ni", J, tangent)
    deviation = np.abs(angle_difference(np.arctan2(t[:, 1], t[:, 0]), axis))
    return float(np.mean(np.sort(deviation)[: max(int(0.9 * len(deviation)), 1)]))


@dataclass(frozen=True, slots=True, eq=False)
class FlowField:
    """Dense orientation field on a regular grid, extrapolated to every pixel.

    `doubled` (rows, columns, 2) holds (cos 2a, sin 2a); node (r, c) lies at `origin` + `spacing_px` (c, r).
    """

    """The field in the frame of the image enlarged by `factor` (for pixel centres see the conventions)."""
    doubled: Floats
    origin: tuple[float, float]
    spacing_px: float

    def at(self, points: Points) -> Vector:
        """Direction at `points` (N, 2), rad in [-pi/2, pi/2), bilinear between nodes, constant beyond them."""
        return _halved_angle(self._table.at(points, border=cv2.BORDER_REPLICATE))

    def at_pixels(self, pixels: NDArray[np.integer[Any]]) -> Vector:
        """As `at` the points whose x and y are the whole numbers `pixels` (2, N), not negative; faster for many."""
        return _halved_angle(self._table.at_pixels(pixels, border=cv2.BORDER_REPLICATE))

    @property
    def _table(self) -> TabulatedValues:
        return TabulatedValues(self.doubled, self.origin, self.spacing_px)


def _halved_angle(doubled: Floats) -> Vector:
    """Directions (N,) of the doubled angles' (cos, sin) (N, 2)."""
    return np.asarray(0.5 * np.arctan2(doubled[:, 1], doubled[:, 0]))


def move_field(field: FlowField, by: tuple[float, float]) -> FlowField:
    """The same field in a frame whose pixels lie `by` (x, y) further."""
    return FlowField(field.doubled, (field.origin[0] + by[0], field.origin[1] + by[1]), field.spacing_px)


def resize_field(field: FlowField, factor: float) -> FlowField:
    """The same field in the frame of the image enlarged by `factor` (see conventions: pixel centres)."""
    shift = 0.5 * factor - 0.5
    origin = (field.origin[0] * factor + shift, field.origin[1] * factor + shift)
    return FlowField(field.doubled, origin, field.spacing_px * factor)
