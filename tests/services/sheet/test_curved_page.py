"""The shape of curved pages on simulated photos: errors are bounded, and it is the same however the photo lies."""

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest

from services.arrays import Floats, Points, Vector
from services.geometry.focal_prior import FocalPrior
from services.geometry.photo_frame import PhotoFrame
from services.rectify.analysis.focal_length import focal_prior
from services.rectify.analysis.page_analysis import analyse_photo
from services.sheet import curved_page
from services.sheet.curved_page import (
    START_BENDS,
    STRIPS,
    CurvedPage,
    describe_strips,
    estimate_curved_page,
    flow_deviation,
    implausibility,
    page_hull,
    recentre,
    start_surface,
    thin,
)
from services.sheet.developable.fitting import FittedSurface, fit_surface
from services.sheet.developable.observations import NO_LINES, PageObservations
from services.sheet.developable.residuals import BENDS, surface_of
from services.sheet.developable.surface import DevelopableSurface, bend_basis
from services.sheet.shape import EXIF_CONTRADICTED
from services.texture_flow.field import FlowSamples
from services.texture_flow.vanishing_points import estimate_vanishing_points
from simulation.pages import own_pages
from simulation.scenes import BOOK, POSES, photograph
from simulation.truth import Truth
from tests.services.scenes import Album, Shot, errors_deg
from tests.services.sheet.developable.sheets import (
    FLAT,
    PAGE,
    Bent,
    box,
    observe,
    residual_percent,
    seen_flow,
)

pytestmark = pytest.mark.pipeline

NAMES = ["book", "wave", "bent", "cone"]


class Estimates:
    """The curved pages of shots, each estimated once."""

    def __init__(self, album: Album) -> None:
        self.album = album
        self._found: dict[str, CurvedPage] = {}

    def __getitem__(self, name: str) -> CurvedPage:
        if name not in self._found:
            page = estimate(self.album[name])
            assert page is not None
            self._found[name] = page
        return self._found[name]


def estimate(
    shot: Shot,
    prior: FocalPrior | None = None,
    major: FlowSamples | None = None,
    minor: FlowSamples | None = None,
) -> CurvedPage | None:
    """The curved page of a shot, perhaps with other flows."""
    major, minor = major or shot.major, minor or shot.minor
    points = estimate_vanishing_points(major, minor)
    prior = prior or focal_prior(shot.frame, None, None)
    evidence = replace(shot.evidence, major=major, minor=minor, vanishing_points=points)
    page = estimate_curved_page(evidence, prior)
    return page if isinstance(page, CurvedPage) else None


def field_of_view_deg(focal: float) -> float:
    """Diagonal, of a focal length over half the diagonal."""
    return float(np.degrees(2 * np.arctan(1 / focal)))


@pytest.fixture(scope="module")
def found(album: Album) -> Estimates:
    return Estimates(album)


@pytest.mark.parametrize("name", NAMES)
def test_pages_are_flattened(album: Album, found: Estimates, name: str) -> None:
    shot, page = album[name], found[name]
    points = np.asarray(shot.text_points, np.float64)
    assert residual_percent(page.page_map, shot.truth, points) < 0.4
    true = shot.truth.focal_length_px / shot.frame.unit_px
    assert abs(field_of_view_deg(page.focal) - field_of_view_deg(true)) < 2.0
    assert page.focal_source == "estimated"
    assert page.focal == page.fitted.surface.focal
    # Its lines are as straight as those of flat pages: nothing is left for the small residual.
    assert page.page_map is page.fitted.surface
    normals = page.fitted.surface.normals((points - shot.frame.centre) / shot.frame.unit_px)
    cosine = (normals * shot.truth.normals(points)).sum(axis=1)
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean() < 1.5
    assert page.line_count == pytest.approx(len(shot.truth.visible_lines()), abs=5)
    assert page.deviation < np.radians(0.6)
    assert page.line_straightness < 0.04
    assert page.notices == ()


