"""Planar and curved pages are told apart by whether their flows converge."""

import numpy as np
import pytest

from services.geometry.photo_frame import PhotoFrame
from services.geometry.vanishing_points import FlowVanishingPoints, VanishingPoint
from services.sheet.plane.planarity import MAJOR_LIMIT, MINOR_LIMIT, discriminate_surface
from services.texture_flow.field import FlowSamples
from services.texture_flow.vanishing_points import estimate_vanishing_points
from simulation.camera import Camera, Pose
from simulation.flat_page import Page
from simulation.scenes import CURVATURE_SERIES, PLANE, POSES, View
from simulation.surfaces import Shape
from simulation.truth import Truth
from tests.services.scenes import CURVED_SCENES, FLAT_SCENES, Album


@pytest.mark.parametrize("name", [*FLAT_SCENES, "frontal"])
def test_photos_of_flat_pages_are_planar(album: Album, name: str) -> None:
    points, text_height_px = album[name].vanishing_points, album[name].analysis.text_height_px
    assert discriminate_surface(points, text_height_px) == "planar"
    # Noise leaves some rank, so zero would be the truth itself.
    assert points.horizontal.convergence < 0.007
    assert points.vertical.convergence < 0.03


@pytest.mark.parametrize("name", CURVED_SCENES)
def test_photos_of_curved_pages_are_curved(album: Album, name: str) -> None:
    points, text_height_px = album[name].vanishing_points, album[name].analysis.text_height_px
    assert discriminate_surface(points, text_height_px) == "curved"
    assert points.horizontal.convergence > 0.02


def exact_flows(shape: Shape, view: View = POSES[0]) -> FlowVanishingPoints:
    """Vanishing points of the simulator's own flows on a grid over the page."""
    page, camera = Page(np.full((1250, 800), 255, np.uint8)), view.camera(1050, 1350)
    truth = Truth(page, shape, 0.0, view.pose(page, shape, camera), camera)
    x, y = np.meshgrid(np.linspace(80, 720, 15), np.linspace(100, 1150, 20))
    points = truth.page_to_photo(np.stack([x.ravel(), y.ravel()], axis=1))
    frame = PhotoFrame(1050, 1350)
    weights = np.ones(len(points))
    return estimate_vanishing_points(
        FlowSamples(points, truth.major_flow(points), weights).centred(frame),
        FlowSamples(points, truth.minor_flow(points), weights).centred(frame),
    )


@pytest.mark.parametrize("view", POSES, ids=lambda view: f"pose{view.name}")
def test_exact_flows_of_a_plane_have_no_rank_left(view: View) -> None:
    points = exact_flows(PLANE, view)
    assert points.horizontal.convergence < 1e-6
    assert points.vertical.convergence < 1e-6
    assert discriminate_surface(points, 22.0) == "planar"


def test_convergence_worsens_with_curvature() -> None:
    series = [exact_flows(shape).horizontal.convergence for shape in CURVATURE_SERIES]
    assert (np.diff(series) > 0).all()
    assert series[0] > MAJOR_LIMIT
    # The page bends round its own vertical: strokes stay parallel to the rulings.
    assert exact_flows(CURVATURE_SERIES[3]).vertical.convergence < 1e-6


@pytest.mark.parametrize(
    ("major", "minor", "kind"),
    [(0.0, 0.0, "planar"), (0.009, 0.039, "planar"), (0.011, 0.0, "curved"), (0.0, 0.041, "curved")],
)
def test_either_flow_of_full_rank_tells_a_curved_page(major: float, minor: float, kind: str) -> None:
    horizontal, vertical = (
        VanishingPoint(np.array([1.0, 0, 0]), value, 0.0, np.ones(3, bool)) for value in (major, minor)
    )
    assert discriminate_surface(FlowVanishingPoints(horizontal, vertical), 22.0) == kind
    assert MAJOR_LIMIT < MINOR_LIMIT  # "a tighter threshold"


def test_small_print_may_have_rougher_strokes_but_no_rougher_lines() -> None:
    def kinds(major: float, minor: float) -> list[str]:
        both = (
            VanishingPoint(np.array([1.0, 0, 0]), value, 0.0, np.ones(3, bool)) for value in (major, minor)
        )
        points = FlowVanishingPoints(*both)
        return [discriminate_surface(points, height) for height in (40.0, 22.0, 11.0)]

    assert kinds(0.0, 0.1) == ["curved", "curved", "planar"]
    assert kinds(0.0, 0.17) == ["curved"] * 3
    assert kinds(0.011, 0.0) == ["curved"] * 3


def test_a_curved_page_looked_at_along_its_rulings() -> None:
    # From afar and straight on, parallel lines of a cylinder still bend: the limit holds for a long lens.
    page, camera = Page(np.full((1250, 800), 255, np.uint8)), Camera(20000.0, 1050, 1350)
    truth = Truth(page, CURVATURE_SERIES[2], 0.0, Pose(0.5, 1.57, 0.0, (0.0, 0.0, 50.0)), camera)
    x, y = np.meshgrid(np.linspace(80, 720, 15), np.linspace(100, 1150, 20))
    points = truth.page_to_photo(np.stack([x.ravel(), y.ravel()], axis=1))
    frame = PhotoFrame(1050, 1350)
    samples = [FlowSamples(points, f(points), np.ones(300)) for f in (truth.major_flow, truth.minor_flow)]
    found = estimate_vanishing_points(*(flow.centred(frame) for flow in samples))
    assert discriminate_surface(found, 22.0) == "curved"
