"""Lines of the analysed text in a view: where they lie, and their crops, against the view drawn as a whole."""

from functools import lru_cache

import numpy as np
import pytest

from services.arrays import GrayImage
from services.contract.rectify import RectifyParameters
from services.geometry.page_frame import Frame, resize_frame
from services.ocr.engine import Word
from services.ocr.text_lines import cut_line
from services.rectify.analysis.page_analysis import PageAnalysis
from services.rectify.page_search import find_page
from services.rectify.stage_clock import StageClock
from services.rectify.view.drawing import draw_gray_view
from services.rectify.view.judged_view import judge_view
from services.rectify.view.line_reader import CROP_HEIGHT_PX
from services.rectify.view.rows_in_view import CROP_LENGTH, cut_from_view, evident_line, lines_in_view
from simulation.pages import own_pages
from simulation.scenes import BOOK, PLANE, POSES, photograph

pytestmark = pytest.mark.pipeline


@lru_cache
def seen(shape: str) -> tuple[PageAnalysis, Frame]:
    """The analysis of a photo of a page, and the frame of its view."""
    bent = {"flat": PLANE, "bent": BOOK}[shape]
    photo = photograph(own_pages(900, 1270)[0], POSES[2], 8.0, bent, size=(1300, 1600)).image
    page = find_page(photo, RectifyParameters(), None, StageClock())
    assert page.analysis is not None
    return page.analysis, judge_view(photo, page, "content").frame


class Reader:
    """Says the same of every line."""

    name = "same"

    def __init__(self, text: str, confidence: float) -> None:
        self.said = text, confidence
        self.crops: list[GrayImage] = []

    def read_page(self, image: GrayImage) -> list[Word]:
        raise AssertionError("lines are read")

    def read_line(self, image: GrayImage) -> tuple[str, float]:
        self.crops.append(image)
        return self.said


@pytest.mark.parametrize("shape", ["flat", "bent"])
def test_lines_are_level_and_of_one_height_and_hold_their_ink(shape: str) -> None:
    analysis, frame = seen(shape)
    view = resize_frame(frame, analysis.strokes.factor)
    lines = lines_in_view(analysis, view)
    assert len(lines) > 15
    assert np.median([abs(line.slope) for line in lines]) < 0.004
    whole = draw_gray_view(analysis.strokes.image, analysis.strokes.factor, view, analysis.strokes.origin)
    usual = np.median([line.height_px for line in lines])
    is_clear = []
    for line in (line for line in lines if 0.8 * usual < line.height_px < 1.25 * usual):
        crop = cut_from_view(line, view, analysis.strokes)
        dark = 255.0 - crop
        # In the middle half there is more ink in a row than above and below the letters.
        quarter = CROP_HEIGHT_PX // 4
        is_clear.append(dark[quarter:-quarter].mean() > 2 * np.concatenate([dark[:3], dark[-3:]]).mean())
        same = cut_line(whole, line, False, CROP_HEIGHT_PX, CROP_LENGTH)
        assert same.shape == crop.shape
        assert np.abs(same.astype(int) - crop).mean() < 6
    assert np.mean(is_clear) > 0.9, "a rule or a frame beside a line is seen in few"


def test_the_first_evident_line_ends_the_search_and_so_does_one_that_hardly_reads() -> None:
    analysis, frame = seen("flat")
    evident, poor, doubtful = Reader("a" * 25, 0.93), Reader("a" * 25, 0.3), Reader("a" * 12, 0.95)
    assert evident_line(analysis, frame, evident) == 0.93
    assert evident_line(analysis, frame, poor) is None
    assert evident_line(analysis, frame, doubtful) is None, "too few letters"
    assert [len(reader.crops) for reader in (evident, poor, doubtful)] == [1, 1, 3]