@pytest.mark.parametrize("name", NAMES)
def test_strips_lie_between_true_rulings(album: Album, found: Estimates, name: str) -> None:
    shot, strips = album[name], found[name].strips
    truth = shot.truth
    assert strips.normals.shape == (STRIPS, 3)
    assert strips.points.shape == (STRIPS + 1, 2)
    assert strips.vanishing_points.shape == (STRIPS + 1, 3)
    assert np.allclose(np.linalg.norm(strips.normals, axis=1), 1)
    assert (strips.normals[:, 2] > 0).all()
    assert ((strips.angles_rad >= 0) & (strips.angles_rad < np.pi)).all()
    on_page = truth.on_page(strips.points)
    assert on_page.mean() > 0.75
    points = strips.points[on_page]
    assert errors_deg(strips.angles_rad[on_page], truth.rulings(points)).mean() < 1.0
    # In space: by the ray to the vanishing point.
    x, y, w = strips.vanishing_points[on_page].T
    (cx, cy), f = truth.camera.principal_point, truth.focal_length_px
    rays = np.column_stack([x - cx * w, y - cy * w, f * w])
    cosine = np.einsum("ij,ij->i", rays, truth.rulings_3d(points)) / np.linalg.norm(rays, axis=1)
    assert np.degrees(np.arccos(np.clip(np.abs(cosine), 0, 1))).mean() < 2.0
    middles = 0.5 * (strips.points[1:] + strips.points[:-1])
    inside = truth.on_page(middles)
    cosine = np.einsum("ij,ij->i", strips.normals[inside], truth.normals(middles[inside]))
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean() < 2.0
    # From one end of the text to the other.
    extent = np.ptp(points @ (points[-1] - points[0])) / np.linalg.norm(points[-1] - points[0])
    across = shot.text_points @ (points[-1] - points[0]) / np.linalg.norm(points[-1] - points[0])
    assert extent > 0.7 * np.ptp(across)


Way = Callable[[Points, int, int], Points]


def turned(photo: Points, width: int, height: int) -> Points:
    """Clockwise by a quarter."""
    return np.stack([height - 1 - photo[:, 1], photo[:, 0]], axis=1)


def mirrored_and_reduced(photo: Points, width: int, height: int) -> Points:
    """Left to right, at 0.8 of the size."""
    return np.asarray((np.stack([width - 1 - photo[:, 0], photo[:, 1]], axis=1) + 0.5) * 0.8 - 0.5)


@pytest.mark.parametrize("name", ["turned", "mirrored and reduced"])
def test_the_same_page_however_the_photo_lies(album: Album, name: str) -> None:
    shot = album["book"]
    image = shot.photo.image
    height, width = image.shape[:2]
    way: Way
    other: Floats
    if name == "turned":
        other, way = np.rot90(image, -1), turned
    else:
        other = np.asarray(cv2.resize(image[:, ::-1], None, fx=0.8, fy=0.8, interpolation=cv2.INTER_AREA))
        way = mirrored_and_reduced
    photo = Photographed(other, shot.truth, lambda points: way(points, width, height))
    page = photo.estimate()
    assert page is not None
    assert photo.residual_percent(page, shot.text_points, mirrored=name != "turned") < 0.3
    true = shot.truth.focal_length_px / shot.frame.unit_px
    assert field_of_view_deg(page.focal) == pytest.approx(field_of_view_deg(true), abs=2.0)


