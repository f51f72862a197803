"""A bent page is drawn from where its frame says, whole, seamlessly, and white where there is nothing to show."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import cv2
import numpy as np
import pytest

from services.arrays import Points, RgbImage
from services.geometry.homographies import transform_points, translation
from services.geometry.page_frame import Frame, mesh_of, resize_frame, turn_frame
from services.geometry.photo_frame import PhotoFrame
from services.imaging import node_grid
from services.imaging.bicubic import draw_between_nodes_plain
from services.rectify.view import drawing
from services.rectify.view.drawing import FlatDrawing, draw_flat_view, draw_gray_view
from services.sheet.developable.surface import bend_basis
from services.sheet.framing import CurvedFrame, frame_curved_page
from services.sheet.plane.framing import FlatFrame
from tests.services.scenes import Album
from tests.services.sheet.curved_views import SHEET, BentView, code, drawn_off
from tests.services.sheet.developable.sheets import FLAT, Bent, box

SEEN = BentView(replace(SHEET, bends=(0.2, 0.3, 0.4, 0.2, -0.1, -0.3, -0.2, 0.1)))
"""Bent with a radius of a thousand pixels or so, as pages are."""


@pytest.fixture(scope="module")
def photo() -> RgbImage:
    return SEEN.coded()


def within(frame: CurvedFrame, count: int, seed: int, border: float = 3.0) -> tuple[Points, Points]:
    """Random output pixels (N, 2) that show the photo, and where in the photo they lie."""
    rng = np.random.default_rng(seed)
    pixels = rng.integers([0, 0], [frame.width, frame.height], (count, 2)).astype(np.float64)
    seen = frame.to_photo(pixels)
    inside = ((seen > border) & (seen < np.array([SEEN.width, SEEN.height]) - 1 - border)).all(axis=1)
    return pixels[inside], seen[inside]


@pytest.mark.parametrize("name", ["bent", "rolled", "small"])
def test_every_pixel_shows_the_photo_where_the_frame_says(photo: RgbImage, name: str) -> None:
    if name == "rolled":
        bent = Bent(skew=1.5, slopes=(0.1, 0.0), bends=(0.3,) * 8, anchor=(0.0, 0.0))
        frame = replace(SEEN, bent=bent).frame()
    else:
        frame = SEEN.frame()
    if name == "small":
        frame = resize_frame(frame, 0.9)
    image = draw_flat_view(photo, frame)
    assert image.shape == (frame.height, frame.width, 3)
    # Everywhere: cell by cell of a lattice over the view.
    pixels, seen = within(frame, 20000, 1)
    cell = (pixels[:, 0] * 4 / frame.width).astype(int) + 4 * (pixels[:, 1] * 5 / frame.height).astype(int)
    tried = 0
    for c in range(20):
        chosen = cell == c
        if chosen.sum() > 100:
            tried += 1
            assert np.abs(drawn_off(image, seen[chosen], pixels[chosen])).max() < 0.06
    assert tried > 10
    miss = image[pixels[:, 1].astype(int), pixels[:, 0].astype(int)] - code(seen)
    # A slope of the code is up to 26 a pixel: a twentieth of a pixel, and rounding twice.
    assert np.sqrt(np.mean(miss**2)) < 1.5


def test_the_meshs_nodes_are_the_drawn_pixels(photo: RgbImage) -> None:
    frame = SEEN.frame()
    image = draw_flat_view(photo, frame)
    columns, rows = (frame.width - 1) // 4 + 1, (frame.height - 1) // 4 + 1
    whole = frame.through(np.eye(3), 4 * (columns - 1) + 1, 4 * (rows - 1) + 1)
    mesh = mesh_of(whole, columns, rows)
    y, x = np.mgrid[0:rows, 0:columns] * 4
    seen, pixels = mesh.reshape(-1, 2), np.stack([x.ravel(), y.ravel()], axis=1)
    inside = ((seen > 3) & (seen < [SEEN.width - 4, SEEN.height - 4])).all(axis=1)
    assert np.abs(drawn_off(image, seen[inside], pixels[inside])).max() < 0.05
    corners = mesh[[0, 0, -1, -1], [0, -1, 0, -1]]
    expected = frame.to_photo(np.array([[0.0, 0.0], [whole.width - 1, 0], [0, whole.height - 1],
                                        [whole.width - 1, whole.height - 1]]))  # fmt: skip
    assert np.allclose(corners, expected)


@pytest.mark.parametrize("band", [16, 64, 4096])
def test_bands_leave_no_seams(photo: RgbImage, band: int, monkeypatch: pytest.MonkeyPatch) -> None:
    frame = SEEN.frame()
    usual = draw_flat_view(photo, frame)
    assert frame.height > 500
    monkeypatch.setattr(drawing, "BAND_PX", band)
    assert np.abs(draw_flat_view(photo, frame).astype(int) - usual).max() <= 1


def test_a_coarse_grid_is_as_good_as_a_fine_one(photo: RgbImage, monkeypatch: pytest.MonkeyPatch) -> None:
    frame = SEEN.frame()
    usual = draw_flat_view(photo, frame).astype(int)
    # The kernel knows one step.
    monkeypatch.setattr(drawing, "draw_between_nodes", draw_between_nodes_plain)
    monkeypatch.setattr(node_grid, "GRID_STEP_PX", 2)
    fine = draw_flat_view(photo, frame)
    shown = (usual < 255).all(axis=2) & (fine < 255).all(axis=2)
    assert 0 < np.abs(usual - fine)[shown].mean() < 0.5


@pytest.mark.parametrize("kind", ["bent", "flat"])
def test_threads_draw_the_same_view_together(photo: RgbImage, kind: str) -> None:
    frame: Frame = SEEN.frame()
    if kind == "flat":
        H_photo_flat = np.array([[0.9, 0.05, 20.0], [-0.04, 0.95, 60.0], [1e-5, 2e-5, 1.0]])
        frame = FlatFrame(H_photo_flat, frame.width, frame.height)
    usual = draw_flat_view(photo, frame)
    shared = FlatDrawing(photo, frame, None)
    with ThreadPoolExecutor(3) as threads:
        for _ in range(3):
            threads.submit(shared.draw)
    assert np.array_equal(shared.finish(), usual)


def test_a_stopped_drawing_draws_no_other_band(photo: RgbImage) -> None:
    stopped = FlatDrawing(photo, SEEN.frame(), None)
    stopped.stop()
    stopped.draw()
    assert (stopped.finish() == 255).all()


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (33, 1), (16, 512), (17, 513)])
def test_any_size_is_drawn(photo: RgbImage, size: tuple[int, int]) -> None:
    frame = SEEN.frame().through(translation(200.0, 150.0), *size)
    image = draw_flat_view(photo, frame)
    assert image.shape == (size[1], size[0], 3)
    x, y = size[0] - 1, min(size[1] - 1, 300)
    assert np.abs(image[y, x] - code(frame.to_photo(np.array([[float(x), float(y)]])))[0]).max() < 4


@pytest.mark.parametrize("rotation_deg", [90, 180, 270])
@pytest.mark.parametrize("mirrored", [False, True])
def test_turned_frames_draw_turned_pictures(photo: RgbImage, rotation_deg: int, mirrored: bool) -> None:
    frame = SEEN.frame()
    upright = draw_flat_view(photo, frame)
    turned = draw_flat_view(photo, turn_frame(frame, rotation_deg, mirrored))
    flipped = np.fliplr(upright) if mirrored else upright
    expected = np.rot90(flipped, -rotation_deg // 90)
    assert turned.shape == expected.shape
    # The lattice of the map lies elsewhere, and where the photo ends its neighbours are white.
    difference = np.abs(turned.astype(int) - expected)
    assert np.median(difference) == 0
    assert (difference > 6).mean() < 0.01


def test_it_is_white_beyond_the_photo(photo: RgbImage) -> None:
    frame = SEEN.frame()
    wide = frame.through(translation(-150.0, -100.0), frame.width + 300, frame.height + 200)
    image = draw_flat_view(photo, wide)
    y, x = np.mgrid[0 : wide.height, 0 : wide.width]
    seen = wide.to_photo(np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float64))
    # Two pixels beside: the kernel's reach.
    beyond = ((seen < -2.1) | (seen > np.array([SEEN.width, SEEN.height]) + 1.1)).any(axis=1)
    assert 0.05 < beyond.mean() < 0.9
    shown = image.reshape(-1, 3)
    assert (shown[beyond] == 255).all()
    inside = ((seen > 2) & (seen < np.array([SEEN.width, SEEN.height]) - 3)).all(axis=1)
    assert (shown[inside] < 240).all()


@pytest.mark.filterwarnings("error")
def test_it_is_white_where_the_sheet_turns_away(photo: RgbImage) -> None:
    basis = bend_basis(-1.0, 1.0, 16, 0.3)
    bends = np.zeros(16)
    bends[11:] = -9.0
    bent = replace(FLAT, turn=(0.0, 0.0, 0.0), anchor=(0.0, 0.0), skew=0.0, bends=tuple(bends))
    surface = bent.surface(basis)
    view = PhotoFrame(SEEN.width, SEEN.height)
    text = surface.to_photo(box(0.3, 0.4)) * view.unit_px + np.array(view.centre)
    frame = frame_curved_page(surface, view, text, 5.0, None)
    wide = frame.through(np.eye(3), 3 * frame.width, frame.height)
    lost = np.isnan(wide.to_photo(np.array([[3.0 * frame.width - 1, 100.0]]))).all()
    assert lost
    image = draw_flat_view(photo, wide)
    assert (image[:, -10:] == 255).all()
    assert (image[100, 20 : frame.width // 2] < 240).all()


def test_it_is_white_beyond_the_paper(photo: RgbImage) -> None:
    outline = SEEN.outline()
    frame = SEEN.frame(outline)
    frame = frame.through(translation(-12.0, -10.0), frame.width + 20, frame.height + 24)
    plain, cut = draw_flat_view(photo, frame), draw_flat_view(photo, frame, outline)
    sheet = np.zeros((frame.height, frame.width), np.uint8)
    cv2.fillPoly(sheet, [np.round(frame.to_flat(outline)).astype(np.int32)], 1)
    # Corners are rounded by a step of the map's grid.
    step = np.ones((2 * node_grid.GRID_STEP_PX + 1,) * 2)
    inner = cv2.erode(sheet, step).astype(bool)
    outer = cv2.dilate(sheet, np.ones((7, 7))) == 0
    assert outer.sum() > 500
    assert np.array_equal(cut[inner], plain[inner])
    assert (cut[outer] == 255).all()
    assert not (plain[outer] == 255).all()


def test_bent_without_bends_is_drawn_as_the_plane_is(photo: RgbImage) -> None:
    bent = replace(FLAT, anchor=(0.0, 0.0))
    frame = replace(SEEN, bent=bent).frame()
    corners = np.array([[0.0, 0.0], [frame.width - 1, 0], [frame.width - 1, frame.height - 1],
                        [0, frame.height - 1]], np.float32)  # fmt: skip
    seen = frame.to_photo(corners.astype(np.float64)).astype(np.float32)
    H = np.asarray(cv2.getPerspectiveTransform(corners, seen), np.float64)
    plane = FlatFrame(H, frame.width, frame.height)
    assert np.allclose(transform_points(H, np.array([[100.0, 90.0]])), frame.to_photo(np.array([[100.0, 90.0]])),
                       atol=1e-3)  # fmt: skip
    a, b = draw_flat_view(photo, frame).astype(int), draw_flat_view(photo, plane)
    assert np.median(np.abs(a - b)) <= 1
    assert (np.abs(a - b) > 6).mean() < 0.01


@pytest.mark.parametrize("factor", [1.0, 0.4])
def test_the_gray_view_is_the_same_view(album: Album, factor: float) -> None:
    shot = album["bent"]
    image = shot.analysis.reduced
    source = np.asarray(cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA), np.uint8)
    surface = replace(SEEN.bent, bends=(0.3,) * 8).surface()
    frame = resize_frame(frame_curved_page(surface, shot.frame, shot.analysis.characters, 10.0, None), factor)
    gray = draw_gray_view(source, factor, frame)
    assert gray.shape == (frame.height, frame.width)
    x, y = np.meshgrid(np.arange(20.0, frame.width - 20, 31), np.arange(20.0, frame.height - 20, 29))
    pixels = np.stack([x.ravel(), y.ravel()], axis=1)
    at = (frame.to_photo(pixels) + 0.5) * factor - 0.5
    inside = ((at > 1) & (at < np.array(source.shape[::-1]) - 2)).all(axis=1)
    at_x, at_y = (np.ascontiguousarray(v, np.float32)[:, None] for v in at[inside].T)
    expected = cv2.remap(source, at_x, at_y, cv2.INTER_LINEAR)
    shown = gray[y.ravel()[inside].astype(int), x.ravel()[inside].astype(int)]
    assert inside.sum() > 100
    assert np.abs(shown.astype(int) - expected[:, 0]).mean() < 2
