"""The kernels of the search for outlines beside their plain versions."""

from collections.abc import Callable

import numpy as np
import pytest

from services.geometry.polygons import distances_within, distances_within_plain
from services.kernels.library import find_kernels
from services.sheet.outline.colors import (
    color_codes,
    color_codes_plain,
    count_colors,
    count_colors_plain,
    smooth_colors,
    smooth_colors_plain,
)
from services.sheet.outline.corners import piece_costs, piece_costs_plain
from services.sheet.outline.rays import score_rays, score_rays_plain

pytestmark = pytest.mark.skipif(find_kernels() is None, reason="needs kernels, which a C compiler makes")


def rng() -> np.random.Generator:
    return np.random.default_rng(5)


@pytest.mark.parametrize("shape", [(0,), (1,), (7,), (8,), (61, 83)])
def test_colors(shape: tuple[int, ...]) -> None:
    """Also those beyond the bins."""
    colors = rng().normal((50, 0, 0), (60, 70, 70), (*shape, 3)).astype(np.float32)
    codes = color_codes(colors)
    assert np.array_equal(codes, color_codes_plain(colors))
    inside = rng().random(shape) < 0.4
    for chosen in (inside, None):
        counts = count_colors(codes, chosen)
        assert np.array_equal(counts, count_colors_plain(codes, chosen))
        assert np.array_equal(smooth_colors(counts), smooth_colors_plain(counts))


def test_gains_of_rays() -> None:
    edges, last = rng().random((40, 30)), rng().integers(0, 30, 40)
    least = rng().uniform(-3, 33, 40)
    all_odds: list[np.ndarray] = [
        rng().normal(0, 1, (40, 30)),
        rng().normal(0, 1, (40, 30)).astype(np.float32),
        rng().random((40, 1)),
        np.array(0.0),
    ]
    for odds in all_odds:
        ours = score_rays(edges, odds, last, least, 0.03, 0.3)
        plain = score_rays_plain(edges, odds, last, least, 0.03, 0.3)
        np.testing.assert_allclose(ours, plain, atol=1e-12)


@pytest.mark.parametrize("shown", [0.0, 0.2, 1.0])
def test_costs_of_pieces(shown: float) -> None:
    angle = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    curve = np.stack([np.cos(angle), 0.7 * np.sin(angle)], axis=1) + rng().normal(0, 0.02, (200, 2))
    marked = rng().random(200) < shown
    starts, lengths = rng().integers(0, 200, 50), rng().integers(10, 120, 50)
    ours, plain = (costs(curve, marked, starts, lengths) for costs in (piece_costs, piece_costs_plain))
    np.testing.assert_allclose(ours, plain, rtol=1e-6, atol=1e-12)


def test_distances_within_polygons() -> None:
    """Of a curve that crosses itself, on its corners and sides, and of curves of few points."""
    curve = np.array([[0.0, 0.0], [10, 0], [10, 10], [4, -3], [4, -3], [0, 10]])
    points = np.concatenate([rng().uniform(-5, 15, (200, 2)), curve, [[5.0, 0.0], [0.0, 5.0], [-1e6, 3.0]]])
    for corners in (curve, curve[:3], curve[:2], curve[:1]):
        ours, plain = distances_within(points, corners), distances_within_plain(points, corners)
        np.testing.assert_allclose(np.abs(ours), np.abs(plain), rtol=1e-6, atol=1e-6)
        clear = np.abs(plain) > 1e-6
        assert np.array_equal(ours[clear] > 0, plain[clear] > 0)
    assert distances_within(np.zeros((0, 2)), np.eye(3, 2)).shape == (0,)


def test_what_kernels_cannot_take_is_refused() -> None:
    rays, ones = np.zeros((4, 5)), np.ones(4)
    codes, curve, shown = np.zeros((3, 4), np.uint16), np.zeros((9, 2)), np.ones(9, bool)
    first = np.zeros(1, np.intp)
    calls: list[Callable[[], object]] = [
        lambda: count_colors(codes, np.ones((4, 3), bool)),
        lambda: smooth_colors(np.zeros(7, np.int64)),
        lambda: score_rays(rays, np.zeros((4, 3)), np.zeros(4, np.intp), ones, 1.0, 0.3),
        lambda: score_rays(rays, np.array(0.0), np.full(4, 5), ones, 1.0, 0.3),
        lambda: piece_costs(curve, shown[1:], first, first),
        lambda: piece_costs(curve, shown, first + 9, first),
        lambda: distances_within(curve, np.zeros((0, 2))),
    ]
    for call in calls:
        with pytest.raises((ValueError, IndexError), match=r"mask|bins|ray|piece|points"):
            call()
