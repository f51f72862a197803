"""A rectangle's sides give its plane: exactly without noise, within the stated deviations with it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from services.arrays import Points
from services.geometry.focal_prior import FocalPrior, typical_focal_prior
from services.geometry.homographies import transform_points
from services.geometry.photo_frame import PhotoFrame
from services.sheet.outline.results import SheetOutline
from services.sheet.plane import outline_plane
from services.sheet.plane.outline_plane import (
    OutlinePlane,
    plane_from_lines,
    read_sides,
    side_lines,
)
from tests.services.sheet.sheet_sides import ALL, FRAME, leaning, outline_of, seen_rectangle

TYPICAL = typical_focal_prior()


def plane_of(outline: SheetOutline, prior: FocalPrior = TYPICAL, *, exact: bool = False) -> OutlinePlane:
    """`exact`: sides that are known without any error; else the sheet's own squareness is allowed for."""
    with pytest.MonkeyPatch.context() as patch:
        if exact:
            patch.setattr(outline_plane, "CUT_RAD", 1e-12)
        sides = read_sides(outline, FRAME, prior)
    assert sides is not None
    assert isinstance(sides.plane, OutlinePlane), sides.plane
    return sides.plane


def zhang_he(corners: Points) -> tuple[float, float]:
    """Focal length (half diagonals) and aspect of a quadrilateral by the closed form of Zhang & He 2007."""
    m = np.hstack([(corners - FRAME.centre) / FRAME.unit_px, np.ones((4, 1))])[[0, 1, 3, 2]]
    k2 = np.cross(m[0], m[3]) @ m[2] / (np.cross(m[1], m[3]) @ m[2])
    k3 = np.cross(m[0], m[3]) @ m[1] / (np.cross(m[2], m[3]) @ m[1])
    n2, n3 = k2 * m[1] - m[0], k3 * m[2] - m[0]
    square = -(n2[0] * n3[0] + n2[1] * n3[1]) / (n2[2] * n3[2])
    metric = np.diag([1 / square, 1 / square, 1.0])
    return float(np.sqrt(square)), float(np.sqrt((n2 @ metric @ n2) / (n3 @ metric @ n3)))


cameras = st.tuples(
    st.floats(12, 50), st.floats(20, 70), st.integers(0, 3), st.floats(-20, 20), st.floats(-0.5, 0.5)
)


@settings(deadline=None, max_examples=20)
@given(camera=cameras, log_aspect=st.floats(-0.5, 0.5), x=st.floats(-0.1, 0.1))
def test_exact_sides_give_pose_focal_length_and_aspect(
    camera: tuple[float, float, int, float, float], log_aspect: float, x: float
) -> None:
    tilt, azimuth, quarter, roll, log_focal = camera
    rotation = leaning(tilt, azimuth + 90 * quarter, roll)
    focal, aspect = float(np.exp(TYPICAL.log_focal + log_focal)), float(np.exp(log_aspect))
    corners = seen_rectangle(aspect, rotation, focal, (x, -x))
    assume(int(np.argmin(corners.sum(axis=1))) == 0)  # else another side is on top
    outline = outline_of(corners, 0.0, np.random.default_rng(0))
    found = plane_of(outline, exact=True)
    assert np.allclose(found.plane.rotation, rotation, atol=1e-6)
    assert found.plane.focal == pytest.approx(focal, rel=1e-6)
    assert found.aspect == pytest.approx(aspect, rel=1e-6)
    assert zhang_he(corners) == pytest.approx((found.plane.focal, found.aspect), rel=1e-6)


