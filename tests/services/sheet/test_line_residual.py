"""The small residual takes the waves out of text lines that the sheet has left, and nothing else."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.arrays import Points, Vector
from services.sheet.developable.observations import LineObservations
from services.sheet.developable.surface import DevelopableSurface
from services.sheet.line_residual import MorphedPage, morph_to_lines
from services.sheet.tracing.line_tracing import measure_straightness
from tests.services.sheet.developable.sheets import FLAT, PAGE, Bent, box

SHEET = Bent()
HEIGHT = 0.02
"""Of the text, on the page."""


def printed(
    surface: DevelopableSurface,
    wave: Vector | float = 0.0,
    noise: float = 0.0,
    count: int = 16,
    seed: int = 0,
) -> LineObservations:
    """Lines (`count`) of 14 points, the page being shifted down by `wave` where they are printed."""
    u, v = np.linspace(-0.42, 0.42, 14), np.linspace(-0.5, 0.5, count)
    page = np.stack([np.tile(u, count), np.repeat(v, 14)], axis=1)
    page[:, 1] += wave + np.random.default_rng(seed).normal(0, noise, len(page))
    return LineObservations(
        surface.to_photo(page),
        np.repeat(np.arange(count), 14),
        np.full(len(page), 1e-3),
        [],
        [],
        [],
        # One unit of the page is about one of the photo.
        HEIGHT,
    )


def page_of(count: int = 16) -> Points:
    """Where the lines are printed."""
    u, v = np.linspace(-0.42, 0.42, 14), np.linspace(-0.5, 0.5, count)
    return np.stack([np.tile(u, count), np.repeat(v, 14)], axis=1)


def ripple(page: Points, size: float) -> Vector:
    """A wave one and a half times along the lines, stronger at the page's head."""
    return np.asarray(size * np.sin(1.5 * 2 * np.pi * page[:, 0] / 0.9) * (0.7 - 0.6 * page[:, 1]))


@pytest.mark.parametrize("bent", [SHEET, FLAT], ids=["bent", "flat"])
def test_a_known_wave_is_taken_out(bent: Bent) -> None:
    surface = bent.surface()
    size = 0.3 * HEIGHT
    lines = printed(surface, ripple(page_of(), size))
    morphed = morph_to_lines(surface, lines)
    before, after = measure_straightness(surface, lines), measure_straightness(morphed, lines)
    assert 0.05 < before < 0.3
    assert after < 0.12 * before
    assert isinstance(morphed, MorphedPage)
    # What is added is the wave's opposite, but for what is common to a line.
    page = surface.to_page(lines.points)
    shift = (morphed.shift(page) + ripple(page, size)).reshape(16, 14)
    error = shift - shift.mean(axis=1, keepdims=True)
    assert np.sqrt(np.mean(error**2)) < 0.1 * size
    assert np.abs(error).max() < 0.3 * size


def test_nothing_moves_along_the_lines() -> None:
    surface = SHEET.surface()
    lines = printed(surface, ripple(page_of(), 0.3 * HEIGHT))
    morphed = morph_to_lines(surface, lines)
    assert np.array_equal(morphed.to_page(lines.points)[:, 0], surface.to_page(lines.points)[:, 0])


def test_straight_lines_are_left_alone() -> None:
    surface = SHEET.surface()
    morphed = morph_to_lines(surface, printed(surface))
    assert isinstance(morphed, MorphedPage)
    assert np.abs(morphed.shift(PAGE)).max() < 1e-6 * HEIGHT
    # Wherever each of them lies: a level is nobody's wave.
    uneven = np.repeat(np.random.default_rng(1).normal(0, 0.3 * HEIGHT, 16), 14)
    morphed = morph_to_lines(surface, printed(surface, uneven))
    assert isinstance(morphed, MorphedPage)
    assert np.abs(morphed.shift(PAGE)).max() < 1e-6 * HEIGHT


def test_noise_is_not_followed() -> None:
    surface = SHEET.surface()
    noise = 0.04 * HEIGHT
    morphed = morph_to_lines(surface, printed(surface, noise=noise, seed=2))
    assert isinstance(morphed, MorphedPage)
    field = morphed.shift(page_of())
    assert float(np.sqrt(np.mean(field**2))) < 0.6 * noise


