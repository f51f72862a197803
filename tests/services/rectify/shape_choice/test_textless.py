"""Pages without text: by the sheet's sides, by straight print, or refused."""

from functools import lru_cache

import cv2
import numpy as np
import pytest

from services.arrays import RgbImage
from services.contract.rectify import RectifyParameters
from services.errors import NoText
from services.geometry.focal_prior import FocalPrior, typical_focal_prior
from services.geometry.page_frame import Frame
from services.geometry.photo_frame import PhotoFrame
from services.rectify import page_search
from services.rectify.analysis import outline_search
from services.rectify.page_description import describe_camera, describe_evidence
from services.rectify.page_search import find_page
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.shape_choice.textless import find_textless_page
from services.rectify.stage_clock import StageClock
from services.rectify.view.orientation import draw_for_reading
from services.rectify.view.paper_end import find_paper_end
from services.sheet.framing import CurvedFrame
from services.sheet.outline.results import SheetOutline
from services.sheet.plane.outline_plane import OutlinePlane
from services.sheet.plane.planar_page import PlanarPage
from services.sheet.plane.ruled_plane import plane_from_rules
from services.sheet.ridged_page import RidgedPage
from services.sheet.surfaces import MeshSurface
from simulation.degradation import PHONE
from simulation.flat_page import Page
from simulation.folded import folded_in_thirds
from simulation.photo import SimulatedPhoto
from simulation.scenes import BOOK, POSES, View, photograph
from simulation.sheets import SHEET_VIEWS, Staging, photograph_sheet
from simulation.surfaces import Shape
from tests.services.sheet.sheet_sides import bent_outline_of_truth, outline_of_truth

pytestmark = pytest.mark.pipeline

REFUSAL = NoText("only 3 printed characters were found.")
PRIOR = typical_focal_prior()


def drawing(width: int = 700, height: int = 990) -> Page:
    """A sheet with some blots of colour and no straight line."""
    image = np.full((height, width, 3), 250, np.uint8)
    rng = np.random.default_rng(5)
    for _ in range(12):
        centre = rng.uniform([100, 100], [width - 100, height - 100])
        colour = tuple(int(v) for v in rng.integers(60, 200, 3))
        cv2.circle(image, (int(centre[0]), int(centre[1])), int(rng.uniform(20, 70)), colour, -1)
    return Page(image)


def ruled(width: int = 700, height: int = 990) -> Page:
    """A sheet of squares: no text."""
    image = np.full((height, width), 250, np.uint8)
    image[40:-40:45, 30:-30] = image[41:-40:45, 30:-30] = 60
    image[40:-40, 30:-30:45] = image[40:-40, 31:-30:45] = 60
    return Page(image)


@lru_cache
def photo_of(page: str, view: View) -> SimulatedPhoto:
    drawn = drawing() if page == "drawing" else ruled()
    return photograph(drawn, view, 0.0, dirt=PHONE, rng=np.random.default_rng(2), size=(700, 900))


def frame_of(photo: RgbImage) -> PhotoFrame:
    return PhotoFrame(photo.shape[1], photo.shape[0])


def framed(page: ShapedPage) -> Frame:
    return page.frame(find_paper_end(page, "sheet", np.zeros((0, 4, 2))).reach, "sheet")


@pytest.mark.parametrize("view", POSES, ids=lambda view: f"pose{view.name}")
def test_a_drawing_comes_out_rectangular_by_its_outline(view: View) -> None:
    shot = photo_of("drawing", view)
    outline = outline_of_truth(shot.truth, 0.5, np.random.default_rng(0))
    page = find_textless_page(shot.image, outline, frame_of(shot.image), PRIOR, REFUSAL)
    assert page.shape.sources == ("outline",)
    frame = framed(page)
    corners = shot.truth.page_to_photo(np.array([[0.0, 0], [699, 0], [699, 989], [0, 989]]))
    flat = frame.to_flat(corners)
    ratio = np.linalg.norm(flat[1] - flat[0]) / np.linalg.norm(flat[3] - flat[0])
    assert ratio == pytest.approx(700 / 990, rel=0.03)
    # The sheet fills its view but for a small rim.
    assert abs(np.linalg.norm(flat[1] - flat[0]) / frame.width - 1) < 0.04
    assert draw_for_reading(shot.image, None, frame).shape == (frame.height, frame.width)


@pytest.mark.parametrize("view", POSES[:2], ids=lambda view: f"pose{view.name}")
def test_straight_print_shows_the_plane_where_no_edge_is_seen(view: View) -> None:
    shot = photo_of("ruled", view)
    page = find_textless_page(shot.image, None, frame_of(shot.image), PRIOR, REFUSAL)
    assert page.shape.sources == ("rules",)
    assert isinstance(page.shape, PlanarPage)
    normal = shot.truth.normals(shot.truth.page_to_photo(np.array([[350.0, 495.0]])))[0]
    assert np.degrees(np.arccos(abs(normal @ page.shape.plane.rotation[:, 2]))) < 2.0


def test_a_drawing_without_edges_is_refused_and_the_message_says_so() -> None:
    shot = photo_of("drawing", POSES[0])
    inside = shot.image[250:650, 200:500]
    with pytest.raises(NoText, match=r"only 3 printed characters were found\. No sheet's edge is seen"):
        find_textless_page(inside, None, frame_of(inside), PRIOR, REFUSAL)


