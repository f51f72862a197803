"""Vanishing points of both texture flows (dissertation 3.2.2)."""

from services.geometry.vanishing_points import FlowVanishingPoints, estimate_vanishing_point
from services.texture_flow.field import FlowSamples


def estimate_vanishing_points(major: FlowSamples, minor: FlowSamples) -> FlowVanishingPoints:
    """Both vanishing points, each from its own samples in centred unit coordinates."""
    return FlowVanishingPoints(
        estimate_vanishing_point(major.points, major.angles, major.weights),
        estimate_vanishing_point(minor.points, minor.angles, minor.weights),
    )
