"""Every derivative of the unrolled page by the surface's parameters, against central differences."""

import numpy as np
import pytest
from hypothesis import given, settings

from services.arrays import Floats, Vector
from services.geometry.camera import rotation_from_vector
from services.sheet.developable.residuals import surface_of
from services.sheet.developable.surface import bend_basis
from services.sheet.developable.variation import GLOBAL, vary_page
from tests.services.sheet.developable.sheets import BASIS, BENT, FLAT, PAGE, SLANT_RAD, Bent, differences

NAMES = [
    "turn x",
    "turn y",
    "turn z",
    "log focal",
    "skew",
    "slope 1",
    "slope 2",
    *(f"bend {k}" for k in range(8)),
]
TOLERANCE = 6e-3
"""Of the greatest derivative: both are discrete, the surface by Hermite's cubics, its variation by straight lines."""


def both(bent: Bent) -> tuple[Floats, Floats]:
    """Derivatives (N, 2, 15) of the page at fixed photo points: analytic, and by differences."""
    surface = bent.surface()
    seen = surface.to_photo(PAGE)
    R = rotation_from_vector(np.array(bent.turn))

    def page(y: Vector) -> Floats:
        # A turn about the camera's axes comes after the sheet's own.
        x = np.concatenate([np.zeros(3), y[3:7], [SLANT_RAD], y[7:]])
        return surface_of(x, rotation_from_vector(y[:3]) @ R, bent.anchor, BASIS).to_page(seen)

    y = np.concatenate([np.zeros(3), np.delete(bent.parameters[3:], 4)])
    return vary_page(surface, surface.unroll(seen)), differences(page, y)


def check(bent: Bent) -> None:
    exact, slow = both(bent)
    assert exact.shape == slow.shape == (len(PAGE), 2, GLOBAL + 8)
    for name, a, b in zip(NAMES, np.moveaxis(exact, 2, 0), np.moveaxis(slow, 2, 0), strict=True):
        assert np.abs(a - b).max() < TOLERANCE * max(np.abs(b).max(), 0.02), name


@pytest.mark.pipeline
@given(BENT)
@settings(max_examples=30)
def test_all_derivatives_of_random_sheets(bent: Bent) -> None:
    check(bent)


@pytest.mark.parametrize("skew", [0.0, 0.5, -1.5])
def test_derivatives_at_the_flat_sheet(skew: float) -> None:
    check(Bent(slopes=(0.0, 0.0), bends=(0.0,) * 8, skew=skew))
    exact, _ = both(FLAT)
    # On a flat sheet, where rulings lie changes nothing.
    assert np.abs(exact[:, :, 5:7]).max() < 1e-12
    assert np.abs(exact[:, :, 4]).max() < 1e-9


def test_derivatives_by_the_number_of_bends() -> None:
    for count in (4, 12):
        bent = Bent(bends=tuple(np.linspace(-1, 1, count)))
        surface = bent.surface(bend_basis(-0.75, 0.75, count, 0.4))
        moved = vary_page(surface, surface.unroll(surface.to_photo(PAGE)))
        assert moved.shape == (len(PAGE), 2, GLOBAL + count)
        assert np.isfinite(moved).all()


def test_columns_of_what_moves_nothing_come_before_the_bends() -> None:
    surface = Bent().surface()
    at = surface.unroll(surface.to_photo(PAGE))
    usual, wider = vary_page(surface, at), vary_page(surface, at, still=2)
    assert np.array_equal(np.delete(wider, [GLOBAL, GLOBAL + 1], axis=2), usual)
    assert not wider[:, :, GLOBAL : GLOBAL + 2].any()


def test_nothing_moves_at_the_anchor_but_by_turning_round_it() -> None:
    surface = Bent().surface()
    moved = vary_page(surface, surface.unroll(np.array([[0.05, -0.08]])))
    assert np.abs(moved).max() < 1e-3
