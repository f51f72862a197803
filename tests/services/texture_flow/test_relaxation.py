"""Relaxation labelling on grids whose right labels are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from services.texture_flow.relaxation import Candidates, find_peaks, label_by_relaxation

ANGLES = np.arange(0.0, np.pi - 1e-9, np.radians(5.0))


def bump(centre: float, height: float = 1.0) -> np.ndarray:
    """Cyclic curve (36,) over `ANGLES`, a parabola of 20 degrees round `centre`."""
    off = (ANGLES - centre + np.pi / 2) % np.pi - np.pi / 2
    return height * np.maximum(1 - (off / np.radians(20)) ** 2, 0.0)


@given(st.floats(0, np.pi), st.floats(0.5, 3.0))
def test_one_peak_is_found_anywhere_on_the_circle(centre: float, height: float) -> None:
    found = find_peaks(bump(centre, height)[None, None], ANGLES, 3)
    off = (found.angles[0, 0, 0] - centre + np.pi / 2) % np.pi - np.pi / 2
    assert abs(off) < 1e-6
    assert 0 <= found.angles[0, 0, 0] < np.pi
    assert found.energies[0, 0, 0] == pytest.approx(height, rel=0.02)
    assert (found.energies[0, 0, 1:] == 0).all()


@pytest.mark.parametrize("centre_deg", [0.0, 1.0, 177.6, 178.0, 179.9])
def test_peak_at_the_seam(centre_deg: float) -> None:
    curve = bump(np.radians(centre_deg)) + bump(np.radians(90.0), 0.5)
    found = find_peaks(curve[None, None], ANGLES, 4)
    off = (np.degrees(found.angles[0, 0, 0]) - centre_deg + 90) % 180 - 90
    assert abs(off) < 1e-6
    assert 0 <= found.angles[0, 0, 0] < np.pi
    assert np.degrees(found.angles[0, 0, 1]) == pytest.approx(90.0)
    assert (found.energies[0, 0] > 0).sum() == 2


def test_highest_peaks_come_first_and_no_more_than_asked() -> None:
    heights = {10.0: 0.4, 50.0: 1.0, 95.0: 0.7, 140.0: 0.2}
    curve = sum((bump(np.radians(c), h) for c, h in heights.items()), np.zeros(36))
    found = find_peaks(curve[None, None], ANGLES, 3)
    assert np.allclose(np.degrees(found.angles[0, 0]), [50, 95, 10], atol=1.0)
    assert np.all(np.diff(found.energies[0, 0]) < 0)


def test_flat_curves_have_no_peaks() -> None:
    found = find_peaks(np.stack([np.zeros(36), np.ones(36)])[None], ANGLES, 4)
    assert (found.energies == 0).all()


def field_with_a_liar(direction: float, lie: float, size: int = 5) -> Candidates:
    """Every node holds `direction` at energy 0.6; the one in the middle also `lie`, at 1."""
    angles = np.full((size, size, 2), direction)
    energies = np.zeros((size, size, 2))
    energies[..., 0] = 0.6
    angles[size // 2, size // 2, 1] = lie
    energies[size // 2, size // 2, 1] = 1.0
    return Candidates(angles, energies)


@pytest.mark.parametrize("direction_deg", [0.0, 30.0, 90.0, 179.0])
@pytest.mark.parametrize("off_deg", [30.0, 60.0, 90.0, 120.0])
def test_neighbours_overrule_one_strong_lie(direction_deg: float, off_deg: float) -> None:
    lie = np.radians((direction_deg + off_deg) % 180)
    candidates = field_with_a_liar(np.radians(direction_deg), lie)
    confidence = label_by_relaxation(candidates, 10)
    assert confidence[2, 2, 0] > confidence[2, 2, 1]
    before = label_by_relaxation(candidates, 0)
    assert before[2, 2, 1] > before[2, 2, 0]  # it is the neighbours that decide


def test_alone_the_stronger_candidate_stays() -> None:
    lonely = Candidates(np.array([[[0.1, 1.3]]]), np.array([[[0.6, 1.0]]]))
    confidence = label_by_relaxation(lonely, 10)
    assert confidence[0, 0, 1] > confidence[0, 0, 0] > 0


def test_random_lies_lose_against_a_smooth_field() -> None:
    rng = np.random.default_rng(8)
    rows, columns = np.mgrid[0:9, 0:7]
    truth = 0.3 + 0.02 * rows + 0.03 * columns
    angles = rng.uniform(0, np.pi, (9, 7, 4))
    energies = rng.uniform(0.3, 0.9, (9, 7, 4))
    angles[..., 2], energies[..., 2] = truth, 0.7
    strongest = np.argmax(energies, axis=-1) == 2
    chosen = np.argmax(label_by_relaxation(Candidates(angles, energies), 10), axis=-1)
    picked = np.take_along_axis(angles, chosen[..., None], axis=-1)[..., 0]
    close = np.abs((picked - truth + np.pi / 2) % np.pi - np.pi / 2) < np.radians(15)
    assert strongest.mean() < 0.6
    assert close.mean() > 0.9


def test_first_step_by_hand() -> None:
    # Two nodes, one label each way at node 0: support is |cos| of the difference times the other's confidence.
    candidates = Candidates(
        np.array([[[0.0, np.pi / 2], [np.pi / 6, 0.0]]]), np.array([[[1.0, 2.0], [3.0, 0.0]]])
    )
    confidence = label_by_relaxation(candidates, 1)[0]
    first = 0.5 * (1 + np.cos(np.pi / 6))  # C = 1/2, s = cos 30
    second = 1.0 * (1 + np.cos(np.pi / 3))  # C = 1, s = cos 60
    assert confidence[0, 0] == pytest.approx(first / (first + second))
    assert confidence[0, 1] == pytest.approx(second / (first + second))
    assert confidence[1].tolist() == [1.0, 0.0]


GRIDS = arrays(np.float64, (3, 4, 3), elements=st.sampled_from([0.0, 0.2, 0.5, 1.0]))


@pytest.mark.pipeline
@given(GRIDS, st.integers(0, 2**32 - 1), st.floats(-3, 3))
@pytest.mark.filterwarnings("error")
def test_confidences_are_shares_and_absent_candidates_stay_absent(
    energies: np.ndarray, seed: int, turn: float
) -> None:
    angles = np.random.default_rng(seed).uniform(0, np.pi, energies.shape)
    confidence = label_by_relaxation(Candidates(angles, energies), 10)
    assert (confidence[energies == 0] == 0).all()
    assert (confidence[energies > 0] > 0).all()
    total = confidence.sum(axis=-1)
    assert np.allclose(total[(energies > 0).any(axis=-1)], 1.0)
    # What an absent candidate's angle says is nothing, and only differences of directions matter.
    other = np.where(energies > 0, (angles + turn) % np.pi, 0.123)
    assert np.allclose(label_by_relaxation(Candidates(other, energies), 10), confidence)
    # The photo turned by 180 degrees has the same directions, in the opposite order.
    back = label_by_relaxation(Candidates(angles[::-1, ::-1], energies[::-1, ::-1]), 10)
    assert np.allclose(back[::-1, ::-1], confidence)
