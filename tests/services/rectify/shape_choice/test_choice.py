"""A flat sheet stays a plane, a smooth one a smooth surface, a creased one becomes a mesh; and `kind` is honoured."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from services.arrays import Points, Vector
from services.contract.rectify import PageKind
from services.geometry.focal_prior import FocalPrior
from services.geometry.page_map import PageMap
from services.geometry.photo_frame import PhotoFrame
from services.rectify.analysis.page_analysis import analyse_photo
from services.rectify.shape_choice.choice import SMOOTH_SIDE, STRAIGHT_SIDE, choose_shape, ridged_page
from services.sheet.curved_page import CurvedPage
from services.sheet.evidence import PageEvidence
from services.sheet.outline.results import SheetOutline
from services.sheet.plane import pose
from services.sheet.plane.outline_plane import read_sides
from services.sheet.plane.planar_page import PlanarPage
from services.sheet.ridged_page import RidgedPage, sides_bend, sides_crease
from services.sheet.shape import NoShape, PageShape
from simulation.folded import folded_in_thirds
from simulation.pages import own_pages
from simulation.scenes import BOOK, PLANE
from simulation.sheets import SHEET_ASPECT, SHEET_VIEWS, Staging, photograph_sheet, with_margins
from simulation.surfaces import Shape
from simulation.truth import Truth
from tests.services.sheet.sheet_sides import bent_outline_of_truth

pytestmark = pytest.mark.pipeline

SHAPES: dict[str, Shape] = {"flat": PLANE, "folded": folded_in_thirds(SHEET_ASPECT, 24, -18), "smooth": BOOK}
SIZE = (840, 1080)
VIEW = PhotoFrame(*SIZE)


@lru_cache
def seen(name: str) -> tuple[PageEvidence, SheetOutline, Truth]:
    """What a photo of the sheet shows, with its true outline."""
    sheet = with_margins(own_pages(400, 565)[0])
    photo = photograph_sheet(
        sheet, SHEET_VIEWS[2], SHAPES[name], Staging("black"), rng=np.random.default_rng(1), size=SIZE
    )
    analysis = analyse_photo(photo.image)
    return (
        analysis.evidence(VIEW),
        bent_outline_of_truth(photo.truth, 0.4, np.random.default_rng(2)),
        photo.truth,
    )


@lru_cache
def chosen(name: str, kind: PageKind = "auto", *, outlined: bool = True) -> PageShape:
    evidence, outline, truth = seen(name)
    prior = FocalPrior(float(np.log(truth.focal_length_px / VIEW.unit_px)), 0.03, "exif")
    if not outlined:
        return choose_shape(evidence, prior, kind)
    sheet = read_sides(outline, VIEW, prior)
    assert sheet is not None
    return choose_shape(evidence, prior, kind, outline, sheet)


def errors_at_text(name: str, page_map: PageMap) -> Vector:
    """Distances (N,) from the true page at its characters after the best similarity, in widths of the sheet."""
    evidence, _, truth = seen(name)
    at = evidence.text.characters
    page = page_map.to_page((at - VIEW.centre) / VIEW.unit_px)
    known = np.isfinite(page).all(axis=1)
    assert known.mean() > 0.98
    a, b = ((p - p.mean(axis=0)) @ np.array([1, 1j]) for p in (page[known], truth.photo_to_sheet(at)[known]))
    return np.asarray(np.abs(np.vdot(a, b) / np.vdot(a, a) * a - b) / 2)


def turned(outline: SheetOutline, angle_rad: float) -> SheetOutline:
    """The outline turned about its middle."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    middle = outline.polygon.mean(axis=0)

    def turn(points: Points) -> Points:
        return np.asarray((points - middle) @ np.array([[c, s], [-s, c]]) + middle)

    sides = [replace(side, points=turn(side.points)) for side in outline.sides]
    return replace(
        outline,
        corners=turn(outline.corners),
        polygon=turn(outline.polygon),
        sides=(sides[0], sides[1], sides[2], sides[3]),
    )


def test_a_flat_sheet_stays_a_plane() -> None:
    shape = chosen("flat")
    assert isinstance(shape, PlanarPage)
    assert shape.sides_believed
    assert sides_bend(seen("flat")[1]) < STRAIGHT_SIDE
    assert np.median(errors_at_text("flat", shape.page_map)) < 0.002


def test_a_folded_sheet_becomes_a_mesh_that_is_flatter_than_the_plane() -> None:
    shape = chosen("folded")
    assert isinstance(shape, RidgedPage)
    assert sides_bend(seen("folded")[1]) > STRAIGHT_SIDE
    assert sides_crease(seen("folded")[1]) > SMOOTH_SIDE
    assert shape.line_count > 15
    off, flat = (
        errors_at_text("folded", shape.page_map),
        errors_at_text("folded", chosen("folded", "planar").page_map),
    )
    assert np.median(off) < 0.006
    assert np.median(off) < 0.5 * np.median(flat)


def test_a_smooth_sheet_stays_with_the_smooth_surface() -> None:
    shape = chosen("smooth")
    assert isinstance(shape, CurvedPage)
    assert sides_crease(seen("smooth")[1]) < SMOOTH_SIDE
    assert np.median(errors_at_text("smooth", shape.page_map)) < 0.004


@pytest.mark.parametrize("name", ["folded", "smooth"])
def test_a_plane_that_is_asked_for_is_given(name: str) -> None:
    assert isinstance(chosen(name, "planar"), PlanarPage)


@pytest.mark.parametrize("name", ["folded", "smooth"])
def test_a_bent_sheet_that_is_asked_for_is_given(name: str) -> None:
    assert not isinstance(chosen(name, "curved"), PlanarPage)


def test_without_an_outline_there_is_no_mesh() -> None:
    assert not isinstance(chosen("folded", outlined=False), RidgedPage)


def test_print_that_stands_askew_on_its_sheet_gives_no_mesh() -> None:
    evidence, outline, truth = seen("folded")
    prior = FocalPrior(float(np.log(truth.focal_length_px / VIEW.unit_px)), 0.03, "exif")
    assert isinstance(chosen("folded"), RidgedPage)
    # Another sheet, or a frame: turned by twelve degrees.
    found = ridged_page(evidence, prior, turned(outline, 0.2))
    assert isinstance(found, NoShape)
    assert "askew" in found.reason


@pytest.mark.parametrize(("name", "wanted"), [("folded", RidgedPage), ("smooth", CurvedPage)])
def test_no_plane_is_fitted_to_a_page_that_is_clearly_bent(
    name: str, wanted: type, monkeypatch: pytest.MonkeyPatch
) -> None:
    evidence, outline, truth = seen(name)
    prior = FocalPrior(float(np.log(truth.focal_length_px / VIEW.unit_px)), 0.03, "exif")
    fitted: list[str] = []

    def choose_pose(*given: object, **more: object) -> PlanarPage:
        fitted.append(name)
        return pose.choose_pose(*given, **more)  # type: ignore[arg-type]

    monkeypatch.setattr("services.rectify.shape_choice.choice.choose_pose", choose_pose)
    assert isinstance(choose_shape(evidence, prior, "auto", outline, None), wanted)
    assert not fitted
    assert isinstance(choose_shape(evidence, prior, "planar", outline, None), PlanarPage)
    assert fitted == [name]