def test_what_is_held_stays() -> None:
    surface = FLAT.surface()
    lines = printed(surface, ripple(page_of(), 0.5 * HEIGHT))
    turn = np.linspace(0, 2 * np.pi, 60)
    rim = np.clip(np.stack([np.cos(turn), np.sin(turn)], axis=1) * 2, -1, 1) * [0.55, 0.65]
    morphed = morph_to_lines(surface, lines, rim)
    assert isinstance(morphed, MorphedPage)
    assert np.abs(morphed.shift(rim)).max() < 0.05 * HEIGHT
    assert measure_straightness(morphed, lines) < 0.25 * measure_straightness(surface, lines)
    # There and back.
    at = morphed.to_photo(box(0.4, 0.5, 12, 12))
    np.testing.assert_allclose(morphed.to_page(at), box(0.4, 0.5, 12, 12), atol=1e-3 * HEIGHT)


@pytest.mark.parametrize("size", [0.5, 1.0, 3.0, 10.0, 100.0])
def test_waves_that_are_no_creases_are_not_believed(size: float) -> None:
    surface = FLAT.surface()
    morphed = morph_to_lines(surface, printed(surface, ripple(page_of(), size * HEIGHT)))
    if size < 2:
        assert isinstance(morphed, MorphedPage)
        assert 0.3 * size * HEIGHT < np.abs(morphed.shift(box(0.6, 0.8, 30, 30))).max()
    elif size < 50:
        assert morphed is surface
    # Lines that go across one another and the whole page are outliers to one another.
    if isinstance(morphed, MorphedPage):
        assert np.abs(morphed.shift(box(0.6, 0.8, 30, 30))).max() < 1.5 * HEIGHT


def test_a_line_that_was_traced_wrongly_does_not_count() -> None:
    surface = FLAT.surface()
    clean = ripple(page_of(), 0.2 * HEIGHT)
    spoiled = clean.copy()
    spoiled[5 * 14 : 6 * 14] += np.linspace(-1.5, 1.5, 14) * HEIGHT
    found = [morph_to_lines(surface, printed(surface, wave)) for wave in (clean, spoiled)]
    assert all(isinstance(m, MorphedPage) for m in found)
    v = [m.to_page(surface.to_photo(page_of()))[:, 1] for m in found]
    assert np.sqrt(np.mean((v[1] - v[0]) ** 2)) < 0.08 * HEIGHT


def test_with_few_points_the_surface_is_taken_as_it_is() -> None:
    surface = SHEET.surface()
    assert morph_to_lines(surface, printed(surface, count=4)) is surface
    assert isinstance(morph_to_lines(surface, printed(surface, count=5)), MorphedPage)


def test_lines_in_one_row_are_no_field() -> None:
    surface = FLAT.surface()
    page = np.stack([np.linspace(-0.4, 0.4, 80), np.full(80, 0.01)], axis=1)
    lines = LineObservations(
        surface.to_photo(page), np.arange(80) // 8, np.full(80, 1e-3), [], [], [], HEIGHT
    )
    assert morph_to_lines(surface, lines) is surface


@given(st.integers(0, 99), st.floats(0.0, 0.4))
@settings(max_examples=15)
def test_photo_and_page_are_inverse(seed: int, size: float) -> None:
    surface = SHEET.surface()
    coefficients = size * HEIGHT * np.random.default_rng(seed).normal(0, 1, (10, 12))
    morphed = MorphedPage(surface, coefficients, np.array([-0.42, -0.5]), np.array([0.42, 0.5]))
    page = box(0.5, 0.6)
    seen = morphed.to_photo(page)
    # A pixel is a tenth of a text height or less.
    assert np.abs(morphed.to_page(seen) - page).max() < 0.02 * HEIGHT * max(size, 0.01)
    before = page.copy()
    morphed.to_photo(page)
    assert np.array_equal(page, before)


def test_the_field_goes_on_constantly_beyond_its_lines() -> None:
    coefficients = np.random.default_rng(5).normal(0, 0.01, (10, 12))
    morphed = MorphedPage(SHEET.surface(), coefficients, np.array([-0.42, -0.5]), np.array([0.42, 0.5]))
    rim = morphed.shift(np.array([[0.42, 0.1], [-0.42, 0.1], [0.1, -0.5], [0.1, 0.5], [0.42, 0.5]]))
    far = morphed.shift(np.array([[0.9, 0.1], [-2.0, 0.1], [0.1, -3.0], [0.1, 0.8], [5.0, 5.0]]))
    assert np.allclose(rim, far)
    assert far[4] == pytest.approx(coefficients[-1, -1])
    assert np.isfinite(morphed.shift(np.full((1, 2), np.nan))).all()
