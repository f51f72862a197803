"""Projection profiles of drawn stripes, against a slow reference and against the stripes' own angles."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import map_coordinates

from services.arrays import Vector
from services.texture_flow.field import angle_difference
from services.texture_flow.major import (
    ALONG_SAMPLING,
    FINE_RANGE_RAD,
    FINE_WINDOW,
    STRIPS,
    MajorFlowParameters,
)
from services.texture_flow.projection_profiles import (
    catmull_rom,
    parabola_peak,
    sample_windows,
    scan_directions,
    scan_slopes,
)
from services.texture_flow.relaxation import find_peaks
from tests.services.texture_flow.stripes import draw_stripes

QUARTER = np.arange(0.0, np.pi / 2 - 1e-9, np.radians(5.0))
ANGLES = np.concatenate([QUARTER, QUARTER + np.pi / 2])
CENTRES = np.array([[130.0, 150.0], [90.0, 100.0], [170.0, 200.0]])


@pytest.mark.parametrize("angle_deg", [0, 17, 33, 60, 90, 123, 150, 179])
def test_energy_peaks_along_the_stripes(angle_deg: float) -> None:
    ink = draw_stripes((300, 260), np.radians(angle_deg), 12.0)
    energies = scan_directions(ink, CENTRES, QUARTER, (60.0, 45.0))
    off = angle_difference(ANGLES, np.radians(angle_deg))
    nearest, across = int(np.argmin(np.abs(off))), int(np.argmax(np.abs(off)))
    assert (np.argmax(energies, axis=1) == nearest).all()
    assert (energies[:, nearest] > 20 * energies[:, across]).all()
    # A parabola through 5-degree steps tells the angle far better than the step.
    peaks = find_peaks(energies[None], ANGLES, 1).angles[0, :, 0]
    assert np.degrees(np.abs(angle_difference(peaks, np.radians(angle_deg)))).max() < 0.4


def slow_energy(ink: np.ndarray, centre: Vector, angle: float, size: tuple[int, int]) -> float:
    """Deviation of the mean ink of the rows of one turned window (width, height), sample by sample."""
    u = np.arange(size[0]) - (size[0] - 1) / 2
    v = np.arange(size[1]) - (size[1] - 1) / 2
    x = centre[0] + u * np.cos(angle) - v[:, None] * np.sin(angle)
    y = centre[1] + u * np.sin(angle) + v[:, None] * np.cos(angle)
    return float(map_coordinates(ink, [y, x], order=1).mean(axis=1).std())


def test_energies_are_those_of_the_definition() -> None:
    rng = np.random.default_rng(5)
    ink = draw_stripes((300, 260), 0.4, 11.0)
    ink *= np.kron(rng.random((30, 26)) > 0.4, np.ones((10, 10)))
    energies = scan_directions(ink, CENTRES, QUARTER, (61.0, 45.0))
    slow = np.array([[slow_energy(ink, c, a, (61, 45)) for a in ANGLES] for c in CENTRES])
    # The fast form rounds a window's place to whole pixels.
    assert np.abs(energies - slow).max() < 0.06 * slow.max()
    assert np.corrcoef(energies.ravel(), slow.ravel())[0, 1] > 0.995


def test_no_ink_no_energy() -> None:
    energies = scan_directions(
        np.zeros((40, 60), np.float32), np.array([[30.0, 20.0]]), QUARTER, (20.0, 15.0)
    )
    assert (energies == 0).all()


@pytest.mark.parametrize("shape", [(1, 1), (3, 3), (7, 90)])
def test_windows_larger_than_the_image_and_centres_on_its_rim(shape: tuple[int, int]) -> None:
    rows, columns = shape
    corners = np.array([[0.0, 0.0], [columns - 1, 0], [0, rows - 1], [columns - 1, rows - 1]])
    energies = scan_directions(np.ones(shape, np.float32), corners, QUARTER, (200.0, 150.0))
    assert energies.shape == (4, len(ANGLES))
    assert np.isfinite(energies).all()


def test_sampled_windows_are_bilinear_and_zero_outside() -> None:
    y, x = np.mgrid[0:80, 0:90].astype(np.float32)
    image = 1.0 + 2.0 * x + 3.0 * y  # bilinear interpolation of a plane is exact
    centres = np.array([[40.25, 30.5], [50.0, 45.0]])
    along, across = np.array([[0.8, 0.6], [1.0, 0.0]]), np.array([[-0.6, 0.8], [0.0, 1.0]])
    windows = sample_windows(image, centres, along, across, (5, 7))
    assert windows.shape == (2, 5, 7)
    for n in range(2):
        for r in range(5):
            for c in range(7):
                px, py = centres[n] + (c - 3) * along[n] + (r - 2) * across[n]
                # OpenCV knows places to 1/32 of a pixel.
                assert windows[n, r, c] == pytest.approx(1 + 2 * px + 3 * py, abs=5 / 64 + 1e-3)
    outside = sample_windows(image, np.array([[-50.0, 20.0]]), along[:1], across[:1], (5, 7))
    assert (outside == 0).all()


def test_many_windows_are_those_taken_one_by_one() -> None:
    rng = np.random.default_rng(6)
    image = rng.random((60, 60), np.float32)
    count = 2 * (8000 // 50) + 7  # three batches, the last not full
    centres = rng.uniform(10, 50, (count, 2))
    along, across = np.tile([0.9, 0.2], (count, 1)), np.tile([-0.2, 0.9], (count, 1))
    windows = sample_windows(image, centres, along, across, (50, 12))
    for n in (0, 159, 160, 161, 320, count - 1):
        alone = sample_windows(image, centres[n : n + 1], along[:1], across[:1], (50, 12))[0]
        assert np.array_equal(windows[n], alone)


def measure(offset_deg: float, text_height_px: float, *, binary: bool) -> Vector:
    """Errors (60,) in degrees of slopes measured in windows as the fine major flow takes them."""
    p = MajorFlowParameters()
    rng = np.random.default_rng(7)
    ink = draw_stripes((900, 900), np.radians(offset_deg), 1.9 * text_height_px, word_px=3.3 * text_height_px)
    ink = (ink > 0.5).astype(np.float32) if binary else ink
    along, across = text_height_px / ALONG_SAMPLING, text_height_px / p.across_sampling
    columns = int(FINE_WINDOW[0] * text_height_px / along / STRIPS) * STRIPS
    slopes = np.tan(np.arange(-FINE_RANGE_RAD, FINE_RANGE_RAD + 1e-9, p.fine_step_rad))
    margin = int(np.ceil(columns / 2 * abs(slopes[0]) * along / across)) + 4
    rows = int(FINE_WINDOW[1] * text_height_px / across) + 2 * margin
    centres = rng.uniform(200, 700, (60, 2))
    steps = np.tile([along, 0.0], (60, 1)), np.tile([0.0, across], (60, 1))
    windows = sample_windows(ink, centres, *steps, (rows, columns))
    energies, amount = scan_slopes(windows, slopes * along / across, margin, STRIPS)
    slope, inner = parabola_peak(energies, slopes)
    assert inner.all()
    assert (amount > 0).all()
    return np.asarray(np.degrees(np.arctan(slope)) - offset_deg)


@pytest.mark.parametrize("offset_deg", [-3, -1.3, -0.4, -0.2, 0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.75, 1.1, 3])
def test_slopes_are_not_drawn_anywhere(offset_deg: float) -> None:
    for binary in (False, True):
        error = measure(offset_deg, 11.0, binary=binary)
        assert abs(error.mean()) < 0.03
        assert error.std() < 0.08  # of binary ink: its stairs are a hundred pixels long at small slopes


@pytest.mark.parametrize("text_height_px", [5.0, 8.0, 25.0])
def test_slopes_of_small_and_large_print(text_height_px: float) -> None:
    for offset_deg in (-2.0, 0.3):
        assert abs(measure(offset_deg, text_height_px, binary=False).mean()) < 0.03


@given(st.floats(0, 1, exclude_max=True), st.tuples(*[st.floats(-5, 5)] * 3))
def test_catmull_rom_reproduces_quadratics(t: float, c: tuple[float, float, float]) -> None:
    weights = catmull_rom(t).astype(np.float64)
    at = np.array([-1.0, 0.0, 1.0, 2.0])
    assert weights.sum() == pytest.approx(1.0, abs=1e-6)
    values = c[0] + c[1] * at + c[2] * at**2
    assert weights @ values == pytest.approx(c[0] + c[1] * t + c[2] * t**2, abs=1e-5)


@given(st.floats(0, 1))
def test_catmull_rom_is_the_hermite_cubic_of_central_differences(t: float) -> None:
    # Of x^3 the ends 0, 1 and slopes 1, 4 are kept: t(1 - t)(1 - 2t) too much, nothing in the middle.
    weights = catmull_rom(t).astype(np.float64)
    assert weights @ [-1.0, 0.0, 1.0, 8.0] - t**3 == pytest.approx(t * (1 - t) * (1 - 2 * t), abs=1e-5)
    assert np.allclose(weights, catmull_rom(1 - t)[::-1], atol=1e-6)


def test_catmull_rom_keeps_the_samples() -> None:
    assert np.array_equal(catmull_rom(0.0), [0, 1, 0, 0])


@given(st.floats(-2.9, 2.9), st.floats(0.1, 50), st.floats(-10, 10))
def test_parabola_peak_is_exact_on_parabolas(peak: float, bend: float, level: float) -> None:
    positions = np.linspace(-4, 4, 17)
    found, inner = parabola_peak((level - bend * (positions - peak) ** 2)[None], positions)
    assert inner.all()
    assert found[0] == pytest.approx(peak, abs=1e-9)


def test_parabola_peak_at_the_ends_and_on_flat_curves() -> None:
    positions = np.linspace(-1, 1, 9)
    curves = np.stack([positions, -positions, np.zeros(9), np.where(np.abs(positions) < 0.3, 2.0, 0.0)])
    found, inner = parabola_peak(curves, positions)
    assert found[:2].tolist() == [1.0, -1.0]
    assert inner.tolist() == [False, False, False, True]
    assert np.isfinite(found).all()
    assert abs(found[3]) <= 0.3


def test_no_windows_have_no_energies() -> None:
    energies, ink = scan_slopes(np.empty((0, 40, 32), np.float32), np.linspace(-0.1, 0.1, 5), 4, 8)
    assert energies.shape == (0, 5)
    assert ink.shape == (0,)
