"""Views are cut at the sheet's sides, never through its text, and where blank ground begins."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from services.arrays import Floats, Points, RgbImage
from services.geometry.homographies import transform_points
from services.geometry.page_frame import resize_frame, restore_detail
from services.geometry.photo_frame import PhotoFrame
from services.rectify.analysis.page_analysis import analyse_photo
from services.rectify.view.drawing import whiten_beyond
from services.rectify.view.sheet_cut import (
    blank_ground,
    cut_to_outline,
    cut_to_page,
)
from services.sheet.framing import CurvedFrame
from services.sheet.plane.framing import FlatFrame, frame_page
from simulation.pages import own_pages
from tests.services.scenes import Album
from tests.services.sheet.sheet_sides import outline_of

pytestmark = pytest.mark.pipeline

LEAN = np.array([[1.05, 0.08, 60.0], [-0.06, 0.98, 90.0], [6e-5, 4e-5, 1.0]])
"""H_photo_flat of a sheet that leans a little."""
SHEET = (100.0, 120.0, 699.0, 959.0)
"""Left, top, right and bottom of the sheet in the flat view."""
VIEW = FlatFrame(LEAN, 800, 1100)
TEXT_HEIGHT_PX = 10.0
RNG = np.random.default_rng


def corners(rect: tuple[float, float, float, float] = SHEET) -> Points:
    x0, y0, x1, y1 = rect
    return transform_points(LEAN, np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]))


def text(rect: tuple[float, float, float, float] = (180.0, 200.0, 620.0, 800.0)) -> Points:
    """Photo points (N, 2) of characters all over a rectangle of the flat view."""
    x, y = np.meshgrid(np.linspace(rect[0], rect[2], 40), np.linspace(rect[1], rect[3], 50))
    return transform_points(LEAN, np.stack([x.ravel(), y.ravel()], axis=1))


def shown_corner(frame: FlatFrame) -> Points:
    """Pixel of `VIEW` that is the first of `frame`."""
    return transform_points(np.linalg.inv(LEAN), frame.to_photo(np.zeros((1, 2))))[0]


def last_corner(frame: FlatFrame) -> Points:
    """Pixel of `VIEW` that is the last of `frame`."""
    return np.asarray(shown_corner(frame) + np.array([frame.width - 1.0, frame.height - 1.0]))


@pytest.mark.parametrize("noise_px", [0.0, 0.5])
def test_the_view_is_cut_at_the_sides_of_the_outline(noise_px: float) -> None:
    outline = outline_of(corners(), noise_px, RNG(0))
    cut, known = cut_to_outline(VIEW, outline, text(), TEXT_HEIGHT_PX, believed=True)
    assert isinstance(cut, FlatFrame)
    assert known == {"left", "top", "right", "bottom"}
    assert shown_corner(cut) == pytest.approx(SHEET[:2], abs=1.0 + 2 * noise_px)
    assert last_corner(cut) == pytest.approx(SHEET[2:], abs=1.0 + 2 * noise_px)


@pytest.mark.parametrize(
    ("wave_px", "believed", "may_wave"),
    [(1.0, True, True), (40.0, True, True), (40.0, False, True), (40.0, True, False)],
)
def test_a_side_that_waves_keeps_all_of_its_paper(wave_px: float, believed: bool, may_wave: bool) -> None:
    outline = outline_of(corners(), 0.0, RNG(0))
    y = np.linspace(SHEET[1], SHEET[3], 200)
    waving = np.column_stack([SHEET[2] + wave_px * np.sin(np.linspace(0, 4 * np.pi, 200)), y])
    right = replace(outline.sides[1], points=transform_points(LEAN, waving))
    outline = replace(outline, sides=(outline.sides[0], right, *outline.sides[2:]))
    cut, _ = cut_to_outline(VIEW, outline, text(), TEXT_HEIGHT_PX, believed=believed, may_wave=may_wave)
    assert isinstance(cut, FlatFrame)
    # In the middle, as paper must not be white that is beyond a side that may be none.
    kept = wave_px if believed and may_wave and wave_px > 4.0 else 0.0
    assert last_corner(cut)[0] == pytest.approx(SHEET[2] + kept, abs=1.5)


@pytest.mark.parametrize("missing", range(4))
def test_a_side_that_is_not_seen_is_not_cut_at(missing: int) -> None:
    seen = tuple(k for k in range(4) if k != missing)
    cut, known = cut_to_outline(
        VIEW, outline_of(corners(), 0.3, RNG(0), seen), text(), TEXT_HEIGHT_PX, believed=True
    )
    names = ("top", "right", "bottom", "left")
    assert known == {names[k] for k in seen}
    whole = {"top": 0, "left": 0, "right": VIEW.width - 1, "bottom": VIEW.height - 1}[names[missing]]
    assert isinstance(cut, FlatFrame)
    first = shown_corner(cut)
    last = last_corner(cut)
    place = {"top": first[1], "left": first[0], "right": last[0], "bottom": last[1]}[names[missing]]
    assert place == pytest.approx(whole, abs=1e-6)


def test_a_side_that_would_cut_text_off_is_not_believed() -> None:
    # A frame printed on the page, with a page number below.
    below = np.concatenate([text(), text((350.0, 985.0, 450.0, 995.0))[:30]])
    cut, known = cut_to_outline(
        VIEW, outline_of(corners(), 0.3, RNG(0)), below, TEXT_HEIGHT_PX, believed=False
    )
    assert known == {"left", "top", "right"}
    seen = transform_points(np.linalg.inv(cut.H_photo_flat), below) if isinstance(cut, FlatFrame) else below
    assert (seen > 0).all()
    assert (seen < [cut.width - 1, cut.height - 1]).all()


def test_beyond_a_believed_outline_lie_specks_and_no_text() -> None:
    specks = np.concatenate([text(), text((350.0, 985.0, 450.0, 995.0))[:30]])
    _, known = cut_to_outline(VIEW, outline_of(corners(), 0.3, RNG(0)), specks, TEXT_HEIGHT_PX, believed=True)
    assert known == {"left", "top", "right", "bottom"}
    on_edge = np.concatenate([text(), text((350.0, 961.0, 450.0, 962.0))[:30]])
    _, known = cut_to_outline(
        VIEW, outline_of(corners(), 0.3, RNG(0)), on_edge, TEXT_HEIGHT_PX, believed=True
    )
    assert known == {"left", "top", "right", "bottom"}, "the sheet's edge looks like letters"


@pytest.mark.parametrize(("apart_px", "is_cut"), [(40.0, True), (6.0, False)])
def test_specks_that_stand_in_no_word_do_not_hide_a_side(apart_px: float, is_cut: bool) -> None:
    row = np.column_stack([250.0 + apart_px * np.arange(12), np.full(12, 990.0)])
    seen = np.concatenate([text()[::2], transform_points(LEAN, row)])
    _, known = cut_to_outline(VIEW, outline_of(corners(), 0.3, RNG(0)), seen, TEXT_HEIGHT_PX, believed=False)
    assert ("bottom" in known) == is_cut


def test_slanting_sides_are_left_alone() -> None:
    kite = np.array([[400.0, 100.0], [750.0, 500.0], [420.0, 1000.0], [60.0, 520.0]])
    assert (
        cut_to_outline(
            VIEW, outline_of(transform_points(LEAN, kite), 0.3, RNG(0)), text(), TEXT_HEIGHT_PX, believed=True
        )[1]
        == frozenset()
    )


def printed(
    size: tuple[int, int], rect: tuple[int, int, int, int], paper: int = 245
) -> tuple[RgbImage, Points]:
    """White paper with blots like words in a rectangle, and the blots' centres (N, 2)."""
    width, height = size
    image = np.full((height, width, 3), paper, np.uint8)
    centres = []
    for y in range(rect[1], rect[3], 16):
        for x in range(rect[0], rect[2] - 8, 12):
            image[y : y + 8, x : x + 7] = 30
            centres.append((x + 3.0, y + 3.5))
    return image, np.array(centres)


