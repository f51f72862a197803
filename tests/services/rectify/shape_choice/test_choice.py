"""A flat sheet stays a plane, a smooth one a smooth surface, a creased one becomes a mesh; and `kind` is honoured."""

from dataclasses import replace
from functools import lru_cache
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from services.arrays import Points, Vector
from services.contract.rectify import PageKind
from services.geometry.focal_prior import FocalPrior
from services.geometry.page_map import PageMap
from services.geometry.photo_frame import PhotoFrame
from services.notices import Notice
from services.rectify.analysis.page_analysis import analyse_photo
from services.rectify.shape_choice import choice, hypotheses
from services.rectify.shape_choice.choice import (
    VISIBLE_BEND,
    _ends_at_sides_better,
    _is_flat,
    _needs_creases,
    _with_doubt,
    rank_shapes,
)
from services.rectify.shape_choice.hypotheses import STRAIGHT_SIDE, Hypotheses
from services.sheet.curved_page import CurvedPage, estimate_curved_page
from services.sheet.developable.observations import NO_EDGES, NO_LINES
from services.sheet.evidence import PageEvidence
from services.sheet.outline.results import BELIEVED_CONFIDENCE, SheetOutline
from services.sheet.plane import pose
from services.sheet.plane.outline_plane import read_sides
from services.sheet.plane.planar_page import PlanarPage
from services.sheet.ridged_page import RidgedPage, sides_bend
from services.sheet.shape import NoShape, PageShape
from services.sheet.sheet_edges import measure_sides, read_edges
from services.sheet.tracing.line_tracing import measure_bend
from simulation.creased import Crossed
from simulation.folded import folded_in_thirds
from simulation.pages import own_pages
from simulation.relaxed import FOLDED_PAPER, Relaxed
from simulation.scenes import BOOK, PLANE
from simulation.sheets import SHEET_ASPECT, SHEET_VIEWS, Staging, photograph_sheet, with_margins
from simulation.surfaces import Shape
from simulation.truth import Truth
from tests.services.sheet.sheet_sides import bent_outline_of_truth

pytestmark = pytest.mark.pipeline

SHAPES: dict[str, Shape] = {
    "flat": PLANE,
    "folded": folded_in_thirds(SHEET_ASPECT, 24, -18),
    "crossed": Relaxed(Crossed(SHEET_ASPECT, 25, 15, alike=True, centre=(0.03, -0.02)), FOLDED_PAPER),
    "smooth": BOOK,
    "gentle": folded_in_thirds(SHEET_ASPECT, 12, 8, radius=0.1),
}
SIZE = (840, 1080)
VIEW = PhotoFrame(*SIZE)
EDGE_NOISE_PX = 0.1
"""As edges of sheets in focus have it; four times as much is bent sides on a photo of this size."""


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
        bent_outline_of_truth(photo.truth, EDGE_NOISE_PX, np.random.default_rng(2)),
        photo.truth,
    )


def prior_of(name: str) -> FocalPrior:
    """The true focal length, as EXIF tells it."""
    return FocalPrior(float(np.log(seen(name)[2].focal_length_px / VIEW.unit_px)), 0.03, "exif")


@lru_cache
def chosen(name: str, kind: PageKind = "auto", *, outlined: bool = True) -> PageShape:
    evidence, outline, _ = seen(name)
    prior = prior_of(name)
    if not outlined:
        return next(rank_shapes(evidence, prior, kind))
    sheet = read_sides(outline, VIEW, prior)
    assert sheet is not None
    return next(rank_shapes(evidence, prior, kind, outline, sheet))


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


def test_a_crossed_sheet_becomes_a_mesh_that_is_flatter_than_the_plane() -> None:
    shape = chosen("crossed")
    assert isinstance(shape, RidgedPage)
    assert sides_bend(seen("crossed")[1]) > STRAIGHT_SIDE
    assert shape.line_count > 15
    off, flat = (errors_at_text("crossed", chosen("crossed", kind).page_map) for kind in ("auto", "planar"))
    assert np.median(off) < 0.002
    assert np.median(off) < 0.2 * np.median(flat)


def test_a_sheet_folded_along_parallel_lines_is_flattened_by_either_bent_shape() -> None:
    off, flat = (errors_at_text("folded", chosen("folded", kind).page_map) for kind in ("auto", "planar"))
    assert chosen("folded").kind == "curved"
    assert np.median(off) < 0.003
    assert np.median(off) < 0.4 * np.median(flat)