def test_noise_leaves_errors_that_the_stated_deviations_cover_and_no_more() -> None:
    rng = np.random.default_rng(1)
    aspects, focals = [], []
    for _ in range(24):
        rotation = leaning(rng.uniform(10, 45), rng.uniform(0, 360), rng.uniform(-15, 15))
        aspect, focal = (
            float(np.exp(rng.uniform(-0.4, 0.4))),
            float(np.exp(rng.normal(TYPICAL.log_focal, 0.2))),
        )
        corners = seen_rectangle(aspect, rotation, focal)
        if np.argmin(corners.sum(axis=1)) != 0:
            continue
        found = plane_from_lines(side_lines(outline_of(corners, 0.5, rng), FRAME), TYPICAL)
        assert isinstance(found, OutlinePlane)
        assert found.aspect is not None
        aspects.append(np.log(found.aspect / aspect) / found.log_aspect_deviation)
        focals.append(np.log(found.plane.focal / focal))
    assert len(aspects) > 12
    # The deviations allow for paper that is not quite square, which these sheets are.
    assert 0.1 < np.sqrt(np.mean(np.square(aspects))) < 1.0
    assert np.abs(aspects).max() < 2.5
    assert np.median(np.abs(focals)) < 0.1


def test_a_frontal_sheet_does_not_show_the_focal_length_but_its_shape() -> None:
    outline = outline_of(seen_rectangle(0.7, np.eye(3), 1.3), 0.3, np.random.default_rng(0))
    found = plane_of(outline)
    assert found.plane.focal == pytest.approx(np.exp(TYPICAL.log_focal), rel=0.01)
    assert found.log_focal_deviation > 3
    assert found.aspect == pytest.approx(0.7, rel=2e-3)
    assert found.log_aspect_deviation < 3e-3


@pytest.mark.parametrize("azimuth_deg", [0.0, 90.0])
def test_in_one_point_perspective_the_prior_decides_and_the_aspect_is_called_uncertain(
    azimuth_deg: float,
) -> None:
    corners = seen_rectangle(0.7, leaning(30.0, azimuth_deg, 0.0), 1.6)
    sides = read_sides(outline_of(corners, 0.3, np.random.default_rng(0)), FRAME, TYPICAL)
    assert sides is not None
    assumed = plane_from_lines(sides.lines, TYPICAL)
    assert isinstance(assumed, OutlinePlane)
    assert assumed.log_aspect_deviation > 0.03
    assert assumed.aspect is not None
    assert abs(np.log(assumed.aspect / 0.7)) < 2.5 * assumed.log_aspect_deviation
    known = plane_of(
        outline_of(corners, 0.3, np.random.default_rng(0)), FocalPrior(float(np.log(1.6)), 0.003, "given")
    )
    assert known.aspect == pytest.approx(0.7, rel=3e-3)
    assert known.log_aspect_deviation < 4e-3


@pytest.mark.parametrize("missing", ALL)
def test_three_sides_and_a_known_focal_length_suffice(missing: int) -> None:
    rotation = leaning(30.0, 40.0, 5.0)
    corners = seen_rectangle(0.7, rotation, 1.4)
    sides = tuple(k for k in ALL if k != missing)
    outline = outline_of(corners, 0.0, np.random.default_rng(0), sides)
    found = plane_of(outline, FocalPrior(float(np.log(1.4)), 0.003, "given"), exact=True)
    assert np.allclose(found.plane.rotation, rotation, atol=1e-6)
    assert found.aspect is None
    assert found.log_aspect_deviation < 0.01


def test_two_sides_are_no_plane_but_lines() -> None:
    outline = outline_of(seen_rectangle(0.7, np.eye(3), 1.3), 0.3, np.random.default_rng(0), (0, 1))
    sides = read_sides(outline, FRAME, TYPICAL)
    assert sides is not None
    assert sides.plane is None
    assert len(sides.lines) == 2
    assert not sides.straight


def test_an_outline_of_low_confidence_and_none_are_not_used() -> None:
    outline = outline_of(seen_rectangle(0.7, np.eye(3), 1.3), 0.3, np.random.default_rng(0))
    assert read_sides(None, FRAME, TYPICAL) is None
    assert read_sides(replace(outline, confidence=0.6), FRAME, TYPICAL) is not None


def test_a_side_that_is_partly_covered_keeps_its_line() -> None:
    corners = seen_rectangle(0.7, leaning(25.0, 40.0, 5.0), 1.3)
    clean = outline_of(corners, 0.3, np.random.default_rng(0))
    points = clean.sides[2].points.copy()
    points[10:20] -= [0.0, 25.0]  # a thumb
    sides = (*clean.sides[:2], replace(clean.sides[2], points=points), clean.sides[3])
    covered = plane_of(replace(clean, sides=sides))
    assert covered.aspect == pytest.approx(plane_of(clean).aspect, rel=0.004)