class Photographed:
    """A photo made from a simulated one, `way` leading from the one's pixels to the other's."""

    def __init__(self, image: Floats, truth: Truth, way: Callable[[Points], Points]) -> None:
        self.truth, self.way = truth, way
        self.frame = PhotoFrame(image.shape[1], image.shape[0])
        self.analysis = analyse_photo(np.ascontiguousarray(image, np.uint8))

    def estimate(self) -> CurvedPage | None:
        """Its curved page."""
        page = estimate_curved_page(self.analysis.evidence(self.frame), focal_prior(self.frame, None, None))
        return page if isinstance(page, CurvedPage) else None

    def residual_percent(self, page: CurvedPage, points: Points, *, mirrored: bool = False) -> float:
        """RMS error at the simulated photo's `points`, percent of the page's width."""
        z = page.page_map.to_page((self.way(points) - self.frame.centre) / self.frame.unit_px) @ [1, 1j]
        w = self.truth.photo_to_page(np.asarray(points, np.float64)) @ [1, 1j]
        z = np.conj(z) if mirrored else z
        z, w = z - z.mean(), w - w.mean()
        left = w - np.vdot(z, w) / np.vdot(z, z) * z
        return float(100 * np.sqrt(np.mean(np.abs(left) ** 2)) / self.truth.page.width)


def test_a_page_that_is_rolled_along_its_height() -> None:
    """Its text lines are straight, and bent is what stands upright."""
    shot = photograph(own_pages(800, 800)[0], POSES[0], np.pi / 2, BOOK, size=(1050, 1350))
    photo = Photographed(
        np.rot90(shot.image),
        shot.truth,
        lambda points: np.stack([points[:, 1], 1049 - points[:, 0]], axis=1),
    )
    page = photo.estimate()
    assert page is not None
    points = shot.truth.text_points(np.random.default_rng(2))
    assert photo.residual_percent(page, points) < 0.5
    # The rulings run along the text.
    assert abs(np.sin(page.fitted.surface.skew_rad)) > 0.95


def test_a_known_focal_length_is_kept_and_a_wrong_exif_one_is_not(album: Album) -> None:
    shot = album["bent"]
    true = shot.truth.focal_length_px
    given = estimate(shot, focal_prior(shot.frame, 0.8 * true, None))
    assert given is not None
    assert given.focal * shot.frame.unit_px == pytest.approx(0.8 * true, rel=0.03)
    assert given.focal_source == "given"
    exif = estimate(shot, focal_prior(shot.frame, None, 0.8 * true))
    assert exif is not None
    assert exif.focal * shot.frame.unit_px == pytest.approx(true, rel=0.03)
    assert exif.focal_source == "estimated"
    assert exif.notices == (EXIF_CONTRADICTED,)
    assert given.notices == ()


def fuzzed(name: str, shot: Shot) -> tuple[FlowSamples, FlowSamples]:
    """Flows that no page shows."""
    rng = np.random.default_rng(len(name))
    major, minor = shot.major, shot.minor

    def replaced(flow: FlowSamples, angles: Vector) -> FlowSamples:
        return replace(flow, angles=angles)

    match name:
        case "random":
            return (
                replaced(major, rng.uniform(-1.6, 1.6, len(major))),
                replaced(minor, rng.uniform(0, 3.1, len(minor))),
            )
        case "exchanged":
            return replaced(major, major.angles + np.pi / 2), replaced(minor, minor.angles + np.pi / 2)
        case "wild waves":
            return replaced(major, major.angles + 0.6 * np.sin(20 * major.points[:, 0])), minor
        case _:
            return major.select(np.arange(len(major)) < 5), minor.select(np.arange(len(minor)) < 5)


@pytest.mark.parametrize("name", ["random", "exchanged", "wild waves", "few"])
def test_whatever_the_flows_are_the_answer_is_finite_or_none(album: Album, name: str) -> None:
    shot = album["bent"]
    page = estimate(shot, None, *fuzzed(name, shot))
    if page is None:
        return
    characters = (shot.analysis.characters - shot.frame.centre) / shot.frame.unit_px
    placed = np.isfinite(page.page_map.to_page(characters)).all(axis=1)
    assert placed.mean() > 0.96
    assert 0.3 < page.focal < 13
    for told in (
        page.strips.normals,
        page.strips.points,
        page.strips.angles_rad,
        page.strips.vanishing_points,
    ):
        assert np.isfinite(told).all()
    # And nobody is deceived: the flows say how little this page fits.
    if name != "few":
        assert page.deviation > np.radians(1.0)


