"""Distances from a scan: zero for the scan itself, known where the displacement is known."""

import cv2
import numpy as np
import pytest

from benchmarks.common.scan_distances import (
    SCALE_WEIGHTS,
    aligned_distortion,
    compare_with_scan,
    edge_strength,
    estimate_flow,
    ms_ssim,
)

HEIGHT, WIDTH = 560, 420


@pytest.fixture(scope="module")
def scan() -> np.ndarray:
    """Lines of words of varied letters on white."""
    rng = np.random.default_rng(3)
    page = np.full((HEIGHT, WIDTH), 235, np.uint8)
    for row in range(50, HEIGHT - 30, 24):
        text = "".join(rng.choice(list("abdefghkmnoprstuvw   "), 34))
        cv2.putText(page, text, (30, row), cv2.FONT_HERSHEY_SIMPLEX, 0.5, 30, 1, cv2.LINE_AA)
    return page


def _places() -> tuple[np.ndarray, np.ndarray]:
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float32)
    return columns, rows


def _rgb(image: np.ndarray) -> np.ndarray:
    return np.repeat(image[..., None], 3, axis=2)


def test_a_scan_lies_on_itself(scan: np.ndarray) -> None:
    distances = compare_with_scan(_rgb(scan), _rgb(scan))
    assert distances.ms_ssim == pytest.approx(sum(SCALE_WEIGHTS), abs=1e-9)
    assert distances.local_distortion_px < 0.1
    assert distances.aligned_distortion_px < 0.01
    assert distances.aspect_error_percent == 0


def test_a_wave_in_shade_is_measured(scan: np.ndarray) -> None:
    columns, rows = _places()
    wave = (8 * np.sin(2 * np.pi * columns / WIDTH)).astype(np.float32)
    view = cv2.remap(scan, columns, rows - wave, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    shaded = (view * np.linspace(0.6, 1.0, WIDTH)).astype(np.uint8)
    flow = estimate_flow(scan, shaded)
    ink = edge_strength(scan[::2, ::2]) > 0.2
    # A pixel of the scan lies lower by the wave; at half size, half of it.
    errors = np.abs(flow[..., 1] - wave[::2, ::2] / 2)[ink]
    assert np.median(errors) < 0.3
    assert np.abs(flow[..., 0])[ink].mean() < 0.3
    true_flow = np.stack([np.zeros_like(wave), wave], axis=2)[::2, ::2] / 2
    edges = edge_strength(scan[::2, ::2])
    assert aligned_distortion(flow, edges) == pytest.approx(aligned_distortion(true_flow, edges), rel=0.15)


def test_margins_count_in_ld_and_not_in_ad(scan: np.ndarray) -> None:
    wider = _rgb(np.pad(scan, ((14, 14), (20, 20)), constant_values=235))
    distances = compare_with_scan(wider, _rgb(scan))
    assert distances.local_distortion_px > 2
    assert distances.aligned_distortion_px < 0.05
    assert distances.aspect_error_percent == pytest.approx(100 * (460 / 420 * 560 / 588 - 1))


def test_ad_is_what_scale_and_shift_leave() -> None:
    rows, columns = np.mgrid[0:60, 0:40].astype(np.float32)
    edges = np.full((60, 40), 0.8, np.float32)
    affine = np.stack([0.05 * columns + 3, -0.02 * rows - 1], axis=2)
    assert aligned_distortion(affine, edges) < 1e-4
    # A step that no scale explains: +-1 about the best line is weighted by the edges.
    step = affine.copy()
    step[..., 1] += np.where(columns < 20, 1, -1)
    assert aligned_distortion(step, edges) == pytest.approx(0.8, rel=0.05)


def test_ms_ssim_falls_with_distance(scan: np.ndarray) -> None:
    near, far = (np.roll(scan, shift, axis=0) for shift in (1, 6))
    assert ms_ssim(scan, far) < ms_ssim(scan, near) < 0.999


def test_blank_views_are_no_accident(scan: np.ndarray) -> None:
    blank = np.full((300, 200, 3), 200, np.uint8)
    distances = compare_with_scan(blank, _rgb(scan))
    assert 0 < distances.ms_ssim < 0.9
    assert np.isfinite(distances.local_distortion_px)
    assert np.isfinite(distances.aligned_distortion_px)
