"""The whole rectification on simulated photos: errors are bounded."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import cv2
import numpy as np
import pytest

from services.contract.rectify import RectifyParameters
from services.errors import InvalidOption, NoText
from services.geometry.photo_frame import PhotoFrame
from services.geometry.planar import PagePlane
from services.ocr.engine import OcrEngine, Word
from services.progress import progress_to
from services.rectify import page_search
from services.rectify.analysis.page_analysis import PageAnalysis
from services.rectify.pipeline import rectify
from services.rectify.results import RectifyResult
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.shape_choice.text_check import LinesAcross
from services.sheet.plane.planar_page import PlanarPage
from services.sheet.surfaces import StripsSurface
from services.side_by_side import spare_processors
from simulation.degradation import PHONE
from simulation.pages import own_pages
from simulation.photo import SimulatedPhoto
from simulation.scenes import BOOK, POSES, photograph
from tests.services.sheet.sheet_sides import outline_of

pytestmark = pytest.mark.pipeline

SIZE = (1260, 1620)
AS_IT_LIES = RectifyParameters(upright=False)


@pytest.fixture(scope="module")
def photo() -> SimulatedPhoto:
    return photograph(own_pages()[0], POSES[3], 0.0, size=SIZE)


@pytest.fixture(scope="module")
def reports() -> list[tuple[str, float]]:
    """What `result` tells of its progress."""
    return []


@pytest.fixture(scope="module")
def result(photo: SimulatedPhoto, reports: list[tuple[str, float]]) -> RectifyResult:
    with progress_to(lambda *report: reports.append(report)):
        return rectify(photo.image, AS_IT_LIES)


def test_text_whose_rows_cross_its_lines_is_analysed_again(
    photo: SimulatedPhoto, result: RectifyResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first analysis is said to have taken columns for lines; the second one is the page's."""
    barred: list[float | None] = []

    def first_time_across(analysis: PageAnalysis, *others: object) -> None:
        barred.append(taken)
        if len(barred) == 1:
            raise LinesAcross("columns", taken_rad=taken)

    lines = photo.truth.major_flow(photo.truth.text_points(np.random.default_rng(1)))
    taken = float(np.median(lines)) + np.pi / 2
    monkeypatch.setattr(page_search, "check_text", first_time_across)
    again = rectify(photo.image, AS_IT_LIES)
    assert len(barred) == 2
    np.testing.assert_allclose(again.image.shape, result.image.shape, atol=2)


def test_its_stages_are_told_as_they_begin(result: RectifyResult, reports: list[tuple[str, float]]) -> None:
    assert list(dict(reports)) == ["text", "texture_flow", "outline", "shape", "framing", "remap"]
    assert list(dict(reports)) == list(result.timings_ms)
    begins = [fraction for _, fraction in sorted(dict(reports).items(), key=lambda report: report[1])]
    assert begins == list(dict(reports).values())
    assert begins[0] == 0.0 < begins[-1] < 1.0


def test_two_threads_find_the_same_page(photo: SimulatedPhoto, result: RectifyResult) -> None:
    with spare_processors(lambda: 1):
        beside = rectify(photo.image, AS_IT_LIES)
    assert np.array_equal(beside.image, result.image)
    assert np.array_equal(beside.mesh, result.mesh)
    assert beside.evidence == result.evidence
    assert list(beside.timings_ms) == list(result.timings_ms)


def mesh_residual(result: RectifyResult, photo: SimulatedPhoto) -> float:
    """RMS distance from the true page after the best similarity, over the page's width."""
    rows, columns = result.mesh.shape[:2]
    height, width = result.image.shape[:2]
    x, y = np.meshgrid(np.linspace(0, width - 1, columns), np.linspace(0, height - 1, rows))
    page = photo.truth.photo_to_page(result.mesh.reshape(-1, 2))
    on_page = photo.truth.on_page(result.mesh.reshape(-1, 2)) & np.isfinite(page).all(axis=1)
    a = page[on_page] @ [1, 1j]
    b = np.column_stack([x.ravel(), y.ravel()])[on_page] @ [1, 1j]
    a, b = a - a.mean(), b - b.mean()
    scale = np.vdot(b, a) / np.vdot(b, b)
    return float(np.sqrt(np.mean(np.abs(a - scale * b) ** 2)) / photo.truth.page.width)