def test_strips_of_a_cone_in_closed_form() -> None:
    bent = Bent(slopes=(0.4, 0.0), skew=0.0, bends=(0.6,) * 8, anchor=(0.0, 0.0))
    surface, view = bent.surface(), PhotoFrame(840, 1080)
    strips = describe_strips(surface, view, surface.to_photo(PAGE), 12)
    # All rulings meet in one point of space, which is seen where their images meet.
    P, R = surface.line_at(np.array([0.1]))
    apex = (P - R / 0.4)[0]
    seen = surface.focal * apex[:2] / apex[2] * view.unit_px + np.array(view.centre)
    way = np.stack([np.cos(strips.angles_rad), np.sin(strips.angles_rad)], axis=1)
    to_apex = seen - strips.points
    off = np.abs(way[:, 0] * to_apex[:, 1] - way[:, 1] * to_apex[:, 0]) / np.linalg.norm(to_apex, axis=1)
    assert off.max() < 2e-3
    # A ruling's image runs through its own vanishing point.
    end = strips.vanishing_points
    line = np.column_stack([strips.points, np.ones(13)])
    ahead = np.column_stack([strips.points + way, np.ones(13)])
    det = np.linalg.det(np.stack([line, ahead, end / np.linalg.norm(end, axis=1, keepdims=True)], axis=1))
    assert np.abs(det).max() < 1e-6 * np.abs(strips.points).max()
    # The outermost percent of the characters lies beyond the strips.
    s = surface.to_sheet(PAGE)[:, 0]
    ends = surface.unroll((strips.points[[0, -1]] - view.centre) / view.unit_px).sheet[:, 0]
    assert np.allclose(ends, np.percentile(s, [0.5, 99.5]), atol=1e-6)
    assert np.allclose(
        strips.normals, surface.normals_at(np.linspace(float(ends[0]), float(ends[1]), 25)[1::2]), atol=1e-6
    )


def test_plausible_sheets_face_the_camera_under_all_text(monkeypatch: pytest.MonkeyPatch) -> None:
    bent = Bent()
    characters = bent.surface().to_photo(box(0.4, 0.5, 20, 20))
    assert implausibility(bent.surface(), characters) is None
    steep = replace(FLAT, turn=(0.0, 1.45, 0.0), skew=0.0, anchor=(0.0, 0.0))
    grid = box(0.2, 0.3, 20, 20)
    assert "hidden" in (implausibility(steep.surface(), grid) or "")
    # A plane at 50 degrees, whose magnification alone is doubtful.
    leaning = replace(FLAT, turn=(0.0, 0.87, 0.0), anchor=(0.0, 0.0), focal=1.0)
    assert implausibility(leaning.surface(), grid) is None
    with monkeypatch.context() as bound:
        bound.setattr(curved_page, "MAX_MAGNIFICATION_RATIO", 1.5)
        assert "enlarged 2 times" in (implausibility(leaning.surface(), grid) or "")
    with monkeypatch.context() as bound:
        bound.setattr(curved_page, "MAX_TILT_RAD", np.radians(45.0))
        assert "edge-on" in (implausibility(leaning.surface(), grid) or "")
    # Rulings that cross in the text.
    crossed = replace(FLAT, slopes=(3.0, 0.0), skew=0.0)
    assert "folded over" in (implausibility(crossed.surface(), characters) or "")
    # A few characters beyond are forgiven.
    stray = np.concatenate([characters, crossed.surface().to_photo(np.array([[0.0, -0.9]]))])
    assert implausibility(bent.surface(), np.nan_to_num(stray)) is None