def test_lines_of_every_direction_are_no_rules() -> None:
    rays = np.full((800, 800), 250, np.uint8)
    for angle in np.linspace(0, np.pi, 25, endpoint=False):
        way = 380 * np.array([np.cos(angle), np.sin(angle)])
        a, b = (np.array([400, 400]) + way).astype(int), (np.array([400, 400]) - way).astype(int)
        cv2.line(rays, (int(a[0]), int(a[1])), (int(b[0]), int(b[1])), 30, 2, cv2.LINE_AA)
    assert not isinstance(plane_from_rules(rays, PhotoFrame(800, 800), PRIOR), OutlinePlane)
    blank = np.full((300, 300), 200, np.uint8)
    assert not isinstance(plane_from_rules(blank, PhotoFrame(300, 300), PRIOR), OutlinePlane)


def test_the_answer_tells_what_decided() -> None:
    shot = photo_of("drawing", POSES[2])
    outline = outline_of_truth(shot.truth, 0.5, np.random.default_rng(0))
    textless = find_textless_page(shot.image, outline, frame_of(shot.image), PRIOR, REFUSAL)
    evidence = describe_evidence(textless)
    assert (evidence.source, evidence.outline_confidence, evidence.sides_seen) == (("outline",), 0.95, 4)
    assert (evidence.major_convergence, evidence.text_area_fraction) == (None, 0.0)
    assert textless.shape.kind == "planar"


def test_what_is_taken_for_text_on_a_drawing_does_not_turn_it() -> None:
    # Blots, and the grain of the desk, which the sheet's edges leave far from level.
    shot = photo_of("drawing", POSES[2])
    page = find_page(shot.image, RectifyParameters(), shot.truth.focal_length_px, StageClock())
    evidence = describe_evidence(page)
    assert evidence.source == ("outline",)
    assert evidence.outline_confidence is not None
    assert (evidence.outline_confidence > 0.5, evidence.sides_seen) == (True, 4)
    assert [notice.code for notice in page.notices] == ["outline-disagrees"]
    assert isinstance(page.shape, PlanarPage)
    assert (page.shape.focal_source, page.shape.skew_rad) == ("exif", 0.0)


BENT: dict[str, Shape] = {"folded": folded_in_thirds(990 / 700, 20, -15), "curved": BOOK}


@lru_cache
def bent_sheet(name: str) -> SimulatedPhoto:
    staging = Staging("black")
    rng = np.random.default_rng(3)
    return photograph_sheet(drawing(), SHEET_VIEWS[1], BENT[name], staging, rng=rng, size=(700, 900))


@pytest.mark.parametrize("name", BENT)
def test_a_bent_drawing_comes_out_rectangular_by_its_bent_sides(name: str) -> None:
    shot = bent_sheet(name)
    outline = bent_outline_of_truth(shot.truth, 0.4, np.random.default_rng(0))
    view = frame_of(shot.image)
    prior = FocalPrior(float(np.log(shot.truth.focal_length_px / view.unit_px)), 0.03, "exif")
    page = find_textless_page(shot.image, outline, view, prior, REFUSAL)
    assert isinstance(page.shape, RidgedPage)
    assert page.shape.kind == "curved"
    frame = framed(page)
    assert isinstance(frame, CurvedFrame)
    # The view is the sheet: its border shows the sheet's sides, evenly spaced.
    assert frame.width / frame.height == pytest.approx(700 / 990, rel=0.03)
    places = np.linspace(0, 1, 9)
    for axis, at in ((0, 0.0), (0, 1.0), (1, 0.0), (1, 1.0)):
        edge = np.full((9, 2), at)
        edge[:, 1 - axis] = places
        seen = frame.to_photo(edge * [frame.width - 1, frame.height - 1])
        sheet = shot.truth.photo_to_sheet(seen) / [1.0, shot.truth.page.half_height_units]
        assert np.abs((sheet + 1) / 2 - edge).max() < 0.03
    assert draw_for_reading(shot.image, None, frame).shape == (frame.height, frame.width)
    evidence = describe_evidence(page)
    assert (evidence.source, evidence.sides_seen) == (("outline",), 4)
    assert isinstance(page.shape.surface(page.view), MeshSurface)
    assert describe_camera(page).source == "exif"


def test_the_outline_is_looked_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    shot = photo_of("drawing", POSES[2])
    outline = outline_of_truth(shot.truth, 0.5, np.random.default_rng(0))
    looked: list[bool] = []

    def look(_photo: RgbImage, characters: object = None, *_: object) -> SheetOutline:
        looked.append(characters is not None)
        return outline

    def refuse(*_: object) -> None:
        raise REFUSAL

    monkeypatch.setattr(outline_search, "find_outline", look)
    monkeypatch.setattr(page_search, "shape_page", refuse)
    page = find_page(shot.image, RectifyParameters(), None, StageClock())
    assert page.analysis is None
    assert page.outline is outline
    assert looked == [True]
    # Where the text was refused before, it is looked for without.
    monkeypatch.setattr(page_search, "analyse_photo", lambda *_, **__: refuse())
    page = find_page(shot.image, RectifyParameters(), None, StageClock())
    assert page.analysis is None
    assert looked == [True, False]
