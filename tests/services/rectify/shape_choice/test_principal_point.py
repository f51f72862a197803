"""A cropped photo shows where its middle was; one that was not cropped keeps it."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.geometry.focal_prior import FocalPrior
from services.geometry.photo_frame import PhotoFrame
from services.rectify.analysis.focal_length import focal_prior
from services.rectify.analysis.page_analysis import analyse_photo
from services.rectify.analysis.photo_border import find_cut_borders, leave_out_borders
from services.rectify.shape_choice.principal_point import (
    aspect_cost,
    cut_border,
    find_principal_point,
    original_size,
    prior_at,
)
from services.sheet.evidence import PageEvidence
from services.sheet.outline.results import SheetOutline, SheetSide
from services.sheet.plane.planar_page import PlanarPage
from services.sheet.plane.pose import choose_pose
from services.texture_flow.vanishing_points import estimate_vanishing_points
from simulation.pages import own_pages
from simulation.photo import SimulatedPhoto
from simulation.scenes import POSES, photograph

pytestmark = pytest.mark.pipeline

CROPS = {"left": (0.25, 0.0, 0.0), "below": (0.0, 0.0, 0.2)}
"""Shares of the width cut from the left and from the right, of the height from below."""


@lru_cache(maxsize=1)
def photo() -> SimulatedPhoto:
    """A page of text, 840 x 1080 px."""
    return photograph(own_pages(640, 1000)[0], POSES[0], 0.0, size=(840, 1080))


@lru_cache(maxsize=3)
def evidence_of(crop: tuple[float, float, float]) -> tuple[PageEvidence, np.ndarray]:
    """What a part of the photo shows, and the offset of the true principal point from its middle, in pixels."""
    image = photo().image
    height, width = image.shape[:2]
    left, right, foot = round(crop[0] * width), round(crop[1] * width), round(crop[2] * height)
    part = np.ascontiguousarray(image[: height - foot, left : width - right])
    view, analysis = PhotoFrame(part.shape[1], part.shape[0]), analyse_photo(part)
    true = photo().truth.camera.principal_point - [left, 0] - view.centre
    return analysis.evidence(view), true


def pose_of(e: PageEvidence, prior: FocalPrior) -> PlanarPage:
    """The plane under the photo's middle."""
    return choose_pose(e, prior)


def test_a_plane_shows_how_much_was_cut_from_a_side() -> None:
    e, true = evidence_of(CROPS["left"])
    prior = focal_prior(e.view, None, photo().truth.focal_length_px)
    moved = find_principal_point(e, prior, pose_of(e, prior))
    assert moved is not None
    found = np.array(moved.evidence.view.centre) - e.view.centre
    assert np.abs(found - true).max() < 0.2 * np.abs(true).max()
    # The text is where it was in the photo.
    again = moved.evidence.view.to_photo(moved.evidence.major.points)
    np.testing.assert_allclose(again, e.view.to_photo(e.major.points))


def test_the_focal_length_may_be_known_as_a_share_of_the_diagonal() -> None:
    e, true = evidence_of(CROPS["left"])
    whole = np.hypot(photo().truth.camera.width, photo().truth.camera.height)
    share = photo().truth.focal_length_px / whole * 2 * e.view.unit_px
    prior = replace(focal_prior(e.view, None, share), of_diagonal=True)
    moved = find_principal_point(e, prior, pose_of(e, prior))
    assert moved is not None
    assert (
        np.abs(np.array(moved.evidence.view.centre) - e.view.centre - true).max() < 0.2 * np.abs(true).max()
    )
    known = np.exp(moved.prior.log_focal) * e.view.unit_px
    assert known == pytest.approx(photo().truth.focal_length_px, rel=0.03)


@pytest.mark.parametrize("known", [True, False])
def test_a_whole_photo_keeps_its_middle(known: bool) -> None:
    e, _ = evidence_of((0.0, 0.0, 0.0))
    prior = focal_prior(e.view, photo().truth.focal_length_px if known else None, None)
    assert find_principal_point(e, prior, pose_of(e, prior)) is None


