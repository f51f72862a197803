"""Edges of strokes by kernels, beside their plain versions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.arrays import GrayImage
from services.kernels.library import find_kernels
from services.texture_flow import stroke_edges
from services.texture_flow.field import FlowField, angle_difference
from services.texture_flow.stroke_edges import (
    MinorFlowParameters,
    StrokeEdges,
    detect_stroke_edges,
    detect_stroke_edges_plain,
    gather_blocks,
)

pytestmark = pytest.mark.skipif(find_kernels() is None, reason="needs kernels, which a C compiler makes")


def bent_field(rng: np.random.Generator, size: float) -> FlowField:
    """Directions of up to 0.3 rad at the nodes, as strong as they like."""
    angles, strengths = rng.uniform(-0.3, 0.3, (4, 5)), rng.uniform(0.5, 2.0, (4, 5, 1))
    doubled = np.stack([np.cos(2 * angles), np.sin(2 * angles)], axis=-1)
    return FlowField(strengths * doubled, (-3.0, 2.0), size / 3)


def strokes(rng: np.random.Generator, height: int, width: int) -> GrayImage:
    """Bright and dark patches of a few pixels."""
    coarse = rng.integers(0, 256, (height // 5 + 1, width // 4 + 1), np.uint8)
    return np.ascontiguousarray(np.kron(coarse, np.ones((5, 4), np.uint8))[:height, :width])


@settings(max_examples=40, deadline=None)
@given(
    st.integers(1, 90),
    st.integers(1, 90),
    st.integers(0, 99),
    st.floats(0.0, 1.0),
    st.sampled_from([300, 200_000]),
)
def test_edges_are_the_same_but_for_rounding(
    height: int, width: int, seed: int, share: float, most: int
) -> None:
    rng = np.random.default_rng(seed)
    gray, area = strokes(rng, height, width), rng.random((height, width)) < share
    field, p = bent_field(rng, float(max(height, width))), MinorFlowParameters(max_edges=most, band_rows=32)
    ours, plain = detect_stroke_edges(gray, area, field, p), detect_stroke_edges_plain(gray, area, field, p)
    keys = [each.points.astype(int) @ [1, 1000] for each in (ours, plain)]
    # An edge at the bound of strength or direction may be one here and none there; thinned out, its followers differ.
    shared, here, there = np.intersect1d(*keys, return_indices=True)
    differing = len(keys[0]) + len(keys[1]) - 2 * len(shared)
    assert differing <= 2 or most == 300
    assert len(keys[0]) == pytest.approx(len(keys[1]), abs=2)
    assert np.abs(angle_difference(ours.angles[here], plain.angles[there])).max(initial=0.0) < 2e-5
    np.testing.assert_allclose(ours.strengths[here], plain.strengths[there], rtol=1e-5, atol=1e-4)


def test_blocks_are_the_same_but_for_rounding(monkeypatch: pytest.MonkeyPatch) -> None:
    rng, count = np.random.default_rng(3), 4000
    points, strengths = rng.uniform(0.0, 1.0, (count, 2)) * [299.0, 199.0], rng.random(count)
    edges = StrokeEdges(*(each.astype(np.float32) for each in (points, 0 * strengths, strengths)))
    ours = gather_blocks(edges, 40.0, (6, 8))
    monkeypatch.setattr(stroke_edges, "find_kernels", lambda: None)
    plain = gather_blocks(edges, 40.0, (6, 8))
    assert np.array_equal(ours.which, plain.which)
    np.testing.assert_allclose(ours.population, plain.population)
    np.testing.assert_allclose(ours.centres, plain.centres, rtol=1e-6)
