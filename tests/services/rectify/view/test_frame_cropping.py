"""A cropped view shows the same pixels as the view it was cropped from."""

import numpy as np

from services.imaging.sheet_edges import SheetEdges
from services.rectify.view.sheet_cut import crop_frame
from services.sheet.plane.framing import FlatFrame


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