def test_a_planar_page_comes_out_flat(result: RectifyResult, photo: SimulatedPhoto) -> None:
    assert result.kind == "planar"
    assert mesh_residual(result, photo) < 0.003
    assert not result.warnings


def test_camera_and_plane_are_near_the_truth(result: RectifyResult, photo: SimulatedPhoto) -> None:
    assert result.camera.source == "estimated"
    assert result.camera.focal_length_px is not None
    assert abs(result.camera.focal_length_px / photo.truth.focal_length_px - 1) < 0.05
    normal = np.array(result.surface.normal)
    true = photo.truth.normals(photo.truth.page_to_photo(np.array([[800.0, 1250.0]])))[0]
    angle = np.degrees(np.arccos(abs(normal @ true)))
    assert np.isclose(np.linalg.norm(normal), 1)
    assert normal[2] > 0
    assert angle < 1.5


def test_the_sheets_corners_are_found_in_the_photo(result: RectifyResult, photo: SimulatedPhoto) -> None:
    page = photo.truth.page
    truth = photo.truth.page_to_photo(
        np.array([[0.0, 0], [page.width, 0], [page.width, page.height], [0, page.height]])
    )
    assert result.corners is not None
    assert np.abs(result.corners - truth).max() < 3.0


def test_the_picture_is_what_the_mesh_says(result: RectifyResult, photo: SimulatedPhoto) -> None:
    height, width = result.image.shape[:2]
    rows, columns = result.mesh.shape[:2]
    differences = []
    for r in range(4, rows - 4, 7):
        for c in range(4, columns - 4, 5):
            x, y = (round(v) for v in result.mesh[r, c])
            u, v = round(c * (width - 1) / (columns - 1)), round(r * (height - 1) / (rows - 1))
            if 2 <= x < SIZE[0] - 2 and 2 <= y < SIZE[1] - 2:
                shown = result.image[v - 1 : v + 2, u - 1 : u + 2].mean()
                differences.append(abs(shown - photo.image[y - 1 : y + 2, x - 1 : x + 2].mean()))
    assert len(differences) > 30
    assert np.median(differences) < 12


def test_all_text_is_in_view(result: RectifyResult, photo: SimulatedPhoto) -> None:
    low, high = result.mesh.reshape(-1, 2).min(axis=0), result.mesh.reshape(-1, 2).max(axis=0)
    words = np.array([word.box for line in photo.truth.visible_lines() for word in line])
    corners = photo.truth.page_to_photo(words[:, :2])
    assert ((corners > low) & (corners < high)).all()


def test_background_shadow_and_noise_change_little() -> None:
    rng = np.random.default_rng(3)
    photo = photograph(own_pages()[3], POSES[0], 0.0, dirt=PHONE, rng=rng, size=SIZE)
    result = rectify(photo.image, AS_IT_LIES)
    assert result.kind == "planar"
    assert mesh_residual(result, photo) < 0.01


def test_light_print_on_dark_paper_is_seen() -> None:
    page = own_pages()[0]
    negative = replace(page, image=(255 - 0.85 * page.image).astype(np.uint8))
    photo = photograph(negative, POSES[2], 0.0, dirt=PHONE, rng=np.random.default_rng(5), size=SIZE)
    result = rectify(photo.image, AS_IT_LIES)
    assert result.kind == "planar"
    assert mesh_residual(result, photo) < 0.01


def test_a_curved_page_is_flattened() -> None:
    photo = photograph(own_pages()[0], POSES[0], 0.0, BOOK, size=SIZE)
    result = rectify(photo.image, AS_IT_LIES)
    assert result.kind == "curved"
    assert isinstance(result.surface, StripsSurface)
    assert result.warnings == ()
    assert residual_percent(result, photo) < 1.0


