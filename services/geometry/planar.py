"""The pose of a planar page from its two vanishing points (dissertation 3.2.3, 3.2.4)."""

from dataclasses import dataclass

import numpy as np

from services.arrays import Floats, Homography
from services.geometry.camera import focal_length_from_vanishing_points, plane_to_image, rotation_from_flows
from services.geometry.focal_prior import FocalPrior
from services.geometry.vanishing_points import FlowVanishingPoints

MAX_TILT_RAD = float(np.deg2rad(65.0))
"""Tilt beyond which a plane is no page that a person photographed."""


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
