"""Views that end at given points of the photo, what lies around a view, and turns against the photo."""

from dataclasses import dataclass

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from services.arrays import Homography, Points
from services.geometry.page_frame import Frame, mesh_of, turn_against_photo, turn_frame
from services.rectify.view.held_corners import end_at_corners, hold_corners, with_margin
from services.sheet.plane.framing import FlatFrame

SQUARE = np.array([[200.0, 150.0], [700.0, 150.0], [700.0, 850.0], [200.0, 850.0]])
NUDGES = st.lists(st.floats(-90, 90), min_size=8, max_size=8)
TURNS = st.floats(0, 2 * np.pi)


def turned(angle: float) -> FlatFrame:
    c, s = np.cos(angle), np.sin(angle)
    H = np.array([[c, -s, 450 - 450 * c + 500 * s], [s, c, 500 - 450 * s - 500 * c], [0.0, 0.0, 1.0]])
    return FlatFrame(H, 900, 1000)


@settings(deadline=None)
@given(NUDGES, TURNS, st.integers(0, 3))
def test_the_views_corners_are_the_given_ones(nudges: list[float], angle: float, first: int) -> None:
    corners = np.roll(SQUARE + np.reshape(nudges, (4, 2)), first, axis=0)
    frame = end_at_corners(turned(angle), corners)
    for quarter in range(4):
        mesh = mesh_of(turn_frame(frame, 90 * quarter, mirrored=False))
        seen = mesh[[0, 0, -1, -1], [0, -1, -1, 0]]
        assert np.abs(seen - np.roll(corners, quarter, axis=0)).max() < 1e-6


@settings(deadline=None)
@given(NUDGES, st.integers(0, 3))
def test_a_wider_view_shows_them_as_a_rectangle_from_the_first_on(nudges: list[float], first: int) -> None:
    corners = np.roll(SQUARE + np.reshape(nudges, (4, 2)) / 4, first, axis=0)
    at = hold_corners(turned(0.2), corners).to_flat(corners)
    assert np.abs(at[[0, 1]][:, 1] - at[0, 1]).max() < 1e-6
    assert np.abs(at[[1, 2]][:, 0] - at[1, 0]).max() < 1e-6
    assert (at[0] < at[2]).all()


@settings(deadline=None)
@given(TURNS)
def test_the_turn_against_the_photo_is_that_of_the_view(angle: float) -> None:
    found = turn_against_photo(mesh_of(turned(angle)))
    assert abs((found + np.degrees(angle) + 180) % 360 - 180) < 1e-6
    quarter = turn_against_photo(mesh_of(turn_frame(turned(angle), 90, mirrored=False)))
    assert abs((quarter - found - 90 + 180) % 360 - 180) < 1e-6
    mirrored = turn_frame(turned(angle), 0, mirrored=True)
    assert 0 <= turn_against_photo(mesh_of(mirrored)) < 360


def test_a_margin_shows_what_lies_around_and_bent_pages_go_on_straight() -> None:
    flat = end_at_corners(turned(0.1), SQUARE)
    wide = with_margin(flat, 10.0)
    edge = round(0.1 * flat.width)
    assert (wide.width, wide.height) == (flat.width + 2 * edge, flat.height + 2 * edge)
    inner = np.array([[0.0, 0.0], [37.5, 81.25], [flat.width - 1.0, flat.height - 1.0]])
    assert np.allclose(wide.to_photo(inner + edge), flat.to_photo(inner))

    assert with_margin(flat, 0.0) is flat
    around = with_margin(BentFrame(flat), 10.0)
    beyond = np.array([[-30.0, 200.0], [flat.width + 20.0, flat.height + 25.0]])
    assert np.allclose(around.to_photo(beyond + edge), flat.to_photo(beyond), atol=1.0)
    assert np.allclose(around.to_photo(inner + edge), flat.to_photo(inner))


@dataclass(frozen=True)
class BentFrame:
    """A view as of a bent page: no homography, and nothing beyond its border."""

    inner: Frame
    H_photo_flat: None = None

    @property
    def width(self) -> int:
        return self.inner.width

    @property
    def height(self) -> int:
        return self.inner.height

    def to_photo(self, pixels: Points) -> Points:
        inside = ((pixels >= 0) & (pixels <= [self.width - 1, self.height - 1])).all(axis=1)
        return np.where(inside[:, None], self.inner.to_photo(pixels), np.nan)

    def to_flat(self, photo: Points) -> Points:
        return self.inner.to_flat(photo)

    def through(self, H_old_new: Homography, width: int, height: int) -> "BentFrame":
        raise AssertionError("a bent view is not asked for another one")
