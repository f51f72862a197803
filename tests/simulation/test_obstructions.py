"""Glare lies where the mirror sends the lamp, and hides what the truth says."""

import numpy as np
import pytest

from simulation.obstructions import (
    PAPER_AND_INK,
    Finger,
    Lamp,
    Obstructions,
    Shadow,
    lamp_for,
    mirror_image,
    obstruct,
)
from simulation.photo import simulate_photo
from tests.simulation.scene import SHAPES, blank_page, truth_of


@pytest.mark.parametrize("name", list(SHAPES))
def test_the_mirror_image_lies_where_it_was_aimed_at(name: str) -> None:
    truth = truth_of(SHAPES[name])
    lamp = lamp_for(truth, (0.2, -0.3), 3.0, 0.05)
    level = mirror_image(truth, lamp).upsampled(0, truth.camera.height)[..., 0]
    x, y = truth.sheet_to_photo(np.array([[0.2, -0.3]]))[0]
    assert level[round(y), round(x)] > 0.95 * lamp.level
    assert level[level > 0.5 * lamp.level].size < 0.2 * level.size


def test_on_a_flat_sheet_the_lamp_is_seen_behind_it() -> None:
    """The image is where the line from the eye to the lamp's image behind the plane Z = 0 meets it."""
    truth = truth_of(SHAPES["plane"])
    lamp = Lamp((0.4, 0.3, -2.0), 0.1)
    eye, behind = truth.pose.eye(), np.array([0.4, 0.3, 2.0])
    meets = eye + eye[2] / (eye[2] - behind[2]) * (behind - eye)
    level = mirror_image(truth, lamp).upsampled(0, truth.camera.height)[..., 0]
    rows, columns = np.nonzero(level > 0.9 * lamp.level)
    middle = truth.sheet_to_photo(meets[None, :2])[0]
    assert np.hypot(columns.mean() - middle[0], rows.mean() - middle[1]) < 6


def test_what_is_hidden_is_told() -> None:
    truth = truth_of(SHAPES["plane"], 0.0)
    photo = simulate_photo(blank_page(), truth.shape, 0.0, truth.pose, truth.camera)
    finger, shadow = Finger((-1.2, 0.5), (-0.7, 0.5)), Shadow((0.5, 0.6), (0.3, 0.2), 0.2)
    lamp = lamp_for(truth, (0.3, -0.5), 3.0, 0.1)
    made = obstruct(photo, Obstructions(lamp, shadow, (finger,)))
    points = np.array([[-0.75, 0.5], [0.5, 0.6], [0.3, -0.5], [-0.5, -0.8]])
    at = np.round(truth.sheet_to_photo(points)).astype(int)
    covered, shaded, glaring, clear = (made.image[y, x].astype(int) for x, y in at)
    before = photo.image[at[3][1], at[3][0]].astype(int)
    assert covered[0] > covered[1] + 30 > covered[2] + 30
    assert shaded == pytest.approx(before * 0.5, abs=6)
    assert (glaring == 255).all()
    assert clear == pytest.approx(before, abs=1)
    assert [made.lost[y, x] > 0.95 for x, y in at] == [True, False, True, False]
    assert [made.shaded[y, x] > 0.45 for x, y in at] == [False, True, False, False]
    # Only what was hidden has changed.
    untouched = (made.lost < 0.01) & (made.shaded == 0)
    assert untouched.mean() > 0.5
    change = np.abs(made.image.astype(int) - photo.image).max(axis=2)
    # Light that lies over paper without clipping it takes nothing from the print.
    assert change[untouched].max() <= 255 - PAPER_AND_INK[0]
