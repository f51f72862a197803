"""Views of a flat page against the photo."""

import numpy as np
import pytest

from services.geometry.page_frame import turn_against_photo


@pytest.mark.parametrize(("across", "down"), [(1.0, 1.0), (1.0, 0.0), (0.0, 1.0)])
def test_a_view_that_is_one_pixel_wide_has_the_turn_of_its_other_side(across: float, down: float) -> None:
    turn = np.deg2rad(20.0)
    along, below = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    rows, columns = np.mgrid[:3, :4][..., None]
    assert turn_against_photo(across * columns * along + down * rows * below) == pytest.approx(340.0)