def residual_percent(result: RectifyResult, photo: SimulatedPhoto) -> float:
    """RMS distance of the mesh from the true page after the best similarity, % of the page's width."""
    height, width = result.image.shape[:2]
    rows, columns = result.mesh.shape[:2]
    x, y = np.meshgrid(np.linspace(0, width - 1, columns), np.linspace(0, height - 1, rows))
    seen = result.mesh.reshape(-1, 2)
    truth = photo.truth
    shown = truth.on_page(seen) & ((seen >= 0) & (seen < SIZE)).all(axis=1)
    a = truth.photo_to_page(seen[shown]) @ [1, 1j]
    b = (x.ravel() + 1j * y.ravel())[shown]
    a, b = a - a.mean(), b - b.mean()
    rest = a - np.vdot(b, a) / np.vdot(b, b) * b
    return float(100 * np.sqrt(np.mean(np.abs(rest) ** 2)) / truth.page.width)


def test_a_frontal_page_is_left_as_it_is() -> None:
    page = own_pages(1000, 1400)[1]
    photo = np.repeat(page.image[..., None], 3, axis=2) if page.image.ndim == 2 else page.image
    result = rectify(photo, AS_IT_LIES)
    corners = result.mesh[[0, 0, -1, -1], [0, -1, 0, -1]]
    x, y = corners[1] - corners[0], corners[2] - corners[0]
    assert abs(np.degrees(np.arctan2(x[1], x[0]))) < 0.3
    assert abs(np.degrees(np.arctan2(-y[0], y[1]))) < 0.3
    height, width = result.image.shape[:2]
    assert abs(np.linalg.norm(x) / (width - 1) / (np.linalg.norm(y) / (height - 1)) - 1) < 0.01


@pytest.mark.parametrize("turns", [1, 2])
def test_turning_the_photo_turns_the_view(turns: int, photo: SimulatedPhoto, result: RectifyResult) -> None:
    turned = rectify(np.ascontiguousarray(np.rot90(photo.image, turns)), AS_IT_LIES)
    assert turned.camera.focal_length_px is not None
    assert result.camera.focal_length_px is not None
    assert abs(turned.camera.focal_length_px / result.camera.focal_length_px - 1) < 0.05
    assert abs(turned.image.size / result.image.size - 1) < 0.1


def test_a_given_focal_length_is_taken(photo: SimulatedPhoto) -> None:
    true = photo.truth.focal_length_px
    given = rectify(photo.image, replace(AS_IT_LIES, focal_length_px=true))
    assert given.camera.source == "given"
    assert given.camera.focal_length_px is not None
    assert abs(given.camera.focal_length_px / true - 1) < 0.02
    exif = rectify(photo.image, AS_IT_LIES, true)
    assert exif.camera.source == "exif"


def test_exif_that_the_page_contradicts_is_left_out_of_account(photo: SimulatedPhoto) -> None:
    wrong = rectify(photo.image, AS_IT_LIES, 0.6 * photo.truth.focal_length_px)
    assert wrong.camera.source == "estimated"
    assert "exif-contradicted" in [notice.code for notice in wrong.warnings]
    assert mesh_residual(wrong, photo) < 0.003


def test_a_region_guides(photo: SimulatedPhoto, result: RectifyResult) -> None:
    upper = ((0.0, 0.0), (SIZE[0], 0.0), (SIZE[0], SIZE[1] / 2), (0.0, SIZE[1] / 2))
    guided = rectify(photo.image, replace(AS_IT_LIES, region=upper))
    assert 0.2 < guided.evidence.text_area_fraction / result.evidence.text_area_fraction < 0.8


def test_a_region_without_text_is_refused(photo: SimulatedPhoto) -> None:
    corner = ((0.0, 0.0), (12.0, 0.0), (12.0, 12.0))
    with pytest.raises(NoText, match="larger region"):
        rectify(photo.image, replace(AS_IT_LIES, region=corner))