def test_starts_lie_in_the_flows_pose() -> None:
    plane = replace(FLAT, anchor=(0.0, 0.0), skew=0.0).surface()
    major, minor = (seen_flow(plane, PAGE, lean, 1e-5) for lean in (0.0, np.pi / 2))
    prior = FocalPrior(float(np.log(FLAT.focal)), 0.25, "assumed")
    points = estimate_vanishing_points(major, minor)
    characters = plane.to_photo(box(0.4, 0.5, 31, 31))
    for skew in (0.0, 0.4, np.pi / 2):
        start = start_surface(points, prior, characters, skew)
        x = np.concatenate([np.zeros(3), start.parameters])
        surface = surface_of(x, start.rotation, start.anchor, start.basis)
        assert surface.skew_rad == skew
        assert not surface.bends.any()
        assert np.allclose(surface.normals(characters[:5]), plane.N[0], atol=0.01)
        # The bends span the text, and a quarter of it on either side.
        across = surface.to_sheet(surface.to_page(characters))[:, 0]
        low, high = np.percentile(across, [0.5, 99.5])
        assert start.basis.low == pytest.approx(low - 0.25 * (high - low), abs=0.02)
        assert start.basis.high == pytest.approx(high + 0.25 * (high - low), abs=0.02)


def test_a_recentred_start_is_the_same_sheet() -> None:
    bent = Bent(bends=(0.4, 0.5, 0.6, 0.7, 0.7, 0.6, 0.5, 0.4))
    wide = bend_basis(-2.0, 2.0, 8, 0.3)
    fitted: FittedSurface = fit_surface(bent.start(basis=wide), observe(bent.surface(wide)))
    characters = fitted.surface.to_photo(PAGE)
    start = recentre(fitted, characters)
    x = np.concatenate([np.zeros(3), start.parameters])
    again = surface_of(x, start.rotation, start.anchor, start.basis)
    assert len(again.bends) == START_BENDS == len(start.parameters) - (BENDS - 3)
    assert start.basis.high - start.basis.low < 2.5
    assert np.abs(again.to_page(characters) - PAGE).max() < 2e-3


def test_thinning_keeps_the_spread_and_the_weight() -> None:
    flow = FlowSamples(np.arange(2000.0).reshape(1000, 2), np.arange(1000.0), np.full(1000, 0.5))
    thinned = thin(flow, 200)
    assert len(thinned) == 200
    assert thinned.angles[[0, -1]].tolist() == [0.0, 999.0]
    assert np.ptp(np.diff(thinned.angles)) <= 1
    assert thinned.weights.sum() == pytest.approx(500.0)
    assert thin(flow, 1000) is flow
    assert thin(flow, 50).weights.max() == 4.0  # a sample does not count for any number


def test_the_hull_surrounds_the_text_and_little_more() -> None:
    points = np.random.default_rng(3).uniform(-0.5, 0.5, (200, 2)) + np.array([0.3, 0.0])
    hull = page_hull(points)
    assert 4 < len(hull) < 40
    size = np.ptp(points, axis=0)
    for beyond in (points.min(axis=0) - hull.min(axis=0), hull.max(axis=0) - points.max(axis=0)):
        assert (beyond > 0.02 * size).all()
        assert (beyond < 0.08 * size).all()


@pytest.mark.parametrize("lean", [0.0, 0.02, -0.05])
def test_the_flows_deviation_is_what_is_left_on_the_flat_page(lean: float) -> None:
    surface: DevelopableSurface = Bent().surface()
    major = seen_flow(surface, PAGE, lean, 1e-5)
    minor = seen_flow(surface, PAGE, np.pi / 2 + 2 * lean, 1e-5)
    found = flow_deviation(surface, major, minor, 0.3)
    assert found == pytest.approx(abs(lean) * (1 + 0.3 * 2), abs=1e-3)
    observed = PageObservations(major, minor, NO_LINES, PAGE, 0.0, 0.2)
    assert len(observed.hull) == len(PAGE)
