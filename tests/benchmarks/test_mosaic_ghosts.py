"""The measure of doubled words: none where every word is one photo's, all where two photos are averaged apart."""

from dataclasses import dataclass
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from benchmarks.mosaic.errors import mesh_of_homography
from benchmarks.mosaic.ghosts import measure_mixture, mixed_share, mosaic_scale, shifted_photo
from services.geometry.homographies import scaling, translation
from services.mosaic import pipeline
from services.mosaic.placing.placement import Placement
from simulation.letter_pages import letter_pages
from simulation.mosaic_sets import MosaicSet, photograph_set


@dataclass(frozen=True)
class PlacedStandIn:
    """As much of a placed photo as a shift needs."""

    flat: SimpleNamespace
    placement: Placement


H_MOSAIC_PAGE = scaling(0.9)
SIZE = (2300, 2970)
SHIFT = (1.5, 0.0)


@pytest.fixture(scope="module")
def made() -> MosaicSet:
    return photograph_set(letter_pages()[1], 2, 0.4, np.random.default_rng(6))


@pytest.fixture(scope="module")
def meshes(made: MosaicSet) -> list[np.ndarray]:
    inverses = [np.linalg.inv(photo.truth.H_photo_page()) for photo in made.photos]
    return [
        mesh_of_homography(H_MOSAIC_PAGE @ inverse, image.shape[1], image.shape[0])
        for inverse, image in zip(inverses, made.images, strict=True)
    ]


def _drawn(made: MosaicSet, k: int, H_shift: np.ndarray) -> np.ndarray:
    H = H_shift @ H_MOSAIC_PAGE @ np.linalg.inv(made.photos[k].truth.H_photo_page())
    return np.asarray(cv2.warpPerspective(made.images[k], H, SIZE, flags=cv2.INTER_LINEAR))


def test_words_of_one_photo_are_not_mixed(made: MosaicSet, meshes: list[np.ndarray]) -> None:
    for k, shift in ((0, np.eye(3)), (1, translation(*SHIFT))):
        single = _drawn(made, k, shift)
        found = measure_mixture(single, made, meshes, (1, SHIFT))
        assert found.words > 40
        assert found.mixed <= 0.02 * found.words
        assert found.mean_share < 0.06


def test_the_mean_of_two_photos_apart_is_mixed(made: MosaicSet, meshes: list[np.ndarray]) -> None:
    mean = (_drawn(made, 0, np.eye(3)) / 2 + _drawn(made, 1, translation(*SHIFT)) / 2).astype(np.uint8)
    found = measure_mixture(mean, made, meshes, (1, SHIFT))
    assert found.mixed > 0.9 * found.words


@pytest.mark.parametrize("share", [0.1, 0.4])
def test_the_share_is_measured(share: float) -> None:
    rng = np.random.default_rng(3)
    one, other = rng.random((20, 50)), rng.random((20, 50))
    word = 7 + 90 * ((1 - share) * one + share * other)
    assert mixed_share(word, [one, 40 * other]) == pytest.approx(share, abs=0.02)
    assert mixed_share(word, [one, other, rng.random((20, 50))], 1) == pytest.approx(share, abs=0.02)
    assert mixed_share(word, [one, other, rng.random((20, 50))], 2) == pytest.approx(0, abs=0.03)
    assert mixed_share(word, [one, np.ones((20, 50))]) is None


def test_scale_of_the_mosaic(made: MosaicSet, meshes: list[np.ndarray]) -> None:
    assert mosaic_scale(made, [None, meshes[1]]) == pytest.approx(0.9, rel=1e-3)


def test_one_photo_is_shifted_and_the_pipeline_left_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    def compose(placed: list[PlacedStandIn]) -> list[np.ndarray]:
        return [one.placement.to_mosaic(np.zeros((1, 2)))[0] for one in placed]

    monkeypatch.setattr(pipeline, "compose_page", compose, raising=False)
    placed = [PlacedStandIn(SimpleNamespace(index=k), Placement(np.eye(3))) for k in range(3)]
    with shifted_photo(1, SHIFT):
        moved = pipeline.compose_page(placed)  # type: ignore[attr-defined, call-arg]
    assert np.allclose(moved, [[0, 0], SHIFT, [0, 0]])
    assert pipeline.compose_page is compose  # type: ignore[attr-defined]
