"""Minor flow: exact curve peaks, drawn edges, and simulated photos against the simulator's strokes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.arrays import GrayImage, Mask
from services.texture_flow import minor
from services.texture_flow.field import FlowField, FlowSamples, angle_difference
from services.texture_flow.minor import (
    MinorFlow,
    MinorFlowParameters,
    StrokeEdges,
    detect_edges,
    edges_of_strokes,
    estimate_minor_flow,
    fit_curve_peaks,
    strength_curves,
)
from services.texture_flow.regression import smooth_samples
from services.texture_flow.text_identification import identify_text
from simulation.flat_page import Page
from tests.services.scenes import CURVED_SCENES, FLAT_SCENES, Album, errors_deg


def level_field(angle_rad: float = 0.0, size: float = 2000.0) -> FlowField:
    """Major flow of one direction everywhere."""
    doubled = np.tile([np.cos(2 * angle_rad), np.sin(2 * angle_rad)], (3, 3, 1))
    return FlowField(doubled, (0.0, 0.0), size / 2)


@pytest.mark.parametrize("name", FLAT_SCENES)
def test_flow_of_flat_pages(album: Album, name: str) -> None:
    shot = album[name]
    minor = shot.analysis.minor
    assert minor is not None
    signed = np.degrees(angle_difference(minor.angles, shot.truth.minor_flow(minor.points)))
    errors = np.abs(signed)
    # A result without any error would have seen the truth. The dissertation's Table 2.1 says 0.90.
    assert errors.mean() < 0.6
    assert np.median(errors) < 0.4
    assert abs(signed.mean()) < 0.5
    field = shot.analysis.minor_field
    assert field is not None
    field_errors = errors_deg(field.at(shot.text_points), shot.truth.minor_flow(shot.text_points))
    assert np.median(field_errors) < 0.8
    assert field_errors.mean() < 1.2


@pytest.mark.parametrize("name", CURVED_SCENES)
def test_flow_of_curved_pages(album: Album, name: str) -> None:
    shot = album[name]
    minor = shot.analysis.minor
    assert minor is not None
    errors = errors_deg(minor.angles, shot.truth.minor_flow(minor.points))
    assert np.median(errors) < 0.4
    assert errors.mean() < 0.7


def stroke_edges(gray: GrayImage, area: Mask, parameters: MinorFlowParameters | None = None) -> StrokeEdges:
    return edges_of_strokes(detect_edges(gray, area, parameters), level_field())


def minor_flow(gray: GrayImage, area: Mask, text_height_px: float, major: FlowField) -> MinorFlow | None:
    height, width = gray.shape
    return estimate_minor_flow(detect_edges(gray, area), (height, width), text_height_px, major)


@pytest.mark.parametrize("turns", [1, 3])
def test_a_turned_page_has_turned_strokes(pages: tuple[Page, ...], turns: int) -> None:
    gray = pages[1].image
    found = []
    for k in (0, turns):
        turned = np.ascontiguousarray(np.rot90(gray, k))
        text = identify_text(turned)
        flow = minor_flow(turned, text.area, text.text_height_px, level_field(k * np.pi / 2))
        assert flow is not None
        strokes = np.pi / 2 * (1 - k)
        found.append(np.degrees(angle_difference(flow.samples.angles, strokes)))
    assert np.median(np.abs(found[1])) < 0.3
    assert abs(np.median(found[0]) - np.median(found[1])) < 0.06


def test_strokes_of_a_straight_page_are_upright(pages: tuple[Page, ...]) -> None:
    for page in pages:
        text = identify_text(page.image)
        flow = minor_flow(page.image, text.area, text.text_height_px, level_field())
        assert flow is not None
        lean = np.degrees(angle_difference(flow.samples.angles, np.pi / 2))
        assert np.abs(lean).mean() < 0.3, page.name
        assert np.abs(lean).max() < 1.5, page.name


def draw_bars(angle_rad: float, shape: tuple[int, int] = (300, 300)) -> np.ndarray:
    """Parallel bars 6 px wide in the direction `angle_rad`, with edges of one pixel's area."""
    y, x = np.mgrid[0 : shape[0], 0 : shape[1]].astype(float)
    across = np.cos(angle_rad) * (y - 150) - np.sin(angle_rad) * (x - 150)
    from_bar = np.abs((across / 20 + 0.5) % 1 - 0.5) * 20
    return (255 * np.clip(from_bar - 3 + 0.5, 0, 1)).astype(np.uint8)