def blank_around(image: RgbImage, at: Points) -> dict[str, float | None]:
    shown = np.ones(image.shape[:2], bool)
    edges = blank_ground(image, shown, at, 8.0)
    return {side: getattr(edges, side) for side in ("left", "top", "right", "bottom")}


def test_blank_ground_is_cut_a_margin_from_the_print() -> None:
    image, at = printed((600, 700), (220, 250, 380, 450))
    edges = blank_around(image, at)
    margin = 0.12 * 200
    expected = {"left": 220 - margin, "top": 250 - margin, "right": 380 + margin, "bottom": 450 + margin}
    for side, place in expected.items():
        found = edges[side]
        assert found is not None
        assert abs(found - place) < 16, side


def test_a_drawing_beside_the_text_is_no_blank_ground() -> None:
    image, at = printed((600, 700), (220, 250, 380, 450))
    cv2.line(image, (500, 100), (590, 600), (60, 60, 60), 3)
    edges = blank_around(image, at)
    assert edges["right"] is None
    assert edges["left"] is not None
    assert edges["top"] is not None
    assert edges["top"] < 100


def test_a_desk_in_view_is_no_blank_ground() -> None:
    image, at = printed((600, 700), (220, 250, 380, 450))
    grain = np.clip(RNG(3).normal(110, 40, (700, 150, 3)), 0, 255).astype(np.uint8)
    image[:, :150] = grain
    edges = blank_around(image, at)
    assert edges["left"] is None
    assert edges["right"] is not None


