"""Sheets come back from what a photo shows of them, to a share of the page's width."""

from dataclasses import replace

import numpy as np
import pytest

from services.sheet.developable.observations import NO_LINES
from services.sheet.ridged import residuals
from services.sheet.ridged.fitting import FittedMesh, fit_mesh
from services.sheet.ridged.mesh import SheetMesh
from services.sheet.ridged.observations import SheetObservations
from services.sheet.ridged.parameters import RidgedParameters
from services.sheet.ridged.start import mesh_between_sides
from tests.services.sheet.ridged.sheets import (
    CURVED,
    FLAT,
    FOCAL,
    FOLDED,
    HEIGHT,
    WIDTH,
    Sheet,
    errors,
    observe,
)

QUICK = RidgedParameters()


@pytest.fixture(autouse=True)
def upright_type(monkeypatch: pytest.MonkeyPatch) -> None:
    """The strokes of these pages are upright, as those of no real type are."""
    monkeypatch.setattr(residuals, "SLANT_MEAN_RAD", 0.0)


def start_of(sheet: Sheet, observed: SheetObservations) -> SheetMesh:
    """The mesh between the sheet's corners, its border along the sides."""
    sides = tuple(side.points for side in observed.sides if side is not None)
    start = mesh_between_sides(sheet.corners(), sides, FOCAL, 12)
    assert start is not None
    return start


def fit(sheet: Sheet, observed: SheetObservations, p: RidgedParameters = QUICK) -> FittedMesh:
    return fit_mesh(start_of(sheet, observed), observed, p)


@pytest.mark.parametrize(
    ("sheet", "median", "most"),
    [(FLAT, 0.0003, 0.0008), (FOLDED, 0.003, 0.007), (CURVED, 0.002, 0.008)],
    ids=["flat", "folded in thirds", "cylinder"],
)
def test_text_and_sides_give_the_sheet(sheet: Sheet, median: float, most: float) -> None:
    observed = observe(sheet, np.random.default_rng(1))
    start = start_of(sheet, observed)
    found = fit(sheet, observed)
    off = errors(sheet, found.mesh)
    assert np.median(off) < median
    assert np.quantile(off, 0.95) < most
    if sheet is not FLAT:
        assert np.median(off) < 0.35 * np.median(errors(sheet, start))
    # Half a pixel of noise cannot leave nothing.
    assert np.median(off) > 1e-6
    width, height = found.mesh.size
    assert height / width == pytest.approx(HEIGHT / WIDTH, rel=0.01)
    assert found.mesh.focal == pytest.approx(FOCAL, rel=0.02)


@pytest.mark.parametrize(
    ("sheet", "median"),
    [(FLAT, 0.003), (Sheet(radius=1.5), 0.006), (Sheet(radius=-1.5, angles_deg=(35.0, 0.0, 0.0)), 0.006)],
    ids=["flat", "cylinder", "hollow cylinder"],
)
def test_the_sides_alone_give_a_smooth_sheet_whose_bends_cost_little(sheet: Sheet, median: float) -> None:
    observed = observe(sheet, np.random.default_rng(2), text=False)
    found = fit(sheet, observed, replace(QUICK, bend_rad=3.0)).mesh
    assert np.median(errors(sheet, found)) < median
    assert found.aspect_ratio == pytest.approx(WIDTH / HEIGHT, rel=0.02)


def test_paper_keeps_its_lengths() -> None:
    mesh = fit(FOLDED, observe(FOLDED, np.random.default_rng(1))).mesh
    across = np.linalg.norm(np.diff(mesh.nodes, axis=1), axis=2) / mesh.step
    down = np.linalg.norm(np.diff(mesh.nodes, axis=0), axis=2) / (mesh.step * mesh.aspect)
    assert np.sqrt(np.mean((across - 1) ** 2)) < 0.002
    assert np.sqrt(np.mean((down - 1) ** 2)) < 0.004


def test_bends_gather_at_the_creases() -> None:
    mesh = fit(FOLDED, observe(FOLDED, np.random.default_rng(1))).mesh
    turns = np.linalg.norm(np.diff(mesh.nodes, n=2, axis=0), axis=2).mean(axis=1)
    at = (np.arange(1, mesh.rows - 1) / (mesh.rows - 1) - 0.5) * 3
    near = np.abs(np.abs(at) - 0.5) < 0.15
    assert turns[near].sum() > 0.75 * turns.sum()


@pytest.mark.pipeline
def test_a_tenth_of_wrong_points_and_a_thumb_change_little() -> None:
    rng = np.random.default_rng(3)
    observed = observe(CURVED, rng)
    clean = np.median(errors(CURVED, fit(CURVED, observed).mesh))
    points = observed.lines.points.copy()
    wrong = rng.random(len(points)) < 0.1
    points[wrong] += rng.normal(0, 0.01, (int(wrong.sum()), 2))
    side = observed.sides[2]
    assert side is not None
    covered = side.points.copy()
    covered[10:20] -= [0.0, 0.03]  # a thumb
    spoilt = replace(
        observed,
        lines=replace(observed.lines, points=points),
        sides=(*observed.sides[:2], replace(side, points=covered), observed.sides[3]),
    )
    assert np.median(errors(CURVED, fit(CURVED, spoilt).mesh)) < clean + 0.002


def test_nothing_but_priors_leaves_the_start() -> None:
    nothing = SheetObservations(NO_LINES, None, (None,) * 4, float(np.log(FOCAL)), 0.05)
    start = FLAT.mesh(13)
    found = fit_mesh(start, nothing, QUICK)
    assert errors(FLAT, found.mesh).max() < 1e-4
    assert found.cost < 1e-3


def test_the_fit_goes_on_from_a_fit() -> None:
    observed = observe(CURVED, np.random.default_rng(1))
    first = fit(CURVED, observed)
    again = fit_mesh(first.mesh, observed, replace(QUICK, schedule=QUICK.schedule[-1:]))
    assert again.cost <= first.cost * 1.001
    assert again.evaluations <= QUICK.evaluations
    assert np.median(errors(CURVED, again.mesh)) < 0.003
