"""The measures of a mosaic: nothing for the truth, as much as was put in for an error of known size."""

import numpy as np
import pytest

from benchmarks.mosaic.cases import (
    BENT,
    BENT_SETS,
    COUNTS,
    HomographyMap,
    MosaicCase,
    TrueSet,
    bent_cases,
    own_cases,
)
from benchmarks.mosaic.errors import measure_placement, mesh_at, mesh_of_homography
from services.geometry.homographies import scaling, transform_points, translation
from simulation.letter_pages import letter_pages
from simulation.mosaic_sets import OVERLAPS, PHOTO_SIZES, MosaicSet, photograph_set

H_MOSAIC_PAGE = scaling(0.8) @ translation(30, -12)


def _true_set(made: MosaicSet) -> TrueSet:
    page = made.page
    box = (200.0, 200.0, page.width - 200.0, page.height - 200.0)
    image = np.zeros((page.height, page.width, 3), np.uint8)
    maps = tuple(photo.truth for photo in made.photos)
    return TrueSet("set", made.images, maps, image, 300.0, box, (), made.overlaps)


@pytest.fixture(scope="module")
def made() -> MosaicSet:
    """Small photos: of them only size and truth are measured."""
    width, height = PHOTO_SIZES[4]
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(PHOTO_SIZES, 4, (width // 4, height // 4))
        return photograph_set(letter_pages()[0], 4, 0.2, np.random.default_rng(2))


@pytest.fixture(scope="module")
def truth(made: MosaicSet) -> TrueSet:
    return _true_set(made)


def _meshes(
    made: MosaicSet, H_mosaic_page: np.ndarray, moved: dict[int, np.ndarray] | None = None
) -> list[np.ndarray]:
    meshes = []
    for k, photo in enumerate(made.photos):
        height, width = photo.image.shape[:2]
        H = H_mosaic_page @ (moved or {}).get(k, np.eye(3)) @ np.linalg.inv(photo.truth.H_photo_page())
        meshes.append(mesh_of_homography(H, width, height))
    return meshes


def test_the_truth_has_no_error(made: MosaicSet, truth: TrueSet) -> None:
    errors = measure_placement(truth, _meshes(made, H_MOSAIC_PAGE))
    assert (errors.placed, errors.false) == (4, ())
    assert errors.rms_px < 0.02
    assert errors.disagreement_px < 0.02
    assert errors.frontal_percent < 1e-3


def test_a_common_homography_is_no_error_of_registration_but_of_the_frontal_view(
    made: MosaicSet, truth: TrueSet
) -> None:
    leaning = np.array([[1.0, 0.02, 0.0], [0.0, 1.0, 0.0], [2e-5, 0.0, 1.0]])
    errors = measure_placement(truth, _meshes(made, leaning))
    assert errors.rms_px < 0.02
    assert 0.3 < errors.frontal_percent < 3


@pytest.mark.parametrize("shift", [0.3, 1.5, 8.0])
def test_a_shift_of_one_photo_is_measured(made: MosaicSet, truth: TrueSet, shift: float) -> None:
    errors = measure_placement(truth, _meshes(made, H_MOSAIC_PAGE, {2: translation(shift, 0)}))
    assert errors.false == ()
    # Between the photos it is seen nearly whole; what the common fit takes up bounds it from below.
    assert 0.25 * shift < errors.disagreement_px < shift
    assert 0.1 * shift < errors.rms_px < 0.6 * shift


def test_random_jitter_is_measured_to_its_size(made: MosaicSet, truth: TrueSet) -> None:
    rng = np.random.default_rng(1)
    moved = {k: translation(*rng.normal(0, 0.5, 2)) for k in range(4)}
    errors = measure_placement(truth, _meshes(made, H_MOSAIC_PAGE, moved))
    assert 0.2 < errors.rms_px < 1.0


@pytest.mark.parametrize("far", [translation(60, 0), scaling(1.1), translation(0, 900)])
def test_a_false_placement_is_named(made: MosaicSet, truth: TrueSet, far: np.ndarray) -> None:
    errors = measure_placement(truth, _meshes(made, H_MOSAIC_PAGE, {1: far}))
    assert errors.false == (1,)
    assert errors.rms_px < 0.05


def test_unplaced_photos_are_neither_placed_nor_false(made: MosaicSet, truth: TrueSet) -> None:
    meshes = _meshes(made, H_MOSAIC_PAGE)
    errors = measure_placement(truth, [meshes[0], None, meshes[2], None])
    assert (errors.placed, errors.false) == (2, ())
    assert np.isnan(errors.by_photo_px[1])
    assert np.isnan(measure_placement(truth, [None] * 4).rms_px)


def test_dpi_is_brought_to_300(made: MosaicSet, truth: TrueSet) -> None:
    double = TrueSet("set", truth.photos, truth.maps, truth.page, 600.0, truth.box, (), {})
    moved = _meshes(made, H_MOSAIC_PAGE, {2: translation(2, 0)})
    assert measure_placement(double, moved).rms_px == pytest.approx(
        measure_placement(truth, moved).rms_px / 2
    )


def test_a_mesh_is_read_between_its_nodes_as_well_as_at_them() -> None:
    rng = np.random.default_rng(0)
    steep = np.array([[1.0, 0.1, 5.0], [0.05, 1.2, -7.0], [1.5e-4, 2.5e-4, 1.0]])
    points = rng.random((500, 2)) * [1499, 1999]
    mesh = mesh_of_homography(steep, 1500, 2000)
    assert np.abs(mesh_at(mesh, points, 1500, 2000) - transform_points(steep, points)).max() < 0.02
    nodes = np.stack(np.meshgrid(np.linspace(0, 1499, 33), np.linspace(0, 1999, 33)), axis=-1).reshape(-1, 2)
    assert np.abs(mesh_at(mesh, nodes, 1500, 2000) - mesh.reshape(-1, 2)).max() < 1e-9


def test_a_page_point_behind_the_camera_is_not_seen_by_a_homography() -> None:
    there = HomographyMap(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-2e-3, 0.0, 1.0]]), 400, 300)
    before, behind = np.array([[100.0, 50.0]]), np.array([[900.0, 50.0]])
    assert np.allclose(there.photo_to_page(there.page_to_photo(before)), before)
    assert np.isnan(there.page_to_photo(behind)).all()


def test_own_cases_are_all_counts_and_overlaps_and_varied_from_the_start() -> None:
    cases = own_cases(("a", "b"))
    assert len(cases) == len(set(case.name for case in cases)) == 27
    assert {(case.count, case.overlap) for case in cases[:9]} == {(n, o) for n in COUNTS for o in OVERLAPS}
    assert MosaicCase("shared", 2, 0.1, "n2_o10").name == "n2_o10"


def test_bent_sets_are_varied_and_have_names_of_their_own() -> None:
    cases = bent_cases(["one", "two", "three"])
    assert len({case.name for case in cases}) == len(cases) == BENT_SETS * len(BENT)
    assert {case.sheet for case in cases[: len(BENT)]} == set(BENT)
    assert {(case.count, case.overlap) for case in cases} == {(2, 0.4), (4, 0.4), (4, 0.2)}
