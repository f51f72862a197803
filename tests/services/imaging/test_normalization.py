"""Pictures in normalized views: kept where no text is, while shadows on text become white paper."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from services.imaging.levels import measure_levels
from services.imaging.normalization import normalize_illumination
from services.imaging.pictures import levels_beside_pictures, pictures_without_text
from tests.services.imaging.test_illumination import PAPER, set_page, take_colour_photo

SHAPE = (1400, 1000)
FIGURE = (slice(520, 860), slice(120, 880))
BORDER = (slice(0, 1400), slice(0, 150))


def characters_of(page: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places of print (N, 2) of the text, one in 40 of its pixels."""
    rows, columns = np.nonzero(page < 0.2)
    return np.column_stack([columns, rows])[::40].astype(np.float64)


def smooth_figure(rows: int, columns: int) -> NDArray[np.float64]:
    """Reflectance of a figure of soft dark and light blobs."""
    coarse = np.random.default_rng(6).uniform(0.1, 0.8, (4, 9))
    return np.asarray(cv2.resize(coarse, (columns, rows), interpolation=cv2.INTER_CUBIC)).clip(0.08, 0.85)


def page_with_figure() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A page with a figure, and the places of its text."""
    page = set_page(*SHAPE)
    rows, columns = FIGURE
    page[rows.start - 30 : rows.stop + 30] = 1.0
    characters = characters_of(page)
    page[FIGURE] = smooth_figure(rows.stop - rows.start, columns.stop - columns.start)
    return page, characters


def tone_error(view: NDArray[np.uint8], page: NDArray[np.float64]) -> float:
    """Mean difference of the figure's tones to those of the page, 0-1."""
    return float(np.abs(view[FIGURE][..., 0] / 255.0 - page[FIGURE]).mean())


def test_a_smooth_figure_keeps_its_tones() -> None:
    page, characters = page_with_figure()
    photo = take_colour_photo(page, np.ones(SHAPE))
    view = normalize_illumination(photo, characters)
    assert tone_error(view, page) < 0.08
    # Without the places of text its lighter parts are taken for paper.
    assert tone_error(normalize_illumination(photo), page) > 0.15
    assert np.percentile(view[page == 1.0], 3) > 230


def test_a_shadow_on_text_is_no_picture() -> None:
    page = set_page(*SHAPE)
    light = np.ones(SHAPE)
    light[300:900, 250:800] = 0.5
    photo = take_colour_photo(page, np.asarray(cv2.GaussianBlur(light, (0, 0), 8.0)))
    levels = measure_levels(photo)
    assert levels is not None
    assert not pictures_without_text(levels, photo, characters_of(page)).any()
    view = normalize_illumination(photo, characters_of(page))
    assert np.array_equal(view, normalize_illumination(photo))


@pytest.mark.parametrize(
    ("colour", "text_from", "is_picture"),
    [((0.3, 0.5, 0.8), 220, True), ((0.3, 0.5, 0.8), 160, True), ((0.5, 0.5, 0.5), 220, False)],
)
def test_a_dark_part_at_the_border_is_a_picture_if_it_is_coloured(
    colour: tuple[float, float, float], text_from: int, is_picture: bool
) -> None:
    """A gray one may be the shadow of a hand. Text that begins just beside it is not in it."""
    page = set_page(*SHAPE)
    light_print = 0.5 + 0.5 * page[:, 300:450, None]
    page[:, :text_from] = 1.0
    characters = characters_of(page)
    reflectance = np.repeat(page[..., None], 3, axis=2)
    reflectance[BORDER] = light_print * colour
    photo = np.rint(PAPER * reflectance).astype(np.uint8)
    levels = measure_levels(photo)
    assert levels is not None
    inside = (slice(100, 500), slice(20, 120))
    found = cv2.resize(
        pictures_without_text(levels, photo, characters).astype(np.uint8),
        (SHAPE[1], SHAPE[0]),
        interpolation=cv2.INTER_NEAREST,
    )
    assert bool(found[inside].mean() > 0.9) == is_picture
    view = normalize_illumination(photo, characters)
    if is_picture:
        shown = np.median(view[inside].reshape(-1, 3), axis=0) / 255
        assert shown == pytest.approx(colour, abs=0.08)


def test_levels_stay_where_no_picture_is_or_nothing_beside_it() -> None:
    page, _ = page_with_figure()
    photo = take_colour_photo(page, np.ones(SHAPE))
    levels = measure_levels(photo)
    assert levels is not None
    none = np.zeros(levels.paper.shape, bool)
    assert levels_beside_pictures(photo, levels, none) is levels
    assert levels_beside_pictures(photo, levels, ~none) is levels
