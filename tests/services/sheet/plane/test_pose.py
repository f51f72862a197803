"""The pose that is chosen for simulated photos, and when a pose is not believed."""

from dataclasses import replace

import numpy as np
import pytest

from services.arrays import Points
from services.geometry.focal_prior import FocalPrior
from services.geometry.homographies import denominators, transform_points
from services.geometry.planar import PagePlane
from services.rectify.analysis.focal_length import focal_prior
from services.sheet.plane import pose as pose_module
from services.sheet.plane.flat_text import flatten_text
from services.sheet.plane.outline_plane import SheetSides, read_sides
from services.sheet.plane.planar_page import PlanarPage
from services.sheet.plane.pose import (
    choose_pose,
    flow_deviation,
    is_plausible,
    level_plane,
    most_common_direction,
)
from services.texture_flow.field import FlowSamples
from services.texture_flow.vanishing_points import estimate_vanishing_points
from simulation.scenes import POSES, View
from tests.services.scenes import CURVED_SCENES, FLAT_SCENES, Album, Shot
from tests.services.sheet.plane.observations import photograph_plane
from tests.services.sheet.sheet_sides import outline_of_truth


def pose_of(shot: Shot, prior: FocalPrior | None = None) -> PlanarPage:
    """The pose that the pipeline would choose."""
    return choose_pose(shot.evidence, prior or focal_prior(shot.frame, None, None))


def pose_with(shot: Shot, sides: SheetSides | None, prior: FocalPrior | None = None) -> PlanarPage:
    """The pose that the pipeline would choose with the sheet's sides in view."""
    prior = prior or focal_prior(shot.frame, None, None)
    return choose_pose(shot.evidence, prior, sheet=sides)


def sides_of(shot: Shot) -> SheetSides:
    """The simulated sheet's sides, known to half a pixel."""
    outline = outline_of_truth(shot.truth, 0.5, np.random.default_rng(0))
    sides = read_sides(outline, shot.frame, focal_prior(shot.frame, None, None))
    assert sides is not None
    return sides


def page_grid(shot: Shot) -> Points:
    """Points (63, 2) over the page's print, page pixels."""
    x, y = np.meshgrid(np.linspace(0.1, 0.9, 7), np.linspace(0.08, 0.92, 9))
    return np.stack([x.ravel() * shot.truth.page.width, y.ravel() * shot.truth.page.height], axis=1)


def residual_percent(shot: Shot, pose: PlanarPage) -> float:
    """RMS distance of the flattened page from the true one after the best similarity, of the page's width."""
    page = page_grid(shot)
    flat = pose.page_map.to_page(shot.frame.to_centred(shot.truth.page_to_photo(page)))
    p, q = ((z - z.mean(axis=0)) @ [1, 1j] for z in (page, flat))
    scale = (p.conj() @ q) / (p.conj() @ p)
    return float(100 * np.sqrt(np.mean(np.abs(q / scale - p) ** 2)) / shot.truth.page.width)


@pytest.mark.parametrize("name", FLAT_SCENES)
def test_flat_pages_are_flattened(album: Album, name: str) -> None:
    shot = album[name]
    pose = pose_of(shot)
    assert pose.focal_source == "estimated"
    assert pose.notices == ()
    off = np.degrees(np.arccos(np.clip(pose.plane.rotation[:, 2] @ shot.truth.pose.rotation()[:, 2], -1, 1)))
    assert off < 1.5
    assert abs(np.log(pose.focal * shot.frame.unit_px / shot.truth.focal_length_px)) < 0.06
    assert residual_percent(shot, pose) < 0.4
    assert abs(pose.line_count - len(shot.truth.visible_lines())) < 0.2 * len(shot.truth.visible_lines())


@pytest.mark.parametrize("name", FLAT_SCENES)
def test_lines_of_the_flat_view_are_level(album: Album, name: str) -> None:
    shot = album[name]
    pose = pose_of(shot)
    long = [line for line in shot.truth.visible_lines() if len(line) > 4]
    tops = np.array([((line[0].box[0], line[0].box[1]), (line[-1].box[2], line[0].box[1])) for line in long])
    photo = shot.truth.page_to_photo(tops.reshape(-1, 2))
    flat = pose.page_map.to_page(shot.frame.to_centred(photo)).reshape(-1, 2, 2)
    way = flat[:, 1] - flat[:, 0]
    slopes = np.degrees(np.arctan2(way[:, 1], way[:, 0]))
    assert np.abs(slopes).max() < 0.1
    assert abs(slopes.mean()) < 0.04


