"""A view says how flat it is: right ones expect a small error, bent ones about their own, and are tried again."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from services.arrays import Points
from services.contract.rectify import RectifyParameters
from services.geometry.focal_prior import typical_focal_prior
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.view.flatness import NOT_FLAT_PERCENT, measure_flatness
from services.rectify.view.judged_view import best_view
from services.sheet.curved_page import estimate_curved_page
from services.sheet.plane.framing import FlatFrame
from services.sheet.plane.planar_page import PlanarPage
from services.sheet.plane.pose import choose_pose
from services.sheet.shape import NoShape
from services.sheet.sheet_edges import read_edges
from tests.services.scenes import Album, Shot
from tests.services.sheet.sheet_sides import outline_of_truth

pytestmark = pytest.mark.pipeline


@pytest.fixture(scope="module")
def album() -> Album:
    return Album()


def as_plane(shot: Shot) -> ShapedPage:
    prior = typical_focal_prior()
    shape = choose_pose(shot.evidence, prior)
    points = shot.evidence.vanishing_points
    return ShapedPage(shot.frame, shape, (), None, shot.analysis, points)


@dataclass(frozen=True, slots=True, eq=False)
class BentFrame(FlatFrame):
    """A view that is wrong on purpose: its lower parts are moved aside, its middle down, by `bend` widths."""

    bend: float = 0.0

    def to_flat(self, photo: Points) -> Points:
        """See `Frame`."""
        pixels = FlatFrame.to_flat(self, photo)
        across, down = pixels[:, 0] / self.width - 0.5, pixels[:, 1] / self.height - 0.5
        return pixels + self.bend * self.width * np.column_stack([down**2, across**2])


@dataclass(frozen=True, eq=False)
class KinkedFrame(FlatFrame):
    """A view whose right lower quarter is turned aside at a kink, by `slope`, as by folds that no mesh followed."""

    slope: float = 0.0

    def to_flat(self, photo: Points) -> Points:
        """See `Frame`."""
        pixels = FlatFrame.to_flat(self, photo)
        beyond = np.maximum(pixels[:, 0] - 0.6 * self.width, 0.0) * (pixels[:, 1] > 0.6 * self.height)
        return pixels + self.slope * np.column_stack([np.zeros(len(pixels)), beyond])


@pytest.mark.parametrize("name", ["plain", "columns", "dirty"])
def test_a_flat_view_expects_little(album: Album, name: str) -> None:
    page = as_plane(album[name])
    found = measure_flatness(page, page.frame(None, "sheet"))
    assert found is not None
    assert found.passes
    assert found.error_percent < 0.4
    assert found.line_straightness is not None
    assert 0 < found.line_straightness < 0.05


def test_a_bent_view_asks_to_be_moved_by_its_bend(album: Album) -> None:
    page = as_plane(album["plain"])
    flat = page.frame(None, "text")
    assert isinstance(flat, FlatFrame)
    asked = []
    for bend in (0.0, 0.08):
        found = measure_flatness(page, BentFrame(flat.H_photo_flat, flat.width, flat.height, bend))
        assert found is not None
        asked.append(found.asked_percent)
    true = 100 * 0.08 * float(np.hypot(*[np.std(np.linspace(-0.5, 0.5, 99) ** 2)] * 2))
    assert 0.5 * true < asked[1] < 1.3 * true
    assert asked[0] < 0.15 * true


def test_a_kink_that_no_smooth_field_follows_is_seen_in_the_lines(album: Album) -> None:
    page = as_plane(album["plain"])
    flat = page.frame(None, "text")
    assert isinstance(flat, FlatFrame)
    shown = []
    for slope in (0.0, 0.1):
        found = measure_flatness(page, KinkedFrame(flat.H_photo_flat, flat.width, flat.height, slope))
        assert found is not None
        shown.append(found)
    assert shown[0].passes
    assert shown[0].lines_percent < 0.02
    # Lines within the kinked quarter rise by up to 4 % of the width: over the page their distance from level is a
    # fifth of a percent to one.
    assert 0.2 < shown[1].lines_percent < 1.0
    assert not shown[1].passes


def test_straight_sides_leave_a_flat_view_flat(album: Album) -> None:
    shot = album["plain"]
    outline = outline_of_truth(shot.truth, 0.3, np.random.default_rng(0))
    page = replace(as_plane(shot), outline=outline)
    found = measure_flatness(page, page.frame(None, "sheet"))
    assert found is not None
    assert found.passes


def test_uncertain_proportions_are_part_of_the_error_but_no_warning(album: Album) -> None:
    page = as_plane(album["plain"])
    assert isinstance(page.shape, PlanarPage)
    frame = page.frame(None, "sheet")
    stretched = replace(page, shape=replace(page.shape, log_aspect_deviation=0.1))
    found = measure_flatness(stretched, frame)
    assert found is not None
    assert found.passes
    # Of a grid that is stretched by e^0.1, less the best similarity.
    x, y = (
        axis.ravel()
        for axis in np.meshgrid(np.linspace(0, frame.width, 50), np.linspace(0, frame.height, 50))
    )
    z = (x - x.mean()) + 1j * (y - y.mean())
    moved = 1.1 * z.real + 1j * z.imag
    rest = moved - z * (np.conj(z) @ moved) / np.sum(np.abs(z) ** 2)
    assert found.proportions_percent == pytest.approx(
        100 * np.sqrt(np.mean(np.abs(rest) ** 2)) / frame.width, rel=0.05
    )
    assert found.error_percent == pytest.approx(np.hypot(found.shown_percent, found.proportions_percent))


@pytest.mark.parametrize(("fitted", "least", "most"), [(False, 0.3, 2.0), (True, 0.0, 0.25)])
def test_one_side_that_a_smooth_sheet_was_not_fitted_to_asks_for_little(
    album: Album, fitted: bool, least: float, most: float
) -> None:
    shot = album["plain"]
    outline = outline_of_truth(shot.truth, 0.3, np.random.default_rng(0))
    left = outline.sides[3]
    along = np.linspace(-1, 1, len(left.points))[:, None]
    strayed = replace(left, points=left.points + np.array([0.03 * shot.frame.width, 0.0]) * along**2)
    outline = replace(outline, sides=(*outline.sides[:3], strayed))
    page = replace(as_plane(shot), outline=outline)
    if fitted:
        bent = estimate_curved_page(shot.evidence, typical_focal_prior())
        assert not isinstance(bent, NoShape)
        page = replace(page, shape=replace(bent, edges=read_edges(outline, shot.frame, 0.0)))
    found = measure_flatness(page, page.frame(None, "sheet"))
    assert found is not None
    assert least <= found.asked_percent < most


def test_a_bent_page_that_was_taken_for_a_plane_is_tried_again(album: Album) -> None:
    shot = album["book"]
    bent = estimate_curved_page(shot.evidence, typical_focal_prior())
    assert not isinstance(bent, NoShape)
    page = as_plane(shot)
    page = replace(page, others=iter([replace(page, shape=bent)]))
    wrong = measure_flatness(page, page.frame(None, "sheet"))
    assert wrong is not None
    assert wrong.error_percent > NOT_FLAT_PERCENT
    view = best_view(shot.photo.image, page, RectifyParameters())
    assert view.page.shape.kind == "curved"
    assert view.error_percent is not None
    assert view.error_percent < NOT_FLAT_PERCENT
    assert "not-flat" not in [notice.code for notice in view.notices]


def test_without_another_shape_the_best_is_answered_with_a_warning(album: Album) -> None:
    shot = album["book"]
    view = best_view(shot.photo.image, as_plane(shot), RectifyParameters(kind="planar"))
    assert view.page.shape.kind == "planar"
    assert [notice.code for notice in view.notices] == ["not-flat"]
