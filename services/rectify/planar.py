"""The pose of a planar page from its two texture flows (dissertation 3.2.3, 3.2.4)."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from services.arrays import Floats, Homography
from services.geometry.camera import (
    TYPICAL_FOCAL_LENGTH,
    focal_length_from_vanishing_points,
    plane_to_image,
    rotation_from_flows,
)
from services.geometry.homographies import scaling, translation
from services.geometry.vanishing_points import VanishingPoint, estimate_vanishing_point
from services.imaging.exif import DiagonalFocalLength
from services.texture_flow.field import FlowSamples

FocalLengthSource = Literal["estimated", "exif", "given", "assumed"]


@dataclass(frozen=True, slots=True, eq=False)
class PhotoFrame:
    """The photo's own frame and the one that geometry is done in: centred, half the diagonal as unit.

    `principal_point_px` is None where it is the photo's middle.
    """

    width: int
    height: int
    principal_point_px: tuple[float, float] | None = None

    @property
    def centre(self) -> tuple[float, float]:
        """Principal point in pixels."""
        return self.principal_point_px or ((self.width - 1) / 2, (self.height - 1) / 2)

    @property
    def unit_px(self) -> float:
        """Half the diagonal in pixels."""
        return float(np.hypot(self.width, self.height)) / 2

    @property
    def H_photo_centred(self) -> Homography:
        """From centred unit coordinates to photo pixels."""
        return translation(*self.centre) @ scaling(self.unit_px)

    def to_centred(self, samples: FlowSamples) -> FlowSamples:
        """Flow samples of the photo's frame in centred unit coordinates (directions are the same)."""
        return FlowSamples((samples.points - self.centre) / self.unit_px, samples.angles, samples.weights)

    def moved(self, offset: tuple[float, float]) -> "PhotoFrame":
        """The frame whose origin lies at `offset`, in centred units of this one."""
        x, y = self.centre
        at = (x + offset[0] * self.unit_px, y + offset[1] * self.unit_px)
        return replace(self, principal_point_px=at)


@dataclass(frozen=True, slots=True)
class FocalPrior:
    """What is known of the focal length beforehand: its logarithm (unit: half diagonal) and the deviation of that."""

    log_focal: float
    deviation: float
    source: FocalLengthSource
    of_diagonal: bool = False
    """The focal length is known as a multiple of the diagonal of the photo as it was taken, before any cropping."""


GIVEN_DEVIATION = 0.003
EXIF_DEVIATION = 0.03
"""EXIF's 35 mm equivalent is rounded to whole millimetres, and the crop of video stabilisation is not told."""
TYPICAL_DEVIATION = 0.25
"""Main cameras of phones lie within one deviation (22 to 36 mm equivalent), most others within two."""


def focal_prior(frame: PhotoFrame, given_px: float | None, exif_px: float | None) -> FocalPrior:
    """The best knowledge at hand: the client's, EXIF's, or that of a typical camera."""
    if given_px is not None:
        return FocalPrior(float(np.log(given_px / frame.unit_px)), GIVEN_DEVIATION, "given")
    if exif_px is not None:
        of_diagonal = isinstance(exif_px, DiagonalFocalLength)
        return FocalPrior(float(np.log(exif_px / frame.unit_px)), EXIF_DEVIATION, "exif", of_diagonal)
    return typical_focal_prior()


def typical_focal_prior() -> FocalPrior:
    """What is known of a camera that is not known."""
    return FocalPrior(float(np.log(2 * TYPICAL_FOCAL_LENGTH)), TYPICAL_DEVIATION, "assumed", True)


@dataclass(frozen=True, slots=True, eq=False)
class PagePlane:
    """A planar page seen by a pin-hole camera, in centred unit coordinates.

    `rotation` (3, 3) has columns V_h, V_v, N in the camera frame; `focal` is the focal length over the unit.
    """

    rotation: Floats
    focal: float

    @property
    def H_centred_plane(self) -> Homography:
        """From the page plane to centred photo coordinates; the same scale at the principal point."""
        return plane_to_image(self.rotation, self.focal)


@dataclass(frozen=True, slots=True, eq=False)
class FlowVanishingPoints:
    """Vanishing points of major and minor flow (centred unit coordinates)."""

    horizontal: VanishingPoint
    vertical: VanishingPoint


def estimate_vanishing_points(major: FlowSamples, minor: FlowSamples) -> FlowVanishingPoints:
    """Both vanishing points, each from its own samples in centred unit coordinates."""
    return FlowVanishingPoints(
        estimate_vanishing_point(major.points, major.angles, major.weights),
        estimate_vanishing_point(minor.points, minor.angles, minor.weights),
    )


MAX_FOCAL, MIN_FOCAL = 12.0, 0.35
"""Bounds of a believable focal length over half the diagonal: 9 to 160 degrees of view (diagonal)."""


def estimate_plane(points: FlowVanishingPoints, prior: FocalPrior) -> PagePlane:
    """Closed-form plane of Equations 3.1 and 3.2, with every degenerate case of 3.2.3.

    When v_h . v_v >= 0 or a point is at infinity, f cannot be solved for and the prior's is taken; the rotation
    nearest to both directions is returned in all cases, so the result is always a metric rectification.
    """
    v_h, v_v = points.horizontal.direction, points.vertical.direction
    focal = float(np.exp(prior.log_focal))
    if prior.source == "assumed":
        solved = focal_length_from_vanishing_points(v_h, v_v)
        if solved is not None:
            reach = np.exp(4 * prior.deviation)
            focal = float(np.clip(solved, focal / reach, focal * reach))
    return PagePlane(rotation_from_flows(v_h, v_v, focal), focal)