@pytest.mark.parametrize("name", ["plain", "ragged"])
def test_a_given_focal_length_is_told_back(album: Album, name: str) -> None:
    shot = album[name]
    pose = pose_of(shot, focal_prior(shot.frame, shot.truth.focal_length_px, None))
    assert pose.focal_source == "given"
    assert pose.focal * shot.frame.unit_px == pytest.approx(shot.truth.focal_length_px, rel=0.005)
    assert residual_percent(shot, pose) < 0.3


def test_a_frontal_page_is_only_turned(album: Album) -> None:
    pose = pose_of(album["frontal"])
    assert [notice.code for notice in pose.notices] == ["already-flat"]
    assert pose.plane.rotation[:, 2].tolist() == [0.0, 0.0, 1.0]
    assert pose.focal_source == "assumed"
    assert residual_percent(album["frontal"], pose) < 0.05


def test_two_sides_that_agree_with_the_text_support_its_plane(album: Album) -> None:
    # A receipt whose ends leave the photo: its long sides show no plane alone.
    shot = album["frontal"]
    prior = focal_prior(shot.frame, None, None)
    outline = outline_of_truth(shot.truth, 0.5, np.random.default_rng(0))
    top, right, bottom, left = outline.sides
    unseen = [replace(side, points=side.points[:0], deviations=side.deviations[:0]) for side in (top, bottom)]
    sides = read_sides(replace(outline, sides=(unseen[0], right, unseen[1], left)), shot.frame, prior)
    assert sides is not None
    assert sides.plane is None
    pose = pose_with(shot, sides)
    assert pose.sources == ("text", "outline")
    assert "already-flat" not in [notice.code for notice in pose.notices]
    assert residual_percent(shot, pose) < 0.1


@pytest.mark.parametrize("name", CURVED_SCENES)
def test_a_curved_page_gets_a_planar_view_that_is_no_worse(album: Album, name: str) -> None:
    shot = album[name]
    chosen = pose_of(shot).plane.H_centred_plane
    level = level_plane(shot.major, focal_prior(shot.frame, None, None)).H_centred_plane
    assert deviation_by_differences(chosen, shot) <= deviation_by_differences(level, shot) + 1e-3


def deviation_by_differences(H_centred_plane: np.ndarray, shot: Shot) -> float:
    """Mean angle (rad) between both flows and the axes of a flat view, by finite differences."""
    H = np.linalg.inv(H_centred_plane)
    total = 0.0
    for samples, axis, share in ((shot.major, 0.0, 1.0), (shot.minor, np.pi / 2, 0.3)):
        step = 1e-6 * np.stack([np.cos(samples.angles), np.sin(samples.angles)], axis=1)
        way = transform_points(H, samples.points + step) - transform_points(H, samples.points - step)
        off = np.abs((np.arctan2(way[:, 1], way[:, 0]) - axis + np.pi / 2) % np.pi - np.pi / 2)
        total += share * float(np.sort(off)[: int(0.9 * len(off))].mean())
    return total


def directions(parts: list[tuple[float, int]]) -> FlowSamples:
    """Samples about each direction (degrees), that many each, with a deviation of 0.6 degrees."""
    rng = np.random.default_rng(0)
    angles = np.concatenate([np.radians(angle) + rng.normal(0, np.radians(0.6), n) for angle, n in parts])
    angles += np.pi * rng.integers(0, 2, len(angles))
    return FlowSamples(np.zeros((len(angles), 2)), angles, np.ones(len(angles)))


@pytest.mark.parametrize("angle_deg", [-89.9, -40.0, 0.0, 10.0, 85.0])
def test_level_plane_turns_by_the_direction_of_the_lines(angle_deg: float) -> None:
    plane = level_plane(directions([(angle_deg, 400)]), FocalPrior(0.3, 0.1, "assumed"))
    turn = np.degrees(np.arctan2(plane.rotation[1, 0], plane.rotation[0, 0]))
    assert abs((turn - angle_deg + 90) % 180 - 90) < 0.15
    assert np.allclose(plane.rotation.T @ plane.rotation, np.eye(3))
    assert plane.rotation[:, 2].tolist() == [0.0, 0.0, 1.0]
    assert plane.focal == pytest.approx(np.exp(0.3))