def test_specks_and_what_the_photo_does_not_show_are_no_print() -> None:
    image, at = printed((600, 700), (220, 250, 380, 450))
    image[80, 80] = image[640, 500] = 40
    image[:, 540:] = 0
    shown = np.ones(image.shape[:2], bool)
    shown[:, 540:] = False
    edges = blank_ground(image, shown, at, 8.0)
    assert None not in (edges.left, edges.top, edges.right, edges.bottom)
    assert edges.right is not None
    assert edges.right < 430


def test_without_text_nothing_is_blank() -> None:
    image = np.full((200, 200, 3), 240, np.uint8)
    assert set(blank_around(image, np.zeros((0, 2))).values()) == {None}
    assert set(blank_around(image, np.full((5, 2), np.nan)).values()) == {None}


def on_white(top: int, bottom: int, left: int, right: int) -> tuple[RgbImage, Points, Points]:
    """A printed page with white round it, and the first and the last pixel (2,) of its print."""
    page = own_pages(400, 625)[0].image
    y, x = np.nonzero(page < 128)
    gray = cv2.copyMakeBorder(page, top, bottom, left, right, cv2.BORDER_CONSTANT, value=255)
    shift = np.array([left, top], np.float64)
    low, high = np.array([x.min(), y.min()]) + shift, np.array([x.max(), y.max()]) + shift
    return np.array(cv2.cvtColor(gray, cv2.COLOR_GRAY2RGB), np.uint8), low, high


def cut_blank(photo: RgbImage, known: frozenset[str] = frozenset()) -> Points:
    """Corners (2, 2) of the view in the photo, which is flat already: its first and its last pixel."""
    frame = FlatFrame(np.eye(3), photo.shape[1], photo.shape[0])
    cut = cut_to_page(photo, frame, analyse_photo(photo), known, whole=False)
    return cut.to_photo(np.array([[0.0, 0.0], [cut.width - 1.0, cut.height - 1.0]]))


def test_on_a_table_as_white_as_the_sheet_the_view_ends_beside_the_print() -> None:
    photo, first, last = on_white(350, 300, 250, 400)
    margin = 0.12 * float((last - first).max())
    low, high = cut_blank(photo)
    assert low == pytest.approx(first - margin, abs=15)
    assert high == pytest.approx(last + margin, abs=15)
    # Sides that are known already stay where they are.
    assert cut_blank(photo, frozenset({"left", "top"}))[0] == pytest.approx([0.0, 0.0])


def test_a_page_that_is_blank_below_its_print_is_shown_whole() -> None:
    photo, _, last = on_white(0, 600, 0, 0)
    low, high = cut_blank(photo)
    assert low == pytest.approx([0.0, 0.0])
    assert high == pytest.approx([photo.shape[1] - 1, photo.shape[0] - 1])
    # Below something else than paper begins, along no straight edge.
    y, x = np.indices(photo.shape[:2])
    photo[y > photo.shape[0] - 150 - 30 * np.sin(x / 40)] = 130
    assert last[1] < cut_blank(photo)[1, 1] < photo.shape[0] - 300


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
    cut = cut_to_page(inside, frame, analysis, frozenset(), whole=False)
    assert (cut.width, cut.height) == (frame.width, frame.height)


def test_sides_that_are_known_and_a_sheet_that_is_seen_whole_are_not_cut_again(album: Album) -> None:
    shot = album["dirty"]
    frame = FlatFrame(np.eye(3), shot.photo.image.shape[1], shot.photo.image.shape[0])
    known = frozenset({"left", "top", "right", "bottom"})
    assert cut_to_page(shot.photo.image, frame, shot.analysis, known, whole=False) is frame
    kept = cut_to_page(shot.photo.image, frame, shot.analysis, frozenset(), whole=True)
    assert (kept.width, kept.height) == (frame.width, frame.height)


