"""One bent sheet before several cameras: what they see of it, and the fit to what each shows of a part."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.common.residuals import similarity_residual
from services.arrays import Points, Vector
from services.sheet.developable.observations import LineObservations, PageObservations
from services.sheet.developable.print_residuals import FittingParameters
from services.sheet.ridged.views import CAMERA_UNKNOWNS, OtherCamera
from services.sheet.shared_fit import SeenPart, SharedPoints, _SheetResiduals, fit_shared_sheet
from services.sheet.shared_sheet import OF_BENDS, SharedSheet, hold_camera, unit_of
from services.texture_flow.field import FlowSamples
from tests.services.sheet.developable.sheets import BASIS, SLANT_RAD, box, differences

pytestmark = pytest.mark.pipeline

BENDS = np.array([0.4, 0.8, 1.2, 0.6, -0.4, -1.0, -0.6, 0.2])
FOCALS = (1.3, 1.5)
UPPER, LOWER = (box(0.45, 0.32, rows=9) + np.array([0.0, shift]) for shift in (-0.22, 0.22))
COMMON = box(0.4, 0.08, rows=5)


def shared_sheet(bends: Vector = BENDS, focals: tuple[float, float] = FOCALS) -> SharedSheet:
    """A sheet before two cameras, of which the second is nearer and leans to another side."""
    turns = Rotation.from_rotvec([[0.2, -0.2, 0.1], [-0.25, 0.15, -0.05]]).as_matrix()
    cameras = (
        OtherCamera(turns[0], np.array([0.05, 0.15, 1.3]), focals[0]),
        OtherCamera(turns[1], np.array([-0.02, -0.2, 1.1]), focals[1]),
    )
    sheet = SharedSheet(0.1, (0.15, 0.05), SLANT_RAD, bends, BASIS, ())
    places = ((0.0, -0.2), (0.05, 0.2))
    held = tuple(hold_camera(sheet, camera, place) for camera, place in zip(cameras, places, strict=True))
    return replace(sheet, held=held)


def see(sheet: SharedSheet, number: int, page: Points) -> Points:
    """Where camera `number` sees points (N, 2) of the page."""
    camera = sheet.cameras[number]
    return sheet.surface(camera).to_photo(page / unit_of(camera))


def on_page(sheet: SharedSheet, number: int, seen: Points) -> Points:
    """The points of the page that camera `number` sees at photo points (N, 2)."""
    camera = sheet.cameras[number]
    return sheet.surface(camera).to_page(seen) * unit_of(camera)


def part_of(sheet: SharedSheet, number: int, page: Points) -> SeenPart:
    """Lines of nine points that camera `number` shows of its part of the page, and its focal length, loosely."""
    none = FlowSamples(np.zeros((0, 2)), np.zeros(0), np.zeros(0))
    seen = see(sheet, number, page)
    index = np.repeat(np.arange(len(page) // 9), 9)
    lines = LineObservations(seen, index, np.full(len(seen), 2e-4), [], [], [], 0.02)
    log_focal = float(np.log(FOCALS[number]))
    observed = PageObservations(none, none, lines, seen[:3], log_focal, 0.1)
    return SeenPart(observed, FittingParameters(cauchy_flows=True), number)


def test_all_cameras_see_one_sheet() -> None:
    sheet = shared_sheet()
    in_space = []
    for number, camera in enumerate(sheet.cameras):
        seen = see(sheet, number, COMMON)
        assert np.abs(on_page(sheet, number, seen) - COMMON).max() < 1e-6
        X = sheet.surface(camera).unroll(seen).X * unit_of(camera)
        in_space.append((X - camera.translation) @ camera.rotation)
        assert np.abs(camera.project(in_space[-1]) - seen).max() < 1e-6
    assert np.abs(in_space[0] - in_space[1]).max() < 1e-5
    # And each sees its held point where it is held.
    for number, held in enumerate(sheet.held):
        assert np.abs(see(sheet, number, np.array([held.held])) - held.anchor).max() < 1e-6


def test_a_change_of_shape_keeps_what_a_camera_sees_of_its_held_point() -> None:
    sheet = shared_sheet()
    step = np.zeros(OF_BENDS + len(BENDS) + 2 * CAMERA_UNKNOWNS)
    step[: OF_BENDS + 3] = [0.05, 0.1, -0.05, 0.0, 0.5, -0.5, 0.4]
    moved = sheet.moved(step)
    for number, held in enumerate(sheet.held):
        assert np.abs(see(moved, number, np.array([held.held])) - held.anchor).max() < 1e-6


@pytest.mark.parametrize("number", [0, 1])
def test_derivatives_of_the_page(number: int) -> None:
    sheet = shared_sheet()
    parts = [part_of(sheet, 0, UPPER), part_of(sheet, 1, LOWER)]
    residuals = _SheetResiduals(sheet, parts, [])

    def page(x: Vector) -> Points:
        moved = sheet.moved(x)
        seen = moved.cameras[number], moved.motions()[number]
        return residuals._page(moved, number, *seen)[0]

    x = np.zeros(residuals.unknowns)
    slow = differences(page, x)[..., residuals._columns(number)]
    exact = residuals._page(sheet, number, sheet.cameras[number], sheet.motions()[number])[1]
    size = np.abs(slow).max(axis=(0, 1))
    assert np.all(np.abs(exact - slow).max(axis=(0, 1)) < 0.02 * size + 1e-3)


def test_parts_with_common_points_show_the_sheet_that_none_shows_alone() -> None:
    true = shared_sheet()
    parts = [part_of(true, 0, UPPER), part_of(true, 1, LOWER)]
    shared = [SharedPoints(0, 1, see(true, 0, COMMON), see(true, 1, COMMON), 1e-4)]
    change = np.array([0.5, -0.5, 0.3, 0.3, 0.4, -0.3, 0.5, -0.4])
    start = shared_sheet(BENDS + change, (1.35, 1.42))
    fitted = fit_shared_sheet(start, parts, shared)

    def error(sheet: SharedSheet) -> float:
        both = [on_page(sheet, k, see(true, k, page)) for k, page in enumerate((UPPER, LOWER))]
        return similarity_residual(np.concatenate(both), np.concatenate([UPPER, LOWER]))

    assert error(start) > 0.01
    assert error(fitted.sheet) < 0.1 * error(start)
    assert fitted.evaluations < 80
    alone = fit_shared_sheet(start, parts, [])
    assert error(alone.sheet) > 2 * error(fitted.sheet)
    # The first camera holds the unit and the place of the sheet.
    assert fitted.sheet.held[0].unit == pytest.approx(start.held[0].unit)


def test_photos_of_one_camera_have_one_focal_length() -> None:
    true = shared_sheet(focals=(1.4, 1.4))
    parts = [replace(part_of(true, k, page), camera="phone") for k, page in enumerate((UPPER, LOWER))]
    shared = [SharedPoints(0, 1, see(true, 0, COMMON), see(true, 1, COMMON), 1e-4)]
    start = shared_sheet(focals=(1.35, 1.5))
    one = [held.focal for held in fit_shared_sheet(start, parts, shared).sheet.held]
    assert one[0] == pytest.approx(one[1], rel=1e-12)
    assert one[0] == pytest.approx(1.4, rel=0.01)
    two = [replace(part, camera=k) for k, part in enumerate(parts)]
    own = [held.focal for held in fit_shared_sheet(start, two, shared).sheet.held]
    assert own[0] != pytest.approx(own[1], rel=1e-9)
