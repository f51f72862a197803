"""Views are cropped to the sheet's edges, and left alone where there is none."""

import numpy as np
import pytest

from services.imaging.sheet_edges import SheetEdges
from services.rectify.analysis import analyse_photo
from services.rectify.edge_cropping import crop_frame, crop_to_sheet
from services.rectify.framing import FlatFrame, frame_page
from tests.services.scenes import Album


def test_pixels_of_a_cropped_frame_are_those_of_the_frame() -> None:
    H = np.array([[1.1, 0.02, 5.0], [0.01, 0.9, -3.0], [1e-5, 2e-5, 1.0]])
    frame = FlatFrame(H, 900, 700)
    cropped = crop_frame(frame, SheetEdges(left=49.75, top=None, right=399.75, bottom=299.75), 0.5)
    assert (cropped.width, cropped.height) == (701, 601)
    at = np.array([[0.0, 0.0], [300.0, 200.0]])
    np.testing.assert_allclose(cropped.to_photo(at), frame.to_photo(at + np.array([100.0, 0.0])), atol=1e-9)


def test_edges_beyond_the_frame_do_not_enlarge_it() -> None:
    frame = FlatFrame(np.eye(3), 90, 70)
    cropped = crop_frame(frame, SheetEdges(-5.0, -1.0, 200.0, 99.0))
    assert (cropped.width, cropped.height) == (90, 70)
    np.testing.assert_array_equal(cropped.to_photo(np.zeros((1, 2))), [[0.0, 0.0]])
    senseless = SheetEdges(left=60.0, right=20.0)
    assert crop_frame(frame, senseless) is frame


@pytest.mark.parametrize("name", ["dirty", "columns", "picture"])
def test_a_photo_of_the_inside_of_a_page_is_shown_whole(album: Album, name: str) -> None:
    shot = album[name]
    height, width = shot.photo.image.shape[:2]
    # Of a page that fills the photo, this part shows no edge.
    inside = np.ascontiguousarray(
        shot.photo.image[
            round(0.25 * height) : round(0.7 * height), round(0.25 * width) : round(0.75 * width)
        ]
    )
    analysis = analyse_photo(inside)
    shape = (inside.shape[0], inside.shape[1])
    frame = frame_page(np.eye(3), shape, analysis.characters, analysis.text_height_px, None)
    cropped = crop_to_sheet(inside, frame, analysis, None)
    assert (cropped.width, cropped.height) == (frame.width, frame.height)


def test_a_sheet_that_is_seen_whole_keeps_its_frame(album: Album) -> None:
    shot = album["dirty"]
    outline = shot.analysis.paper.outline(shot.analysis.characters)
    frame = FlatFrame(np.eye(3), shot.photo.image.shape[1], shot.photo.image.shape[0])
    assert outline is not None
    assert crop_to_sheet(shot.photo.image, frame, shot.analysis, outline) is frame
