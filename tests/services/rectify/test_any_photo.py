"""Whatever the photo shows, `rectify` ends in a page that is finite and bounded, or in a reasoned refusal."""

import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFont

from services.arrays import RgbImage
from services.contract.rectify import PageKind, RectifyParameters
from services.errors import DocumentError, NoText
from services.geometry.page_frame import MAX_ENLARGEMENT, MAX_GROWTH, SMALL_VIEW_PX
from services.rectify.pipeline import rectify
from services.rectify.results import RectifyResult
from simulation.degradation import PHONE
from simulation.pages import own_pages
from simulation.scenes import BOOK, POSES, WAVE, photograph
from tests.counts import some

pytestmark = pytest.mark.pipeline

KINDS: tuple[PageKind, ...] = ("auto", "planar", "curved")
WORDS = ("quick", "brown", "foxes", "jump", "over", "lazy", "dogs", "while", "seven", "wizards", "judge")


def print_lines(width: int, height: int, count: int, size: int, rng: np.random.Generator) -> Image.Image:
    """`count` lines of print on white."""
    page = Image.new("L", (width, height), 245)
    draw, font = ImageDraw.Draw(page), ImageFont.load_default(size)
    for line in range(count):
        text = " ".join(rng.choice(WORDS, 9))
        draw.text((0.08 * width, 0.1 * height + 1.5 * size * line), text, font=font, fill=20)
    return page


def rgb(page: Image.Image) -> RgbImage:
    return np.repeat(np.asarray(page, np.uint8)[..., None], 3, axis=2)


def check(result: RectifyResult, photo: RgbImage) -> None:
    assert np.isfinite(result.mesh).all()
    pixels = result.image.shape[0] * result.image.shape[1]
    # Small print is drawn larger than the photo shows it, in views of a few megapixels.
    shown = photo.shape[0] * photo.shape[1]
    enlarged = min(SMALL_VIEW_PX, MAX_ENLARGEMENT**2 * MAX_GROWTH * shown)
    # So is what lies beside a page that is turned.
    assert pixels <= 1.1 * max(MAX_GROWTH * shown, enlarged) + 100
    assert min(result.image.shape[:2]) >= 1
    assert result.camera.focal_length_px is not None
    assert np.isfinite(result.camera.focal_length_px)


def answer(photo: RgbImage, kind: PageKind) -> RectifyResult | DocumentError:
    """What comes back, a refusal among it."""
    try:
        return rectify(photo, RectifyParameters(kind=kind, upright=False))
    except DocumentError as refusal:
        return refusal


def straightness(result: RectifyResult) -> float:
    """The largest sag of a row of the mesh over its length: a plane has 0."""
    rows = result.mesh @ [1, 1j]
    along = (rows - rows[:, :1]) / (rows[:, -1:] - rows[:, :1])
    return float(np.abs(along.imag).max())


def test_one_line_of_text_shows_no_bend_but_the_photo_is_a_page() -> None:
    photo = rgb(print_lines(900, 300, 1, 26, np.random.default_rng(1)))
    result = rectify(photo, RectifyParameters(upright=False))
    assert result.evidence.source == ("photo",)
    np.testing.assert_array_equal(result.image, photo)
    with pytest.raises(NoText, match="common direction"):
        rectify(photo, RectifyParameters(kind="curved", upright=False))


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (1, 300), (2, 300), (300, 1)])
@pytest.mark.parametrize("level", [0, 255])
def test_a_thin_image_is_no_page(shape: tuple[int, int], level: int) -> None:
    with pytest.raises(NoText):
        rectify(np.full((*shape, 3), level, np.uint8), RectifyParameters(upright=False))


@pytest.mark.long
@pytest.mark.parametrize("kind", some(1, KINDS))
def test_few_lines_of_text(kind: PageKind) -> None:
    photo = rgb(print_lines(900, 300, 4, 26, np.random.default_rng(1)))
    result = rectify(photo, RectifyParameters(kind=kind, upright=False))
    check(result, photo)
    # They lie level and straight, and must not be bent.
    assert straightness(result) < 0.02


@pytest.mark.long
@pytest.mark.parametrize("turns", some(1, [1, 2, 3]))
def test_text_that_stands_upright_comes_out_level(turns: int) -> None:
    photo = rgb(print_lines(700, 900, 20, 22, np.random.default_rng(2)))
    result = rectify(np.ascontiguousarray(np.rot90(photo, turns)), RectifyParameters(upright=False))
    check(result, photo)
    assert result.kind == "planar"
    assert sorted(result.image.shape[:2])[1] == result.image.shape[0]


def test_two_bent_pages_in_view() -> None:
    """Side by side, each with its own rulings."""
    left = photograph(own_pages(700, 1090)[0], POSES[0], 0.0, BOOK, size=(700, 900)).image
    right = photograph(own_pages(700, 1090)[3], POSES[1], 0.1, WAVE, size=(700, 900)).image
    photo = np.concatenate([left, right], axis=1)
    result = rectify(photo, RectifyParameters(upright=False))
    check(result, photo)


@pytest.fixture(scope="module")
def bent() -> RgbImage:
    return photograph(own_pages(700, 1090)[0], POSES[0], 0.0, BOOK, size=(900, 1160)).image


@pytest.mark.long
@pytest.mark.parametrize("part", some(1, [np.s_[:, :520], np.s_[250:700, 200:800]]))
def test_a_bent_page_cut_by_the_frame(bent: RgbImage, part: tuple[slice, ...]) -> None:
    photo = np.ascontiguousarray(bent[part])
    result = rectify(photo, RectifyParameters(upright=False))
    check(result, photo)
    # What is left of the bend is still seen.
    assert result.kind == "curved"


@pytest.mark.long
@pytest.mark.parametrize(("seed", "kind"), some(1, [(3, "auto"), (1, "curved")]))
def test_photos_of_no_page(seed: int, kind: PageKind) -> None:
    """Print that is warped as no paper can be, in noise."""
    rng = np.random.default_rng(seed)
    photo = rgb(print_lines(800, 700, int(rng.integers(3, 25)), int(rng.integers(12, 34)), rng))
    y, x = np.mgrid[0:700, 0:800].astype(np.float64)
    at_x = x + rng.uniform(5, 40) * np.sin(y / rng.uniform(20, 90) + seed)
    at_y = y + rng.uniform(5, 40) * np.sin(x / rng.uniform(20, 90))
    photo = photo[np.clip(at_y, 0, 699).astype(int), np.clip(at_x, 0, 799).astype(int)]
    photo = np.clip(photo + rng.normal(0, 12, photo.shape), 0, 255).astype(np.uint8)
    result = answer(photo, kind)
    if isinstance(result, RectifyResult):
        check(result, photo)
    else:
        assert result.code == "no-text"


def test_a_dirty_bent_page_is_told_without_a_warning() -> None:
    photo = photograph(
        own_pages(700, 1090)[0],
        POSES[2],
        0.0,
        WAVE,
        dirt=PHONE,
        rng=np.random.default_rng(3),
        size=(900, 1160),
    )
    result = rectify(photo.image, RectifyParameters(upright=False))
    check(result, photo.image)
    assert (result.kind, [notice.code for notice in result.warnings]) == ("curved", [])