@pytest.mark.parametrize("angle_deg", [90.0, 88.0, 93.7, 75.0, 105.0, 120.0, 61.0])
def test_edges_tell_their_direction(angle_deg: float) -> None:
    gray = draw_bars(np.radians(angle_deg))
    area = np.zeros(gray.shape, bool)
    area[20:-20, 20:-20] = True
    edges = stroke_edges(gray, area)
    assert len(edges.points) > 2000
    assert area[edges.points[:, 1].astype(int), edges.points[:, 0].astype(int)].all()
    signed = np.degrees(angle_difference(edges.angles, np.radians(angle_deg)))
    # Pixels differ by their place on the edge's stairs; together they know the direction.
    assert np.average(np.abs(signed), weights=edges.strengths) < 1.0
    assert abs(np.average(signed, weights=edges.strengths)) < 0.05


def test_strokes_along_the_lines_are_removed() -> None:
    area = np.zeros((300, 300), bool)
    area[20:-20, 20:-20] = True
    for angle_deg in (0.0, 20.0, 37.0):
        edges = stroke_edges(draw_bars(np.radians(angle_deg)), area)
        assert len(edges.points) == 0, angle_deg
    for angle_deg in (43.0, 90.0, 137.0):
        edges = stroke_edges(draw_bars(np.radians(angle_deg)), area)
        assert len(edges.points) > 2000, angle_deg


@pytest.mark.parametrize("offset", range(1, 16, 3))
def test_strengths_do_not_depend_on_where_arrays_lie_in_memory(offset: int) -> None:
    gradients = np.random.default_rng(0).normal(0, 20, (2, 1001)).astype(np.float32)
    gradients[:, ::7] = 0.0
    memory = np.empty((2, 1040), np.float32)
    moved = memory[:, offset : offset + 1001]
    moved[:] = gradients
    found = minor._lengths(*moved)
    assert np.array_equal(found, minor._lengths(*gradients))
    assert np.allclose(found, np.hypot(*gradients.astype(np.float64)), rtol=2e-7, atol=0)


def test_many_edges_are_thinned_out_evenly() -> None:
    area = np.ones((300, 300), bool)
    few = MinorFlowParameters(max_edges=500)
    edges = stroke_edges(draw_bars(np.pi / 2), area, few)
    assert 200 < len(edges.points) <= 500
    quarters = np.histogram(edges.points[:, 1], 4, (0, 300))[0]
    assert quarters.min() > 0.6 * quarters.max()


@given(st.floats(-4.0, 4.0), st.floats(0.2, 5.0), st.floats(-0.02, 0.02), st.floats(-3, 3))
def test_peaks_of_cubics_are_exact(peak: float, bend: float, skew: float, level: float) -> None:
    directions = np.arange(-12.0, 12.01, 0.25)
    t = directions - peak
    cubic = level - bend * t**2 * (1 + skew * t)
    found = fit_curve_peaks(cubic[None], directions, 2.5)
    assert found[0] == pytest.approx(peak, abs=1e-6)


@pytest.mark.parametrize("centre", [-1.5, -1.0, -0.95, 0.0, 0.95, 1.0, 1.5])
def test_peaks_at_the_ends_stay_in_the_range(centre: float) -> None:
    directions = np.linspace(-1, 1, 41)
    found = fit_curve_peaks(np.exp(-0.5 * ((directions - centre) / 0.4) ** 2)[None], directions, 0.3)
    assert found[0] == pytest.approx(np.clip(centre, -1, 1), abs=0.06)
    assert abs(found[0]) <= 1.0 + 1e-9