def test_a_smooth_sheet_needs_no_fit_of_the_other_shapes(monkeypatch: pytest.MonkeyPatch) -> None:
    def needless(*_: object) -> None:
        raise AssertionError("nothing speaks for this shape")

    monkeypatch.setattr(hypotheses, "choose_pose", needless)
    monkeypatch.setattr(hypotheses, "estimate_ridged_page", needless)
    evidence, outline, _ = seen("gentle")
    sheet = read_sides(outline, VIEW, prior_of("gentle"))
    shape = next(rank_shapes(evidence, prior_of("gentle"), "auto", outline, sheet))
    assert isinstance(shape, CurvedPage)
    assert measure_bend(shape.lines) < VISIBLE_BEND  # the sides decide


def test_sides_and_lines_flatten_a_smooth_sheet_up_to_its_border() -> None:
    shape = chosen("smooth")
    assert isinstance(shape, CurvedPage)
    assert len(shape.edges.points) > 200
    assert np.median(errors_at_text("smooth", shape.page_map)) < 0.001
    evidence, outline, _ = seen("smooth")
    edges = read_edges(outline, VIEW, 0.0)
    assert measure_sides(shape.page_map, edges) < 0.001
    by_text = estimate_curved_page(evidence, prior_of("smooth"))
    assert isinstance(by_text, CurvedPage)
    assert measure_sides(shape.page_map, edges) < 0.5 * measure_sides(by_text.page_map, edges)


@pytest.mark.parametrize("name", ["smooth", "flat"])
def test_the_next_best_shapes_follow_the_best_and_a_rigid_sheet_is_never_bent(name: str) -> None:
    evidence, outline, _ = seen(name)
    shapes = list(
        rank_shapes(evidence, prior_of(name), "auto", outline, read_sides(outline, VIEW, prior_of(name)))
    )
    assert type(shapes[0]) is type(chosen(name))
    kinds = {type(shape) for shape in shapes}
    assert len(kinds) == len(shapes)
    if name == "flat":
        assert kinds == {PlanarPage}
    else:
        assert {CurvedPage, PlanarPage} <= kinds
    only = list(rank_shapes(evidence, prior_of(name), "planar", outline, None))
    assert [type(shape) for shape in only] == [PlanarPage]


@pytest.mark.parametrize(("lines", "by_sides"), [(3, True), (30, False)])
def test_the_sides_of_a_rigid_sheet_yield_to_many_lines_only(
    lines: int, monkeypatch: pytest.MonkeyPatch, *, by_sides: bool
) -> None:
    evidence, outline, _ = seen("flat")
    prior = prior_of("flat")
    sheet = read_sides(outline, VIEW, prior)
    assert sheet is not None
    assert sheet.plane is not None
    turned_by_text = PlanarPage(sheet.plane.plane, prior.source, line_count=lines, skew_rad=np.pi / 4)
    monkeypatch.setattr(
        "services.rectify.shape_choice.hypotheses.choose_pose", lambda *_, **__: turned_by_text
    )
    found = Hypotheses(evidence, prior, "curved", outline, sheet)
    assert found.rigid
    assert (found.plane.sources == ("outline",)) == by_sides
    assert found.plane.sides_believed == by_sides
    # A bent sheet is no board.
    assert not Hypotheses(evidence, prior, "curved", seen("smooth")[1], sheet).rigid


@pytest.mark.parametrize("name", ["folded", "smooth"])
def test_a_plane_that_is_asked_for_is_given(name: str) -> None:
    assert isinstance(chosen(name, "planar"), PlanarPage)


@pytest.mark.parametrize("name", ["folded", "smooth"])
def test_a_bent_sheet_that_is_asked_for_is_given(name: str) -> None:
    assert not isinstance(chosen(name, "curved"), PlanarPage)


def test_a_page_that_seems_curved_is_not_called_flat() -> None:
    plane = chosen("flat", "planar", outlined=False)
    assert isinstance(plane, PlanarPage)
    said = tuple(Notice(code, "") for code in ("already-flat", "low-text"))
    found = Hypotheses(seen("flat")[0], prior_of("flat"), "curved", None, None)
    found.__dict__["plane"] = replace(plane, notices=said, sources=("text",))
    assert [notice.code for notice in _with_doubt(found).notices] == ["curved-page", "low-text"]
    flat = replace(found, seems="planar")
    flat.__dict__["plane"] = found.plane
    assert _with_doubt(flat).notices == said


