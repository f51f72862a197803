"""The sheet that several photos show: which photo's is taken, and when none is."""

from collections.abc import Mapping
from dataclasses import replace

import cv2
import numpy as np
import pytest

from benchmarks.common.residuals import similarity_residual
from services.arrays import GrayImage, Points
from services.geometry.focal_prior import typical_focal_prior
from services.geometry.homographies import translation
from services.geometry.photo_frame import PhotoFrame
from services.geometry.vanishing_points import FlowVanishingPoints, VanishingPoint
from services.mosaic.evidence import describe_camera, describe_sheet
from services.mosaic.flat_photo import FlatPhoto, SeenPage
from services.mosaic.placing import joint_sheet as joint
from services.mosaic.placing.joint_sheet import JointSheet, find_joint_sheet
from services.mosaic.placing.placement import Placement
from services.mosaic.registration.pair_registration import PairRegistration
from services.sheet.developable.observations import NO_LINES
from services.sheet.evidence import PageEvidence
from services.sheet.framing import frame_mesh
from services.sheet.ridged.mesh import SheetMesh
from services.sheet.ridged_page import RidgedPage
from services.sheet.tracing.page_text import TracedText
from services.texture_flow.field import FlowSamples
from tests.services.sheet.ridged.sheets import CURVED, FOCAL, HEIGHT, WIDTH, Sheet
from tests.services.sheet.ridged.test_views import second_camera

VIEW = PhotoFrame(1020, 1360)
TEXT_HEIGHT_PX = 12.0
PAGE = np.stack(np.meshgrid(np.linspace(-0.35, 0.35, 25), np.linspace(-0.35, 0.35, 33)), axis=-1)
PAGE = PAGE.reshape(-1, 2) * [WIDTH, HEIGHT]
POINTS = FlowVanishingPoints(*(VanishingPoint(np.eye(3)[k], 0.0, 0.0, np.zeros(0, bool)) for k in (0, 1)))
MORE_CURVED, LESS_CURVED = Sheet(radius=0.75), Sheet(radius=1.3)


@pytest.fixture(autouse=True)
def no_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(joint, "trace_by_profiles", lambda *_: NO_LINES)


def flat_photo(index: int, mesh: SheetMesh, seen: Points) -> FlatPhoto:
    """A photo whose page was taken for `mesh`, with characters at `seen` (N, 2), centred."""
    characters = VIEW.to_photo(seen)
    blank: GrayImage = np.full((8, 8), 255, np.uint8)
    text = TracedText(blank, blank < 0, blank < 0, 8 / VIEW.width, characters, TEXT_HEIGHT_PX)
    flow = FlowSamples(np.zeros((0, 2)), np.zeros(0), np.zeros(0))
    evidence = PageEvidence(text, VIEW, flow, flow, POINTS, has_strokes=False)
    page = SeenPage(RidgedPage(mesh, mesh, "assumed"), evidence, typical_focal_prior())
    frame = frame_mesh(mesh, mesh, VIEW, characters)
    size = frame.height, frame.width
    photo = np.zeros((VIEW.height, VIEW.width, 3), np.uint8)
    return FlatPhoto(
        index,
        photo,
        frame,
        np.zeros(size, np.uint8),
        np.ones(size, bool),
        TEXT_HEIGHT_PX,
        1.0,
        900.0,
        page=page,
    )


def joint_sheet(
    taken: Mapping[int, SheetMesh], shown: Mapping[int, Points], *, apart_px: float = 5.0
) -> JointSheet | None:
    """The joint sheet of two photos that were taken for these meshes, and show the points of `PAGE` at `shown`.

    Views laid on each other by homographies disagree by `apart_px`.
    """
    photos = {k: flat_photo(k, taken[k], shown[k]) for k in taken}
    flat = {k: photos[k].frame.to_flat(VIEW.to_photo(shown[k])) for k in taken}
    known = np.isfinite(flat[0]).all(axis=1) & np.isfinite(flat[1]).all(axis=1)
    matched = flat[0][known], flat[1][known]
    pair = PairRegistration(0, 1, np.eye(3), *matched, np.ones(len(matched[0])), 900, 300, 9, 1.0)
    laid, _ = cv2.findHomography(matched[1], matched[0])
    placements = {0: Placement(np.eye(3)), 1: Placement(translation(apart_px, 0.0) @ laid)}
    return find_joint_sheet(photos, (pair,), placements)


