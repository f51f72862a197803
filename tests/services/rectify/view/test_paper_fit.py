"""A size that the request names gives the view its proportions, where the sheet's sides bound the view."""

import numpy as np
import pytest

from services.arrays import Points
from services.geometry.homographies import transform_points
from services.geometry.photo_frame import PhotoFrame
from services.geometry.planar import PagePlane
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.view.paper_fit import fit_to_paper
from services.sheet.outline.results import SheetOutline, SheetSide
from services.sheet.plane.framing import FlatFrame
from services.sheet.plane.planar_page import PlanarPage

VIEW = PhotoFrame(1200, 1600)
H_PHOTO_FLAT = np.array([[1.1, 0.05, 120.0], [-0.04, 1.0, 90.0], [6e-5, 3e-5, 1.0]])
SQUEEZED = FlatFrame(H_PHOTO_FLAT, 800, 1074)
"""An A4 sheet that is 5 % too short: 210 x 282 mm."""
A4 = 210 / 297


def corners_of(frame: FlatFrame, margin: float = 0.0) -> Points:
    """Of the view in the photo, `margin` pixels of the view within it."""
    right, bottom = frame.width - 1 - margin, frame.height - 1 - margin
    ends = np.array([[margin, margin], [right, margin], [right, bottom], [margin, bottom]])
    return transform_points(frame.H_photo_flat, ends)


def page_of(corners: Points | None, confidence: float = 0.95, **shape: object) -> ShapedPage:
    """A flat page whose sheet has these corners in the photo."""
    flat = PlanarPage(PagePlane(np.eye(3), 1.3), "exif", **shape)  # type: ignore[arg-type]
    if corners is None:
        return ShapedPage(VIEW, flat, ())
    unseen = SheetSide(np.zeros((0, 2)), np.zeros(0), 0.0, 0.0)
    outline = SheetOutline(corners, (unseen, unseen, unseen, unseen), confidence, corners)
    return ShapedPage(VIEW, flat, (), outline)


@pytest.mark.parametrize("first", [0, 1, 2, 3])
def test_a_squeezed_sheet_gets_the_proportions_of_its_size(first: int) -> None:
    corners = np.roll(corners_of(SQUEEZED), first, axis=0)
    frame, stretch = fit_to_paper(SQUEEZED, page_of(corners), "a4")
    assert stretch == pytest.approx(A4 * 1073 / 799, rel=1e-6)
    assert (frame.width, frame.height) == (800, round(1074 / stretch))
    # The view shows the same: its corners stay where they are, but for half a pixel that is now larger.
    assert corners_of(frame) == pytest.approx(corners_of(SQUEEZED), abs=0.1)
    seen = frame.to_flat(corners_of(SQUEEZED))
    assert np.ptp(seen[:, 0]) / np.ptp(seen[:, 1]) == pytest.approx(A4, rel=1e-3)


def test_the_direction_of_a_format_is_that_of_the_sheet_and_no_detail_is_lost() -> None:
    lying = FlatFrame(H_PHOTO_FLAT, 1074, 800)
    frame, stretch = fit_to_paper(lying, page_of(corners_of(lying)), "a4")
    assert stretch == pytest.approx(799 / 1073 / A4, rel=1e-6)
    assert (frame.width, frame.height) == (round(1074 * 799 / 1073 / A4), 800)
    # A size in millimetres is as it was sent; lying on its side this is another sheet.
    assert fit_to_paper(lying, page_of(corners_of(lying)), "210x297") == (lying, None)


def test_a_photo_that_is_the_page_is_bounded_by_its_own_corners() -> None:
    whole = FlatFrame(np.eye(3), VIEW.width, VIEW.height)
    frame, stretch = fit_to_paper(whole, page_of(None, sources=("photo",)), "a4")
    assert stretch == pytest.approx(A4 * 1599 / 1199, rel=1e-6)
    assert frame.width / frame.height == pytest.approx(A4, rel=2e-3)
    assert fit_to_paper(whole, page_of(None), "a4") == (whole, None)


@pytest.mark.parametrize(
    ("corners", "paper"),
    [
        (corners_of(SQUEEZED), "auto"),
        (corners_of(SQUEEZED), "none"),
        (corners_of(SQUEEZED), "100x297"),
        (corners_of(SQUEEZED, 60.0), "a4"),
        (np.where(np.arange(8).reshape(4, 2) < 2, np.nan, corners_of(SQUEEZED)), "a4"),
    ],
    ids=["auto", "none", "another sheet", "sides within the view", "a corner unseen"],
)
def test_a_view_that_the_sheet_does_not_bound_is_left_alone(corners: Points, paper: str) -> None:
    assert fit_to_paper(SQUEEZED, page_of(corners), paper) == (SQUEEZED, None)
