"""The trust region against SciPy's, which decomposes the Jacobian itself."""

from collections.abc import Callable

import numpy as np
import pytest
import scipy.optimize

from services.arrays import Floats, Vector
from services.trust_region import least_squares

Evaluation = Callable[[Vector], tuple[Vector, Floats]]
TIMES = np.linspace(0.0, 4.0, 60)
NOISE = 0.01 * np.random.default_rng(5).normal(size=len(TIMES))


def decay(x: Vector) -> tuple[Vector, Floats]:
    """Residuals and derivatives of a decaying wave: amplitude, rate, frequency."""
    amplitude, rate, frequency = x
    wave, fall = np.cos(frequency * TIMES), np.exp(-rate * TIMES)
    seen = 2.0 * np.exp(-0.7 * TIMES) * np.cos(3.0 * TIMES) + NOISE
    slope = [
        fall * wave,
        -amplitude * TIMES * fall * wave,
        -amplitude * TIMES * fall * np.sin(frequency * TIMES),
    ]
    return amplitude * fall * wave - seen, np.stack(slope, axis=1)


def valley(x: Vector) -> tuple[Vector, Floats]:
    """Rosenbrock's: steps to its curved floor are refused."""
    value = np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])
    return value, np.array([[-20 * x[0], 10.0], [-1.0, 0.0]])


@pytest.mark.parametrize(
    ("evaluate", "start", "scale"),
    [
        (decay, (1.0, 0.2, 2.5), (0.1, 0.1, 0.1)),
        (decay, (4.0, 1.5, 3.3), (1.0, 0.02, 0.3)),
        (valley, (-1.2, 1.0), (1.0, 1.0)),
    ],
)
def test_takes_the_steps_of_scipy(
    evaluate: Evaluation, start: tuple[float, ...], scale: tuple[float, ...]
) -> None:
    x0, units = np.array(start), np.array(scale)
    ours = least_squares(evaluate, x0, units, 200)
    theirs = scipy.optimize.least_squares(
        lambda x: evaluate(x)[0], x0, lambda x: evaluate(x)[1], x_scale=units, max_nfev=200
    )
    assert np.allclose(ours.x, theirs.x, atol=1e-7)
    assert ours.cost == pytest.approx(theirs.cost, abs=1e-12)
    assert ours.evaluations == theirs.nfev
    assert np.allclose(ours.jac, evaluate(ours.x)[1])


def test_ends_when_little_is_gained_or_nothing_is_left_to_spend() -> None:
    x0, units = np.array([1.0, 0.2, 2.5]), np.full(3, 0.1)
    thorough = least_squares(decay, x0, units, 200)
    early = least_squares(decay, x0, units, 200, least_gain=0.5)
    bounded = least_squares(decay, x0, units, 2)
    assert early.evaluations < thorough.evaluations
    assert bounded.evaluations == 2
    assert thorough.cost <= early.cost
    assert bounded.cost <= 0.5 * float(np.sum(decay(x0)[0] ** 2))


def test_an_unknown_that_changes_nothing_stays() -> None:
    def one_of_two(x: Vector) -> tuple[Vector, Floats]:
        return np.array([x[0] - 3.0, 2 * x[0] - 6.0]), np.array([[1.0, 0.0], [2.0, 0.0]])

    found = least_squares(one_of_two, np.array([0.5, 0.25]), np.ones(2), 50)
    assert found.x == pytest.approx([3.0, 0.25])


def test_steps_to_where_nothing_is_defined_are_shortened() -> None:
    def root(x: Vector) -> tuple[Vector, Floats]:
        with np.errstate(invalid="ignore"):
            below = np.sqrt(1.0 - x[0])
        return np.array([below - 0.1]), np.array([[-0.5 / below]])

    assert least_squares(root, np.array([-30.0]), np.ones(1), 50).x == pytest.approx([0.99])
