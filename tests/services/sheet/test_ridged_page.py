"""Creased sheets by their outline and text: as flat as the truth says, and refused where no paper looks like that."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from services.arrays import Points, Vector
from services.geometry.focal_prior import FocalPrior
from services.geometry.page_map import PageMap
from services.geometry.photo_frame import PhotoFrame
from services.sheet import ridged_page
from services.sheet.developable.observations import LineObservations, Run
from services.sheet.outline.results import SheetOutline
from services.sheet.ridged_page import (
    RidgedPage,
    complete_corners,
    estimate_ridged_page,
    sides_bend,
    turn_outline,
)
from services.sheet.shape import NoShape
from simulation.flat_page import Page
from simulation.folded import folded_in_thirds
from simulation.sheets import SHEET_ASPECT, SHEET_VIEWS
from simulation.surfaces import Shape
from simulation.truth import Truth
from tests.services.sheet.sheet_sides import (
    FRAME,
    bent_outline_of_truth,
    leaning,
    outline_of,
    seen_rectangle,
)

pytestmark = pytest.mark.pipeline

SHEET = Page(np.full((283, 200), 255, np.uint8))
SIZE = (1500, 1930)
VIEW = PhotoFrame(*SIZE)
FOLDED = folded_in_thirds(SHEET_ASPECT, 22, -18)


@lru_cache
def truth_of(view: int, shape: Shape = FOLDED) -> Truth:
    camera = SHEET_VIEWS[view].camera(*SIZE)
    return Truth(SHEET, shape, 0.0, SHEET_VIEWS[view].pose(SHEET, shape, camera, 0.06), camera)


def prior_of(truth: Truth) -> FocalPrior:
    return FocalPrior(float(np.log(truth.focal_length_px / VIEW.unit_px)), 0.03, "exif")


def lines_of(truth: Truth, rng: np.random.Generator) -> LineObservations:
    """Level lines on the sheet in six paragraphs, as they are seen with half a pixel of noise."""
    s, t = np.linspace(-0.75, 0.75, 30), np.linspace(-1.15, 1.15, 42)
    sheet = np.stack([np.tile(s, len(t)), np.repeat(t, len(s))], axis=1)
    points = truth.sheet_to_photo(sheet) + rng.normal(0, 0.5, (len(sheet), 2))
    numbers = np.arange(len(t))
    runs = [Run(numbers[k : k + 7], np.arange(7.0)) for k in numbers[::7]]
    unit = VIEW.unit_px
    margin = truth.sheet_to_photo(np.stack([np.full(len(t), -0.75), t], axis=1))
    return LineObservations(
        (points - VIEW.centre) / unit,
        np.repeat(numbers, len(s)),
        np.full(len(sheet), 0.5 / unit),
        runs,
        [np.arange(len(runs))],
        [(margin - VIEW.centre) / unit],
        16.0 / unit,
    )


def map_errors(truth: Truth, page_map: PageMap) -> Vector:
    """Distances (N,) from the true sheet after the best similarity, in widths of the sheet."""
    s, t = np.meshgrid(np.linspace(-0.97, 0.97, 25), np.linspace(-1.38, 1.38, 35))
    sheet = np.stack([s.ravel(), t.ravel()], axis=1)
    page = page_map.to_page((truth.sheet_to_photo(sheet) - VIEW.centre) / VIEW.unit_px)
    assert np.isfinite(page).all()
    a, b = ((p - p.mean(axis=0)) @ np.array([1, 1j]) for p in (page, sheet))
    return np.asarray(np.abs(np.vdot(a, b) / np.vdot(a, a) * a - b) / 2)


def estimate(truth: Truth, *, text: bool = True, outline: SheetOutline | None = None) -> RidgedPage | NoShape:
    rng = np.random.default_rng(4)
    outline = outline or bent_outline_of_truth(truth, 0.5, rng)
    lines = lines_of(truth, rng)
    return estimate_ridged_page(
        outline,
        VIEW,
        prior_of(truth),
        0.0,
        (lambda _: lines) if text else None,
        None,
    )


@pytest.mark.parametrize("view", [0, 2, 3])
def test_a_folded_sheet_comes_out_flat_by_text_and_sides(view: int) -> None:
    truth = truth_of(view)
    page = estimate(truth)
    assert isinstance(page, RidgedPage)
    off = map_errors(truth, page.page_map)
    assert np.median(off) < 0.005
    assert np.quantile(off, 0.95) < 0.014
    assert page.mesh.aspect_ratio == pytest.approx(1 / SHEET_ASPECT, rel=0.015)
    assert page.focal == pytest.approx(truth.focal_length_px / VIEW.unit_px, rel=0.05)
    assert (page.line_count, page.focal_source) == (21, "exif")
    assert page.line_straightness < 0.06
    assert page.stretch < 0.005
    assert page.side_deviation < 2.0 / VIEW.unit_px


def test_its_surface_is_described_in_photo_pixels_and_true_normals() -> None:
    truth = truth_of(2)
    page = estimate(truth)
    assert isinstance(page, RidgedPage)
    surface = page.surface(VIEW)
    rows, columns = surface.points.shape[:2]
    assert surface.normals.shape == (rows - 1, columns - 1, 3)
    corners = surface.points[[0, 0, -1, -1], [0, -1, -1, 0]]
    true = truth.sheet_to_photo(np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [1.0, SHEET_ASPECT])
    assert np.abs(corners - true).max() < 6
    middles = (surface.points[:-1, :-1] + surface.points[1:, 1:]).reshape(-1, 2) / 2
    cosines = np.einsum("ni,ni->n", truth.normals(middles), surface.normals.reshape(-1, 3))
    assert np.allclose(np.linalg.norm(surface.normals, axis=2), 1)
    # A crease is as wide as a cell of the mesh.
    assert np.median(np.degrees(np.arccos(np.clip(cosines, -1, 1)))) < 4
    assert (cosines > 0.8).all()


@pytest.mark.parametrize("view", [0, 2, 3])
def test_the_outline_alone_gives_a_sheet_of_the_right_shape(view: int) -> None:
    truth = truth_of(view)
    page = estimate(truth, text=False)
    assert isinstance(page, RidgedPage)
    assert page.mesh.aspect_ratio == pytest.approx(1 / SHEET_ASPECT, rel=0.03)
    assert np.median(map_errors(truth, page.page_map)) < 0.02
    assert page.line_count == 0
    assert np.isnan(page.line_straightness)


def test_a_corner_that_is_folded_under_does_not_stop_it() -> None:
    truth = truth_of(0)
    outline = bent_outline_of_truth(truth, 0.5, np.random.default_rng(4))
    corners = outline.corners.copy()
    corners[1] = np.nan
    top, right = outline.sides[0], outline.sides[1]
    cut = (
        replace(top, points=top.points[:-8], deviations=top.deviations[:-8], seen=0.87),
        replace(right, points=right.points[8:], deviations=right.deviations[8:], seen=0.87),
    )
    page = estimate(truth, outline=replace(outline, corners=corners, sides=(*cut, *outline.sides[2:])))
    assert isinstance(page, RidgedPage)
    assert np.median(map_errors(truth, page.page_map)) < 0.007


@pytest.mark.parametrize("view", [0, 2])
def test_a_sheet_with_two_straight_sides_starts_as_a_cylinder(view: int) -> None:
    truth = truth_of(view, folded_in_thirds(SHEET_ASPECT, -40, 40))
    page = estimate(truth)
    assert isinstance(page, RidgedPage)
    # Begun between its sides only, the fit ends at 0.0081 and 0.0053.
    assert np.median(map_errors(truth, page.page_map)) < 0.0048


@pytest.mark.parametrize("view", range(4))
def test_a_corner_that_is_not_seen_lies_beyond_the_last_part_of_a_folded_side(view: int) -> None:
    outline = bent_outline_of_truth(truth_of(view), 0.5, np.random.default_rng(4))
    corners = outline.corners.copy()
    corners[1] = np.nan
    top, right = (
        replace(side, points=side.points[ends])
        for side, ends in zip(outline.sides[:2], (slice(None, -5), slice(5, None)), strict=True)
    )
    found = complete_corners(replace(outline, corners=corners, sides=(top, right, *outline.sides[2:])))
    assert found is not None
    assert np.linalg.norm(found[1] - outline.corners[1]) < 3.0


@pytest.mark.parametrize("missing", range(4))
def test_a_corner_that_is_not_seen_is_where_the_sides_meet(missing: int) -> None:
    corners = seen_rectangle(0.7, leaning(25.0, 40.0, 5.0), 1.3)
    outline = outline_of(corners, 0.0, np.random.default_rng(0))
    partial = outline.corners.copy()
    partial[missing] = np.nan
    found = complete_corners(replace(outline, corners=partial))
    assert found is not None
    assert np.allclose(found, outline.corners, atol=1e-3)
    none = replace(outline.sides[missing], points=np.zeros((0, 2)), deviations=np.zeros(0))
    sides = tuple(none if k == missing else side for k, side in enumerate(outline.sides))
    bare = replace(outline, corners=partial, sides=(sides[0], sides[1], sides[2], sides[3]))
    assert complete_corners(bare) is None


def quarter_turned(corners: Points, quarters: int) -> Points:
    """The corners of the photo turned clockwise, again from its top left."""
    for _ in range(quarters):
        corners = np.stack([2000 - corners[:, 1], corners[:, 0]], axis=1)
    return np.asarray(np.roll(corners, -int(np.argmin(corners.sum(axis=1))), axis=0))


@pytest.mark.parametrize("quarters", range(4))
@pytest.mark.parametrize("lean_deg", [-30.0, 0.0, 20.0])
def test_the_outline_is_turned_to_the_text_whichever_way_the_photo_is(quarters: int, lean_deg: float) -> None:
    c, s = np.cos(np.radians(lean_deg)), np.sin(np.radians(lean_deg))
    upright = np.array([[-350.0, -500.0], [350.0, -500.0], [350.0, 500.0], [-350.0, 500.0]])
    corners = quarter_turned(upright @ np.array([[c, s], [-s, c]]) + 1000, quarters)
    direction = np.radians(lean_deg) + quarters * np.pi / 2
    for half_turn in (-np.pi, 0.0, np.pi):
        turned, order = turn_outline(corners, direction + half_turn)
        top = turned[1] - turned[0]
        # The top side is a short one, along the text, left to right as the photo shows it.
        assert np.linalg.norm(top) == pytest.approx(700)
        assert abs(top @ [-np.sin(direction), np.cos(direction)]) < 1e-6
        assert top[0] > -1e-6
        assert np.allclose(turned, corners[list(order)])
        assert sorted(order) == [0, 1, 2, 3]
        # Clockwise still.
        assert np.linalg.det(np.stack([turned[1] - turned[0], turned[2] - turned[1]])) > 0


def test_a_photo_on_its_side_gives_the_page_on_its_side() -> None:
    truth = truth_of(0)
    outline = bent_outline_of_truth(truth, 0.5, np.random.default_rng(4))
    page = estimate_ridged_page(outline, VIEW, prior_of(truth), np.pi / 2, None, None)
    assert isinstance(page, RidgedPage)
    assert page.mesh.aspect_ratio == pytest.approx(SHEET_ASPECT, rel=0.04)


def test_bent_sides_are_told_from_straight_ones() -> None:
    rng = np.random.default_rng(0)
    straight = outline_of(seen_rectangle(0.7, leaning(25.0, 40.0, 5.0), 1.3), 0.3, rng)
    folded = bent_outline_of_truth(truth_of(2), 0.3, rng)
    assert FRAME.unit_px > 1000
    assert sides_bend(straight) < 0.001
    assert sides_bend(folded) > 0.006


def refusal(**changes: object) -> str:
    truth = truth_of(2)
    outline = replace(bent_outline_of_truth(truth, 0.5, np.random.default_rng(4)), **changes)  # type: ignore[arg-type]
    found = estimate(truth, text=False, outline=outline)
    assert isinstance(found, NoShape)
    return found.reason


def test_an_outline_that_is_not_seen_is_no_sheet() -> None:
    outline = bent_outline_of_truth(truth_of(2), 0.5, np.random.default_rng(4))
    unseen = replace(outline.sides[1], seen=0.1)
    assert "a side" in refusal(sides=(outline.sides[0], unseen, *outline.sides[2:]))
    crossed = outline.corners[[0, 2, 1, 3]]
    assert "rectangle before a camera" in refusal(corners=crossed)


@pytest.mark.parametrize(
    ("bound", "value", "reason"),
    [
        ("MAX_STRETCH", 1e-6, "stretch"),
        ("MAX_SIDE", 1e-6, "sides are not those"),
        ("MAX_MAGNIFICATION_RATIO", 1.01, "enlarged"),
    ],
)
def test_what_is_beyond_the_bounds_of_paper_is_refused(
    bound: str, value: float, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ridged_page, bound, value)
    found = estimate(truth_of(2), text=False)
    assert isinstance(found, NoShape)
    assert reason in found.reason


def test_sides_of_no_sheet_of_paper_are_refused() -> None:
    # A leaf: both upright sides bulge by a third of the width, in opposite directions.
    outline = outline_of(seen_rectangle(0.7, np.eye(3), 1.3), 0.3, np.random.default_rng(0))
    sides = list(outline.sides)
    width = float(np.ptp(outline.corners[:, 0]))
    for k, sign in ((1, 1.0), (3, -1.0)):
        place = np.linspace(-1, 1, len(sides[k].points))
        bulge = np.outer(1 - place**2, [0.33 * width * sign, 0.0])
        sides[k] = replace(sides[k], points=sides[k].points + bulge, straightness_px=0.1 * width)
    leaf = replace(outline, sides=(sides[0], sides[1], sides[2], sides[3]))
    found = estimate_ridged_page(leaf, FRAME, FocalPrior(float(np.log(1.3)), 0.03, "exif"), 0.0, None, None)
    assert isinstance(found, NoShape)
