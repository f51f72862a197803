"""The photo is the page until its evidence shows more: cropped pages, pages of PDFs, and what is no page."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFont
from scipy.ndimage import gaussian_filter

from services.arrays import Points, RgbImage
from services.contract.rectify import Origin, RectifyParameters, TypesetPage
from services.errors import NoText
from services.geometry.photo_frame import PhotoFrame
from services.imaging.reduction import Halves
from services.rectify.pipeline import rectify
from services.rectify.results import RectifyResult
from services.rectify.shape_choice.flat_hypothesis import ends_at_band, sheet_in_view, sure_departure
from services.sheet.outline.results import SheetOutline, SheetSide
from services.sheet.plane.departure import Departure, Measured
from simulation.degradation import PHONE
from simulation.pages import own_pages
from simulation.photo import simulate_photo
from simulation.scenes import BOOK, PLANE, POSES, WAVE, View
from simulation.sheets import Staging, take_photo, with_margins
from simulation.surfaces import Shape
from simulation.truth import Truth
from tests.services.rectify.test_pipeline import mesh_residual

pytestmark = pytest.mark.pipeline
AS_IT_LIES = RectifyParameters(upright=False)


def answer(photo: RgbImage, *, origin: Origin = "photo") -> RectifyResult:
    return rectify(photo, AS_IT_LIES, origin=origin)


def letter(width: int = 840, height: int = 1188) -> RgbImage:
    """A page (H, W, 3) whose lower half is blank."""
    page = np.full((height, width), 235, np.uint8)
    printed = own_pages(width, round(1.5 * width))[0].image[: height // 2]
    page[: len(printed)] = np.minimum(printed, 235)
    return np.repeat(page[..., None], 3, axis=2)


def cropped_by_an_app(seed: int) -> RgbImage:
    """A letter, a little out of square, with a shadow, noise and a wedge of desk at its left."""
    rng = np.random.default_rng(seed)
    page = letter()
    height, width = page.shape[:2]
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    moved = corners + rng.uniform(-3, 3, (4, 2)).astype(np.float32) + np.array([3, 0], np.float32)
    H = cv2.getPerspectiveTransform(corners, moved)
    photo = cv2.warpPerspective(page, H, (width, height), borderMode=cv2.BORDER_REPLICATE).astype(np.float64)
    photo *= np.linspace(1.0, 0.8, height)[:, None, None]
    cv2.fillPoly(photo, [np.array([[0, 0], [9, 0], [0, height]], np.int32)], (70.0, 60.0, 50.0))
    return np.clip(photo + rng.normal(0, 3, photo.shape), 0, 255).astype(np.uint8)


def test_a_program_s_picture_is_shown_whole() -> None:
    """Its panel has four sides as a sheet has, and a title stands above it."""
    picture = np.full((1200, 1000, 3), 255, np.uint8)
    picture[120:1100, 60:940] = 60
    picture[140:1080, 80:920] = letter()[:940, :840]
    for y in (40, 110, 1110, 1140):
        picture[y, :400] = 120
    image = Image.fromarray(picture)
    ImageDraw.Draw(image).text(
        (60, 60), "Documents, 17 of 40", font=ImageFont.load_default(32), fill=(20, 20, 20)
    )
    result = answer(np.asarray(image))
    assert result.evidence.source == ("photo",)
    height, width = result.image.shape[:2]
    assert width / height == pytest.approx(1000 / 1200, abs=0.002)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_cropped_page_stays_as_it_is_with_its_blank_half(seed: int) -> None:
    photo = cropped_by_an_app(seed)
    result = answer(photo)
    assert (result.kind, result.evidence.source, result.warnings) == ("planar", ("photo",), ())
    # Nothing is bent or turned: the mesh is the photo's own grid, less a sliver at its left.
    step = np.diff(result.mesh, axis=1)
    assert np.ptp(step[..., 0]) < 1e-6
    assert np.abs(step[..., 1]).max() < 1e-6
    height, width = photo.shape[:2]
    assert result.mesh[0, 0, 0] < 5
    assert abs(result.mesh[0, 0, 1]) < 0.5
    np.testing.assert_allclose(result.mesh[-1, -1], [width - 1, height - 1], atol=1)
    # The desk is drawn white.
    assert result.image[: len(result.image) // 3, :2].min() > 150


@pytest.mark.parametrize("shape", [PLANE, BOOK], ids=["plane", "book"])
def test_a_photo_close_to_the_page_is_flattened(shape: Shape) -> None:
    page, view = own_pages(700, 1090)[0], POSES[1]
    camera = view.camera(900, 1200)
    photo = simulate_photo(page, shape, 0.0, view.pose(page, shape, camera, margin=-0.08), camera)
    result = answer(photo.image)
    assert "photo" not in result.evidence.source
    assert result.kind == ("planar" if shape is PLANE else "curved")


def test_a_scan_that_lies_askew_is_turned() -> None:
    page = letter()
    middle = (page.shape[1] / 2, page.shape[0] / 2)
    M = cv2.getRotationMatrix2D(middle, 2.0, 1.0)
    scan = cv2.warpAffine(page, M, page.shape[1::-1], borderValue=(235, 235, 235))
    result = answer(np.asarray(scan, np.uint8))
    assert result.evidence.source == ("photo",)
    way = result.mesh[0, -1] - result.mesh[0, 0]
    assert np.degrees(np.arctan2(way[1], way[0])) == pytest.approx(-2.0, abs=0.15)


def test_only_what_is_beyond_its_noise_departs_from_a_flat_page() -> None:
    noisy, sure = Measured(-0.03, 0.01), Measured(0.002, 0.0001)
    assert sure_departure(Departure(0.0, noisy, None, None)) == 0.0
    found = sure_departure(Departure(0.0, noisy, sure, Measured(0.001, 0.00005)))
    assert np.hypot(0.0019, 0.0009) < found < np.hypot(0.002, 0.001)


def test_a_scan_with_few_words_in_italics_is_flat() -> None:
    scan = np.full((1100, 850, 3), 250, np.uint8)
    for k, y in enumerate((90, 140, 190, 600, 650)):
        write(scan, "Invoice number and date", (80 if k < 3 else 450, y), 26)
    lean = np.array([[1, -0.25, 0.25 * 640], [0, 1, 0]])
    leaning = cv2.warpAffine(scan[560:720], lean, (850, 160), borderValue=(250, 250, 250))
    scan[560:720] = leaning
    result = answer(scan)
    assert result.evidence.source == ("photo",)
    assert result.evidence.flatness_error_percent == pytest.approx(0.1, abs=0.1)
    assert result.warnings == ()


def outline_at(corners: Points, confidence: float, seen: float) -> SheetOutline:
    sides = [SheetSide(np.linspace(corners[k], corners[k - 3], 20), np.ones(20), seen, 0.0) for k in range(4)]
    return SheetOutline(corners, (sides[0], sides[1], sides[2], sides[3]), confidence, corners)


@pytest.mark.parametrize(
    ("confidence", "seen", "inset", "is_seen"),
    [
        (0.8, 1.0, 0.2, True),
        (0.8, 0.6, 0.2, False),
        (0.6, 1.0, 0.2, False),
        (0.95, 0.6, 0.2, True),
        (0.95, 1.0, 0.01, False),
    ],
)
def test_a_sheet_whose_sides_are_all_seen_is_in_view(
    confidence: float, seen: float, inset: float, is_seen: bool
) -> None:
    view, square = PhotoFrame(800, 1000), np.array([[0.0, 0.05], [1.0, 0.0], [0.95, 1.0], [0.0, 1.0]])
    corners = [800, 1000] * (inset + (1 - 2 * inset) * square)
    assert sheet_in_view(outline_at(corners, confidence, seen), view, origin="photo") is is_seen


@pytest.mark.parametrize(
    ("bend_px", "seen", "is_seen"), [(20.0, 1.0, True), (5.0, 1.0, False), (20.0, 0.6, False)]
)
def test_a_sheet_that_is_bent_all_round_is_in_view_at_the_frame(
    bend_px: float, seen: float, is_seen: bool
) -> None:
    outline = outline_at(np.array([[8.0, 8.0], [792.0, 8.0], [792.0, 992.0], [8.0, 992.0]]), 0.97, seen)
    sides = tuple(replace(side, straightness_px=bend_px) for side in outline.sides)
    bent = replace(outline, sides=sides)
    assert sheet_in_view(bent, PhotoFrame(800, 1000), origin="photo") is is_seen


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    ("words", "askew", "expected"), [(True, 0.0, True), (False, 0.0, False), (True, 0.05, False)]
)
def test_a_level_edge_with_print_beyond_is_that_of_a_band(
    turned: bool, words: bool, askew: float, expected: bool
) -> None:
    card = np.full((500, 800, 3), 235, np.uint8)
    card[:110] = (120, 50, 30)
    for k in range(3 * words):
        row = np.full((30, 760, 3), 255, np.uint8)
        write(row, "Light words on the head of a card"[k:], (10, 0), 24)
        rows = slice(10 + 32 * k, 40 + 32 * k)
        card[rows, 20:780] = np.maximum(card[rows, 20:780], 255 - row)
    level = np.column_stack([np.linspace(0, 799, 40), 110 + askew * np.linspace(0, 799, 40)])
    if turned:  # clockwise: the head is at the right
        card = np.ascontiguousarray(np.rot90(card, -1))
        level = np.column_stack([499 - level[:, 1], level[:, 0]])
    none = SheetSide(np.zeros((0, 2)), np.zeros(0), 0.0, 0.0)
    sides = [none] * 4
    sides[1 if turned else 0] = SheetSide(level, np.ones(40), 1.0, 0.0)
    outline = SheetOutline(np.full((4, 2), np.nan), (sides[0], sides[1], sides[2], sides[3]), 0.98, level)
    assert ends_at_band(Halves(card), outline) is expected


def test_a_bent_sheet_on_a_desk_is_not_its_photo() -> None:
    sheet, view = with_margins(own_pages(800, 1250)[0]), View("far", 2600, 12, 200, 4)
    camera = view.camera(1200, 1500)
    pose = view.pose(sheet, WAVE, camera)
    x, y, z = pose.translation
    far = replace(pose, translation=(x, y, 1.9 * z))
    photo = take_photo(
        Truth(sheet, WAVE, 0.0, far, camera),
        Staging(lamp_deg=200.0, lamp_height_deg=40.0),
        PHONE,
        np.random.default_rng(3),
    )
    result = answer(photo.image)
    assert "photo" not in result.evidence.source
    assert mesh_residual(result, photo) < 0.004


def write(image: RgbImage, text: str, at: tuple[int, int], size: int = 22, turn_deg: float = 0.0) -> None:
    """Draw `text` on `image` in place, turned counter-clockwise."""
    label = Image.new("L", (12 * len(text) + 40, 40), 255)
    ImageDraw.Draw(label).text((5, 5), text, font=ImageFont.load_default(size), fill=0)
    turned = np.asarray(label.rotate(turn_deg, expand=True, fillcolor=255, resample=Image.Resampling.BICUBIC))
    x, y = at
    part = image[y : y + turned.shape[0], x : x + turned.shape[1]]
    part[:] = np.minimum(part, turned[: part.shape[0], : part.shape[1], None])


def test_slanted_labels_do_not_turn_a_page() -> None:
    chart = np.full((700, 1500, 3), 255, np.uint8)
    for k in range(18):
        write(chart, "Category name", (60 + 75 * k, 480), turn_deg=45.0)
    for k in range(6):
        write(chart, f"{100 * k}", (10, 400 - 70 * k))
        write(chart, "series of values", (1280, 100 + 50 * k))
    result = answer(chart, origin="page")
    assert (result.evidence.source, result.image.shape) == (("photo",), chart.shape)
    np.testing.assert_array_equal(result.image, chart)


def assert_whole(result: RectifyResult, photo: RgbImage) -> None:
    """The view shows the `photo`, unturned, up to its borders; small print may be enlarged."""
    rows, columns = np.array(photo.shape[:2]) - 1
    corners = result.mesh[[0, 0, -1, -1], [0, -1, 0, -1]]
    np.testing.assert_allclose(corners, [[0, 0], [columns, 0], [0, rows], [columns, rows]], atol=0.5)


def stamped(size: int, turn_deg: float) -> RgbImage:
    scan = np.full((1100, 800, 3), 250, np.uint8)
    for k in range(6):
        write(
            scan, "Thank you for your order, the goods come on Friday"[: 50 - 3 * k], (80, 100 + 32 * k), 20
        )
    word = np.full((300, 600, 3), 255, np.uint8)
    write(word, "RECEIVED, 12 March", (60, 10), 24, turn_deg)
    grown = cv2.resize(word, None, fx=size / 24, fy=size / 24, interpolation=cv2.INTER_AREA)[:680, :720]
    scan[400 : 400 + len(grown), 60 : 60 + grown.shape[1]] = np.minimum(
        scan[400 : 400 + len(grown), 60 : 60 + grown.shape[1]], grown
    )
    return scan


@pytest.mark.parametrize(("size", "turn_deg"), [(60, 6.0), (60, 25.0)])
def test_a_stamp_aslant_does_not_bend_a_scan(size: int, turn_deg: float) -> None:
    scan = stamped(size, turn_deg)
    result = answer(scan)
    assert (result.evidence.source, result.warnings) == (("photo",), ())
    assert_whole(result, scan)


def test_a_window_whose_right_half_is_empty_is_shown_whole() -> None:
    window = np.full((600, 1000, 3), 30, np.uint8)
    for k in range(9):
        label = np.full((40, 420, 3), 255, np.uint8)
        write(label, "a line of code, and a comment"[k:], (5, 0), 22)
        rows = slice(70 + 50 * k, 110 + 50 * k)
        window[rows, 20:440] = np.maximum(window[rows, 20:440], 255 - label)
    result = answer(window)
    assert result.evidence.source == ("photo",)
    assert_whole(result, window)


def test_a_picture_on_a_page_of_a_pdf_is_not_its_sheet() -> None:
    page = np.full((1170, 830, 3), 255, np.uint8)
    page[120:820, 60:760] = 40
    page[200:220, 120:700] = 130
    write(page, "What follows is an image that is embedded in the page", (60, 60))
    result = answer(page, origin="page")
    assert (result.evidence.source, result.image.shape) == (("photo",), page.shape)


def test_a_page_that_is_set_in_type_is_flat_whatever_its_print_seems_to_show() -> None:
    page = np.full((900, 700, 3), 255, np.uint8)
    for k in range(20):
        write(page, "lines that seem to converge upon a page", (40 + 6 * k, 60 + 40 * k), 22, 0.6 * k - 6.0)
    assert answer(page, origin="page").evidence.source != ("photo",)
    result = rectify(page, RectifyParameters(), origin=TypesetPage(90))
    assert (result.evidence.source, result.orientation.rotation_deg, result.warnings) == (("photo",), 90, ())
    # Small print is enlarged. The top left of the view is the bottom left of the page.
    corners = result.mesh[[0, 0, -1, -1], [0, -1, 0, -1]]
    np.testing.assert_allclose(corners, [[0, 899], [0, 0], [699, 899], [699, 0]], atol=0.5)


def test_a_blank_page_is_one_only_in_a_pdf() -> None:
    blank = np.full((400, 300, 3), 255, np.uint8)
    assert answer(blank, origin="page").evidence.source == ("photo",)
    with pytest.raises(NoText):
        answer(blank)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_leaves_are_no_text(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rough = np.stack([gaussian_filter(rng.normal(0, 1, (480, 640)), 2 + seed) for _ in range(3)], axis=2)
    photo = np.clip(120 + 45 * rough / rough.std(), 0, 255).astype(np.uint8)
    with pytest.raises(NoText):
        answer(photo)
