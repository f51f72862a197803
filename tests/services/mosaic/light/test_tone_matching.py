"""Photos cut from one page under light that the tests choose."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from services.arrays import RgbImage
from services.imaging.normalization import normalize_illumination
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.light.tone_matching import match_tones
from services.mosaic.light.tones import ToneMap, apply_tones, tone_factors
from services.mosaic.placing.placement import DisplacementField, Placement
from services.sheet.plane.framing import FlatFrame
from tests.counts import some

pytestmark = pytest.mark.pipeline

WIDTH, HEIGHT = 1200, 1500
PICTURE = (slice(500, 860), slice(420, 900))
BOX = (slice(1050, 1250), slice(300, 1000))
INK = 0.12

Light = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
"""Gain (H, W) or (H, W, 3) at x, y from 0 to 1 over a photo."""


@pytest.fixture(scope="module")
def page() -> NDArray[np.float64]:
    """Reflectance (H, W, 3): text, a picture of coloured middle tones, a tinted box with text in it."""
    gray = np.full((HEIGHT, WIDTH), 255, np.uint8)
    for line in range(90, HEIGHT - 60, 34):
        cv2.putText(
            gray, "Mosaicing of document images taken from any position",
            (60, line), cv2.FONT_HERSHEY_SIMPLEX, 1.1, 0, 3, cv2.LINE_AA,
        )  # fmt: skip
    print_ = INK + (1 - INK) * gray[..., None] / 255.0
    paper = np.ones((HEIGHT, WIDTH, 3))
    paper[BOX] = (0.86, 0.9, 0.8)
    result = paper * print_
    rng = np.random.default_rng(5)
    rows, columns = (s.stop - s.start for s in PICTURE)
    # Larger than a neighbourhood of the normalization, darker than paper, and no two tones alike.
    picture = cv2.resize(rng.uniform(0.1, 0.7, (9, 12, 3)), (columns, rows), interpolation=cv2.INTER_CUBIC)
    result[450 : PICTURE[0].stop + 50, 380 : PICTURE[1].stop + 40] = 1.0
    result[PICTURE] = np.clip(picture, 0.05, 0.8)
    return result.astype(np.float32)


def even(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.ones_like(x)


def vignette(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    return 1 / (1 + 0.7 * ((x - 0.5) ** 2 + (y - 0.5) ** 2)) ** 2


def slope(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    return 1 - 0.35 * x - 0.15 * y


def warm(light: Light) -> Light:
    return lambda x, y: light(x, y)[..., None] * np.array([0.95, 0.85, 0.65])


def dim(light: Light, gain: float) -> Light:
    return lambda x, y: gain * light(x, y)


def take(
    page: NDArray[np.float64],
    box: tuple[int, int, int, int],
    light: Light,
    index: int = 0,
    blur: float = 0.0,
    noise: float = 0.0,
) -> tuple[FlatPhoto, Placement]:
    """A photo of `box` (left, top, right, bottom) of the page, pixel for pixel."""
    left, top, right, bottom = box
    part = page[top:bottom, left:right]
    if blur:
        part = cv2.GaussianBlur(part, (0, 0), blur)
    height, width = part.shape[:2]
    y, x = np.mgrid[0:height, 0:width]
    gain = light(x / (width - 1), y / (height - 1))
    level = 235.0 * part * (gain if gain.ndim == 3 else gain[..., None]).astype(np.float32)
    level = level + np.random.default_rng(index).normal(0, noise, level.shape) if noise else level
    photo = np.clip(np.rint(level), 0, 255).astype(np.uint8)
    frame = FlatFrame(np.eye(3), width, height)
    flat = FlatPhoto(
        index,
        photo,
        frame,
        np.ascontiguousarray(photo[..., 1]),
        np.ones((height, width), bool),
        25.0,
        1.0,
        100.0,
    )
    return flat, Placement(np.array([[1.0, 0, left], [0, 1, top], [0, 0, 1]]))


def toned(photo: FlatPhoto, tones: ToneMap) -> RgbImage:
    """The photo with the map sampled at the middles of squares of four pixels, and linear between them."""
    width, height = photo.size
    x, y = np.meshgrid(np.arange(1.5, width, 4), np.arange(1.5, height, 4))
    coarse = tones.at(np.stack([x, y], axis=-1).reshape(-1, 2)).reshape(*x.shape, 6)
    size = (4 * x.shape[1], 4 * x.shape[0])
    planes = (cv2.resize(plane, size)[:height, :width] for plane in tone_factors(coarse))
    return apply_tones(photo.photo, [np.asarray(plane, np.float32) for plane in planes])


def on_page(photos: list[tuple[FlatPhoto, Placement]], illumination: str) -> list[NDArray[np.float32]]:
    """Toned photos (H, W, 3) in the page's frame, not-a-number where they show nothing."""
    maps = match_tones([p for p, _ in photos], [q for _, q in photos], illumination).maps  # type: ignore[arg-type]
    layers = []
    for (photo, placement), tones in zip(photos, maps, strict=True):
        layer = np.full((HEIGHT, WIDTH, 3), np.nan, np.float32)
        left, top = placement.H_mosaic_flat[:2, 2].astype(int)
        width, height = photo.size
        layer[top : top + height, left : left + width] = toned(photo, tones)
        layers.append(layer)
    return layers