LARGE_PRINT_PX = 30.0
"""Text height of print that needs no enlargement."""


def steps(frame: FlatFrame, at: Points) -> Floats:
    """Photo pixels (N,) per pixel of the view."""
    a, b, c = (frame.to_photo(at + d) for d in np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    return np.sqrt(np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]))


def test_detail_that_a_larger_view_had_lost_comes_back() -> None:
    small = resize_frame(VIEW, 0.5)
    found = restore_detail(small, 1600 * 2000, text(), LARGE_PRINT_PX)
    assert isinstance(found, FlatFrame)
    lost = steps(found, transform_points(np.linalg.inv(found.H_photo_flat), text()))
    assert np.percentile(lost, 95) < 1.1
    assert np.median(lost) > 0.8
    # What it shows is the same.
    last = np.array([[small.width - 0.5, small.height - 0.5]])
    grown = (last + 0.5) * [found.width / small.width, found.height / small.height] - 0.5
    assert found.to_photo(grown) == pytest.approx(small.to_photo(last), abs=1.5)


def test_a_view_grows_no_further_than_the_photo_and_never_shrinks() -> None:
    small = resize_frame(VIEW, 0.5)
    bounded = restore_detail(small, 300 * 300, text(), LARGE_PRINT_PX)
    assert bounded is small or bounded.width * bounded.height < 1.7 * 300 * 300
    large = resize_frame(VIEW, 2.0)
    assert restore_detail(large, 4000 * 4000, text(), LARGE_PRINT_PX) is large
    assert restore_detail(VIEW, 4000 * 4000, np.zeros((0, 2)), LARGE_PRINT_PX) is VIEW


def test_small_print_gets_more_pixels_than_the_photo_has_of_it() -> None:
    plain = restore_detail(VIEW, 1600 * 2000, text(), LARGE_PRINT_PX)
    enlarged = restore_detail(VIEW, 1600 * 2000, text(), 15.0)
    assert enlarged.width == pytest.approx(1.2 * plain.width, rel=0.05)
    # Twice at most, however small it is.
    assert restore_detail(VIEW, 1600 * 2000, text(), 2.0).width <= 2.0 * plain.width


def test_what_lies_beyond_the_sheet_is_white() -> None:
    torn = corners()
    torn[0] = transform_points(LEAN, np.array([[160.0, 180.0]]))[0]
    outline = outline_of(torn, 0.0, RNG(0))
    frame, _ = cut_to_outline(VIEW, outline_of(corners(), 0.0, RNG(0)), text(), TEXT_HEIGHT_PX, believed=True)
    flat = np.full((frame.height, frame.width, 3), 90, np.uint8)
    whiten_beyond(flat, frame, outline.polygon)
    assert (flat[2, 2] == 255).all()
    # Half way along the torn sides, well inside and well outside of them.
    assert (flat[150, 150] == 90).all()
    assert (flat[-20:, -20:-10] == 90).all()
    assert 0.005 < (flat == 255).mean() < 0.12


class OneWay:
    """A page's map whose inverse nobody may ask for: beyond a bent page's horizon it has none."""

    def to_photo(self, page: Points) -> Points:
        return np.where(page[:, :1] < 0.02, np.nan, page + np.array([0.1, 0.2]))

    def to_page(self, centred: Points) -> Points:
        raise AssertionError

    def jacobians(self, centred: Points) -> Floats:
        raise AssertionError


def test_the_paper_s_edge_is_found_without_the_map_s_inverse() -> None:
    view = PhotoFrame(2001, 2001)
    frame = CurvedFrame(OneWay(), view, np.diag([1e-3, 1e-3, 1.0]), 400, 300)
    photo = frame.to_photo(np.array([[100.0, 50.0], [350.0, 50.0], [350.0, 250.0], [100.0, 250.0]]))
    flat = np.full((300, 400, 3), 90, np.uint8)
    whiten_beyond(flat, frame, photo)
    kept = (flat == 90).all(axis=2)
    rows, columns = np.nonzero(kept)
    found = [rows.min(), rows.max(), columns.min(), columns.max()]
    assert found == pytest.approx([50, 250, 100, 350], abs=1)
    # Between nodes of the grid corners are rounded by a few pixels.
    assert kept[52:249, 108:343].all()
    assert kept[58:243, 102:349].all()
