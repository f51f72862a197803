"""A photo whose colours are known at half its size is drawn as by all of its channels."""

from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pytest

from services.arrays import RgbImage
from services.geometry.homographies import translation
from services.geometry.page_frame import Frame
from services.imaging.channels import luminance
from services.rectify.view import drawing
from services.rectify.view.drawing import FlatDrawing, draw_flat_view
from services.sheet.plane.framing import FlatFrame
from tests.services.sheet.curved_views import BentView

SEEN = BentView()
WIDTH, HEIGHT = SEEN.width, SEEN.height
FRAMES: dict[str, Frame] = {
    "bent": SEEN.frame(),
    "flat": FlatFrame(np.array([[0.9, 0.05, 20.0], [-0.04, 0.95, 60.0], [1e-5, 2e-5, 1.0]]), 501, 607),
    "whole": FlatFrame(np.eye(3), WIDTH, HEIGHT),
}


@pytest.fixture(scope="module")
def photo() -> RgbImage:
    """Fine gray strokes on grounds whose colours change softly, as a JPEG in 4:2:0 can hold them."""
    rng = np.random.default_rng(3)
    ground = cv2.resize(
        rng.integers(90, 200, (12, 9, 3), np.uint8), (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC
    )
    strokes = cv2.GaussianBlur(rng.integers(0, 90, (HEIGHT, WIDTH), np.uint8), (3, 3), 0.7)
    return np.asarray(cv2.subtract(ground, cv2.merge([strokes] * 3)), np.uint8)


@pytest.mark.parametrize("name", FRAMES)
def test_luminance_and_soft_colours_are_those_of_all_channels(photo: RgbImage, name: str) -> None:
    frame = FRAMES[name]
    whole = draw_flat_view(photo, frame)
    halves = draw_flat_view(photo, frame, half_colors=True)
    inner = (whole < 255).all(axis=2)
    inner = cv2.erode(inner.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
    assert inner.mean() > 0.3
    apart = np.abs(luminance(whole).astype(int) - luminance(halves))[inner]
    assert apart.max() <= 2
    assert np.abs(whole.astype(int) - halves)[inner].max() <= 9


def test_it_is_white_beyond_the_photo(photo: RgbImage) -> None:
    frame = FlatFrame(translation(-30.25, -20.5), WIDTH + 61, HEIGHT + 43)
    view = draw_flat_view(photo, frame, half_colors=True)
    # Two pixels beside: the kernel's reach.
    inside = np.zeros(view.shape[:2], bool)
    inside[18:-20, 28:-28] = True
    assert (view[~inside] == 255).all()
    assert (view[22:-24, 32:-32] < 255).any(axis=2).all()


@pytest.mark.parametrize("name", FRAMES)
def test_bands_leave_no_seams(photo: RgbImage, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    frame = FRAMES[name]
    usual = draw_flat_view(photo, frame, half_colors=True)
    monkeypatch.setattr(drawing, "BAND_PX", 48)
    assert np.abs(draw_flat_view(photo, frame, half_colors=True).astype(int) - usual).max() <= 2


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (33, 1), (16, 512), (17, 513)])
def test_any_size_is_drawn(photo: RgbImage, size: tuple[int, int]) -> None:
    frame = FRAMES["bent"].through(translation(100.0, 100.0), *size)
    whole, halves = (draw_flat_view(photo, frame, half_colors=half) for half in (False, True))
    assert np.abs(whole.astype(int) - halves).max() <= 6


def test_threads_draw_the_same_view_together(photo: RgbImage) -> None:
    usual = draw_flat_view(photo, FRAMES["bent"], half_colors=True)
    shared = FlatDrawing(photo, FRAMES["bent"], None, half_colors=True)
    with ThreadPoolExecutor(3) as threads:
        for _ in range(3):
            threads.submit(shared.draw)
    assert np.array_equal(shared.finish(), usual)