def test_a_bent_side_is_less_certain_and_a_very_bent_one_is_left_out() -> None:
    corners = seen_rectangle(0.7, leaning(25.0, 40.0, 5.0), 1.3)
    clean = outline_of(corners, 0.3, np.random.default_rng(0))

    def bent(sagitta_px: float) -> SheetOutline:
        place = np.linspace(-1, 1, len(clean.sides[0].points))
        points = clean.sides[0].points + np.outer(1 - place**2, [0.0, sagitta_px])
        side = replace(clean.sides[0], points=points, straightness_px=0.3 * sagitta_px)
        return replace(clean, sides=(side, *clean.sides[1:]))

    straight, slight, much = (side_lines(outline, FRAME) for outline in (clean, bent(15.0), bent(80.0)))
    assert slight.deviations[0] > 5 * straight.deviations[0]
    assert len(much) == 3
    assert read_sides(bent(15.0), FRAME, TYPICAL) is not None
    assert plane_of(bent(15.0)).log_aspect_deviation > plane_of(clean).log_aspect_deviation


def test_a_quadrilateral_that_is_no_rectangle_is_refused() -> None:
    kite = np.array([[400.0, 400.0], [1100.0, 700.0], [1150.0, 1000.0], [450.0, 1700.0]])
    sides = read_sides(
        outline_of(kite, 0.3, np.random.default_rng(0)), FRAME, FocalPrior(0.25, 0.003, "given")
    )
    assert sides is not None
    assert sides.plane is None


@pytest.mark.parametrize("cut_px", [375.0, -375.0])
def test_a_cropped_photo_shows_its_principal_point(cut_px: float) -> None:
    # The whole photo's middle lies half of what was cut off the middle of what was left.
    off = np.array([cut_px / 2, 0.0])
    corners, known = (
        seen_rectangle(0.7, leaning(33.0, 35.0, 4.0), 1.3),
        FocalPrior(float(np.log(1.3)), 0.03, "exif"),
    )
    cropped = read_sides(outline_of(corners + off, 0.3, np.random.default_rng(0)), FRAME, known)
    whole = read_sides(outline_of(corners, 0.3, np.random.default_rng(0)), FRAME, known)
    assert cropped is not None
    assert whole is not None
    assert isinstance(cropped.plane, OutlinePlane)
    assert whole.view.principal_point_px is None
    assert cropped.view.principal_point_px is not None
    found = np.array(cropped.view.principal_point_px) - FRAME.centre
    # Two coordinates cannot be had from one equation: the nearest principal point is found.
    assert 0.2 < found @ off / (off @ off) < 1.5
    assert cropped.plane.aspect == pytest.approx(0.7, rel=0.05)


@settings(deadline=None, max_examples=5)
@given(noise=st.floats(0.0, 1.0))
def test_the_photo_may_be_resized(noise: float) -> None:
    corners = seen_rectangle(0.7, leaning(25.0, 40.0, 5.0), 1.3)
    outline = outline_of(corners, noise, np.random.default_rng(0))
    large = PhotoFrame(round(FRAME.width * 2), round(FRAME.height * 2))
    H = large.H_photo_centred @ np.linalg.inv(FRAME.H_photo_centred)
    resized = replace(
        outline,
        sides=tuple(
            replace(
                side,
                points=transform_points(H, side.points),
                deviations=2 * side.deviations,
                straightness_px=2 * side.straightness_px,
            )
            for side in outline.sides
        ),
    )
    sides = read_sides(resized, large, TYPICAL)
    assert sides is not None
    assert isinstance(sides.plane, OutlinePlane)
    same = plane_of(outline)
    assert np.allclose(sides.plane.plane.rotation, same.plane.rotation, atol=2e-3)
    assert sides.plane.log_aspect_deviation == pytest.approx(same.log_aspect_deviation, rel=0.02)
