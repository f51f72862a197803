"""What every map between page and photo promises: inverses of one another, and true derivatives."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.geometry.page_map import PageMap, PlaneMap
from services.sheet.developable.surface import bend_basis
from services.sheet.line_residual import MorphedPage
from tests.services.sheet.developable.sheets import PAGE, Bent

SMALL = st.floats(-0.3, 0.3)


def plane(a: float = 0.1, b: float = -0.2, c: float = 0.15, d: float = -0.1) -> PlaneMap:
    """A plane in perspective, with its vanishing line beyond the page."""
    return PlaneMap(np.array([[1.1, a, 0.05], [b, 0.9, -0.08], [c, d, 1.0]]))


def sheet() -> PageMap:
    """A bent sheet."""
    return Bent().surface()


def creased() -> PageMap:
    """The sheet with a small smooth residual."""
    coefficients = 0.004 * np.random.default_rng(3).normal(0, 1, (6, 7))
    return MorphedPage(Bent().surface(), coefficients, np.array([-0.45, -0.55]), np.array([0.45, 0.55]))


MAPS: dict[str, Callable[[], PageMap]] = {"plane": plane, "sheet": sheet, "creased sheet": creased}


@pytest.mark.parametrize("name", MAPS)
def test_page_and_photo_are_inverse(name: str) -> None:
    page_map = MAPS[name]()
    seen = page_map.to_photo(PAGE)
    assert seen.shape == PAGE.shape
    assert np.isfinite(seen).all()
    assert np.allclose(page_map.to_page(seen), PAGE, atol=1e-5)


@pytest.mark.parametrize("name", MAPS)
def test_the_page_is_neither_turned_over_nor_upside_down(name: str) -> None:
    page_map = MAPS[name]()
    J = page_map.jacobians(page_map.to_photo(PAGE))
    assert (np.linalg.det(J) > 0).all()
    assert (J[:, 0, 0] > 0).all()
    assert (J[:, 1, 1] > 0).all()


@pytest.mark.parametrize("name", MAPS)
def test_jacobians_are_derivatives(name: str) -> None:
    page_map = MAPS[name]()
    seen, step = page_map.to_photo(PAGE), 1e-5
    d = step * np.eye(2)
    slow = [(page_map.to_page(seen + e) - page_map.to_page(seen - e)) / (2 * step) for e in d]
    assert np.allclose(page_map.jacobians(seen), np.stack(slow, axis=2), atol=2e-3)


@given(SMALL, SMALL, SMALL, SMALL)
@settings(max_examples=30)
def test_planes_are_homographies(a: float, b: float, c: float, d: float) -> None:
    page_map = plane(a, b, c, d)
    homogeneous = np.column_stack([PAGE, np.ones(len(PAGE))]) @ page_map.H_centred_page.T
    seen = page_map.to_photo(PAGE)
    assert np.allclose(seen, homogeneous[:, :2] / homogeneous[:, 2:])
    assert np.allclose(page_map.to_page(seen), PAGE, atol=1e-9)
    back = PlaneMap(np.linalg.inv(page_map.H_centred_page))
    product = page_map.jacobians(seen) @ back.jacobians(PAGE)
    assert np.allclose(product, np.eye(2), atol=1e-9)


def test_where_the_sheet_ends_there_is_no_photo() -> None:
    surface = Bent(slopes=(1.5, 0.0), skew=0.0).surface(bend_basis(-1.0, 1.0, 8, 0.3))
    beyond = np.array([[0.0, -0.9]])
    assert np.isnan(surface.to_photo(beyond)).all()
    page_map = MorphedPage(surface, np.zeros((5, 5)), np.array([-0.4, -0.5]), np.array([0.4, 0.5]))
    assert np.isnan(page_map.to_photo(beyond)).all()