def smoothed(layer: NDArray[np.float32]) -> NDArray[np.float32]:
    """Means over 25 pixels, not-a-number beside what is seen."""
    seen = cv2.erode(np.isfinite(layer[..., 0]).astype(np.uint8), np.ones((25, 25)), borderValue=0) > 0
    mean = cv2.blur(np.nan_to_num(layer), (25, 25))
    return np.where(seen[..., None], mean, np.nan)


UPPER, LOWER = (0, 0, WIDTH, 900), (0, 600, WIDTH, HEIGHT)


def quarters(page: NDArray[np.float64]) -> list[tuple[FlatPhoto, Placement]]:
    return [
        take(page, (0, 0, 720, 900), dim(vignette, 0.9), 0),
        take(page, (500, 0, WIDTH, 900), warm(slope), 1),
        take(page, (0, 620, 720, HEIGHT), warm(vignette), 2),
        take(page, (500, 620, WIDTH, HEIGHT), dim(slope, 0.7), 3),
    ]


@pytest.mark.parametrize(("illumination", "noise"), [("keep", 0.0), ("keep", 4.0), ("normalize", 4.0)])
def test_photos_agree_where_they_overlap(page: NDArray[np.float64], illumination: str, noise: float) -> None:
    photos = [
        take(page, UPPER, dim(vignette, 0.8), 0, noise=noise),
        take(page, LOWER, warm(slope), 1, noise=noise),
    ]
    first, second = (smoothed(layer) for layer in on_page(photos, illumination))
    with np.errstate(invalid="ignore"):
        ratio = (first / second)[620:880, 20:-20]
    assert abs(np.median(ratio) - 1) < 0.003
    # Levels of ink that are measured photo by photo, and stretched, leave more than gains.
    bound = 0.015 if illumination == "keep" else 0.02
    assert np.quantile(np.abs(ratio - 1), 0.95) < (0.01 if (illumination, noise) == ("keep", 0.0) else bound)
    # The match follows light and not content.
    assert np.quantile(np.abs(ratio - 1), 0.5) < 0.004


def test_four_photos_agree_and_their_mean_light_stays(page: NDArray[np.float64]) -> None:
    photos = quarters(page)
    layers = on_page(photos, "keep")
    values = np.stack([smoothed(layer) for layer in layers])[:, 20:-20, 20:-20]
    with np.errstate(all="ignore"):
        spread = (np.nanmax(values, axis=0) / np.nanmin(values, axis=0) - 1)[
            np.isfinite(values).sum(axis=0) > 1
        ]
    assert np.quantile(spread, 0.95) < 0.012
    before = [np.log(photo.photo[::4, ::4].astype(float) + 1).mean() for photo, _ in photos]
    after = [np.log(layer[np.isfinite(layer[..., 0])] + 1).mean() for layer in layers]
    assert np.mean(after) == pytest.approx(np.mean(before), abs=0.06)
    assert np.nanmax(layers) <= 252


def test_the_order_of_photos_does_not_matter(page: NDArray[np.float64]) -> None:
    photos = quarters(page)
    expected = match_tones([p for p, _ in photos], [q for _, q in photos], "normalize").maps
    order = [2, 0, 3, 1]
    found = match_tones([photos[k][0] for k in order], [photos[k][1] for k in order], "normalize").maps
    for k, tones in zip(order, found, strict=True):
        assert np.allclose(tones.coefficients, expected[k].coefficients, rtol=1e-4, atol=1e-2)


def test_normalized_paper_is_white_and_ink_is_dark_in_every_photo(page: NDArray[np.float64]) -> None:
    paper = cv2.erode(page.min(axis=2), np.ones((7, 7))) > 0.999
    ink = (page.max(axis=2) < INK + 0.01) & (np.arange(HEIGHT) < 430)[:, None]
    medians = []
    for layer in on_page(quarters(page), "normalize"):
        seen = np.isfinite(layer[..., 0])
        white = layer[seen & paper]
        medians.append(np.median(white, axis=0))
        assert np.median(white.max(axis=1)) >= 253
        assert np.quantile(white.max(axis=1), 0.03) >= 248
        if (seen & ink).any():
            assert 5 < np.median(layer[seen & ink]) < 45
    assert np.ptp(medians, axis=0).max() <= 2


