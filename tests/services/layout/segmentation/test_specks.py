"""Lines of one component have formulas of their own; they say what the measures of a whole line say."""

import numpy as np
import pytest

from services.layout.segmentation.ink import InkComponents
from services.layout.segmentation.text_line_choice import _is_regular
from services.layout.segmentation.text_lines import measure_line


def alike(count: int, height: float, hang: float) -> InkComponents:
    """Components of one height side by side, at one level."""
    left = 40.0 + 13.0 * np.arange(count)
    boxes = np.column_stack([left, np.full(count, 100.0), left + 9, np.full(count, 100.0 + height)])
    full = np.full(count, 1.0)
    return InkComponents(
        boxes, 7 * height * full, 2.5 * full, hang * full, 0.1 * full, full > 2, np.zeros(count, np.intp)
    )


@pytest.mark.parametrize(("height", "hang"), [(1.0, 0.0), (14.0, 0.0), (14.0, 3.0), (60.0, 59.5)])
def test_one_component_is_measured_as_three_of_its_kind(height: float, hang: float) -> None:
    three = alike(3, height, hang)
    whole = measure_line(three, np.arange(3))
    one = measure_line(three, np.array([1]))
    assert one.box == (53.0, 100.0, 62.0, 100.0 + height)
    for name in ("baseline", "em", "small", "stroke", "slant"):
        assert getattr(one, name) == pytest.approx(getattr(whole, name), rel=1e-12), name
    assert _is_regular(one, three) == _is_regular(whole, three)