@pytest.mark.parametrize(
    "wrong",
    [
        {"focal_length_px": 1.0},
        {"focal_length_px": 1e9},
        {"region": ((-9.0, -9.0), (-5, -9), (-5, -5))},
        {"region": ((9.0, 9.0), (90, 90), (50, 50))},
    ],
)
def test_options_that_the_photo_cannot_have_are_refused(wrong: dict, photo: SimulatedPhoto) -> None:
    with pytest.raises(InvalidOption, match=next(iter(wrong))) as caught:
        rectify(photo.image, replace(AS_IT_LIES, **wrong))
    assert caught.value.field == next(iter(wrong))


def blanks() -> list[np.ndarray]:
    return [
        np.full((1, 1, 3), 255, np.uint8),
        np.full((5, 2000, 3), 0, np.uint8),
        np.full((700, 500, 3), 128, np.uint8),
        np.random.default_rng(0).integers(0, 256, (600, 800, 3), np.uint8),
    ]


@pytest.mark.parametrize("photo", blanks(), ids=["pixel", "line", "gray", "noise"])
def test_photos_without_text_are_refused(photo: np.ndarray) -> None:
    with pytest.raises(NoText):
        rectify(photo, RectifyParameters())


class Scripted:
    """An engine that reads lines well when they are as they were set."""

    name = "scripted"

    def read_page(self, image: np.ndarray) -> list[Word]:
        raise AssertionError("orientation needs lines only")

    def read_line(self, image: np.ndarray) -> tuple[str, float]:
        return "nothing", 0.0


def test_who_cannot_read_says_so(photo: SimulatedPhoto) -> None:
    engine: OcrEngine = Scripted()
    unread = rectify(photo.image, RectifyParameters(), None, engine)
    assert "orientation-unknown" in [notice.code for notice in unread.warnings]
    assert unread.orientation.rotation_deg == 0
    without = rectify(photo.image, RectifyParameters())
    assert "ocr-unavailable" in [notice.code for notice in without.warnings]
    assert without.orientation.confidence is None


def test_the_view_shows_the_sheet_the_text_or_the_photo_round_it(photo: SimulatedPhoto) -> None:
    inside = photo.image[:, : photo.image.shape[1] * 9 // 10]
    seen = {
        crop: rectify(inside, replace(AS_IT_LIES, kind="planar", crop=crop))
        for crop in ("text", "sheet", "photo")
    }
    on_page = {crop: photo.truth.on_page(result.mesh.reshape(-1, 2)).mean() for crop, result in seen.items()}
    assert on_page["text"] == 1.0
    assert on_page["text"] >= on_page["sheet"] > on_page["photo"]
    areas = {crop: result.image.shape[0] * result.image.shape[1] for crop, result in seen.items()}
    assert areas["text"] < areas["sheet"] < areas["photo"]
    words = photo.truth.text_points(np.random.default_rng(2))
    words = words[words[:, 0] < inside.shape[1] - 30]
    for result in seen.values():
        border = np.concatenate(
            [result.mesh[0], result.mesh[:, -1], result.mesh[::-1][0][::-1], result.mesh[::-1, 0]]
        )
        assert (
            np.mean(
                [
                    cv2.pointPolygonTest(border.astype(np.float32), tuple(map(float, w)), False) >= 0
                    for w in words[:100]
                ]
            )
            == 1.0
        )


def test_texture_of_the_desk_is_no_text_where_the_outline_was_believed() -> None:
    inside, outside = np.full((3, 2), 50.0), np.full((20, 2), 150.0)
    square = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]])
    outline = outline_of(square, 0.3, np.random.default_rng(0))
    pose = PlanarPage(PagePlane(np.eye(3), 7.0), "assumed", sources=("outline",))
    analysis = cast(PageAnalysis, SimpleNamespace(characters=np.concatenate([inside, outside])))
    page = ShapedPage(PhotoFrame(200, 200), pose, (), outline, analysis)
    assert len(page.characters) == 3
    assert len(replace(page, shape=replace(pose, sources=("outline", "text"))).characters) == 23
    assert len(replace(page, outline=None).characters) == 23