def two_photos(
    second: Sheet = CURVED, wrong: Sheet = MORE_CURVED
) -> tuple[dict[int, SheetMesh], dict[int, Points]]:
    """Meshes of two photos, and what they show of the page: the second shows `second`, and was taken for `wrong`."""
    camera = second_camera()
    taken = {0: CURVED.mesh(49), 1: camera.see(wrong.mesh(49))}
    return taken, {0: CURVED.see(PAGE), 1: camera.project(second.place(PAGE))}


def test_the_sheet_that_the_other_camera_can_see_is_taken() -> None:
    taken, shown = two_photos()
    found = joint_sheet(taken, shown)
    assert found is not None
    assert (found.reference, found.fitted) == (0, False)
    assert found.residual < 0.01
    # The other photo is flattened by its camera before that sheet, and not by its own.
    flat = {k: found.views[k].to_flat(VIEW.to_photo(shown[k])) for k in (0, 1)}
    assert np.nanmax(np.abs(flat[1] - flat[0])) < 0.1
    true = second_camera()
    turn = found.cameras[1].rotation @ true.rotation.T
    assert np.degrees(np.arccos((np.trace(turn) - 1) / 2)) < 0.2


def test_the_order_of_the_photos_does_not_matter() -> None:
    taken, shown = two_photos()
    found = joint_sheet({0: taken[1], 1: taken[0]}, {0: shown[1], 1: shown[0]})
    assert found is not None
    assert found.reference == 1


def test_where_no_photo_has_the_right_sheet_all_together_show_it() -> None:
    _, shown = two_photos()
    camera = second_camera()
    found = joint_sheet({0: LESS_CURVED.mesh(25), 1: camera.see(MORE_CURVED.mesh(25))}, shown)
    assert found is not None
    assert found.fitted
    assert found.residual < 0.05
    mesh = found.mesh if found.reference == 0 else None
    flat = found.views[0].to_flat(VIEW.to_photo(shown[0]))
    before = LESS_CURVED.mesh(25).to_page(shown[0])
    assert mesh is None or similarity_residual(flat, PAGE) < 0.3 * similarity_residual(before, PAGE)


def test_a_page_that_was_bent_between_the_photos_has_no_joint_sheet() -> None:
    taken, shown = two_photos(second=LESS_CURVED, wrong=LESS_CURVED)
    # Each photo was flattened rightly, so the views agree.
    assert joint_sheet(taken, shown, apart_px=0.0) is None


def test_a_photo_that_shows_more_than_the_sheet_is_not_laid_on_it() -> None:
    _, shown = two_photos()
    narrow = CURVED.mesh(49)
    half = SheetMesh(narrow.nodes[:, :25], FOCAL, narrow.step, narrow.aspect, narrow.origin)
    assert joint_sheet({0: half, 1: half}, shown) is None


def test_photos_without_a_page_have_no_joint_sheet() -> None:
    taken, shown = two_photos()
    photos = {k: replace(flat_photo(k, taken[k], shown[k]), page=None) for k in taken}
    assert find_joint_sheet(photos, (), {}) is None


def test_the_answer_tells_where_each_camera_sees_the_sheet() -> None:
    taken, shown = two_photos()
    found = joint_sheet(taken, shown)
    assert found is not None
    photos = {k: flat_photo(k, taken[k], shown[k]) for k in taken}
    sheet = describe_sheet(found)
    assert (sheet.kind, sheet.reference, sheet.columns) == ("creased", 0, 25)
    nodes = np.array(sheet.nodes).reshape(-1, 3)
    u, v = np.meshgrid(
        np.linspace(-WIDTH / 2, WIDTH / 2, sheet.columns), np.linspace(-HEIGHT / 2, HEIGHT / 2, sheet.rows)
    )
    page = np.stack([u.ravel(), v.ravel()], axis=1)
    true = {0: CURVED.see(page), 1: second_camera().project(CURVED.place(page))}
    for k, seen in true.items():
        camera = describe_camera(found, photos[k])
        x, y, z = (nodes @ np.array(camera.rotation).T + camera.translation).T
        at = np.stack([x / z, y / z], axis=1) * camera.focal_length_px + camera.principal_point
        assert np.abs(at - VIEW.to_photo(seen)).max() < 1.0
