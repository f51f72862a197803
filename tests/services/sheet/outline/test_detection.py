"""The outline of a sheet, on photos whose sheet is known."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from services.arrays import Points, RgbImage
from services.sheet.outline.band_beyond import band_side
from services.sheet.outline.candidates import Candidate, CandidateParameters, parted_colors
from services.sheet.outline.colors import color_codes, color_log_odds, count_colors
from services.sheet.outline.detection import (
    MeasuredOutline,
    OutlineParameters,
    find_outline,
    is_surer,
)
from services.sheet.outline.edges import EdgePoints, leave_out_strays
from services.sheet.outline.results import BELIEVED_CONFIDENCE, SheetOutline
from tests.services.sheet.outline.drawn import distances, draw_sheet, sides_of

SIZE = (660, 820)
CORNERS = np.array([[92.3, 71.6], [571.8, 98.2], [604.4, 741.7], [61.1, 722.9]])


def _errors(outline: SheetOutline | None, truth: Points, corners: Points) -> tuple[float, float]:
    """95th percentile of the points' distances from the true outline, and the worst corner's; pixels."""
    assert outline is not None
    points = np.concatenate([side.points for side in outline.sides])
    return (
        float(np.percentile(distances(points, truth), 95)),
        float(np.linalg.norm(outline.corners - corners, axis=1).max()),
    )


@pytest.mark.parametrize("bend", [0.0, 0.06, -0.05])
def test_straight_and_bent_sides_are_found_to_a_fraction_of_a_pixel(bend: float) -> None:
    truth = sides_of(CORNERS, bend)
    outline = find_outline(draw_sheet(truth, SIZE))
    side, corner = _errors(outline, truth, CORNERS)
    assert side < 0.35
    assert corner < 0.8
    assert outline is not None
    assert outline.confidence > 0.9
    assert min(s.seen for s in outline.sides) > 0.95
    straightness = [s.straightness_px for s in outline.sides]
    assert straightness[1] < 0.3
    assert (straightness[0] > 3.0) == (bend != 0)


@pytest.mark.parametrize("ground", [(214, 212, 206), (18, 17, 20), (150, 30, 28)])
def test_light_dark_and_coloured_grounds(ground: tuple[int, int, int]) -> None:
    truth = sides_of(CORNERS, 0.02)
    side, corner = _errors(find_outline(draw_sheet(truth, SIZE, ground=ground)), truth, CORNERS)
    assert side < 0.5
    assert corner < 1.2


def test_deviations_are_of_the_errors_size() -> None:
    truth = sides_of(CORNERS, 0.03)
    outline = find_outline(draw_sheet(truth, SIZE, noise=6.0))
    assert outline is not None
    ratio = np.concatenate([distances(s.points, truth) / s.deviations for s in outline.sides])
    assert 0.2 < np.median(ratio) / 0.6745 < 4.0


def test_a_frame_printed_on_the_page_is_not_the_sheet() -> None:
    photo = draw_sheet(sides_of(CORNERS), SIZE)
    inner = CORNERS.mean(axis=0) + 0.8 * (CORNERS - CORNERS.mean(axis=0))
    cv2.polylines(photo, [np.round(inner).astype(np.int32)], True, (20, 20, 30), 4, cv2.LINE_AA)
    side, corner = _errors(find_outline(photo), sides_of(CORNERS), CORNERS)
    assert side < 0.5
    assert corner < 1.0


def test_a_heading_on_a_ground_of_its_own_belongs_to_the_sheet() -> None:
    photo = draw_sheet(sides_of(CORNERS), SIZE)
    share = 0.12
    bar = np.array(
        [
            CORNERS[0],
            CORNERS[1],
            CORNERS[1] + share * (CORNERS[2] - CORNERS[1]),
            CORNERS[0] + share * (CORNERS[3] - CORNERS[0]),
        ]
    )
    cv2.fillPoly(photo, [np.round(bar).astype(np.int32)], (28, 46, 110), cv2.LINE_AA)
    _, corner = _errors(find_outline(photo), sides_of(CORNERS), CORNERS)
    assert corner < 2.5


@pytest.mark.parametrize("side", [0, 2, 3])
@pytest.mark.parametrize("share", [0.03, 0.08])
def test_a_band_as_dark_as_the_desk_belongs_to_the_sheet(side: int, share: float) -> None:
    # Its border parts the colours better than the sheet's edge beyond it, but the sides next to it go on.
    photo = draw_sheet(sides_of(CORNERS), SIZE, ground=(44, 38, 42))
    a, b = CORNERS[side], CORNERS[(side + 1) % 4]
    band = np.array([a, b, b + share * (CORNERS[(side + 2) % 4] - b), a + share * (CORNERS[side - 1] - a)])
    cv2.fillPoly(photo, [np.round(band).astype(np.int32)], (70, 40, 44), cv2.LINE_AA)
    x, y = np.meshgrid(np.arange(150, 500, 12), np.arange(160, 660, 20))
    text = np.column_stack([x.ravel(), y.ravel()]).astype(np.float64)
    _, corner = _errors(find_outline(photo, text), sides_of(CORNERS), CORNERS)
    assert corner < 5.0


def test_a_band_is_as_wide_as_the_sheet() -> None:
    sides = [
        CORNERS[k] + np.linspace(0, 1, 40)[:, None] * (CORNERS[(k + 1) % 4] - CORNERS[k]) for k in range(4)
    ]
    foot = CORNERS + np.array([[0, 0], [0, 0], [2, 40], [-2, 40]])
    assert band_side(foot, sides) == 2
    bulge = np.concatenate([sides[0], sides[1], sides[2][:14], [[330, 800]], sides[2][26:], sides[3]])
    assert band_side(bulge, sides) is None
    wedge = CORNERS + np.array([[0, 0], [0, 0], [2, 40], [0, 0]])
    assert band_side(wedge, sides) is None
    assert band_side(CORNERS + np.array([[-40, 0], [0, 0], [2, 40], [-40, 40]]), sides) is None, (
        "on two sides"
    )
    assert band_side(CORNERS, sides) is None


def test_fingers_leave_a_gap_and_the_side_goes_on() -> None:
    photo = draw_sheet(sides_of(CORNERS), SIZE)
    thumb = np.round(0.5 * (CORNERS[1] + CORNERS[2])).astype(int)
    cv2.ellipse(photo, (int(thumb[0]), int(thumb[1])), (60, 26), 0, 0, 360, (196, 150, 128), -1, cv2.LINE_AA)
    outline = find_outline(photo)
    side, corner = _errors(outline, sides_of(CORNERS), CORNERS)
    assert corner < 1.2
    assert side < 4.0


def test_a_corner_out_of_view_is_unknown_and_its_sides_are_partly_seen() -> None:
    corners = CORNERS + np.array([130.0, 0.0])
    outline = find_outline(draw_sheet(sides_of(corners), SIZE))
    assert outline is not None
    assert np.isnan(outline.corners).any(axis=1).tolist() == [False, True, True, False]
    known = np.isfinite(outline.corners[:, 0])
    assert np.linalg.norm(outline.corners[known] - corners[known], axis=1).max() < 1.5
    points = np.concatenate([s.points for s in outline.sides])
    assert np.percentile(distances(points, sides_of(corners)), 95) < 1.0
    assert outline.polygon.min() >= 0
    assert (outline.polygon.max(axis=0) <= np.array(SIZE) - 1).all()


def _print_on(corners: Points) -> Points:
    """Characters (80, 2) in the middle of a sheet."""
    places = np.random.default_rng(7).random((80, 2)) - 0.5
    return np.asarray(corners.mean(axis=0) + 0.25 * places * np.ptp(corners, axis=0))


def _on_wood(corners: Points) -> RgbImage:
    """A photo of a sheet with these corners on a desk of wood."""
    grain = np.random.default_rng(7)
    wood = cv2.GaussianBlur(grain.normal(0, 60, (SIZE[1], SIZE[0])), (0, 0), sigmaX=9, sigmaY=1.2)
    photo = draw_sheet(sides_of(corners), SIZE).astype(np.float64)
    return np.clip(photo + np.where(photo.max(axis=2) < 160, wood, 0)[..., None], 0, 255).astype(np.uint8)


@pytest.mark.parametrize("side", range(4))
def test_a_sheet_that_leaves_the_photo_at_one_side_is_believed_on_a_desk_of_wood(side: int) -> None:
    away = np.array([[0, -330], [300, 0], [0, 330], [-300, 0]])[side]
    corners = CORNERS.mean(axis=0) + 0.8 * (CORNERS - CORNERS.mean(axis=0)) + away
    inside = np.clip(_print_on(corners), 60, np.array(SIZE) - 60)
    outline = find_outline(_on_wood(corners), inside)
    assert outline is not None
    assert outline.confidence > BELIEVED_CONFIDENCE
    assert [s.seen < 0.1 for s in outline.sides] == [k == side for k in range(4)]
    end = (0, SIZE[0] - 1, SIZE[1] - 1, 0)[side]
    assert np.sum(outline.polygon[:, (side + 1) % 2] == end) > 50, "the sheet goes on to the photo's border"


@pytest.mark.parametrize("line", [0, 20])
def test_a_receipt_whose_ends_leave_the_photo_is_followed_to_its_border(line: int) -> None:
    """A thick line of print, from side to side, is no end of it: the long sides go on beyond."""
    corners = np.array([[180.0, -150.0], [470.0, -150.0], [500.0, 980.0], [160.0, 980.0]])
    photo = _on_wood(corners)
    photo[60 : 60 + line, 192:464] = 40
    outline = find_outline(photo, _print_on(corners))
    assert outline is not None
    assert outline.confidence > BELIEVED_CONFIDENCE
    assert [round(side.seen, 1) for side in outline.sides] == [0.0, 1.0, 0.0, 1.0]
    for side, ends in ((1, corners[[1, 2]]), (3, corners[[3, 0]])):
        points = outline.sides[side].points
        assert np.percentile(distances(points, ends), 95) < 1.0
        assert points[:, 1].min() < 15
        assert points[:, 1].max() > SIZE[1] - 15
    assert (outline.polygon[:, 1].min(), outline.polygon[:, 1].max()) == (0, SIZE[1] - 1)


def test_a_receipt_that_ends_in_the_photo_ends_there() -> None:
    corners = np.array([[180.0, -150.0], [470.0, -150.0], [490.0, 700.0], [165.0, 700.0]])
    outline = find_outline(_on_wood(corners), _print_on(np.clip(corners, 0, 820)))
    assert outline is not None
    assert [round(side.seen, 1) for side in outline.sides] == [0.0, 1.0, 1.0, 1.0]
    assert outline.polygon[:, 1].max() < 705


def test_letters_that_the_border_cuts_are_no_edge() -> None:
    """A side leaves the photo half-way down; below, one of its points is that of a letter near the border."""
    y = np.linspace(0, 990, 60)
    x = np.where(y < 500, 200 - 0.4 * y, 4.0)
    seen = y < 490
    stray = seen.copy()
    stray[45] = True
    side = EdgePoints(
        np.column_stack([x, y]), np.zeros((60, 2)), np.ones(60), np.ones(60), stray, np.ones(60, bool)
    )
    window = (0.0, 0.0, 800.0, 1000.0)
    assert not leave_out_strays(side, 1300.0, window).seen[30:].any()
    assert leave_out_strays(side, 1300.0, window).seen[:25].all()
    along = replace(side, seen=np.ones(60, bool))
    assert leave_out_strays(along, 1300.0, window).seen.all(), "a page that was cut closely"


def test_a_small_sheet_that_holds_the_print_is_believed() -> None:
    corners = np.array([300.0, 400.0]) + 0.4 * (CORNERS - CORNERS.mean(axis=0))
    photo = draw_sheet(sides_of(corners), SIZE)
    outline = find_outline(photo, _print_on(corners))
    _, corner = _errors(outline, sides_of(corners), corners)
    assert corner < 1.0
    assert outline is not None
    assert outline.confidence > BELIEVED_CONFIDENCE


def test_black_bands_beside_the_photo_are_no_ground() -> None:
    photo = draw_sheet(sides_of(CORNERS), SIZE)
    wide = cv2.copyMakeBorder(photo, 0, 0, 70, 70, cv2.BORDER_CONSTANT, value=(0, 0, 0))
    moved = CORNERS + np.array([70.0, 0.0])
    side, corner = _errors(find_outline(wide), sides_of(moved), moved)
    assert side < 0.5
    assert corner < 1.0


def test_no_outline_where_no_sheet_ends() -> None:
    rng = np.random.default_rng(4)
    paper = np.full((820, 660, 3), 226.0) + rng.normal(0, 3, (820, 660, 3))
    paper -= np.linspace(0, 60, 660)[None, :, None]
    photo = np.asarray(np.clip(paper, 0, 255), np.uint8)
    for row in range(80, 760, 24):
        cv2.putText(photo, "lorem ipsum dolor sit amet", (60, row), 0, 0.9, (40, 40, 50), 2, cv2.LINE_AA)
    assert find_outline(photo) is None
    noise = np.asarray(rng.integers(0, 255, (300, 400, 3)), np.uint8)
    assert find_outline(noise) is None
    assert find_outline(np.zeros((40, 40, 3), np.uint8)) is None


def test_a_turned_photo_has_the_turned_outline() -> None:
    photo = draw_sheet(sides_of(CORNERS, 0.03), SIZE)
    outline = find_outline(photo)
    turned = find_outline(np.ascontiguousarray(photo[::-1, ::-1]))
    assert outline is not None
    assert turned is not None
    back = np.array(SIZE) - 1 - turned.corners
    assert np.abs(np.roll(back, 2, axis=0) - outline.corners).max() < 0.7


def test_print_on_the_desk_does_not_mislead() -> None:
    photo = draw_sheet(sides_of(CORNERS), SIZE)
    rng = np.random.default_rng(5)
    print_points = CORNERS.min(axis=0) + 90 + rng.random((120, 2)) * [250, 400]
    false_points = rng.random((60, 2)) * SIZE
    side, corner = _errors(
        find_outline(photo, np.concatenate([print_points, false_points])), sides_of(CORNERS), CORNERS
    )
    assert side < 0.5
    assert corner < 1.0


def test_a_search_for_whole_sheets_ends_where_the_photo_cuts_the_sheet() -> None:
    photo = draw_sheet(sides_of(CORNERS), SIZE)
    cut = np.ascontiguousarray(photo[:, 220:])  # the left side is out of view
    whole = OutlineParameters(candidates=CandidateParameters(most_cut=0.15), most_cut=0.1)
    assert find_outline(photo, parameters=whole) is not None
    assert find_outline(cut, parameters=whole) is None
    left = find_outline(cut)
    assert left is not None, "all sides that are in view are found otherwise"
    assert sorted(side.seen > 0.3 for side in left.sides) == [False, True, True, True]


@pytest.mark.parametrize("width", [45, 70])
def test_a_lit_stripe_of_a_desk_is_no_part_of_the_sheet(width: int) -> None:
    # Beside the lower part of the right side: its own edge is as clear as the sheet's, its colour is not.
    sides = sides_of(CORNERS)
    photo = draw_sheet(sides, SIZE, ground=(120, 80, 40))
    begin, end = CORNERS[1] + 0.4 * (CORNERS[2] - CORNERS[1]), CORNERS[2]
    aside = np.array([width, 0])
    stripe = np.array([begin, begin + aside, end + aside, end])
    lit = photo.copy()
    cv2.fillConvexPoly(lit, stripe.astype(np.int32), (215, 190, 150))
    sheet = np.zeros(photo.shape[:2], np.uint8)
    cv2.fillPoly(sheet, [np.round(sides).astype(np.int32)], 1)
    x, y = np.meshgrid(np.arange(150, 500, 12), np.arange(160, 660, 20))
    text = np.column_stack([x.ravel(), y.ravel()]).astype(np.float64)
    outline = find_outline(np.where(sheet[..., None] > 0, photo, lit), text)
    side, corner = _errors(outline, sides, CORNERS)
    assert side < 1.0
    assert corner < 1.5


def test_of_two_outlines_the_outer_one_is_taken_unless_the_inner_one_is_clearly_surer() -> None:
    outline = find_outline(draw_sheet(sides_of(CORNERS), SIZE))
    assert outline is not None

    def measured(confidence: float, scale: float) -> MeasuredOutline:
        scaled = replace(outline, confidence=confidence, polygon=scale * outline.polygon)
        return MeasuredOutline(scaled, Candidate(scaled.polygon, 0.0, 0.0), ())

    whole = measured(0.946, 1.0)
    assert not is_surer(measured(0.976, 0.9), whole)
    assert is_surer(measured(0.99, 0.9), whole)
    assert is_surer(measured(0.95, 1.1), whole)
    assert is_surer(measured(0.6, 0.9), measured(0.45, 1.0))


def test_log_odds_of_some_colours_are_those_of_all() -> None:
    rng = np.random.default_rng(0)
    codes = color_codes(rng.normal(50, 20, (60, 50, 3)).astype(np.float32))
    inside = np.zeros(codes.shape, bool)
    inside[10:40, 5:30] = True
    counts = count_colors(codes, inside), count_colors(codes, ~inside)
    assert (counts[0] == count_colors(codes[inside])).all()
    assert np.array_equal(color_log_odds(*counts, codes[::7, 3]), color_log_odds(*counts)[codes[::7, 3]])


def test_a_curve_that_leaves_the_sheets_edge_parts_its_colours_worse() -> None:
    # The lower part of the sheet lies below a coloured band: a curve that ends at the band has paper on both sides.
    colors = np.full((200, 160, 3), (30.0, 10.0, 10.0), np.float32)
    colors[20:180, 20:140] = (90.0, 0.0, 0.0)
    colors[120:130, 24:136] = (60.0, 20.0, 50.0)
    codes = color_codes(colors)
    sheet = np.array([[19.5, 19.5], [139.5, 19.5], [139.5, 179.5], [19.5, 179.5]])
    to_band = np.minimum(sheet, [200.0, 129.5])
    beside = sheet + np.array([[0, 0], [12, 0], [12, 0], [0, 0]])
    counts = count_colors(codes)
    whole = parted_colors(codes, counts, sheet)
    assert whole > 0.95
    assert parted_colors(codes, counts, to_band) < whole - 0.1
    assert parted_colors(codes, counts, beside) < whole - 0.1
