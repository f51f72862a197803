"""Attributes of zones: by hand, what is not known, and what they do not depend on; their cost functions."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from services.layout.graph.node_attributes import (
    LONGEST_TEXT,
    NUMERIC_ATTRIBUTES,
    describe_zones,
    order_from_top,
    robust_difference,
)
from services.layout.page import InkAppearance, Page, Zone
from tests.services.layout.samples import page_of


def measured(page: Page) -> dict[str, list[float]]:
    measures = describe_zones(page)
    return {attribute.name: attribute.measure(measures).tolist() for attribute in NUMERIC_ATTRIBUTES}


def test_two_zones_by_hand() -> None:
    looks = InkAppearance(density=0.25, size=2.0, size_spread=0.5, stroke=0.5, slant=0.1, regularity=0.9)
    heading = Zone(
        "a", (100, 200, 500, 300), lines=3, font_size=20.0, weight=0.1, appearance=looks, text="Ab 12\ncd"
    )
    body = Zone("b", (100, 400, 900, 1000), lines=31, font_size=10.0, weight=0.3, text="x")
    found = measured(Page(1000, 2000, (heading, body)))
    expected = {
        "left": (0.1, 0.1),
        "right": (0.5, 0.9),
        "centre": (0.3, 0.5),
        "top": (0.1, 0.2),
        "bottom": (0.15, 0.5),
        "middle": (0.125, 0.35),
        "width": (0.4, 0.8),
        "height": (math.log2(0.05), math.log2(0.3)),
        "lines": (2.0, 5.0),
        "font": (1.0, 0.0),
        "stroke-weight": (-1.0, math.log2(1.5)),
        "words": (2.0, 1.0),
        "capitals": (0.25, 0.0),
        "digits": (0.25, 0.0),
        "printed": (1.0, 1.0),
        "gap-above": (math.log2(1.002), math.log2(0.052)),
        "gap-below": (math.log2(0.052), math.log2(1.002)),
        "beside": (0.0, 0.0),
        "from-top": (0.0, 1.0),
        "from-bottom": (1.0, 0.0),
        "rank": (0.0, 1.0),
        "aspect": (3.0, math.nan),
        "margin": (math.log2(0.11), math.nan),
        "density": (-2.0, math.nan),
        "size": (1.0, math.nan),
        "size-spread": (0.5, math.nan),
        "stroke": (-1.0, math.nan),
        "slant": (0.1, math.nan),
        "regularity": (0.9, math.nan),
    }
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        assert found[name] == pytest.approx(values, nan_ok=True), name


def test_what_was_not_measured_is_not_known() -> None:
    found = measured(page_of((0, 0, 10, 10), (0, 20, 10, 30)))
    unknown = {name for name, values in found.items() if np.isnan(values).all()}
    assert unknown == {
        *("lines", "font", "stroke-weight", "words", "capitals", "digits", "printed"),
        *("aspect", "margin", "density", "size", "size-spread", "stroke", "slant", "regularity"),
    }
    assert all(np.isfinite(found[name]).all() for name in found.keys() - unknown)


def test_a_zone_without_text_tells_something_on_a_page_that_was_read() -> None:
    found = measured(Page(10, 10, (Zone("a", (0, 0, 1, 1), text="word"), Zone("b", (0, 2, 1, 3), text=" "))))
    assert found["printed"] == [1.0, 0.0]
    assert found["words"] == [1.0, 0.0]
    assert found["capitals"] == [0.0, 0.0]


def test_a_zone_alone_is_first_and_last() -> None:
    found = measured(page_of((100, 100, 200, 200), text="A"))
    assert [found[name] for name in ("from-top", "from-bottom", "rank", "beside")] == [[0.0]] * 4
    assert found["gap-above"] == found["gap-below"] == [pytest.approx(math.log2(1.002))]


def test_zones_on_one_row_stand_beside_each_other() -> None:
    row = [(100.0 * k, 100.0, 100.0 * k + 50, 150.0) for k in range(8)]
    found = measured(page_of(*row[:3], (0, 500, 900, 600)))
    assert found["beside"] == [2.0, 2.0, 2.0, 0.0]
    assert measured(page_of(*row))["beside"] == [5.0] * 8, "many are as good as five"


def test_gaps_are_to_zones_that_stand_over_or_under() -> None:
    found = measured(page_of((0, 0, 100, 100), (200, 0, 300, 300), (0, 350, 300, 400)))
    assert np.exp2(found["gap-below"]) - 0.002 == pytest.approx([0.25, 0.05, 1.0])
    assert np.exp2(found["gap-above"]) - 0.002 == pytest.approx([1.0, 1.0, 0.05])


def test_overlapping_zones_leave_no_gap() -> None:
    found = measured(page_of((0, 0, 100, 100), (0, 90, 100, 200)))
    assert np.exp2(found["gap-below"][0]) - 0.002 == pytest.approx(0.0)
    assert np.exp2(found["gap-above"][1]) - 0.002 == pytest.approx(0.0)


def test_long_texts_are_counted_so_far() -> None:
    words = measured(page_of((0, 0, 1, 1), text="a " * LONGEST_TEXT))["words"]
    assert words == [pytest.approx(math.log2(1 + LONGEST_TEXT / 2))]


def test_thin_and_tiny_boxes_have_finite_attributes() -> None:
    found = measured(page_of((0, 0, 1000, 1e-9), (500, 500, 500 + 1e-9, 900), (1e-12, 0, 2e-12, 1e-12)))
    finite = ("left", "top", "width", "height", "gap-above", "gap-below", "rank")
    assert all(np.isfinite(found[name]).all() for name in finite)
    assert min(found["height"]) >= math.log2(1e-6)


def test_far_outside_of_the_page_is_as_far_as_its_side() -> None:
    found = measured(page_of((-1e6, -1e6, 1e6, 1e6)))
    assert (found["left"], found["right"], found["top"], found["bottom"]) == ([-1.0], [2.0], [-1.0], [2.0])


def test_order_is_from_the_top_then_the_left() -> None:
    boxes = np.array([[5, 1, 6, 2], [0, 1, 9, 2], [3, 0, 4, 9], [0, 1, 9, 1.5]], dtype=float)
    assert order_from_top(boxes).tolist() == [3, 2, 0, 1]
    assert order_from_top(np.ones((3, 4))).tolist() == [0, 1, 2], "equal boxes stand as the zones do"


def test_costs_are_negative_log_densities() -> None:
    masses = []
    for expected, variance in ((0.0, 1.0), (3.0, 1.0), (-2.0, 0.01), (40.0, 25.0)):
        reach = 1e3 * math.sqrt(variance)

        def density(value: float, expected: float = expected, variance: float = variance) -> float:
            return float(np.exp(-robust_difference(np.array(value), np.array(expected), np.array(variance))))

        mass, _ = quad(density, expected - reach, expected + reach, points=[expected], limit=400)
        masses.append(mass)
    assert masses == pytest.approx([masses[0]] * len(masses), rel=1e-4)


@settings(max_examples=60, deadline=None)
@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(0.01, 50.0), st.floats(1e-4, 1e2))
def test_costs_grow_with_the_difference(
    expected: float, difference: float, more: float, variance: float
) -> None:
    further = difference + math.copysign(more, difference)
    values = expected + np.array([0.0, difference, -difference, further])
    none, near, other_side, far = robust_difference(values, np.array(expected), np.array(variance))
    assert none <= near < far
    assert near == pytest.approx(other_side, rel=1e-6, abs=1e-6)


def test_costs_of_small_differences_are_quadratic_and_of_outliers_bounded() -> None:
    zero, one = np.array(0.0), np.array(1.0)
    assert robust_difference(np.array(0.01), zero, one) == pytest.approx(1.25 * 0.01**2 / 2, rel=1e-3)
    outlier = 30.0
    assert robust_difference(np.array(outlier), zero, one) < outlier < outlier**2 / 2
