"""Gray, and black and white: thin strokes stay, bold ones do not grow, grain of paper is no ink."""

import cv2
import numpy as np
import pytest

from services.imaging.looks import black_and_white, scanner_look


def drawn(width: float, ink: int = 20, noise: float = 5.0) -> tuple[np.ndarray, np.ndarray]:
    """A blurred page (H, W) with upright strokes of `width` pixels, and where they are."""
    scale = 8
    fine = np.full((300 * scale, 400 * scale), 250.0)
    ideal = np.zeros((300, 400), bool)
    for x in range(40, 360, 40):
        fine[40 * scale : 260 * scale, round(x * scale) : round((x + width) * scale)] = ink
        ideal[40:260, x : x + max(round(width), 1)] = True
    page = cv2.resize(fine, (400, 300), interpolation=cv2.INTER_AREA)
    page = cv2.GaussianBlur(page, (0, 0), 0.8) + np.random.default_rng(1).normal(0, noise, (300, 400))
    return np.clip(page + 0.5, 0, 255).astype(np.uint8), ideal


@pytest.mark.parametrize(("width", "ink"), [(0.6, 20), (1.0, 20), (1.0, 90), (2.0, 20), (5.0, 20), (9.0, 60)])
def test_strokes_are_whole_and_as_wide_as_they_are(width: float, ink: int) -> None:
    page, ideal = drawn(width, ink)
    found = ~black_and_white(page)
    assert found[ideal].mean() > 0.97
    wide = found[60:240].sum(axis=1).mean() / 8
    # Blur makes 2 px of a hairline.
    assert max(width, 1) - 0.6 < wide < max(width, 2) + 1.0
    away = ~cv2.dilate(ideal.astype(np.uint8), np.ones((1, 7), np.uint8)).astype(bool)
    assert found[away].mean() < 1e-3


def test_areas_of_ink_are_filled_and_their_light_print_stays() -> None:
    page = np.full((200, 300), 250, np.uint8)
    page[40:160, 40:260] = 30
    cv2.putText(page, "light", (80, 110), cv2.FONT_HERSHEY_SIMPLEX, 1.2, 240, 2, cv2.LINE_AA)
    paper = black_and_white(page)
    assert not paper[45:60, 45:255].any()
    assert 0.5 < paper[40:160, 40:260].sum() / (page[40:160, 40:260] > 128).sum() < 1.5


def test_gray_has_one_channel_and_a_page_may_stay_as_it_is() -> None:
    page = np.random.default_rng(2).integers(0, 256, (30, 40, 3), dtype=np.uint8)
    assert scanner_look(page, "gray").shape == (30, 40)
    assert scanner_look(page, "bw").dtype == bool
    assert scanner_look(page, "normalize") is page
