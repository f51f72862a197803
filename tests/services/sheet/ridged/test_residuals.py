"""Residuals vanish at the true sheet, their derivatives are exact, and every kind of them sees what it is about."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from services.arrays import Floats, Vector
from services.sheet.ridged import residuals
from services.sheet.ridged.blocks import ResidualBlock, robust, single_entries, stacked
from services.sheet.ridged.observations import SheetObservations
from services.sheet.ridged.parameters import STRETCH, RidgedParameters, Stage
from services.sheet.ridged.residuals import LOST, SheetResiduals
from tests.services.sheet.ridged.sheets import CURVED, FLAT, FOLDED, Sheet, observe

SHEETS = {"flat": FLAT, "folded": FOLDED, "curved": CURVED}
KINDS = (
    "lines",
    "spacing",
    "margins",
    "strokes",
    "flow",
    "top",
    "right",
    "bottom",
    "left",
    "stretch",
    "across",
    "down",
    "twist",
    "priors",
)
LAST = Stage(8, 1.0, 1.0, 1.0)
UPRIGHT = RidgedParameters()


@pytest.fixture(autouse=True)
def upright_type(monkeypatch: pytest.MonkeyPatch) -> None:
    """The strokes of these pages are upright, as those of no real type are."""
    monkeypatch.setattr(residuals, "SLANT_MEAN_RAD", 0.0)


"""The type of these sheets does not lean."""


def residuals_of(
    sheet: Sheet, observed: SheetObservations, columns: int = 9, p: RidgedParameters = UPRIGHT
) -> SheetResiduals:
    return SheetResiduals(sheet.mesh(columns), observed, p, LAST)


def blocks(residuals: SheetResiduals, x: Vector) -> dict[str, ResidualBlock]:
    return dict(zip(KINDS, residuals.blocks(x), strict=True))


@lru_cache
def small(name: str) -> SheetResiduals:
    """Residuals about a coarse mesh of a sheet, with few observations."""
    observed = observe(SHEETS[name], np.random.default_rng(0), line_points=5, side_points=9, directions=True)
    return residuals_of(SHEETS[name], observed)


def nearby(residuals: SheetResiduals, seed: int = 1) -> Vector:
    """Unknowns a little off the start."""
    rng = np.random.default_rng(seed)
    x = residuals.x0
    x[: residuals.node_unknowns] += rng.normal(0, 2e-3, residuals.node_unknowns)
    x[residuals.node_unknowns :] += rng.normal(0, 5e-3, len(x) - residuals.node_unknowns)
    return x


@pytest.mark.parametrize("name", SHEETS)
def test_derivatives_of_all_residuals_are_exact(name: str) -> None:
    residuals = small(name)
    x = nearby(residuals)
    at_x = blocks(residuals, x)
    for seed in range(6):
        way = np.random.default_rng(100 + seed).normal(0, 1, len(x))
        step = 1e-7
        ahead, behind = blocks(residuals, x + step * way), blocks(residuals, x - step * way)
        for kind, block in at_x.items():
            slow = (ahead[kind].values - behind[kind].values) / (2 * step)
            fast = stacked([block.jacobian], len(x)) @ way
            scale = float(np.abs(fast).max()) + 1e-9
            off = np.abs(slow - fast) / scale
            # A point that crosses a node's row has two derivatives.
            assert np.quantile(off, 0.98) < 1e-4, kind


@pytest.mark.parametrize("kind", ["focal length", "aspect", "slant"])
def test_derivatives_by_what_all_share_are_exact(kind: str) -> None:
    residuals = small("folded")
    x, step = nearby(residuals), 1e-6
    at = residuals.globals_at + ("focal length", "aspect", "slant").index(kind)
    d = np.zeros(len(x))
    d[at] = step
    ahead, behind, here = (blocks(residuals, point) for point in (x + d, x - d, x))
    moved = 0
    for name, block in here.items():
        slow = (ahead[name].values - behind[name].values) / (2 * step)
        fast = stacked([block.jacobian], len(x))[:, [at]].toarray()[:, 0]
        assert np.allclose(slow, fast, rtol=1e-4, atol=1e-4 * (np.abs(fast).max() + 1)), name
        moved += int(np.abs(fast).max() > 0)
    assert moved >= 2


def test_a_flat_sheet_explains_what_is_seen_of_it() -> None:
    observed = observe(FLAT, np.random.default_rng(0), noise=0.0)
    residuals = residuals_of(FLAT, observed)
    for kind, block in blocks(residuals, residuals.x0).items():
        assert np.abs(block.values).max(initial=0.0) < 1e-4, kind


def test_the_right_noise_gives_residuals_of_one(monkeypatch: pytest.MonkeyPatch) -> None:
    observed = observe(FLAT, np.random.default_rng(0))
    monkeypatch.setattr(residuals, "LEAST_LINE", 0.0)
    monkeypatch.setattr(residuals, "LEAST_SIDE", 0.0)
    at = blocks(residuals_of(FLAT, observed), residuals_of(FLAT, observed).x0)
    for kind in ("lines", "top", "right", "bottom", "left"):
        assert 0.75 < np.std(at[kind].values) < 1.25, kind
    # A window's angle is off by a degree, and overlapping windows count less.
    assert 0.4 < np.std(at["strokes"].values) < 1.0


def test_a_bent_sheet_that_is_seen_as_flat_shows_in_lines_and_sides() -> None:
    # Level creases leave lines level, and change their spacing; an upright cylinder bends them.
    for sheet, kinds in ((FOLDED, ("spacing", "right", "left")), (CURVED, ("lines", "top", "bottom"))):
        observed = observe(sheet, np.random.default_rng(0), noise=0.0)
        wrong = blocks(residuals_of(FLAT, observed), residuals_of(FLAT, observed).x0)
        right = blocks(residuals_of(sheet, observed, 25), residuals_of(sheet, observed, 25).x0)
        for kind in kinds:
            assert np.abs(wrong[kind].values).max() > 3, kind
            assert np.median(np.abs(wrong[kind].values)) > 3 * np.median(np.abs(right[kind].values)), kind


def test_a_folded_sheet_bends_only_across_its_creases() -> None:
    observed = observe(FOLDED, np.random.default_rng(0), noise=0.0)
    wrong = blocks(residuals_of(FLAT, observed), residuals_of(FLAT, observed).x0)
    right = blocks(residuals_of(FOLDED, observed, 25), residuals_of(FOLDED, observed, 25).x0)
    assert np.abs(wrong["down"].values).max() < 1e-9
    assert np.abs(right["across"].values).max() < 1e-9
    assert np.abs(right["twist"].values).max() < 1e-9
    assert np.abs(right["down"].values).max() > 10


def test_paper_that_stretches_costs_by_how_much() -> None:
    residuals = small("flat")
    x = residuals.x0
    nodes = slice(0, residuals.node_unknowns)
    stretched = x.copy()
    stretched[nodes] *= 1.01
    values = blocks(residuals, stretched)["stretch"].values
    # Edges by a hundredth, five deviations; diagonals by as much of their length.
    share = values / (0.01 / STRETCH)
    assert share.min() == pytest.approx(1.0, abs=1e-6)
    assert 1.3 < share.max() < 1.6
    turned = x.copy()
    turned[nodes] = (x[nodes].reshape(-1, 3) @ np.array([[0.6, 0.0, -0.8], [0, 1, 0], [0.8, 0, 0.6]])).ravel()
    assert np.abs(blocks(residuals, turned)["stretch"].values).max() < 1e-6


def test_a_bend_costs_by_its_angle() -> None:
    curved = residuals_of(CURVED, observe(CURVED, np.random.default_rng(0), text=False), 25)
    at = blocks(curved, curved.x0)
    bends = np.linalg.norm(at["across"].values.reshape(-1, 3), axis=1)
    # The sheet turns by its width over its radius; a deviation is `bend_rad` over the width.
    assert np.median(bends) == pytest.approx(1.3 / 0.9 / curved.p.bend_rad, rel=0.02)
    assert np.abs(at["down"].values).max() < 1e-6


def test_points_that_the_mesh_does_not_show_are_lost_but_do_not_pull() -> None:
    observed = observe(FLAT, np.random.default_rng(0))
    points = observed.lines.points.copy()
    points[::7] = [4.0, 4.0]
    observed = replace(observed, lines=replace(observed.lines, points=points))
    residuals = residuals_of(FLAT, observed)
    block = blocks(residuals, residuals.x0)["lines"]
    assert (block.values[::7] == LOST).all()
    assert np.abs(block.jacobian.entries[::7]).max(initial=0.0) == 0.0
    assert np.abs(np.delete(block.values, np.arange(0, len(points), 7))).max() < 5


def test_what_is_not_seen_has_no_residuals() -> None:
    observed = observe(FLAT, np.random.default_rng(0), text=False)
    observed = replace(observed, sides=(None, observed.sides[1], None, observed.sides[3]))
    residuals = residuals_of(FLAT, observed)
    at = blocks(residuals, residuals.x0)
    sizes = {kind: len(block.values) for kind, block in at.items()}
    none = ("lines", "spacing", "margins", "strokes", "top", "bottom")
    assert [sizes[kind] for kind in none] == [0] * len(none)
    assert (sizes["left"], sizes["right"], sizes["priors"]) == (60, 60, 3)
    assert len(residuals.x0) == residuals.unknowns


def test_the_unknowns_describe_the_start() -> None:
    residuals = small("curved")
    mesh = residuals.mesh(residuals.x0)
    assert np.allclose(mesh.nodes, residuals.start.nodes)
    assert (mesh.focal, mesh.aspect) == pytest.approx((residuals.start.focal, residuals.start.aspect))
    assert sorted(residuals.order) == list(range(residuals.unknowns))
    assert list(residuals.order[-residuals.border :]) == list(range(residuals.globals_at, residuals.unknowns))


def block_of(values: Floats, group: int) -> ResidualBlock:
    return ResidualBlock(
        np.asarray(values, np.float64), single_entries(np.zeros(len(values), np.intp), values), group
    )


def test_losses_are_squares_for_small_residuals_and_grow_slowly_for_large_ones() -> None:
    stage = Stage(8, 2.0, 1.0, 0.5)
    for group in (0, 1, 3):
        cost, weights = robust(block_of(np.full(3, 1e-4), group), stage)
        assert cost == pytest.approx(0.5 * 3e-8, rel=1e-3)
        assert weights == pytest.approx(np.ones(3), abs=1e-3)
    square, _ = robust(block_of(np.full(3, 100.0), 0), stage)
    far, weights = robust(block_of(np.full(3, 100.0), 1), stage)
    assert square == pytest.approx(15000)
    assert far < 0.01 * square
    assert weights == pytest.approx(np.full(3, 4 / 10004))


def test_few_sharp_ridges_cost_less_than_many_soft_ones() -> None:
    stage = Stage(8, 1.0, 1.0, 1.0)
    one, many = np.zeros(30), np.zeros(30)
    one[0] = 20.0
    many[::3] = 2.0
    assert robust(block_of(one, 3), stage)[0] < 0.5 * robust(block_of(many, 3), stage)[0]


@pytest.mark.parametrize("group", [1, 3])
def test_weights_are_the_slope_of_the_loss(group: int) -> None:
    values, step = np.array([0.3, -2.0, 5.0]), 1e-6
    _, weights = robust(block_of(values, group), LAST)
    for k in range(3):
        d = step * np.eye(3)[k]
        slow = (
            robust(block_of(values + d, group), LAST)[0] - robust(block_of(values - d, group), LAST)[0]
        ) / (2 * step)
        assert weights[k] * values[k] == pytest.approx(slow, rel=1e-5)
