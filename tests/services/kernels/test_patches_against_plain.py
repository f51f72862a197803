"""Photos on a page by kernels beside their plain versions."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.imaging.channels import luminance
from services.kernels.library import find_kernels
from services.mosaic.composition.cell_measures import CellMeasures, measure_cells, measure_cells_plain
from services.mosaic.composition.patch_blending import blend_patch, blend_patch_plain
from services.mosaic.composition.patch_drawing import (
    DrawablePatch,
    PatchNodes,
    Rectangle,
    map_nodes,
    prepare_patch,
)
from services.mosaic.light.tones import ToneMap
from tests.services.mosaic.cuttings import place

pytestmark = pytest.mark.skipif(find_kernels() is None, reason="needs kernels, which a C compiler makes")
H_MOSAIC_PHOTO = np.array([[1.05, 0.08, 12.0], [-0.05, 1.1, 20.0], [8e-5, -5e-5, 1.0]])
WIDTH, HEIGHT = 260, 220


def seen_patch() -> DrawablePatch:
    """A photo, smooth but for an edge, that shows the most of the page, in light that changes."""
    noise = np.random.default_rng(1).integers(0, 256, (180, 200, 3), np.uint8)
    photo = np.asarray(cv2.GaussianBlur(noise, (0, 0), 1.5), np.uint8)
    photo[60:90, 80:120] = 240
    placed = place(photo, H_MOSAIC_PHOTO)
    coefficients = np.random.default_rng(2).uniform(0.8, 1.2, (6, 7, 6)).astype(np.float32)
    coefficients[..., 4:] *= [0.2, -20.0]
    return prepare_patch(replace(placed, tones=ToneMap(coefficients, *placed.flat.size)), WIDTH, HEIGHT)


PATCH = seen_patch()


def nodes_of(rectangle: Rectangle) -> PatchNodes:
    nodes = map_nodes(PATCH, rectangle)
    assert nodes is not None
    return nodes


@given(
    st.integers(0, 60),
    st.integers(1, 190),
    st.integers(1, 150),
    st.integers(1, 9),
    st.booleans(),
    st.integers(0, 2**32 - 1),
)
def test_blended_patches(left: int, width: int, height: int, side: int, toned: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    nodes = map_nodes(PATCH, Rectangle(left, 40, width, height))
    if nodes is None:
        return
    cells = rng.integers(0, 256, (-(-height // side) + 2, -(-width // side) + 2)).astype(np.float32)
    cells[rng.random(cells.shape) < 0.4] = 0
    total = rng.uniform(0, 255, (height, width)).astype(np.float32) * (rng.random((height, width)) < 0.6)
    page = rng.integers(0, 256, (height, width + 2, 3), np.uint8)
    drawn = []
    for blend in (blend_patch, blend_patch_plain):
        into, weights = page.copy(), total.copy()
        blend(replace(PATCH, is_toned=toned), nodes, cells, side, into[:, 1:-1], weights)
        assert np.array_equal(into[:, [0, -1]], page[:, [0, -1]])
        drawn.append((into.astype(int), weights))
    difference = np.abs(drawn[0][0] - drawn[1][0])
    # Single levels, which slopes of up to 1.4 enlarge.
    assert difference.max() <= 2
    assert (difference > 0).mean() < 0.02 + 3 / difference.size
    assert np.abs(drawn[0][1] - drawn[1][1]).max() < 1e-3


@given(st.integers(-20, 60), st.integers(1, 60), st.integers(1, 50), st.integers(1, 9))
def test_measured_cells(left: int, rows: int, columns: int, side: int) -> None:
    rows, columns = -(-rows // side), -(-columns // side)
    nodes = map_nodes(PATCH, Rectangle(left, 5, columns * side + 2, rows * side + 2))
    if nodes is None:
        return
    measured = []
    for measure in (measure_cells, measure_cells_plain):
        around = CellMeasures.nothing(rows + 2, columns + 2)
        inner = (slice(1, -1), slice(1, -1))
        measure(luminance(PATCH.source), nodes, side, around.part(inner))
        assert not around.gray[[0, -1]].any()
        assert not around.energy[:, [0, -1]].any()
        measured.append(around.part(inner))
    ours, plain = measured
    assert np.array_equal(ours.covered, plain.covered)
    whole = ours.covered == 255
    assert np.abs(ours.gray.astype(int) - plain.gray)[whole].max(initial=0) <= 1
    # A level more or less of one pixel is an eighth to a fourth of a slope.
    apart = np.abs(ours.energy - plain.energy)[whole]
    assert (apart <= 0.5 * np.sqrt(plain.energy[whole]) + 0.25).all()


def test_what_kernels_cannot_take_is_refused() -> None:
    nodes, cells = nodes_of(Rectangle(40, 40, 30, 20)), np.zeros((7, 10), np.float32)
    page, total = np.zeros((20, 30, 3), np.uint8), np.zeros((20, 30), np.float32)
    with pytest.raises(ValueError, match="nodes"):
        blend_patch(PATCH, nodes, cells, 4, page[:, :10], total[:, :10])
    with pytest.raises(ValueError, match="weights"):
        blend_patch(PATCH, nodes, cells, 4, page, total[1:])
    with pytest.raises(ValueError, match="cells"):
        blend_patch(PATCH, nodes, cells[1:], 4, page, total)
    with pytest.raises(ValueError, match="nodes"):
        measure_cells(luminance(PATCH.source), nodes, 4, CellMeasures.nothing(9, 9))
    with pytest.raises(ValueError, match="pixels"):
        measure_cells(luminance(PATCH.source), nodes, 4, CellMeasures.nothing(0, 9))


def test_photos_of_one_row_are_measured() -> None:
    nodes, gray = nodes_of(Rectangle(40, 40, 30, 22)), luminance(PATCH.source)[:1]
    ours, plain = CellMeasures.nothing(5, 7), CellMeasures.nothing(5, 7)
    measure_cells(gray, nodes, 4, ours)
    measure_cells_plain(gray, nodes, 4, plain)
    assert np.array_equal(ours.gray, plain.gray)
