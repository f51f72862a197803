"""One bent sheet for photos of its parts: when it is found, and how well it joins them."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest

from benchmarks.common.residuals import similarity_residual
from services.arrays import GrayImage, Points
from services.geometry.focal_prior import FocalPrior
from services.geometry.homographies import transform_points
from services.geometry.photo_frame import PhotoFrame
from services.mosaic import flattening
from services.mosaic.flat_photo import FlatPhoto, SeenPage
from services.mosaic.placing.joint_sheet import JointSheet
from services.mosaic.placing.parts_sheet import find_sheet_of_parts
from services.mosaic.placing.placed_part import place_photos
from services.mosaic.placing.placement import Placement
from services.mosaic.registration.pair_registration import PairRegistration
from services.sheet.curved_page import CurvedPage, describe_strips
from services.sheet.developable.fitting import FittedSurface, SurfaceStart
from services.sheet.evidence import PageEvidence
from services.sheet.framing import frame_curved_page
from services.sheet.shared_sheet import SharedSheet
from services.sheet.tracing.page_text import TracedText
from tests.services.mosaic.placing.test_joint_sheet import POINTS
from tests.services.sheet.developable.sheets import box
from tests.services.sheet.test_shared_sheet import (
    BENDS,
    LOWER,
    UPPER,
    part_of,
    see,
    shared_sheet,
)

pytestmark = pytest.mark.pipeline

VIEW = PhotoFrame(1020, 1360)
TEXT_HEIGHT_PX = 12.0
COMMON = box(0.4, 0.09, 17, 13)
CHANGE = np.array([0.3, -0.2, 0.2, 0.2, -0.2, 0.2, -0.3, 0.2])


def flat_photo(index: int, true: SharedSheet, page: Points, taken: SharedSheet) -> FlatPhoto:
    """A photo of the `page` points of the `true` sheet, whose own surface is that of the sheet it is `taken` for."""
    seen = see(true, index, page)
    characters = VIEW.to_photo(seen)
    surface = taken.surface(taken.cameras[index])
    blank: GrayImage = np.full((8, 8), 255, np.uint8)
    text = TracedText(blank, blank < 0, blank < 0, 8 / VIEW.width, characters, TEXT_HEIGHT_PX)
    part = part_of(true, index, page).observed
    start = SurfaceStart(surface.rotation, surface.anchor, surface.basis, np.zeros(5))
    fitted = FittedSurface(surface, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.1, start)
    strips = describe_strips(surface, VIEW, seen, 4)
    shape = CurvedPage(surface, strips, "assumed", 9, 0.0, 0.0, (), fitted, part.lines)
    evidence = PageEvidence(text, VIEW, part.major, part.minor, POINTS, has_strokes=False)
    frame = frame_curved_page(surface, VIEW, characters, TEXT_HEIGHT_PX, None)
    flat = FlatPhoto(
        index,
        np.zeros((VIEW.height, VIEW.width, 3), np.uint8),
        frame,
        np.zeros((8, 8), np.uint8),
        np.ones((8, 8), bool),
        TEXT_HEIGHT_PX,
        1.0,
        900.0,
    )
    return replace(flat, page=SeenPage(shape, evidence, FocalPrior(part.log_focal, 0.1, "assumed")))


def pair_of(
    true: Sequence[SharedSheet], taken: Sequence[SharedSheet]
) -> tuple[dict[int, FlatPhoto], PairRegistration]:
    """An upper and a lower photo, and what they share."""
    photos = {k: flat_photo(k, true[k], page, taken[k]) for k, page in enumerate((UPPER, LOWER))}
    matched = [photos[k].frame.to_flat(VIEW.to_photo(see(true[k], k, COMMON))) for k in photos]
    H, _ = cv2.findHomography(matched[1], matched[0])
    H_a_b = np.asarray(H, np.float64)
    weights = np.ones(len(COMMON))
    return photos, PairRegistration(0, 1, H_a_b, matched[0], matched[1], weights, 900, 300, 9, 1.0)


def with_prior(flat: FlatPhoto, off: float) -> FlatPhoto:
    """The photo with a focal length before it is seen that is `off` from the true one, in its deviations."""
    assert flat.page is not None
    prior = flat.page.focal_prior
    moved = replace(prior, log_focal=prior.log_focal - off * prior.deviation)
    return replace(flat, page=replace(flat.page, focal_prior=moved))


def sheet_of(
    true: Sequence[SharedSheet], taken: Sequence[SharedSheet]
) -> tuple[JointSheet | None, dict[int, FlatPhoto], dict[int, Placement]]:
    """The sheet of an upper and a lower photo; and the photos as they are placed by homographies."""
    photos, pair = pair_of(true, taken)
    placements = {0: Placement(np.eye(3)), 1: Placement(pair.H_a_b)}
    return find_sheet_of_parts(photos, (pair,), placements), photos, placements


def test_the_sheet_joins_what_the_photos_own_surfaces_bend_apart() -> None:
    true = shared_sheet()
    taken = shared_sheet(BENDS + CHANGE, (1.36, 1.5)), shared_sheet(BENDS - CHANGE, (1.3, 1.42))
    found, photos, placements = sheet_of((true, true), taken)
    assert found is not None
    assert (found.kind, found.fitted) == ("smooth", True)
    assert found.residual < 0.02
    page = np.concatenate([UPPER, LOWER])
    before, after = [], []
    for k, part in enumerate((UPPER, LOWER)):
        shown = VIEW.to_photo(see(true, k, part))
        before.append(placements[k].to_mosaic(photos[k].frame.to_flat(shown)))
        view = found.views[k]
        after.append(transform_points(found.H_world_page[k] @ view.H_page_flat, view.to_flat(shown)))
    own, joint = (similarity_residual(np.concatenate(each), page) for each in (before, after))
    assert joint < 0.2 * own
    # The cameras see the mesh where the photos show the sheet.
    for k, camera in found.cameras.items():
        centred = see(true, k, COMMON)
        X = found.mesh.place(found.mesh.locate(see(true, 0, COMMON))).X
        assert np.nanmax(np.linalg.norm(camera.project(X) - centred, axis=1)) < 2e-3


def test_photos_are_laid_on_the_sheet_whatever_the_size_of_their_views(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    true = shared_sheet()
    photos, pair = pair_of((true, true), (true, shared_sheet(BENDS + CHANGE)))
    monkeypatch.setattr(flattening, "VIEW_PIXELS", 1e5)
    part = place_photos(photos, (pair,), None)
    assert part.joint is not None
    assert max(photo.frame.width * photo.frame.height for photo in part.photos.values()) < 1.1e5
    ends = [
        part.placements[k].to_mosaic(part.photos[k].frame.to_flat(VIEW.to_photo(see(true, k, COMMON))))
        for k in (0, 1)
    ]
    assert np.abs(ends[0] - ends[1]).max() < 0.1


def test_a_page_that_was_bent_between_the_photos_is_not_one_sheet() -> None:
    other = shared_sheet(BENDS + 6 * CHANGE)
    true = shared_sheet()
    found, _, _ = sheet_of((true, other), (true, other))
    assert found is None


def test_a_sheet_before_a_lens_that_nobody_has_is_not_believed() -> None:
    """A long lens and a leaning sheet leave points and lines nearly as they are, and a stretched page."""
    true = shared_sheet()
    photos, pair = pair_of((true, true), (true, true))
    placements = {0: Placement(np.eye(3)), 1: Placement(pair.H_a_b)}
    found = []
    for off in (2.0, 5.0):
        known = {k: with_prior(photo, off) for k, photo in photos.items()}
        found.append(find_sheet_of_parts(known, (pair,), placements) is not None)
    assert found == [True, False]


def test_photos_without_a_bend_stay_as_they_are() -> None:
    true = shared_sheet()
    _, photos, placements = sheet_of((true, true), (true, true))
    assert find_sheet_of_parts({k: replace(p, page=None) for k, p in photos.items()}, (), placements) is None
    assert find_sheet_of_parts({}, (), {}) is None
