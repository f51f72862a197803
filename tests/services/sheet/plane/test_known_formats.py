"""Formats of paper decide the aspect where a photo does not show the focal length, and what is said of it holds."""

import math

import numpy as np
import pytest

from services.geometry.camera import rotation_from_vector
from services.geometry.focal_prior import FocalPrior, typical_focal_prior
from services.geometry.planar import PagePlane
from services.sheet.plane.known_formats import AspectBelief
from services.sheet.plane.outline_plane import SheetSides, plane_from_lines, read_sides
from tests.services.sheet.sheet_sides import FRAME, leaning, outline_of, seen_rectangle

TYPICAL = typical_focal_prior()
A4, LETTER = 210 / 297, 215.9 / 279.4


def sides_of(
    aspect: float,
    tilt_deg: float,
    azimuth_deg: float,
    log_focal: float,
    prior: FocalPrior = TYPICAL,
    seed: int = 0,
) -> SheetSides:
    """Sides of a sheet seen by a camera whose focal length is off the typical one by `log_focal`."""
    focal = math.exp(TYPICAL.log_focal + log_focal)
    corners = seen_rectangle(aspect, leaning(tilt_deg, azimuth_deg, 8.0), focal)
    sides = read_sides(outline_of(corners, 0.3, np.random.default_rng(seed)), FRAME, prior)
    assert sides is not None
    assert sides.plane is not None
    return sides


@pytest.mark.parametrize("aspect", [A4, 1 / A4, LETTER])
@pytest.mark.parametrize("azimuth_deg", [0.0, 90.0])
def test_in_one_point_perspective_a_likely_format_decides(aspect: float, azimuth_deg: float) -> None:
    sides = sides_of(aspect, 25.0, azimuth_deg, 0.1)
    assert sides.belief is not None
    assert sides.belief.prior is not None
    assert sides.plane is not None
    assert sides.plane.aspect == pytest.approx(aspect, rel=3e-3)
    assert sides.belief.prior.log_focal == pytest.approx(TYPICAL.log_focal + 0.1, abs=0.05)
    without = plane_from_lines(sides.lines, TYPICAL)
    assert abs(math.log(without.aspect / aspect)) > 5e-3


def test_no_format_decides_where_none_is_on_the_curve_of_focal_lengths() -> None:
    sides = sides_of(0.9, 25.0, 0.0, 0.2)
    assert sides.belief is not None
    assert sides.belief.prior is None
    assert sides.focal_prior(TYPICAL) is TYPICAL


@pytest.mark.parametrize("known", ["focal length", "two vanishing points", "frontal"])
def test_formats_are_not_asked_where_the_photo_shows_the_aspect(known: str) -> None:
    given = FocalPrior(TYPICAL.log_focal, 0.003, "given")
    sides = {
        "focal length": lambda: sides_of(0.69, 25.0, 0.0, 0.0, given),
        "two vanishing points": lambda: sides_of(0.69, 40.0, 45.0, 0.1),
        "frontal": lambda: sides_of(0.69, 0.0, 0.0, 0.1),
    }[known]()
    assert sides.belief is None
    assert sides.plane is not None
    assert sides.plane.aspect == pytest.approx(0.69, rel=5e-3)


@pytest.mark.pipeline
def test_95_percent_of_the_aspects_are_within_two_of_the_deviations_that_are_stated() -> None:
    rng = np.random.default_rng(3)
    held, formats, decided = [], [], 0
    for seed in range(60):
        odd = seed % 5 < 2
        aspect = math.exp(rng.uniform(math.log(0.5), math.log(0.95))) if odd else (A4, LETTER, A4)[seed % 3]
        azimuth_deg = 90 * rng.integers(4) + (rng.uniform(0, 90) if seed % 3 == 0 else rng.normal(0, 2))
        sides = sides_of(aspect, rng.uniform(5, 40), azimuth_deg, rng.normal(0, 0.25), seed=seed)
        assert sides.plane is not None
        assert sides.plane.aspect is not None
        said = sides.aspect_in(sides.plane.plane)
        assert said is not None
        # Some sheets lie on their sides in the photo.
        error = min(abs(math.log(sides.plane.aspect) - sign * math.log(aspect)) for sign in (1, -1))
        held.append(error < 2 * math.hypot(said.log_deviation, 0.004))
        if not odd and sides.belief is not None:
            formats.append(error)
            decided += sides.belief.prior is not None
    assert np.mean(held) >= 0.95
    assert 0.5 * len(formats) < decided < len(formats)
    assert np.median(formats) < 1e-3


def test_what_is_said_does_not_depend_on_how_the_page_is_turned_on_its_sheet() -> None:
    sides = sides_of(A4, 25.0, 0.0, 0.1)
    assert sides.plane is not None
    plane = sides.plane.plane
    turned = PagePlane(plane.rotation @ rotation_from_vector(np.array([0.0, 0.0, np.pi / 2])), plane.focal)
    first, second = sides.aspect_in(plane), sides.aspect_in(turned)
    assert first is not None
    assert second is not None
    assert second.log_deviation == pytest.approx(first.log_deviation, rel=1e-6)
    assert (first.likely, first.probability) == (second.likely, second.probability)


def test_a_stated_deviation_is_half_the_distance_that_holds_in_95_of_100_cases() -> None:
    values = np.linspace(-0.5, 0.5, 20001)
    bell = np.exp(-0.5 * (values / 0.05) ** 2)
    normal = AspectBelief("a4", 0.0, None, values, bell / bell.sum())
    assert normal.deviation_about(0.0) == pytest.approx(0.05, rel=0.03)
    # One likely value and a far one of 10 %: the root of the mean square would be 0.03.
    two = AspectBelief("a4", 0.9, None, np.array([0.0, 0.1]), np.array([0.9, 0.1]))
    assert two.deviation_about(0.0) == pytest.approx(0.05)
    sure = AspectBelief("a4", 0.97, None, np.array([0.0, 0.1]), np.array([0.97, 0.03]))
    assert sure.deviation_about(0.0) == 0.0
