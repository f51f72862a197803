"""Boards in a room: beside the photo's middle, in a frame, with people before it."""

import cv2
import numpy as np
import pytest

from services.arrays import RgbImage
from services.contract.rectify import RectifyParameters
from services.errors import NoText
from services.rectify.pipeline import rectify
from services.sheet.outline.even_area import find_even_area
from tests.services.sheet.outline.drawn import distances, sides_of

pytestmark = pytest.mark.pipeline

CORNERS = np.array([[232.0, 332.0], [536.0, 338.0], [528.0, 541.0], [220.0, 512.0]])
WHITE, GREEN, BLACK = (214, 216, 224), (38, 74, 58), (20, 20, 22)
FINE = 4
"""Samples a pixel, along each axis."""


def draw_room(
    board: tuple[int, int, int] | None, bezel: tuple[int, int, int], glare: float = 0.0
) -> RgbImage:
    """A wall with a sideboard cut by the frame, a lamp, heads, and a `board` with its `bezel` and a light frame."""
    size = (900 * FINE, 675 * FINE)
    image = np.full((size[1], size[0], 3), (176, 168, 150), np.uint8)
    cv2.rectangle(image, (-1, 230 * FINE), (770 * FINE, 560 * FINE), (120, 138, 136), -1)
    cv2.circle(image, (740 * FINE, 40 * FINE), 65 * FINE, (30, 30, 34), -1)
    if board is not None:
        middle = CORNERS.mean(axis=0)
        for grown, colour in ((1.09, (205, 205, 200)), (1.05, bezel), (1.0, board)):
            corners = (middle + grown * (CORNERS - middle) + 0.5) * FINE - 0.5
            cv2.fillPoly(image, [np.round(corners * 16).astype(np.int32)], colour, cv2.LINE_8, 4)
        strokes = (70, 120, 90) if board == WHITE else (225, 225, 215)
        for x, y in ((270, 365), (350, 372), (440, 380), (290, 450), (400, 460), (470, 470)):
            cv2.ellipse(image, (x * FINE, y * FINE), (12 * FINE, 18 * FINE), 20, 0, 300, strokes, 2 * FINE)
    cv2.ellipse(image, (430 * FINE, 660 * FINE), (55 * FINE, 105 * FINE), 0, 0, 360, (24, 20, 20), -1)
    cv2.ellipse(image, (70 * FINE, 640 * FINE), (80 * FINE, 120 * FINE), 0, 0, 360, (196, 180, 140), -1)
    small = cv2.resize(image, (900, 675), interpolation=cv2.INTER_AREA).astype(np.float64)
    y, x = np.mgrid[0:675, 0:900]
    shine = np.exp(-((x - 450) ** 2 + (y - 400) ** 2) / (2 * 60.0**2))[..., None]
    lit = small * (0.75 + 0.25 * x / 900)[..., None] + glare * shine
    noise = np.random.default_rng(1).normal(0, 2.5, lit.shape)
    return np.asarray(np.clip(cv2.GaussianBlur(lit, (0, 0), 0.8) + noise + 0.5, 0, 255), np.uint8)


@pytest.mark.parametrize(
    ("board", "bezel", "glare"),
    [(WHITE, BLACK, 0.0), (WHITE, BLACK, 40.0), (GREEN, (120, 90, 60), 0.0), (BLACK, WHITE, 50.0)],
)
def test_a_board_beside_the_middle_is_found(
    board: tuple[int, int, int], bezel: tuple[int, int, int], glare: float
) -> None:
    found = find_even_area(draw_room(board, bezel, glare))
    assert found is not None
    points = np.concatenate([side.points for side in found.sides])
    assert np.percentile(distances(points, sides_of(CORNERS)), 95) < 1.0


def test_a_photo_of_a_board_is_answered() -> None:
    answer = rectify(draw_room(WHITE, BLACK), RectifyParameters(upright=False))
    assert answer.evidence.source == ("outline",)
    corners = answer.mesh[[0, 0, -1, -1], [0, -1, -1, 0]]
    assert np.linalg.norm(corners - CORNERS, axis=1).max() < 12


def test_a_room_without_a_board_is_no_page() -> None:
    photo = draw_room(None, BLACK)
    assert find_even_area(photo) is None
    with pytest.raises(NoText):
        rectify(photo, RectifyParameters(upright=False))