def test_a_facing_page_does_not_draw_the_common_direction() -> None:
    found = most_common_direction(directions([(3.0, 300), (14.0, 200), (60.0, 30)]))
    assert np.degrees(found) == pytest.approx(3.0, abs=0.15)
    # Weights are heeded: the other page is the page.
    samples = directions([(3.0, 300), (14.0, 200)])
    heavy = replace(samples, weights=np.where(np.arange(500) < 300, 0.2, 1.0))
    assert np.degrees(most_common_direction(heavy)) == pytest.approx(14.0, abs=0.15)


def test_flow_deviation_is_that_of_finite_differences(album: Album) -> None:
    shot = album["ragged"]
    for plane in (level_plane(shot.major, focal_prior(shot.frame, None, None)), PagePlane(np.eye(3), 1.3)):
        slow = deviation_by_differences(plane.H_centred_plane, shot)
        assert flow_deviation(plane, shot.major, shot.minor, 0.3) == pytest.approx(slow, rel=1e-4)


def test_flow_deviation_is_nothing_in_the_true_plane_and_grows_with_the_error() -> None:
    plane = photograph_plane(POSES[3])
    rng = np.random.default_rng(0)
    major, minor = plane.flow(0.0, 0.0, rng), plane.flow(np.pi / 2, 0.0, rng)
    true = PagePlane(plane.rotation, plane.focal)
    assert flow_deviation(true, major, minor, 0.3) < 1e-6
    errors = [
        flow_deviation(plane.wrong(np.array([0.0, turn, 0.0]), 1.0), major, minor, 0.3)
        for turn in (1, 2, 4, 8)
    ]
    assert (np.diff(errors) > 0).all()
    # Turned in its own plane by a degree, every direction is off by a degree.
    turned = plane.wrong(np.array([0.0, 0.0, 1.0]), 1.0)
    assert np.degrees(flow_deviation(turned, major, minor, 0.3)) == pytest.approx(1.3, abs=1e-6)


