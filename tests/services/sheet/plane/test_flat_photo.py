"""The view of a photo that is the page: its own pixels, a quarter turn, a small turn, a page that keeps its size."""

import numpy as np
import pytest

from services.geometry.photo_frame import PhotoFrame
from services.sheet.plane.flat_photo import PhotoAsPage

VIEW = PhotoFrame(301, 201)
TEXT = np.array([[100.0, 80.0], [200.0, 120.0]])
WHOLE = (0, 0, 300, 200)


def corners_shown(shape: PhotoAsPage) -> tuple[np.ndarray, tuple[int, int]]:
    """Photo points (4, 2) at the corners of the view, and its size."""
    frame = shape.frame(VIEW, TEXT, 10.0, None, "sheet")
    width, height = frame.width, frame.height
    ends = np.array([[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1]], np.float64)
    return frame.to_photo(ends), (width, height)


def test_without_a_turn_pixels_are_those_of_the_photo() -> None:
    frame = PhotoAsPage(0.0, 1.2, WHOLE).frame(VIEW, TEXT, 10.0, None, "sheet")
    np.testing.assert_array_equal(frame.H_photo_flat, np.eye(3))
    assert (frame.width, frame.height) == (301, 201)


def test_slivers_are_cut_at_whole_pixels_and_kept_in_the_photo_around() -> None:
    shape = PhotoAsPage(0.0, 1.2, (3, 5, 290, 199))
    shown, size = corners_shown(shape)
    np.testing.assert_array_equal(shown, [[3, 5], [290, 5], [290, 199], [3, 199]])
    assert size == (288, 195)
    around = shape.frame(VIEW, TEXT, 10.0, None, "photo")
    assert (around.width, around.height) == (301, 201)


def test_a_quarter_turn_is_exact() -> None:
    shown, size = corners_shown(PhotoAsPage(-np.pi / 2, 1.2, WHOLE))
    assert size == (201, 301)
    np.testing.assert_allclose(shown, [[0, 200], [0, 0], [300, 0], [300, 200]], atol=1e-9)


@pytest.mark.parametrize("turn_rad", [0.03, -0.1])
def test_a_turned_page_is_shown_whole(turn_rad: float) -> None:
    frame = PhotoAsPage(turn_rad, 1.2, WHOLE).frame(VIEW, TEXT, 10.0, None, "sheet")
    sheet = frame.to_flat(np.array([[0, 0], [300, 0], [300, 200], [0, 200]], np.float64))
    low, high = sheet.min(axis=0), sheet.max(axis=0)
    assert (low > -1).all()
    assert (low < 1).all()
    assert (high < [frame.width, frame.height]).all()
    # A line along the turned axis is level.
    step = frame.to_flat(np.array([[100.0, 50.0]]) + 10 * np.array([[np.cos(turn_rad), np.sin(turn_rad)]]))
    assert step[0, 1] == pytest.approx(frame.to_flat(np.array([[100.0, 50.0]]))[0, 1], abs=1e-9)


@pytest.mark.parametrize(("turn_rad", "size"), [(0.05, (301, 201)), (np.pi / 2 + 0.05, (201, 301))])
def test_a_page_of_a_document_keeps_its_size(turn_rad: float, size: tuple[int, int]) -> None:
    frame = PhotoAsPage(turn_rad, 1.2, WHOLE, keeps_size=True).frame(VIEW, TEXT, 10.0, None, "sheet")
    assert (frame.width, frame.height) == size
    np.testing.assert_allclose(
        frame.to_photo(np.array([[(size[0] - 1) / 2, (size[1] - 1) / 2]])), [[150, 100]]
    )


def test_without_a_box_the_view_is_framed_as_a_planes() -> None:
    shape = PhotoAsPage(0.0, 1.2, None)
    assert not shape.ends_at_sides
    text = shape.frame(VIEW, TEXT, 4.0, None, "text")
    assert text.width < 150
    assert text.height < 80
