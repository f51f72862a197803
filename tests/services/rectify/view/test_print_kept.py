"""No view ends within print of its sheet, and what the photo cuts is said."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFont

from services.arrays import Floats, Points
from services.contract.rectify import RectifyParameters
from services.geometry.focal_prior import typical_focal_prior
from services.geometry.homographies import transform_points
from services.geometry.photo_frame import PhotoFrame
from services.imaging.sheet_edges import SheetEdges
from services.rectify.analysis.page_analysis import analyse_photo
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.view import judged_view
from services.rectify.view.cut_letters import count_cut_letters
from services.rectify.view.judged_view import best_view, judge_view
from services.rectify.view.print_beyond import NO_BOXES
from services.rectify.view.print_kept import (
    grow_to_print,
    kept_print,
    print_notices,
    share_kept,
    sheet_print,
)
from services.rectify.view.sheet_cut import crop_frame
from services.sheet.plane.framing import FlatFrame
from services.sheet.plane.pose import choose_pose
from tests.services.rectify.view.test_sheet_cut import LEAN, VIEW
from tests.services.scenes import Album, Shot
from tests.services.sheet.sheet_sides import outline_of, outline_of_truth

pytestmark = pytest.mark.pipeline


def boxes(*places: tuple[float, float], size: float = 10.0) -> Floats:
    """Boxes (N, 4, 2) in the photo, whose first corners lie at `places` of the flat view."""
    square = size * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    return np.stack([transform_points(LEAN, square + np.array(place)) for place in places])


@pytest.fixture(scope="module")
def shot() -> Shot:
    return Album()["plain"]


def flat_page(shot: Shot) -> ShapedPage:
    prior = typical_focal_prior()
    shape = choose_pose(shot.evidence, prior)
    points = shot.evidence.vanishing_points
    return ShapedPage(shot.frame, shape, (), None, shot.analysis, points)


def test_a_frame_grows_on_the_side_where_print_ends_outside() -> None:
    grown = grow_to_print(VIEW, boxes((400, 500), (830, 600)), 12.0)
    assert isinstance(grown, FlatFrame)
    assert 841 <= grown.width <= 855
    assert grown.height == VIEW.height
    assert np.allclose(grown.to_photo(np.zeros((1, 2))), VIEW.to_photo(np.zeros((1, 2))))
    assert kept_print(grown, boxes((400, 500), (830, 600))).all()


def test_a_frame_grows_before_its_first_pixel_too() -> None:
    grown = grow_to_print(VIEW, boxes((400, 500), (-25, 600), (300, -12)), 12.0)
    assert isinstance(grown, FlatFrame)
    assert kept_print(grown, boxes((-25, 600), (300, -12))).all()
    assert 26 <= grown.width - VIEW.width <= 40
    assert 13 <= grown.height - VIEW.height <= 27


def test_a_frame_that_holds_its_print_stays() -> None:
    assert grow_to_print(VIEW, boxes((0, 0), (780, 1080)), 12.0) is VIEW


def test_a_frame_does_not_grow_where_the_view_is_white() -> None:
    paper = transform_points(LEAN, np.array([[0.0, 0.0], [780.0, 0.0], [780.0, 1200.0], [0.0, 1200.0]]))
    assert grow_to_print(VIEW, boxes((400, 500), (830, 600)), 12.0, paper) is VIEW
    assert grow_to_print(VIEW, boxes((400, 1110)), 12.0, paper).height > VIEW.height


def test_what_is_far_away_is_no_print_of_the_page() -> None:
    assert grow_to_print(VIEW, boxes((400, 500), (1200, 600)), 12.0) is VIEW


def test_what_is_drawn_white_is_not_kept() -> None:
    paper = transform_points(LEAN, np.array([[0.0, 0.0], [500.0, 0.0], [500.0, 1100.0], [0.0, 1100.0]]))
    kept = kept_print(VIEW, boxes((400, 500), (600, 500)), paper)
    assert kept.tolist() == [True, False]
    assert share_kept(boxes((400, 500), (600, 500)), kept) == 0.5
    assert share_kept(np.zeros((0, 4, 2)), np.zeros(0, bool)) is None


@pytest.mark.parametrize("count", [2, 3])
def test_cut_print_is_said_from_a_few_characters_on(count: int) -> None:
    lost = np.arange(40) >= count
    for notices in (print_notices(np.ones(40, bool), count), print_notices(lost, 0)):
        assert [notice.code for notice in notices] == ["print-cut"] * (count >= 3)
    # Of so much print as many are strays.
    assert not print_notices(np.arange(4000) >= count, 0)


@pytest.mark.parametrize("turns", range(4))
def test_a_line_that_the_photos_border_halves_is_counted(shot: Shot, turns: int) -> None:
    page = flat_page(shot)
    photo = shot.photo.image
    low = sheet_print(page).max(axis=(0, 1))[1]
    letters = sheet_print(page)
    row = letters[np.abs(letters[:, :, 1].max(axis=1) - low) < page.text_height_px]
    at = round(float(row.mean(axis=(0, 1))[1]))
    counts = []
    # The border lies within the last line, or well below it.
    for end in (at, at + round(2.0 * page.text_height_px)):
        seen = np.ascontiguousarray(np.rot90(photo[:end], turns))
        analysis = analyse_photo(seen)
        cut = replace(page, view=PhotoFrame(seen.shape[1], seen.shape[0]), analysis=analysis)
        counts.append(count_cut_letters(cut, sheet_print(cut)))
    assert counts[0] >= 0.5 * len(row)
    assert counts[1] == 0


@pytest.mark.parametrize("turns", range(4))
def test_a_line_that_ends_in_a_cut_letter_is_counted(shot: Shot, turns: int) -> None:
    sheet = Image.new("RGB", (900, 700), (235, 235, 235))
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(28)
    for k in range(12):
        text = "Payment within a month of the invoice" if k == 4 else "Cutlery, a dozen of each"
        draw.text((70, 60 + 45 * k), text, font=font, fill=(30, 30, 30))
    end = 70 + font.getlength("Payment within a month of the invoice") - 0.5 * font.getlength("e")
    counts = []
    # The border lies within the last letter of the longest line, or well beside it.
    for width in (round(end), round(end) + 40):
        seen = np.ascontiguousarray(np.rot90(np.asarray(sheet)[:, :width], turns))
        cut = replace(flat_page(shot), analysis=analyse_photo(seen))
        counts.append(count_cut_letters(cut, sheet_print(cut)))
    assert counts[0] >= 3
    assert counts[1] == 0


def test_grain_at_the_border_is_no_print(shot: Shot) -> None:
    photo = shot.photo.image.copy()
    page = flat_page(shot)
    low, high = (round(float(v)) for v in np.quantile(sheet_print(page)[:, :, 0], [0.0, 1.0]))
    end = round(float(sheet_print(page)[:, :, 1].max() + 2.0 * page.text_height_px))
    grain = np.random.default_rng(0).integers(0, 2, (round(page.text_height_px), high - low), np.uint8)
    photo[end - len(grain) : end, low:high] = 255 * grain[..., None]
    cut = replace(page, analysis=analyse_photo(photo[:end]))
    assert count_cut_letters(cut, sheet_print(cut)) == 0


def test_all_print_of_a_page_is_the_sheets(shot: Shot) -> None:
    found = sheet_print(flat_page(shot))
    assert len(found) > 0.97 * len(shot.analysis.characters)
    middles = found.mean(axis=1)
    assert np.abs(middles - shot.analysis.characters[: len(middles)]).min() < 3


def within(points: Points, share: float) -> Points:
    """Corners (4, 2) of the box of `points` (N, 2) with this share of its width."""
    (x0, y0), (x1, y1) = points.min(axis=0) - 40, points.max(axis=0) + 40
    right = x0 + share * (x1 - x0)
    return np.array([[x0, y0], [right, y0], [right, y1], [x0, y1]])


def test_lines_that_go_on_beyond_an_outline_are_kept(shot: Shot) -> None:
    """As beyond a torn side: the outline is certain, and cuts the ends of lines."""
    page = flat_page(shot)
    outline = replace(
        outline_of(within(page.characters, 0.88), 0.3, np.random.default_rng(0)), confidence=0.99
    )
    view = judge_view(shot.photo.image, replace(page, outline=outline), "sheet")
    assert view.print_kept == 1.0
    assert view.paper is not outline.polygon
    assert not view.notices


def test_an_outline_of_a_part_of_the_page_leaves_no_print_out(shot: Shot) -> None:
    page = flat_page(shot)
    outline = outline_of(within(page.characters, 0.5), 0.3, np.random.default_rng(0))
    doubtful = replace(page, outline=replace(outline, confidence=0.7))
    assert len(sheet_print(doubtful)) == len(sheet_print(page))


def test_grain_beside_a_certain_sheet_is_no_print(shot: Shot) -> None:
    """As on concrete: groups of specks beside the sheet, which text identification takes for characters."""
    page = flat_page(shot)
    rows = page.characters[:, 1]
    low, high = rows.min(), np.percentile(rows, 40)
    x0, x1 = page.characters[:, 0].min() - 40, page.characters[:, 0].max() + 40
    gap = rows[rows > high].min()
    corners = np.array([[x0, low - 40], [x1, low - 40], [x1, 0.5 * (high + gap)], [x0, 0.5 * (high + gap)]])
    outline = replace(outline_of(corners, 0.3, np.random.default_rng(0)), confidence=0.99)
    assert len(sheet_print(replace(page, outline=outline))) < 0.8 * len(sheet_print(page))


def test_a_view_that_ends_within_its_sheet_gives_way_to_the_next_shape(
    shot: Shot, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = replace(flat_page(shot), outline=outline_of_truth(shot.truth, 0.3, np.random.default_rng(0)))
    other = replace(page, notices=())
    first = replace(page, others=iter([other]))
    whole = judged_view.frame_view(shot.photo.image, other, "sheet", sheet_print(other))[0]
    half = crop_frame(whole, SheetEdges(bottom=0.7 * whole.height))
    monkeypatch.setattr(
        judged_view, "frame_view", lambda photo, page, *_: (half if page is first else whole, None, NO_BOXES)
    )
    asked = RectifyParameters()
    seen = best_view(shot.photo.image, first, asked)
    assert seen.page is other
    assert seen.frame is whole
    assert best_view(shot.photo.image, other, asked).page is other
    assert best_view(shot.photo.image, replace(page, others=iter([])), asked).frame is whole