@pytest.mark.parametrize(
    ("creased", "by_text", "better"), [(2, 1, False), (1, 2, True), (1, None, True), (None, 1, False)]
)
def test_a_creased_sheet_needs_straighter_sides_than_the_smooth_one_of_the_text(
    creased: int | None, by_text: int | None, better: bool
) -> None:
    class Stub:
        def __init__(self) -> None:
            self.creased, self.smooth_by_text = (
                None if sides is None else SimpleNamespace(page_map=sides) for sides in (creased, by_text)
            )

        def sides_of(self, page_map: int) -> float:
            return float(page_map)

    assert _ends_at_sides_better(cast(Hypotheses, Stub())) == better


@pytest.mark.parametrize("confidence", [BELIEVED_CONFIDENCE - 0.01, BELIEVED_CONFIDENCE])
def test_sides_that_the_smooth_sheet_was_not_fitted_to_count_where_they_are_believed(
    confidence: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    evidence, outline, _ = seen("crossed")
    found = Hypotheses(evidence, prior_of("crossed"), "curved", replace(outline, confidence=confidence), None)
    creased, by_text = found.creased, cast(CurvedPage, SimpleNamespace(page_map=object(), edges=NO_EDGES))
    assert creased is not None
    sides = {id(creased.page_map): 0.7, id(by_text.page_map): 1.0}
    monkeypatch.setattr(found, "sides_of", lambda page_map: sides[id(page_map)])
    monkeypatch.setattr(found, "profiles_in", lambda _: NO_LINES)
    # Lines 0.9 times as bent are no reason by themselves; with sides 0.7 times as bent they are.
    monkeypatch.setattr(
        choice, "measure_straightness", lambda page_map, _: 0.9 if page_map is creased.page_map else 1.0
    )
    assert _needs_creases(creased, by_text, found) == (confidence >= BELIEVED_CONFIDENCE)


@pytest.mark.parametrize(
    ("straightness", "left", "flat"), [(0.02, 0.5, True), (0.1, 0.9, True), (0.1, 0.5, False)]
)
def test_few_lines_that_a_bend_straightens_show_that_straight_sides_are_not_a_board_s(
    straightness: float, left: float, flat: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    plane = SimpleNamespace(line_count=3, page_map=None, sides_believed=True)
    found = SimpleNamespace(
        bent_sides=False,
        seems="planar",
        sheet=object(),
        rigid=True,
        plane_by_sides=True,
        plane=plane,
        plane_lines=SimpleNamespace(count=3),
        plane_straightness=straightness,
    )
    monkeypatch.setattr(choice, "left_by_bends", lambda *_: left)
    assert _is_flat(cast(Hypotheses, found)) is flat


def test_without_an_outline_there_is_no_mesh() -> None:
    assert not isinstance(chosen("folded", outlined=False), RidgedPage)


def test_print_that_stands_askew_on_its_sheet_gives_no_mesh() -> None:
    evidence, outline, _ = seen("crossed")
    prior = prior_of("crossed")
    assert isinstance(chosen("crossed"), RidgedPage)
    # Another sheet, or a frame: turned by twelve degrees.
    found = Hypotheses(evidence, prior, "curved", turned(outline, 0.2), None).fit_creased()
    assert isinstance(found, NoShape)
    assert "askew" in found.reason


@pytest.mark.parametrize(("name", "wanted"), [("crossed", RidgedPage), ("smooth", CurvedPage)])
def test_no_plane_is_fitted_to_a_page_that_is_clearly_bent(
    name: str, wanted: type, monkeypatch: pytest.MonkeyPatch
) -> None:
    evidence, outline, _ = seen(name)
    prior = prior_of(name)
    fitted: list[str] = []

    def choose_pose(*given: object, **more: object) -> PlanarPage:
        fitted.append(name)
        return pose.choose_pose(*given, **more)  # type: ignore[arg-type]

    monkeypatch.setattr("services.rectify.shape_choice.hypotheses.choose_pose", choose_pose)
    assert isinstance(next(rank_shapes(evidence, prior, "auto", outline)), wanted)
    assert not fitted
    assert isinstance(next(rank_shapes(evidence, prior, "planar", outline)), PlanarPage)
    assert fitted == [name]
