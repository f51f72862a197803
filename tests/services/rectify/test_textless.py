"""Pages without text: by the sheet's sides, by straight print, or refused."""

from functools import lru_cache

import cv2
import numpy as np
import pytest

from services.arrays import RgbImage
from services.errors import NoText
from services.rectify.outline_plane import OutlinePlane
from services.rectify.parameters import RectifyParameters
from services.rectify.pipeline import describe_evidence, find_page
from services.rectify.planar import PhotoFrame, typical_focal_prior
from services.rectify.pose import PagePose
from services.rectify.ruled_plane import plane_from_rules
from services.rectify.stage_clock import StageClock
from services.rectify.textless import draw_for_reading, find_textless_page, frame_textless
from simulation.degradation import PHONE
from simulation.flat_page import Page
from simulation.photo import SimulatedPhoto
from simulation.scenes import POSES, View, photograph
from tests.services.rectify.sheet_sides import outline_of_truth

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


@pytest.mark.parametrize("view", POSES, ids=lambda view: f"pose{view.name}")
def test_a_drawing_comes_out_rectangular_by_its_outline(view: View) -> None:
    shot = photo_of("drawing", view)
    outline = outline_of_truth(shot.truth, 0.5, np.random.default_rng(0))
    page = find_textless_page(shot.image, outline, frame_of(shot.image), PRIOR, REFUSAL)
    assert page.aspect is not None
    assert page.aspect == pytest.approx(700 / 990, rel=0.03)
    assert page.shape.sources == ("outline",)
    frame = frame_textless(page)
    corners = shot.truth.page_to_photo(np.array([[0.0, 0], [699, 0], [699, 989], [0, 989]]))
    H = np.linalg.inv(frame.H_photo_flat)
    seen = np.array([H @ [*corner, 1.0] for corner in corners])
    flat = seen[:, :2] / seen[:, 2:]
    ratio = np.linalg.norm(flat[1] - flat[0]) / np.linalg.norm(flat[3] - flat[0])
    assert ratio == pytest.approx(700 / 990, rel=0.03)
    # The sheet fills its view but for a small rim.
    assert abs(np.linalg.norm(flat[1] - flat[0]) / frame.width - 1) < 0.04
    assert draw_for_reading(shot.image, frame).shape == (frame.height, frame.width)


@pytest.mark.parametrize("view", POSES[:2], ids=lambda view: f"pose{view.name}")
def test_straight_print_shows_the_plane_where_no_edge_is_seen(view: View) -> None:
    shot = photo_of("ruled", view)
    page = find_textless_page(shot.image, None, frame_of(shot.image), PRIOR, REFUSAL)
    assert page.shape.sources == ("rules",)
    normal = shot.truth.normals(shot.truth.page_to_photo(np.array([[350.0, 495.0]])))[0]
    assert np.degrees(np.arccos(abs(normal @ np.array(page.shape.normal)))) < 2.0
    assert page.aspect is None


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
    assert textless.kind == "planar"


def test_what_is_taken_for_text_on_a_drawing_does_not_turn_it() -> None:
    # Blots, and the grain of the desk, which the sheet's edges leave far from level.
    shot = photo_of("drawing", POSES[2])
    page = find_page(shot.image, RectifyParameters(), shot.truth.focal_length_px, StageClock())
    evidence = describe_evidence(page)
    assert evidence.source == ("outline",)
    assert evidence.outline_confidence is not None
    assert (evidence.outline_confidence > 0.5, evidence.sides_seen) == (True, 4)
    assert [notice.code for notice in page.notices] == ["outline-disagrees"]
    assert isinstance(page.shape, PagePose)
    assert (page.shape.focal_source, page.shape.skew_rad) == ("exif", 0.0)