def test_flat_curves_have_some_finite_peak() -> None:
    found = fit_curve_peaks(np.zeros((3, 41)), np.linspace(-1, 1, 41), 0.3)
    assert (np.abs(found) <= 1.0 + 1e-9).all()


def test_noise_moves_the_peak_only_a_little() -> None:
    rng = np.random.default_rng(0)
    directions = np.arange(-12.0, 12.01, 0.25)
    curves = np.exp(-0.5 * ((directions - 1.37) / 2.0) ** 2) + rng.normal(0, 0.01, (200, len(directions)))
    found = fit_curve_peaks(curves, directions, 2.5)
    assert found.std() < 0.15
    assert abs(found.mean() - 1.37) < 0.02


def test_curves_are_weighted_histograms() -> None:
    rng = np.random.default_rng(1)
    blocks, deviations, strengths = rng.integers(0, 4, 500), rng.uniform(-0.4, 0.4, 500), rng.random(500)
    curves, directions = strength_curves(blocks, 5, deviations, strengths, 0.3, 0.05)
    assert curves.shape == (5, 12)
    assert np.allclose(np.diff(directions), 0.05)
    assert directions.sum() == pytest.approx(0.0, abs=1e-12)
    for b in range(5):
        mine = blocks == b
        slow, _ = np.histogram(deviations[mine], 12, (-0.3, 0.3), weights=strengths[mine])
        assert np.allclose(curves[b], slow)


@pytest.mark.parametrize("shape", [(1, 1), (3, 3), (20, 20), (200, 150)])
@pytest.mark.parametrize("value", [0, 128, 255])
def test_no_strokes_no_flow(shape: tuple[int, int], value: int) -> None:
    gray = np.full(shape, value, np.uint8)
    for area in (np.ones(shape, bool), np.zeros(shape, bool)):
        assert minor_flow(gray, area, 10.0, level_field()) is None


def test_horizontal_rules_alone_have_no_minor_flow() -> None:
    gray = draw_bars(0.0)
    assert minor_flow(gray, np.ones(gray.shape, bool), 10.0, level_field()) is None


def test_major_field_may_bend() -> None:
    # Strokes stay upright where the lines fan out by 20 degrees to either side.
    gray = draw_bars(np.pi / 2)
    points = np.stack(np.meshgrid(np.arange(0, 300, 30.0), np.arange(0, 300, 30.0)), axis=-1).reshape(-1, 2)
    fan = FlowSamples(points, np.radians(20) * (points[:, 0] - 150) / 150, np.ones(len(points)))
    field = smooth_samples(fan, (300, 300), 20.0, 30.0)
    flow = minor_flow(gray, np.ones((300, 300), bool), 10.0, field)
    assert flow is not None
    assert errors_deg(flow.samples.angles, np.pi / 2).max() < 0.3
    assert errors_deg(flow.field.at(points), np.pi / 2).max() < 0.3


@pytest.mark.parametrize("order", [1, -1], ids=["strong edges first", "weak edges first"])
def test_edges_do_not_depend_on_what_the_first_bands_show(
    order: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    bars = draw_bars(np.pi / 2, (900, 400)).astype(np.float64)
    contrast = np.linspace(1.0, 0.08, 900)[::order, None]
    gray = (255 - contrast * (255 - bars)).astype(np.uint8)
    area = np.ones(gray.shape, bool)
    found = stroke_edges(gray, area)
    monkeypatch.setattr(minor, "LIKELY_SHARE", 0.0)
    expected = stroke_edges(gray, area)
    assert len(found.points) > 2000
    for name in ("points", "angles", "strengths"):
        assert np.array_equal(getattr(found, name), getattr(expected, name)), name
