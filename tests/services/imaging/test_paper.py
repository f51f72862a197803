"""The sheet round the text: its outline, what lies on it, and when its edge cannot be told."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from services.arrays import Points
from services.imaging.paper import continue_nearest, continue_smoothly, model_paper, row_ends
from simulation.degradation import desk_texture
from tests.counts import some
from tests.services.scenes import FLAT_SCENES, Album

Rgb = NDArray[np.uint8]
SHEET = (200, 150, 700, 850)
"""x0, y0, x1, y1 of a sheet drawn on a photo 900 x 1000."""


def overlap(outline: Points, mask: NDArray[np.bool_]) -> float:
    """Intersection over union of a polygon and a mask (H, W)."""
    drawn = np.zeros(mask.shape, np.uint8)
    cv2.fillPoly(drawn, [np.round(outline).astype(np.int32)], 1)
    return float((drawn & mask).sum() / (drawn | mask).sum())


def sheet_mask(shape: tuple[int, int] = (1000, 900)) -> NDArray[np.bool_]:
    """(H, W) True on `SHEET`."""
    mask = np.zeros(shape, bool)
    mask[SHEET[1] : SHEET[3], SHEET[0] : SHEET[2]] = True
    return mask


def draw_sheet(desk: tuple[int, int, int] | Rgb, paper: tuple[int, int, int] = (225, 222, 214)) -> Rgb:
    """A sheet with rows of print on a desk."""
    photo = np.empty((1000, 900, 3), np.uint8)
    photo[:] = desk
    x0, y0, x1, y1 = SHEET
    photo[y0:y1, x0:x1] = paper
    for x, y in print_points().astype(int):
        cv2.rectangle(photo, (x - 4, y - 5), (x + 4, y + 5), (40, 40, 40), 2)
    return photo


def print_points() -> Points:
    """Centres (N, 2) of the characters on the drawn sheet."""
    x, y = np.meshgrid(np.arange(240, 661, 14.0), np.arange(200, 801, 28.0))
    return np.stack([x.ravel(), y.ravel()], axis=1)


@pytest.mark.long
@pytest.mark.parametrize("name", some(3, [*FLAT_SCENES]))
def test_sheets_of_simulated_photos_are_outlined(album: Album, name: str) -> None:
    shot = album[name]
    outline = shot.analysis.paper.outline(shot.analysis.characters)
    assert outline is not None
    assert overlap(outline, shot.truth.page_mask()) > 0.97
    assert shot.analysis.paper.holds(shot.text_points).mean() > 0.99


@pytest.mark.parametrize("desk", [(60, 50, 40), (0, 0, 0), (130, 110, 90), (60, 90, 140), (225, 150, 120)])
def test_a_sheet_on_darker_or_coloured_ground(desk: tuple[int, int, int]) -> None:
    photo = draw_sheet(desk)
    paper = model_paper(photo, print_points())
    outline = paper.outline(print_points())
    assert outline is not None
    assert overlap(outline, sheet_mask()) > 0.97
    assert paper.holds(print_points()).all()


def test_a_gray_sheet_on_a_lighter_desk() -> None:
    outline = model_paper(draw_sheet((250, 250, 250), (150, 150, 150)), print_points()).outline(
        print_points()
    )
    assert outline is not None
    assert overlap(outline, sheet_mask()) > 0.97


def test_a_desk_of_the_papers_own_colour_has_no_edge() -> None:
    photo = draw_sheet((222, 220, 214))
    assert model_paper(photo, print_points()).outline(print_points()) is None


def test_a_sheet_that_fills_the_photo_has_no_edge() -> None:
    x0, y0, x1, y1 = SHEET
    photo = np.ascontiguousarray(draw_sheet((60, 50, 40))[y0 + 5 : y1 - 5, x0 + 5 : x1 - 5])
    points = print_points() - [x0 + 5, y0 + 5]
    paper = model_paper(photo, points)
    assert paper.outline(points) is None
    assert paper.holds(points).all()


def test_text_on_the_desk_is_told_from_text_on_the_sheet() -> None:
    photo = draw_sheet((70, 55, 45))
    beside = np.stack([np.full(20, 800.0), np.linspace(100, 900, 20)], axis=1)
    for x, y in beside.astype(int):
        cv2.rectangle(photo, (x - 4, y - 5), (x + 4, y + 5), (15, 15, 15), 2)
    both = np.concatenate([print_points(), beside])
    paper = model_paper(photo, both)
    held = paper.holds(both)
    assert held[:-20].all()
    assert not held[-20:].any()
    outline = paper.outline(print_points())
    assert outline is not None
    assert overlap(outline, sheet_mask()) > 0.97


def test_text_on_a_second_sheet_leaves_no_single_outline() -> None:
    photo = draw_sheet((60, 50, 40))
    photo[300:700, 760:890] = (225, 222, 214)
    other = np.stack([np.full(60, 820.0), np.linspace(310, 690, 60)], axis=1)
    both = np.concatenate([print_points(), other])
    assert model_paper(photo, both).outline(both) is None
    alone = model_paper(photo, print_points()).outline(print_points())
    assert alone is not None
    assert overlap(alone, sheet_mask()) > 0.97


def test_tinted_boxes_are_paper() -> None:
    photo = draw_sheet((60, 50, 40))
    photo[400:500, 220:680] = np.minimum(photo[400:500, 220:680], (200, 205, 225))
    points = print_points()
    assert model_paper(photo, points).holds(points).all()


@pytest.mark.parametrize("strength", [0.3, 0.5])
def test_shadow_and_slope_of_light_stay_on_the_sheet(strength: float) -> None:
    photo = draw_sheet((60, 50, 40)).astype(float)
    y, x = np.mgrid[0:1000, 0:900]
    ramp = 1 - 0.3 * y / 1000
    shadow = 1 - strength * np.clip((x + 0.3 * y - 550) / 60 + 0.5, 0, 1)
    lit = (photo * (ramp * shadow)[..., None]).astype(np.uint8)
    paper = model_paper(lit, print_points())
    assert paper.holds(print_points()).mean() > 0.97
    outline = paper.outline(print_points())
    assert outline is not None
    assert overlap(outline, sheet_mask()) > 0.95


def test_a_wooden_desk() -> None:
    photo = draw_sheet(desk_texture(900, 1000, np.random.default_rng(0)))
    outline = model_paper(photo, print_points()).outline(print_points())
    assert outline is not None
    assert overlap(outline, sheet_mask()) > 0.97


@pytest.mark.parametrize("factor", [0.3, 2.0])
def test_outline_is_in_photo_pixels_at_any_size(factor: float) -> None:
    photo = cv2.resize(draw_sheet((60, 50, 40)), None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
    points = (print_points() + 0.5) * factor - 0.5
    outline = model_paper(np.asarray(photo, np.uint8), points).outline(points)
    assert outline is not None
    back = (outline + 0.5) / factor - 0.5
    assert back.min(axis=0) == pytest.approx([200, 150], abs=5)
    assert back.max(axis=0) == pytest.approx([700, 850], abs=5)


@pytest.mark.parametrize("shape", [(1, 1), (3, 3), (20, 20), (5, 300)])
def test_tiny_photos_are_answered(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(1)
    for photo in (np.zeros((*shape, 3)), np.full((*shape, 3), 255), rng.integers(0, 256, (*shape, 3))):
        points = rng.uniform(0, 1, (7, 2)) * [shape[1] - 1, shape[0] - 1]
        paper = model_paper(photo.astype(np.uint8), points)
        assert np.isfinite(paper.contrast).all()
        assert np.isfinite(paper.chroma).all()
        assert paper.holds(points).shape == (7,)
        paper.outline(points)


def surface(coefficients: list[float]) -> NDArray[np.float64]:
    """Quadratic of the place over an image 80 x 60."""
    y, x = np.mgrid[0:80, 0:60] / 40.0 - 0.7
    terms = [np.ones_like(x), x, y, x * x, x * y, y * y]
    return np.asarray(sum(c * t for c, t in zip(coefficients, terms, strict=True)))


@pytest.mark.parametrize(
    "coefficients", [[5.0, 0, 0, 0, 0, 0], [5.0, 0.3, -0.2, 0, 0, 0], [5, 0.1, 0.1, -0.2, 0.1, 0]]
)
def test_smooth_light_is_continued(coefficients: list[float]) -> None:
    values = surface(coefficients)
    at = np.random.default_rng(2).integers([5, 5], [55, 75], (400, 2))
    found = continue_smoothly(values, at)
    # Curvature is damped: where no text holds it, in the corners, it is followed in part only.
    assert np.abs(found - values).max() < (0.2 if coefficients[3] else 0.03)
    assert np.abs(found - values)[at[:, 1], at[:, 0]].mean() < 0.03


def test_a_tenth_of_text_on_other_ground_does_not_bend_the_light() -> None:
    values = surface([5.0, 0.3, -0.2, 0, 0, 0])
    at = np.random.default_rng(3).integers([5, 5], [55, 75], (400, 2))
    spoilt = values.copy()
    spoilt[at[:40, 1], at[:40, 0]] -= 1.5
    assert np.abs(continue_smoothly(spoilt, at) - values).max() < 0.12


def test_nearest_light_is_that_of_the_nearest_text() -> None:
    values = np.random.default_rng(4).random((50, 70))
    at = np.array([[10, 10], [60, 40], [60, 10]])
    found = continue_nearest(values, at)
    assert found.shape == values.shape
    for x, y in ((0, 0), (69, 49), (69, 0), (12, 20), (50, 45)):
        nearest = at[np.argmin(np.hypot(*(at - [x, y]).T))]
        assert found[y, x] == pytest.approx(values[nearest[1], nearest[0]])


def test_the_hull_of_a_sheet_that_a_picture_divides() -> None:
    photo = draw_sheet((90, 60, 40))
    x0, _, x1, _ = SHEET
    photo[420:560, x0:x1] = (40, 70, 60)
    points = print_points()
    points = points[(points[:, 1] < 410) | (points[:, 1] > 570)]
    paper = model_paper(photo, points)
    assert paper.outline(points) is None
    hull = paper.hull(points)
    assert hull is not None
    assert 0.9 < overlap(hull, sheet_mask()) <= 1.0


def test_there_is_no_hull_where_paper_fills_the_photo() -> None:
    photo = draw_sheet((225, 222, 214))
    assert model_paper(photo, print_points()).hull(print_points()) is None


def two_sheets(strip: tuple[int, int, int] | None = None, tilt: int = 0) -> tuple[Rgb, Points]:
    """Two halves of print on a desk, as two sheets 140 px apart or, with a `strip` of a colour between, as one."""
    photo = np.full((600, 900, 3), (90, 70, 50), np.uint8)
    points = []
    for x0, lean in ((100, 0), (520, tilt)):
        corners = np.array([[x0, 90 + lean], [x0 + 280, 90], [x0 + 280, 510], [x0, 510 + lean]])
        cv2.fillConvexPoly(photo, corners, (225, 222, 214))
        for y in range(150, 470, 24):
            points += [(float(x), float(y)) for x in range(x0 + 30, x0 + 250, 12)]
    if strip is not None:
        photo[90:510, 380:520] = strip
    for x, y in points:
        cv2.rectangle(photo, (int(x) - 3, int(y) - 4), (int(x) + 3, int(y) + 4), (40, 40, 40), 2)
    return photo, np.array(points)


@pytest.mark.parametrize("tilt", [0, 40])
def test_sheets_side_by_side_are_told_apart(tilt: int) -> None:
    photo, points = two_sheets(tilt=tilt)
    points = np.vstack([points, points[:40] + 1.0])  # the left one has more
    first, second = model_paper(photo, points).sheets(points)
    left = points[:, 0] < 450
    assert np.array_equal(first.holds, left)
    assert np.array_equal(second.holds, ~left)
    assert first.window == pytest.approx((0, 0, 450, 600), abs=12)
    assert second.window == pytest.approx((450, 0, 900, 600), abs=12)


@pytest.mark.parametrize(
    "strip", [(20, 60, 160), (225, 222, 214), (180, 178, 170)], ids=["picture", "paper", "gray"]
)
def test_a_page_that_a_picture_divides_is_one_sheet(strip: tuple[int, int, int]) -> None:
    photo, points = two_sheets(strip)
    assert model_paper(photo, points).sheets(points) == []


def test_a_sheet_alone_has_no_other() -> None:
    assert model_paper(draw_sheet((60, 50, 40)), print_points()).sheets(print_points()) == []


@pytest.mark.parametrize("share", [0.02, 0.3, 0.9])
def test_the_ends_of_rows_have_the_hull_of_the_mask(share: float) -> None:
    noise = cv2.GaussianBlur(np.random.default_rng(3).random((70, 90)), (0, 0), 3.0)
    mask = np.asarray(noise < np.quantile(noise, share))
    whole = cv2.convexHull(np.argwhere(mask)[:, ::-1].astype(np.int32))
    np.testing.assert_array_equal(cv2.convexHull(row_ends(mask)), whole)