@pytest.mark.parametrize(("tint", "stays"), [((1.0, 0.97, 0.86), False), ((1.0, 0.7, 0.62), True)])
def test_a_tint_of_the_light_goes_and_coloured_paper_stays(
    page: NDArray[np.float64], tint: tuple[float, float, float], stays: bool
) -> None:
    def tinted(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        return even(x, y)[..., None] * np.array(tint)

    photos = [take(page, UPPER, tinted, 0), take(page, LOWER, tinted, 1)]
    paper = cv2.erode(page.min(axis=2), np.ones((7, 7))) > 0.999
    for layer in on_page(photos, "normalize"):
        weakest = np.nanmedian(layer[paper], axis=0).min()
        assert weakest < 235 if stays else weakest > 250
    for layer in on_page(photos, "keep"):
        hue = np.nanmedian(layer[paper], axis=0)
        assert np.allclose(hue / hue.max(), tint, atol=0.02)


def test_ink_of_a_blurred_photo_is_as_dark_as_that_of_a_sharp_one(page: NDArray[np.float64]) -> None:
    photos = [take(page, UPPER, even, 0), take(page, LOWER, dim(vignette, 0.8), 1, blur=2.2)]
    both = page.max(axis=2) < INK + 0.02
    both[:620], both[880:] = False, False
    both[:, 380:960] = False
    levels = [float(np.nanquantile(layer[both], 0.25)) for layer in on_page(photos, "normalize")]
    assert abs(levels[0] - levels[1]) < 20
    assert max(levels) < 45


@pytest.mark.long
@pytest.mark.parametrize("illumination", some(1, ["normalize", "keep"]))
def test_pictures_keep_their_tones(page: NDArray[np.float64], illumination: str) -> None:
    """Also in a photo that shows hardly anything but the picture."""
    left, top = PICTURE[1].start - 10, PICTURE[0].start - 10
    photos = [
        take(page, (0, 0, WIDTH, 800), dim(vignette, 0.95), 0),
        take(page, (left, top, PICTURE[1].stop + 10, PICTURE[0].stop + 10), warm(even), 1),
        take(page, (0, 700, WIDTH, HEIGHT), dim(slope, 0.9), 2),
    ]
    layers = on_page(photos, illumination)
    inside = (
        slice(PICTURE[0].start + 20, PICTURE[0].stop - 20),
        slice(PICTURE[1].start + 20, PICTURE[1].stop - 20),
    )
    paper = 255.0 if illumination == "normalize" else float(np.nanquantile(layers[0], 0.9))
    for layer in layers:
        shown, truth = layer[inside] / paper, page[inside]
        seen = np.isfinite(shown)
        shown, truth = shown[seen], truth[seen]
        middle = np.mean((shown > 0.15) & (shown < 0.75)) / np.mean((truth > 0.15) & (truth < 0.75))
        assert 0.85 < middle < 1.15
        assert np.mean(shown) == pytest.approx(np.mean(truth), abs=0.08)
        assert np.corrcoef(shown, truth)[0, 1] > 0.95
    for one, other in ((0, 1), (1, 2)):
        with np.errstate(invalid="ignore"):
            difference = np.abs(smoothed(layers[one]) - smoothed(layers[other]))[inside]
        assert np.nanquantile(difference, 0.95) < 6


def test_a_shadow_in_one_photo_leaves_no_hard_seam(page: NDArray[np.float64]) -> None:
    def shadow(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where(x < 0.3, 0.55, 1.0)

    photos = [take(page, UPPER, even, 0), take(page, LOWER, shadow, 1)]
    keep = on_page(photos, "keep")
    with np.errstate(invalid="ignore"):
        difference = np.abs(smoothed(keep[0]) - smoothed(keep[1]))[640:880]
    away = np.abs(np.arange(WIDTH) - 0.3 * WIDTH) > 60
    assert np.nanquantile(difference[:, away], 0.95) < 4
    # Far from the overlap each photo keeps its own light.
    ratio = [np.nanmedian(keep[k][rows, :300]) / np.nanmedian(keep[k][rows, 420:]) for k, rows in
             ((0, slice(0, 60)), (1, slice(1460, 1500)))]  # fmt: skip
    assert ratio[0] > 0.9
    assert ratio[1] < 0.7
    paper = cv2.erode(page.min(axis=2), np.ones((7, 7))) > 0.999
    normalized = on_page(photos, "normalize")
    for layer in normalized:
        seen = np.isfinite(layer[..., 0]) & paper & away
        assert np.quantile(layer[seen], 0.03) > 240


def test_one_photo_is_normalized_as_an_image_is(page: NDArray[np.float64]) -> None:
    photo, placement = take(page, (0, 0, WIDTH, HEIGHT), warm(slope), 0)
    (tones,) = match_tones([photo], [placement], "normalize").maps
    difference = np.abs(toned(photo, tones).astype(float) - normalize_illumination(photo.photo))
    difference = difference[(np.arange(HEIGHT) < 430) | (np.arange(HEIGHT) > 930)]  # beside the picture
    assert np.mean(difference) < 3
    assert np.quantile(difference, 0.98) < 16
    (kept,) = match_tones([photo], [placement], "keep").maps
    assert np.allclose(kept.coefficients[..., :3], 1.0, atol=1e-3)


def test_parts_that_do_not_meet_keep_their_own_light(page: NDArray[np.float64]) -> None:
    photos = [take(page, (0, 0, WIDTH, 600), even, 0), take(page, (0, 800, WIDTH, HEIGHT), dim(even, 0.5), 1)]
    for tones in match_tones([p for p, _ in photos], [q for _, q in photos], "keep").maps:
        assert np.allclose(tones.coefficients[..., :3], 1.0, atol=2e-3)


@pytest.mark.parametrize("illumination", ["keep", "normalize"])
def test_blank_and_unseen_views_change_nothing_else(page: NDArray[np.float64], illumination: str) -> None:
    blank = take(np.ones_like(page), LOWER, even, 0)
    maps = match_tones([blank[0]], [blank[1]], illumination).maps  # type: ignore[arg-type]
    assert np.abs(toned(blank[0], maps[0]).astype(int) - blank[0].photo).max() <= 1
    seen, placement = take(page, UPPER, vignette, 0)
    nothing = FlatPhoto(1, seen.photo, seen.frame, seen.gray, np.zeros_like(seen.shown), 25.0, 1.0, 1.0)
    with_nothing = match_tones([seen, nothing], [placement, placement], illumination).maps  # type: ignore[arg-type]
    alone = match_tones([seen], [placement], illumination).maps  # type: ignore[arg-type]
    assert np.allclose(with_nothing[0].coefficients, alone[0].coefficients, rtol=1e-3, atol=1e-2)
    assert np.isfinite(with_nothing[1].coefficients).all()


def test_a_desk_beside_the_page_is_not_paper(page: NDArray[np.float64]) -> None:
    scene = page.copy()
    scene[:, 1080:] = np.array([0.22, 0.15, 0.1]) + np.random.default_rng(3).normal(0, 0.02, (HEIGHT, 120, 1))
    photos = [take(scene, UPPER, dim(vignette, 0.9), 0), take(scene, LOWER, slope, 1)]
    for layer in on_page(photos, "normalize"):
        assert np.nanmedian(layer[:, 1110:].max(axis=2)) < 130
        margin = layer[:, 960:1060].max(axis=2)
        assert np.nanquantile(margin, 0.1) > 240


def test_bent_views_and_displaced_ones_are_matched_where_they_really_lie(page: NDArray[np.float64]) -> None:
    """A shift of many pixels in the placement, right or wrong, shows at the edge of the picture."""
    first, place = take(page, UPPER, even, 0)
    second, _ = take(page, LOWER, dim(even, 0.7), 1)
    bent = np.zeros((5, 5, 2))
    bent[..., 0] = 30.0
    # The homography is 30 pixels off, which the displacement takes back.
    H = np.array([[1.0, 0, -30], [0, 1, 600], [0, 0, 1]])
    displaced = Placement(H, DisplacementField(bent, *second.size))
    straight = Placement(np.array([[1.0, 0, 0], [0, 1, 600], [0, 0, 1]]))
    found = match_tones([first, second], [place, displaced], "keep").maps
    expected = match_tones([first, second], [place, straight], "keep").maps
    for one, other in zip(found, expected, strict=True):
        assert np.quantile(np.abs(one.coefficients - other.coefficients), 0.99) < 0.01
    assert np.median(
        expected[1].coefficients[..., 0] / expected[0].coefficients[..., 0].mean()
    ) == pytest.approx(1 / 0.7, rel=0.01)


def test_no_photos_no_maps() -> None:
    assert match_tones([], [], "keep").maps == ()
