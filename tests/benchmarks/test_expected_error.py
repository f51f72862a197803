"""The model of expected errors is learned as it was made, with the right mean; kinds and photos weigh the same."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import expit

from benchmarks.reading.expected_error import Row, learn, misread, weights_of
from services.capture.quality import CaptureQuality

GOOD = CaptureQuality(24.0, 24.0, 0.8, 0.8, 0.0, 0.0, 0.0)
ROW = Row("photos/a", "photos", "a", False, None, GOOD, 0.1, 0.2)


def test_shares_teach_the_coefficients_and_their_mean() -> None:
    rng = np.random.default_rng(4)
    variables = rng.normal(0.0, 2.0, (4000, 2))
    expected = expit(-2.0 + variables @ [0.9, 0.4])
    errors = rng.binomial(20, expected) / 20
    found = learn(variables, errors, np.ones(len(errors)))
    assert found == pytest.approx([-2.0, 0.9, 0.4], abs=0.1)
    assert expit(found[0] + variables @ found[1:]).mean() == pytest.approx(errors.mean(), abs=1e-3)


def test_a_figure_that_seems_to_help_when_it_is_worse_has_no_weight() -> None:
    variables = np.linspace(-3.0, 3.0, 100)[:, None]
    assert learn(variables, expit(-variables[:, 0]), np.ones(100))[1] == 0.0


def test_kinds_weigh_the_same_and_so_do_photos_with_all_their_sizes() -> None:
    rows = [
        ROW,
        replace(ROW, side_px=700),
        replace(ROW, name="photos/b"),
        replace(ROW, name="app/c", part="app"),
    ]
    assert weights_of(rows) == pytest.approx([0.25, 0.25, 0.5, 1.0])


def test_what_is_cut_off_was_not_misread() -> None:
    assert misread(ROW) == pytest.approx(0.2)
    cut = replace(ROW, error=0.6, quality=replace(GOOD, cut_off_fraction=0.5))
    assert misread(cut) == pytest.approx(0.2)
    assert misread(replace(cut, error=0.3)) == 0.0