TEXT = np.stack(np.meshgrid(np.linspace(-0.4, 0.4, 9), np.linspace(-0.6, 0.6, 9)), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize(
    ("tilt_deg", "focal", "believed"),
    [
        (0.0, 1.3, True),
        (40.0, 1.3, True),
        (60.0, 3.0, True),
        (70.0, 8.0, False),  # too oblique, though a long lens sees it without much perspective
        (50.0, 0.9, False),  # its near side 25 times as large as the far one
        (64.0, 0.4, False),  # its horizon runs through the text
    ],
)
def test_poses_that_can_be_and_that_cannot(tilt_deg: float, focal: float, believed: bool) -> None:
    plane = photograph_plane(View("any", 2300.0, tilt_deg, 90.0, 0.0))
    assert is_plausible(PagePlane(plane.rotation, focal), TEXT) == believed


def test_text_on_both_sides_of_the_horizon_is_not_believed() -> None:
    # Each side alone is a small, believable piece of a page; the two are alike, and equally enlarged.
    plane = PagePlane(photograph_plane(View("foot", 2300.0, 45.0, 90.0, 0.0)).rotation, 0.5)
    w = denominators(np.linalg.inv(plane.H_centred_plane), np.array([[0.0, 0.0], [0.0, 1.0]]))
    horizon = w[0] / (w[0] - w[1])
    block = np.stack(np.meshgrid(np.linspace(-0.1, 0.1, 5), np.linspace(0.3, 0.35, 5)), axis=-1).reshape(
        -1, 2
    )
    below, above = block + np.array([0.0, horizon]), block * [1, -1] + np.array([0.0, horizon])
    assert is_plausible(plane, below)
    assert is_plausible(plane, above)
    assert not is_plausible(plane, np.concatenate([below, above]))


def test_a_pose_that_is_no_number_is_not_believed() -> None:
    assert not is_plausible(PagePlane(np.full((3, 3), np.nan), 1.3), TEXT)


def test_flattened_text_shows_level_lines(album: Album) -> None:
    shot = album["ragged"]
    plane = PagePlane(true_rotation(shot), shot.truth.focal_length_px / shot.frame.unit_px)
    found = flatten_text(shot.evidence.text, shot.frame, plane)
    ink, lines = found.ink, found.baselines
    way = lines.ends - lines.starts
    slopes = np.degrees(np.arctan2(way[:, 1], way[:, 0]))
    assert abs(len(lines) - len(shot.truth.visible_lines())) <= 3
    assert abs(np.average(slopes, weights=way[:, 0])) < 0.06
    # The map tells where each pixel comes from: characters lie where the photo has them.
    centred = (shot.analysis.characters - shot.frame.centre) / shot.frame.unit_px
    flat = transform_points(np.linalg.inv(found.H_centred_flat), centred)
    at = np.round(flat).astype(int)
    height, width = ink.shape
    assert (flat > 0).all()
    assert (flat < [width - 1, height - 1]).all()
    near = [ink[y - 3 : y + 4, x - 3 : x + 4].any() for x, y in at]
    assert np.mean(near) > 0.99


def true_rotation(shot: Shot) -> np.ndarray:
    """Columns: lines, strokes and normal in the camera frame."""
    centre = shot.truth.sheet_to_photo(np.zeros((1, 2)))
    axes = (shot.truth.major_flow_3d, shot.truth.minor_flow_3d, shot.truth.normals)
    return np.stack([axis(centre)[0] for axis in axes], axis=1)


def test_flows_of_no_plane_leave_the_photo_as_it_is_but_for_a_turn(album: Album) -> None:
    # Lines that all run to the middle of the text, as on a clock's face.
    shot = album["plain"]
    middle = shot.major.points.mean(axis=0)

    def radial(samples: FlowSamples, turn: float) -> FlowSamples:
        way = samples.points - middle
        return replace(samples, angles=np.arctan2(way[:, 1], way[:, 0]) + turn)

    major, minor = radial(shot.major, 0.0), radial(shot.minor, np.pi / 2)
    points = estimate_vanishing_points(major, minor)
    prior = focal_prior(shot.frame, None, None)
    pose = choose_pose(replace(shot.evidence, major=major, minor=minor, vanishing_points=points), prior)
    assert len(pose.notices) == 1
    assert pose.notices[0].code in ("implausible-pose", "already-flat")
    assert pose.surface(shot.frame).normal == (0.0, 0.0, 1.0)
    assert np.isfinite(pose.plane.H_centred_plane).all()


def test_an_unseen_focal_length_is_called_uncertain(album: Album, monkeypatch: pytest.MonkeyPatch) -> None:
    shot = album["plain"]
    prior = focal_prior(shot.frame, None, None)
    monkeypatch.setattr(pose_module, "ASPECT_DEVIATION", 0.0)
    pose = choose_pose(shot.evidence, prior)
    assert [notice.code for notice in pose.notices] == ["aspect-ratio-uncertain"]
    assert "focal_length_px" in pose.notices[0].detail


@pytest.mark.parametrize("name", ["plain", "skewed"])
def test_the_sheets_sides_make_the_pose_better(name: str, album: Album) -> None:
    shot = album[name]
    alone, both = pose_of(shot), pose_with(shot, sides_of(shot))
    assert both.sources == ("text", "outline")
    assert both.sides_believed
    # The sheet's frame does not turn with its print.
    assert abs(both.skew_rad + shot.truth.skew_rad) < np.radians(0.2)
    assert [notice.code for notice in both.notices] == ["outline-disagrees"] * (name == "skewed")
    assert residual_percent(shot, both) < max(0.03, residual_percent(shot, alone))


def test_an_outline_that_contradicts_a_page_of_text_is_not_believed(album: Album) -> None:
    shot = album["plain"]
    # A rectangle, but of a sheet that lies otherwise.
    outline = outline_of_truth(photograph_plane(POSES[1]).truth, 0.5, np.random.default_rng(0))
    prior = focal_prior(shot.frame, None, None)
    sides = read_sides(outline, shot.frame, prior)
    assert sides is not None
    assert sides.plane is not None
    pose = pose_with(shot, sides)
    assert pose.sources == ("text",)
    assert not pose.sides_believed
    assert "outline-disagrees" in [notice.code for notice in pose.notices]
    assert residual_percent(shot, pose) < 2 * residual_percent(shot, pose_of(shot)) + 0.05
