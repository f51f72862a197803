"""A photo as the flat view it is registered in."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.common.residuals import similarity_residual
from services.contract.cameras import CameraMemory
from services.errors import NoText
from services.geometry.focal_prior import FocalPrior, typical_focal_prior
from services.geometry.homographies import jacobians, scaling, transform_points
from services.mosaic import flattening
from services.mosaic.flat_photo import trust_by_error
from services.mosaic.flattening import flatten_photo, take_as_flat, view_again, view_photo
from services.rectify import page_search
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.stage_clock import StageClock
from services.rectify.view.flatness import Flatness
from services.sheet.curved_page import estimate_curved_page
from services.sheet.plane.framing import FlatFrame
from services.sheet.plane.pose import choose_pose
from services.sheet.shape import NoShape
from tests.services.mosaic.views import look_at, page_image, photograph
from tests.services.scenes import Album

pytestmark = pytest.mark.pipeline

TILTED = look_at((480.0, 800.0), 25.0, 60.0, 0.85, 1000, 1400)


def similarity_defect(H: np.ndarray, points: np.ndarray) -> float:
    """RMS distance (in flat pixels) of the map from the nearest similarity."""
    seen = transform_points(H, points) @ [1, 1j]
    z = points @ [1, 1j]
    z, seen = z - z.mean(), seen - seen.mean()
    ratio = np.vdot(z, seen) / np.vdot(z, z)
    return float(np.sqrt(np.mean(np.abs(seen - ratio * z) ** 2)) / abs(ratio))


def test_a_tilted_photo_becomes_a_view_that_differs_from_the_page_by_a_similarity() -> None:
    photo = photograph(page_image(), TILTED, 1000, 1400)
    flat = flatten_photo(3, photo, None, StageClock())
    assert flat.index == 3
    assert flat.gray.shape == flat.shown.shape == (flat.frame.height, flat.frame.width)
    assert isinstance(flat.frame, FlatFrame)
    H_page_flat = np.linalg.inv(TILTED) @ flat.frame.H_photo_flat
    corners = np.stack(np.meshgrid(np.linspace(0, flat.size[0], 9), np.linspace(0, flat.size[1], 9)), -1)
    assert similarity_defect(H_page_flat, corners.reshape(-1, 2)) < 4.0
    assert similarity_defect(TILTED, corners.reshape(-1, 2)) > 20.0
    # Bare paper is white, and print is not.
    assert np.median(flat.gray[flat.shown]) > 250
    assert (flat.gray[flat.shown] < 100).mean() > 0.02
    assert flat.weight > 500


@pytest.mark.parametrize(("asked_percent", "codes"), [(0.0, []), (2.0, ["not-flat"])])
def test_a_view_that_shows_that_it_is_not_flat_says_so_until_it_is_viewed_again(
    asked_percent: float, codes: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = Flatness(None, asked_percent)
    monkeypatch.setattr(flattening, "measure_flatness", lambda *_: shown)
    flat = flatten_photo(0, photograph(page_image(), TILTED, 1000, 1400), None, StageClock())
    assert [notice.code for notice in flat.notices] == codes
    again = view_again(flat, flat.frame)
    assert again.notices == ()
    assert again.gray.size == 0


@pytest.mark.parametrize("has_next", [True, False])
def test_a_bent_page_that_was_taken_for_a_plane_is_laid_flat_by_its_next_shape(
    has_next: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    shot = Album()["book"]
    prior = typical_focal_prior()
    plane, bent = choose_pose(shot.evidence, prior), estimate_curved_page(shot.evidence, prior)
    assert not isinstance(bent, NoShape)
    page = ShapedPage(shot.frame, plane, (), None, shot.analysis, shot.evidence.vanishing_points)
    page = replace(page, others=iter([replace(page, shape=bent)] if has_next else []))
    monkeypatch.setattr(flattening, "find_page", lambda *_, **__: page)
    flat = flatten_photo(0, shot.photo.image, None, StageClock())
    assert flat.page is not None
    assert flat.page.shape.kind == ("curved" if has_next else "planar")
    assert [notice.code for notice in flat.notices] == ([] if has_next else ["not-flat"])
    truth, at = shot.truth, shot.text_points
    error = similarity_residual(flat.frame.to_flat(at), truth.photo_to_page(at)) / truth.page.width
    assert (error < 0.004) == has_next


def test_the_remembered_camera_takes_part_in_the_pose(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[FocalPrior] = []

    def shape(_analysis: object, _view: object, prior: FocalPrior, *rest: object) -> None:
        asked.append(prior)
        raise NoText("enough")

    monkeypatch.setattr(page_search, "flat_page", lambda *_, **__: None)
    monkeypatch.setattr(page_search, "shape_page", shape)
    memory = CameraMemory("phone", 0.3, 0.02, 5)
    for known in (memory, None):
        with pytest.raises(NoText):
            flatten_photo(0, page_image(), None, StageClock(), known)
    assert [(prior.source, prior.log_focal == 0.3) for prior in asked] == [
        ("remembered", True),
        ("assumed", False),
    ]


def test_native_scale_tells_how_far_the_view_was_reduced() -> None:
    photo = np.ascontiguousarray(np.kron(page_image(), np.ones((3, 3, 1), np.uint8)))
    height, width = photo.shape[:2]
    flat = take_as_flat(0, photo, StageClock())
    assert flat.size[0] * flat.size[1] <= 5.01e6
    assert abs(flat.native_scale - np.sqrt(5e6 / (width * height))) < 0.01
    assert abs(flat.to_photo(np.array([[100.0, 100.0]]))[0, 0] - (100.5 / flat.native_scale - 0.5)) < 0.5


def test_what_lies_beside_the_photo_is_not_shown() -> None:
    photo = page_image()[:400, :500]
    flat = view_photo(0, photo, FlatFrame(scaling(1.0), 700, 600), 12.0, 1.0)
    assert flat.shown[5:395, 5:495].all()
    assert not flat.shown[405:].any()
    assert not flat.shown[:, 505:].any()


def test_the_text_height_is_in_flat_pixels() -> None:
    flat = view_photo(0, page_image(), FlatFrame(scaling(2.0), 500, 780), 12.0, 1.0)
    assert flat.text_height_px == pytest.approx(6.0)
    assert np.abs(jacobians(flat.frame.H_photo_flat, np.zeros((1, 2)))[0] - 2 * np.eye(2)).max() < 1e-9


def test_a_blank_photo_is_refused_and_can_still_be_taken_as_it_is() -> None:
    blank = np.full((300, 400, 3), 230, np.uint8)
    with pytest.raises(NoText):
        flatten_photo(0, blank, None, StageClock())
    flat = take_as_flat(0, blank, StageClock())
    assert flat.weight == 0
    assert flat.text_height_px == pytest.approx(4.0)


def test_a_coloured_head_with_print_is_part_of_the_sheet() -> None:
    page = page_image().astype(np.float32)
    page[:420] *= np.array([0.25, 0.4, 0.75], np.float32)
    desk = np.full((1700, 1140, 3), (90, 70, 50), np.uint8)
    desk[70:1630, 70:1070] = page.astype(np.uint8)
    flat = flatten_photo(0, desk, None, StageClock())
    corners = np.array([[0.0, 0.0], [flat.size[0], 0.0]])
    assert flat.to_photo(corners)[:, 1].max() < 90


def test_views_count_by_the_errors_that_they_show() -> None:
    shown = take_as_flat(0, page_image(), StageClock())
    assert shown.error_percent is None
    photos = [replace(shown, error_percent=error) for error in (0.2, 0.1, None, 0.4)]
    np.testing.assert_allclose(trust_by_error(photos), [0.25, 1.0, 0.25, 0.0625])
    np.testing.assert_allclose(trust_by_error([shown, shown]), 1.0)