@pytest.mark.parametrize("share", [0.6, 1.4])
def test_a_wrong_focal_length_in_exif_does_not_move_the_middle(share: float) -> None:
    e, _ = evidence_of((0.0, 0.0, 0.0))
    prior = focal_prior(e.view, None, share * photo().truth.focal_length_px)
    assert prior.source == "exif"
    pose = pose_of(e, prior)
    moved = find_principal_point(e, prior, pose)
    # Either it was left out of account before, or it is now.
    if moved is None:
        assert pose.focal_source != "exif"
    else:
        assert moved.evidence.view.centre == e.view.centre
        assert moved.prior.source == "assumed"
        assert [notice.code for notice in moved.notices] == ["exif-contradicted"]
    # The same focal length from the client is meant.
    given = focal_prior(e.view, share * photo().truth.focal_length_px, None)
    meant = find_principal_point(e, given, pose_of(e, given))
    assert meant is None or meant.prior.source == "given"


def test_the_middle_comes_back_where_the_sides_had_moved_it_for_a_wrong_focal_length() -> None:
    e, _ = evidence_of((0.0, 0.0, 0.0))
    prior = focal_prior(e.view, None, 0.7 * photo().truth.focal_length_px)
    view = e.view.moved((0.2, 0.0))
    major, minor = (replace(flow, points=flow.points - np.array([0.2, 0.0])) for flow in (e.major, e.minor))
    points = estimate_vanishing_points(major, minor)
    aside = replace(e, view=view, major=major, minor=minor, vanishing_points=points)
    moved = find_principal_point(aside, prior, pose_of(aside, prior))
    assert moved is not None
    assert moved.evidence.view.centre == pytest.approx(e.view.centre)
    assert np.allclose(moved.evidence.major.points, e.major.points)
    assert moved.notices


def test_a_plane_without_known_focal_length_tells_nothing() -> None:
    e, _ = evidence_of(CROPS["left"])
    prior = focal_prior(e.view, None, None)
    assert find_principal_point(e, prior, pose_of(e, prior)) is None


def test_print_runs_up_to_the_border_that_was_cut() -> None:
    for crop, border in (("left", "left"), ("below", "bottom")):
        e, true = evidence_of(CROPS[crop])
        assert find_cut_borders(e.text.characters, e.text.height_px, e.view.width, e.view.height) == {border}
        assert cut_border((float(true[0]), float(true[1]))) == border
    e, _ = evidence_of((0.0, 0.0, 0.0))
    assert find_cut_borders(e.text.characters, e.text.height_px, e.view.width, e.view.height) == set()


def test_the_border_of_the_photo_is_no_side_of_the_sheet() -> None:
    corners = np.array([[20.0, 30.0], [180.0, 25.0], [190.0, 299.0], [10.0, 299.0]])
    rows = [np.linspace(corners[k], corners[(k + 1) % 4], 30) for k in range(4)]
    top, right, bottom, left = (SheetSide(row, np.full(30, 0.3), 1.0, 0.1) for row in rows)
    outline = SheetOutline(corners, (top, right, bottom, left), 0.9, corners)
    assert leave_out_borders(outline, {"left"}, 200, 300).sides == outline.sides
    kept = leave_out_borders(outline, {"bottom"}, 200, 300)
    assert [side.seen for side in kept.sides] == [1.0, 1.0, 0.0, 1.0]
    assert np.isnan(kept.corners).any(axis=1).tolist() == [False, False, True, True]


@given(st.sampled_from([4 / 3, 3 / 2, 16 / 9]), st.floats(0.1, 0.5), st.sampled_from([-1, 1]))
def test_a_camera_s_photo_costs_least_and_a_cropped_one_costs_as_the_original(
    aspect: float, share: float, sign: int
) -> None:
    whole, part = (
        PhotoFrame(3000, round(3000 * aspect)),
        PhotoFrame(round(3000 * (1 - share)), round(3000 * aspect)),
    )
    offset = (sign * 0.5 * (whole.width - part.width) / part.unit_px, 0.0)
    assert original_size(part, offset) == pytest.approx((whole.width, whole.height))
    assert aspect_cost(part, offset) == pytest.approx(aspect_cost(whole, (0.0, 0.0)), abs=1e-6)
    assert aspect_cost(whole, (0.0, 0.0)) < 3.0 < aspect_cost(PhotoFrame(3000, 3050), (0.0, 0.0))
    prior = FocalPrior(0.1, 0.03, "exif", True)
    moved = prior_at(prior, part, offset)
    assert np.exp(moved.log_focal) * part.unit_px / whole.unit_px == pytest.approx(np.exp(0.1))
    assert prior_at(replace(prior, of_diagonal=False), part, offset).log_focal == 0.1
