"""Frames hold the text and the sheet, and their maps agree with what NumPy does to pictures."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from services.arrays import Homography, Points
from services.geometry.camera import plane_to_image
from services.geometry.homographies import scaling, transform_points, translation
from services.geometry.page_frame import MAX_GROWTH, mesh_of, resize_frame, turn_frame
from services.sheet.plane import framing
from services.sheet.plane.framing import FlatFrame, frame_page

SHAPE = (1350, 1050)
CENTRE = (524.5, 674.5)


def lean(
    tilt_deg: float, azimuth_deg: float = 60.0, roll_deg: float = 5.0, focal_px: float = 1300.0
) -> Homography:
    """H_photo_plane of a page that leans away."""
    angles = [roll_deg - azimuth_deg, tilt_deg, azimuth_deg]
    R = Rotation.from_euler("zyz", angles, degrees=True).as_matrix()
    return np.asarray(translation(*CENTRE) @ plane_to_image(R, focal_px))


def print_on(H_photo_plane: Homography, half: tuple[float, float] = (260.0, 380.0)) -> Points:
    """Photo points (N, 2) of characters on a block of the plane."""
    x, y = np.meshgrid(np.linspace(-half[0], half[0], 25), np.linspace(-half[1], half[1], 33))
    return transform_points(H_photo_plane, np.stack([x.ravel(), y.ravel()], axis=1))


def seen_in(frame: FlatFrame, photo_points: Points) -> Points:
    """Output pixels of photo points."""
    return transform_points(np.linalg.inv(frame.H_photo_flat), photo_points)


@pytest.mark.parametrize("tilt_deg", [0.0, 20.0, 40.0, 55.0])
@pytest.mark.parametrize("azimuth_deg", [0.0, 60.0, 90.0, 200.0])
def test_all_text_is_in_the_frame_with_its_margin(tilt_deg: float, azimuth_deg: float) -> None:
    H = lean(tilt_deg, azimuth_deg)
    text = print_on(H)
    frame = frame_page(H, SHAPE, text, 10.0, None)
    flat = seen_in(frame, text)
    # A character near the middle of the text is 10 px high in the photo; 2.5 of them are left all round.
    scale = np.linalg.norm(seen_in(frame, transform_points(H, np.array([[0.0, 1.0]])))[0]
                           - seen_in(frame, transform_points(H, np.array([[0.0, 0.0]])))[0])  # fmt: skip
    margin = 2.5 * 10 * scale * 0.6
    assert (flat.min(axis=0) > margin).all()
    assert (flat.max(axis=0) < [frame.width - margin, frame.height - margin]).all()
    # Upright and not mirrored: right stays right, down stays down.
    assert flat[24, 0] > flat[0, 0]
    assert flat[-1, 1] > flat[0, 1]


def test_text_keeps_its_margin_where_the_sheet_ends_before() -> None:
    H = translation(*CENTRE)
    text = print_on(H, (150.0, 250.0))
    frame = frame_page(H, SHAPE, text, 10.0, text)
    flat = seen_in(frame, text)
    # Two and a half text heights, and half a pixel from the first pixel's centre to its edge.
    assert flat.min(axis=0) == pytest.approx([24.5, 24.5])
    assert [frame.width, frame.height] - flat.max(axis=0) == pytest.approx([25.5, 25.5])


def test_a_frontal_photo_is_framed_as_it_is() -> None:
    H = translation(*CENTRE)
    frame = frame_page(H, SHAPE, print_on(H, (500.0, 650.0)), 10.0, None)
    # Two and a half text heights of text margin go beyond the photo on the right and left.
    assert frame.width == pytest.approx(1050, abs=4)
    assert frame.height == pytest.approx(1350, abs=4)
    points = np.array([[0.0, 0.0], [500.0, 700.0]])
    flat = seen_in(frame, points)
    assert np.allclose(flat[1] - flat[0], [500, 700], rtol=0.01)


@pytest.mark.parametrize("tilt_deg", [0.0, 30.0, 50.0])
def test_the_sheet_is_shown_whole_and_little_beyond(tilt_deg: float) -> None:
    H = lean(tilt_deg)
    text = print_on(H, (200.0, 300.0))
    corners = np.array([[-270.0, -380.0], [270.0, -380.0], [270.0, 400.0], [-270.0, 400.0]])
    steps = np.linspace(0, 1, 40)[:, None]
    rim = np.concatenate([a + steps * (b - a) for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)])
    frame = frame_page(H, SHAPE, text, 8.0, transform_points(H, rim))
    flat = seen_in(frame, transform_points(H, corners))
    assert (flat > 0).all()
    assert (flat < [frame.width - 1, frame.height - 1]).all()
    size = np.array([frame.width, frame.height])
    assert (np.ptp(flat, axis=0) > 0.95 * size).all()


def test_a_sheet_with_a_few_lines_is_shown_whole() -> None:
    H_photo_plane = translation(*CENTRE)
    text, sheet = (
        print_on(H_photo_plane, (150.0, 30.0)),
        np.array([[125.0, 100], [925, 100], [925, 1250], [125, 1250]]),
    )
    frame = frame_page(H_photo_plane, SHAPE, text, 20.0, sheet)
    corners = seen_in(frame, sheet)
    assert (corners > -1).all()
    assert (corners < [frame.width, frame.height]).all()


def test_without_a_sheet_the_view_ends_with_the_photo() -> None:
    H = lean(25.0)
    frame = frame_page(H, SHAPE, print_on(H, (150.0, 150.0)), 10.0, None)
    photo = transform_points(
        frame.H_photo_flat, np.array([[frame.width / 2, 0.0], [frame.width / 2, frame.height - 1.0]])
    )
    # Text of 300 units is followed by at most another 350 on each side.
    assert np.ptp(photo[:, 1]) < 1100
    beside = mesh_of(frame).reshape(-1, 2)
    inside = ((beside > -1) & (beside < [1050, 1350])).all(axis=1)
    assert inside.mean() > 0.6


@given(
    st.floats(0, 64),
    st.floats(0, 360),
    st.floats(-180, 180),
    st.floats(600, 6000),
    st.booleans(),
)
@settings(max_examples=60)
def test_growth_is_bounded_whatever_the_pose(
    tilt: float, azimuth: float, roll: float, focal: float, sheet: bool
) -> None:
    H = lean(tilt, azimuth, roll, focal)
    text = print_on(H, (220.0, 300.0))
    frame = frame_page(H, SHAPE, text, 10.0, text if sheet else None)
    assert 1 <= frame.width * frame.height <= 1.01 * MAX_GROWTH * SHAPE[0] * SHAPE[1]
    assert max(frame.width, frame.height) <= 20000
    assert np.isfinite(frame.H_photo_flat).all()
    flat = seen_in(frame, text)
    assert (flat > -0.5).all()
    assert (flat < [frame.width - 0.5, frame.height - 0.5]).all()


@pytest.mark.parametrize("stretch", [(1.0, 1e-4), (1e-4, 1.0), (30.0, 0.03)])
def test_growth_is_bounded_for_extreme_maps(stretch: tuple[float, float]) -> None:
    H = translation(*CENTRE) @ np.diag([*stretch, 1.0])
    text = np.random.default_rng(0).uniform([100, 100], [900, 1200], (200, 2))
    frame = frame_page(H, SHAPE, text, 10.0, None)
    assert frame.width * frame.height <= 1.7 * SHAPE[0] * SHAPE[1]
    assert max(frame.width, frame.height) <= 20000
    assert min(frame.width, frame.height) >= 1


def test_most_text_keeps_its_pixels() -> None:
    H = lean(40.0)
    text = print_on(H, (160.0, 220.0))
    frame = frame_page(H, SHAPE, text, 5.0, text)
    step = np.array([0.01, 0.0])
    flat = seen_in(frame, text)
    a, b = (seen_in(frame, text + s) - flat for s in (step, step[::-1]))
    enlargement = np.sqrt(np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])) / 0.01
    assert (enlargement >= 0.999).mean() == pytest.approx(0.85, abs=0.02)


def test_pixel_centres_of_the_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(framing, "PAPER_MARGIN", 0.0)
    # A frame that covers the plane from (low) to (high) has its first pixel's edge at low.
    H = translation(*CENTRE)
    text = print_on(H, (150.0, 250.0))
    sheet = np.array([[300.0, 400.0], [700.0, 400.0], [700.0, 1000.0], [300.0, 1000.0]])
    frame = frame_page(H, SHAPE, text, 1.0, sheet)
    assert (frame.width, frame.height) == (400, 600)
    first = transform_points(frame.H_photo_flat, np.array([[0.0, 0.0], [399.0, 599.0]]))
    assert np.allclose(first, [[300.5, 400.5], [699.5, 999.5]])


FRAME = FlatFrame(lean(30.0) @ translation(-90.0, -60.0) @ scaling(1.3), 160, 110)


def draw(frame: FlatFrame, picture: np.ndarray) -> np.ndarray:
    """`picture` seen in the frame."""
    size = (frame.width, frame.height)
    return np.asarray(
        cv2.warpPerspective(picture, frame.H_photo_flat, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    )


@pytest.mark.parametrize("rotation_deg", [0, 90, 180, 270])
@pytest.mark.parametrize("mirrored", [False, True])
def test_turned_frames_show_the_turned_picture(rotation_deg: int, mirrored: bool) -> None:
    picture = cv2.GaussianBlur(np.random.default_rng(0).random(SHAPE, np.float32), (0, 0), 3) * 255
    expected = draw(FRAME, picture)
    expected = expected[:, ::-1] if mirrored else expected
    expected = np.rot90(expected, -rotation_deg // 90)
    turned = turn_frame(FRAME, rotation_deg, mirrored)
    assert (turned.height, turned.width) == expected.shape
    assert np.abs(draw(turned, picture) - expected).max() < 0.5  # OpenCV's 1/32 px; the picture varies by 60
    # The mesh turns with the picture.
    mesh = mesh_of(FRAME, 5, 5)
    mesh = np.rot90(mesh[:, ::-1] if mirrored else mesh, -rotation_deg // 90)
    assert np.allclose(mesh_of(turned, 5, 5), mesh)


def test_turning_back_gives_the_frame_again() -> None:
    for turns in ([90, 270], [180, 180], [90, 90, 90, 90]):
        frame = FRAME
        for rotation in turns:
            frame = turn_frame(frame, rotation, False)
        assert np.allclose(frame.H_photo_flat, FRAME.H_photo_flat)
        assert (frame.width, frame.height) == (FRAME.width, FRAME.height)
    twice = turn_frame(turn_frame(FRAME, 0, True), 0, True)
    assert np.allclose(twice.H_photo_flat, FRAME.H_photo_flat)


def test_mesh_corners_are_the_photo_points_of_the_corner_pixels() -> None:
    mesh = mesh_of(FRAME)
    assert mesh.shape == (65, 49, 2)
    corners = np.array([[0.0, 0.0], [159.0, 0.0], [0.0, 109.0], [159.0, 109.0]])
    assert np.allclose(
        [mesh[0, 0], mesh[0, -1], mesh[-1, 0], mesh[-1, -1]], transform_points(FRAME.H_photo_flat, corners)
    )
    # mesh[r, c] is shown at (c (width-1)/(columns-1), r (height-1)/(rows-1)).
    inner = transform_points(FRAME.H_photo_flat, np.array([[12 * 159 / 48, 16 * 109 / 64]]))
    assert np.allclose(mesh[16, 12], inner[0])


@pytest.mark.parametrize("factor", [0.25, 0.5, 2.0])
def test_resized_frames_show_the_same(factor: float) -> None:
    resized = resize_frame(FRAME, factor)
    assert (resized.width, resized.height) == (round(160 * factor), round(110 * factor))
    pixels = np.array([[0.0, 0.0], [30.0, 20.0]])
    assert np.allclose(
        transform_points(resized.H_photo_flat, pixels),
        transform_points(FRAME.H_photo_flat, (pixels + 0.5) / factor - 0.5),
    )
    # The picture's edges stay where they are.
    edge, small_edge = np.array([[159.5, 109.5]]), np.array([[resized.width - 0.5, resized.height - 0.5]])
    there = transform_points(resized.H_photo_flat, small_edge)
    assert np.abs(there - transform_points(FRAME.H_photo_flat, edge)).max() < 1 / factor


def test_frames_never_vanish() -> None:
    tiny = resize_frame(FRAME, 1e-4)
    assert (tiny.width, tiny.height) == (1, 1)
    assert mesh_of(tiny, 2, 2).shape == (2, 2, 2)
