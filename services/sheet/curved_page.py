"""The shape of a curved page: the global developable surface, from its start to the last decimals."""

from dataclasses import dataclass, replace

import numpy as np

from services.arrays import Points, Vector
from services.geometry.focal_prior import (
    MAX_FOCAL,
    MIN_FOCAL,
    FocalLengthSource,
    FocalPrior,
    typical_focal_prior,
)
from services.geometry.page_map import PageMap
from services.geometry.photo_frame import PhotoFrame
from services.geometry.planar import estimate_plane
from services.geometry.vanishing_points import FlowVanishingPoints
from services.sheet.developable.fitting import FittedSurface, SurfaceStart, fit_surface, rescale_deviations
from services.sheet.developable.observations import NO_LINES, LineObservations, PageObservations
from services.sheet.developable.residuals import BENDS, FittingParameters
from services.sheet.developable.smooth_residual import morph_to_lines
from services.sheet.developable.surface import BendBasis, DevelopableSurface, bend_basis
from services.sheet.evidence import PageEvidence
from services.sheet.rulings.reference_points import text_hull
from services.sheet.strip_page import BentSheet, StripPage, bend_of_strips, find_strips
from services.sheet.surfaces import StripsSurface
from services.sheet.tracing.line_tracing import line_deviation, trace_by_characters
from services.texture_flow.field import FlowSamples, mean_deviation


@dataclass(frozen=True, slots=True)
class CurvedParameters:
    """How the surface is started and when it is believed."""

    bends: int = 12
    margin: float = 0.25
    """The bend goes on beyond the text by this share of its width."""
    reach: float = 0.4
    """The surface is tabulated, straight, further by this share."""
    start_skews_rad: tuple[float, ...] = (0.0, np.pi / 2)
    """Rulings of the flat starts, beside the strips'."""
    start_samples: int = 200
    start_focal_deviation: float = 0.05
    focal_held: float = 3.5
    """A focal length further than this many deviations from what was assumed comes from a page that is no sheet."""
    held_deviation: float = 0.08
    exif_contradiction: float = 3.0
    seen_focal_deviation: float = 0.25
    max_magnification_ratio: float = 10.0
    max_tilt_rad: float = np.deg2rad(80.0)
    strips: int = 40
    """In which the answer tells the surface."""
    min_visible: float = 0.97
    """Share of the characters that the surface must place."""


@dataclass(frozen=True, slots=True, eq=False)
class CurvedPage:
    """The map that flattens a curved page, its shape in strips, and what to say about it.

    `surface` is the global surface under the map, None where only strips could be fitted. `focal` is in half diagonals;
    `deviation` the mean deviation (rad) of the flows from horizontal and vertical in the flat view, `waviness` the RMS
    deviation, in text heights, of the text lines from straight ones, before the small residual.
    """

    page_map: PageMap
    surface: DevelopableSurface | None
    strips: StripsSurface
    focal: float
    focal_source: FocalLengthSource
    line_count: int
    deviation: float
    waviness: float
    exif_contradicted: bool = False
    """The page does not fit the focal length of the EXIF data, which was left out of account."""
    log_focal_deviation: float = float("inf")
    """Of the focal length's logarithm as the page alone shows it."""
    fitted: FittedSurface | None = None
    lines: LineObservations = NO_LINES
    """The fit of `surface`, and the lines that it was fitted to."""


@dataclass(frozen=True, slots=True)
class NoSheet:
    """No bent sheet is plausible; `reason` completes "a bent sheet is not plausible: "."""

    reason: str


def describe_strips(
    surface: DevelopableSurface, view: PhotoFrame, characters: Points, count: int
) -> StripsSurface:
    """The surface as `count` planar strips between rulings that cover the `characters` (N, 2), centred."""
    sheet = surface.to_sheet(surface.to_page(characters))
    low, high = np.nanpercentile(sheet[:, 0], [0.5, 99.5])
    middle = float(np.nanmedian(sheet[:, 1]))
    s = np.linspace(low, high, count + 1)
    P, R = surface.line_at(s)
    X = P + middle * R
    # A direction R is seen at K R, the ruling's way in the photo at the derivative of the projection.
    way = X[:, 2:] * R[:, :2] - X[:, :2] * R[:, 2:]
    focal_px = surface.focal * view.unit_px
    points = focal_px * X[:, :2] / X[:, 2:] + view.centre
    vanishing = np.column_stack([focal_px * R[:, :2] + np.array(view.centre) * R[:, 2:], R[:, 2]])
    normals = surface.normals_at(0.5 * (s[1:] + s[:-1])).astype(np.float64)
    return StripsSurface(normals, points, np.arctan2(way[:, 1], way[:, 0]) % np.pi, vanishing)


def start_surface(
    points: FlowVanishingPoints, prior: FocalPrior, characters: Points, skew_rad: float, p: CurvedParameters
) -> SurfaceStart:
    """A flat sheet in the mean pose of the flows, whose rulings are turned by `skew_rad` against the strokes."""
    held = FocalPrior(prior.log_focal, 0.01, "given")
    plane = estimate_plane(points, held)
    anchor = (float(np.median(characters[:, 0])), float(np.median(characters[:, 1])))
    flat = DevelopableSurface(
        plane.rotation, plane.focal, anchor, 0.0, (0.0, 0.0), np.zeros(4), bend_basis(-1.0, 1.0, 4, 0.5)
    )
    page = flat.to_page(characters)
    across = np.cos(skew_rad) * page[:, 0] - np.sin(skew_rad) * page[:, 1]
    slant = FittingParameters().slant_mean_rad
    parameters = np.concatenate([[prior.log_focal, skew_rad, 0.0, 0.0, slant], np.zeros(p.bends)])
    return SurfaceStart(plane.rotation, anchor, _basis_over(across, p), parameters)


def start_from_sheet(sheet: BentSheet, characters: Points, p: CurvedParameters) -> SurfaceStart:
    """The strips' smooth sheet as a start."""
    anchor = (float(sheet.anchor[0]), float(sheet.anchor[1]))
    reach = float(np.abs(characters - sheet.anchor).max())
    # Where the characters lie on the flat sheet through the middle strip is near enough to span the bends.
    c, d = np.cos(sheet.skew_rad), np.sin(sheet.skew_rad)
    unskew = np.array([[c, d, 0.0], [-d, c, 0.0], [0.0, 0.0, 1.0]])
    flat = DevelopableSurface(
        sheet.rotation @ unskew, sheet.focal, anchor, sheet.skew_rad, (0.0, 0.0), np.zeros(4),
        bend_basis(-2 * reach, 2 * reach, 4, 0.5),
    )  # fmt: skip
    basis = _basis_over(flat.to_sheet(flat.to_page(characters))[:, 0], p)
    k = np.interp(basis.nodes, sheet.places, sheet.bends)
    inside = np.abs(basis.values).sum(axis=1) > 0
    smooth = np.diff(np.eye(p.bends), 2, axis=0)
    design = np.concatenate([basis.values[inside], smooth])
    bends = np.linalg.lstsq(design, np.concatenate([k[inside], np.zeros(len(smooth))]), rcond=None)[0]
    slant = FittingParameters().slant_mean_rad
    log_focal = float(np.log(sheet.focal))
    parameters = np.concatenate([[log_focal, sheet.skew_rad, 0.0, 0.0, slant], bends])
    return SurfaceStart(sheet.rotation, anchor, basis, parameters)


def _basis_over(across: Vector, p: CurvedParameters) -> BendBasis:
    low, high = (float(v) for v in np.percentile(across, [0.5, 99.5]))
    margin = p.margin * (high - low)
    return bend_basis(low - margin, high + margin, p.bends, p.reach)


def recentre(fitted: FittedSurface, characters: Points, p: CurvedParameters) -> SurfaceStart:
    """The fitted surface as a start whose bends span the characters as they lie on the sheet now."""
    old = fitted.surface
    sheet = old.to_sheet(old.to_page(characters))
    basis = _basis_over(sheet[np.isfinite(sheet).all(axis=1), 0], p)
    k = np.interp(basis.nodes, old.basis.nodes, old.basis.values @ old.bends, left=0.0, right=0.0)
    bends = np.linalg.lstsq(basis.values, k * (np.abs(basis.values).sum(axis=1) > 0), rcond=None)[0]
    parameters = np.concatenate([fitted.start.parameters[: BENDS - 3], bends])
    return replace(fitted.start, basis=basis, parameters=parameters)


def page_hull(characters: Points, growth: float = 1.1) -> Points:
    """The text's hull (H, 2), a little larger: the page does not end with its text."""
    hull = text_hull(characters)
    middle = hull.mean(axis=0)
    return np.asarray(middle + growth * (hull - middle))


def thin(samples: FlowSamples, count: int) -> FlowSamples:
    """At most `count` of the samples, spread evenly, with weights that keep their sum."""
    if len(samples) <= count:
        return samples
    chosen = np.unique(np.linspace(0, len(samples) - 1, count).astype(int))
    share = len(samples) / len(chosen)
    return FlowSamples(
        samples.points[chosen], samples.angles[chosen], np.minimum(samples.weights[chosen] * share, 4.0)
    )


def estimate_curved_page(
    evidence: PageEvidence, prior: FocalPrior, parameters: CurvedParameters | None = None
) -> CurvedPage | NoSheet:
    """Shape of the page through its text, or why no bent sheet is plausible.

    The strips of 3.3.3 to 3.3.5 and flat sheets start the global surface, which flows alone bring near; then the text
    lines are traced in its flat view and everything is fitted together, twice; last, what is left of the lines' waves
    is taken out by a small smooth residual. Where no global surface is plausible, the strips themselves may be.
    """
    p, e = parameters or CurvedParameters(), evidence
    strips = None if e.start else find_strips(e, prior)
    if e.start:
        held = PageObservations(
            e.major, e.minor, NO_LINES, page_hull(e.characters), prior.log_focal, prior.deviation
        )
        fitted = fit_surface(e.start, held, FittingParameters(cauchy_flows=True, max_evaluations=1))
    else:
        fitted = _fit_flows(e, prior, strips, p)
    reason, contradicted = implausibility(fitted.surface, e.characters, p), False
    if reason is None:
        fitted, lines = _fit_lines(e, prior, fitted, p)
        drawn = abs(float(np.log(fitted.surface.focal)) - prior.log_focal)
        if prior.source == "exif" and drawn > p.exif_contradiction * prior.deviation:
            prior, contradicted = typical_focal_prior(), True
            fitted, lines = _fit_lines(e, prior, fitted, p)
            drawn = abs(float(np.log(fitted.surface.focal)) - prior.log_focal)
        if prior.source == "assumed" and drawn > p.focal_held * prior.deviation:
            prior = FocalPrior(prior.log_focal, p.held_deviation, "assumed")
            fitted, lines = _fit_lines(e, prior, fitted, p)
        reason = implausibility(fitted.surface, e.characters, p)
    if reason is not None:
        return _page_of_strips(e, prior, strips, p) or NoSheet(reason)
    seen = prior.source == "assumed" and fitted.log_focal_deviation < p.seen_focal_deviation
    page_map = morph_to_lines(fitted.surface, lines)
    return CurvedPage(
        page_map,
        fitted.surface,
        describe_strips(fitted.surface, e.view, e.characters, p.strips),
        fitted.surface.focal,
        "estimated" if seen else prior.source,
        lines.count // 2,
        flow_deviation(page_map, e.major, e.minor),
        line_deviation(fitted.surface, lines),
        contradicted,
        fitted.log_focal_deviation,
        fitted,
        lines,
    )


def _page_of_strips(
    e: PageEvidence, prior: FocalPrior, strips: StripPage | None, p: CurvedParameters
) -> CurvedPage | None:
    """The page as its strips alone show it; None where they leave too much of its text out."""
    if strips is None or strips.page_map is None or not MIN_FOCAL < strips.shape.focal < MAX_FOCAL:
        return None
    page_map = strips.page_map
    placed = np.isfinite(page_map.to_page(e.characters)).all(axis=1)
    det = np.linalg.det(page_map.jacobians(e.characters[placed])) if placed.any() else np.zeros(0)
    if placed.mean() < p.min_visible or (det <= 0).mean() > 1 - p.min_visible:
        return None
    low, high = np.percentile(np.sqrt(det[det > 0]), [1, 99])
    if high > p.max_magnification_ratio * low:
        return None
    lines = trace_by_characters(e.text, e.view, page_map)
    return CurvedPage(
        page_map,
        None,
        strips.surface(e.view),
        strips.shape.focal,
        "estimated" if prior.source == "assumed" else prior.source,
        lines.count // 2,
        flow_deviation(page_map, _known(page_map, e.major), _known(page_map, e.minor)),
        line_deviation(page_map, lines),
    )


def _known(page_map: PageMap, flow: FlowSamples) -> FlowSamples:
    """The samples within the map."""
    known = np.isfinite(page_map.jacobians(flow.points)).all(axis=(1, 2))
    return flow.select(np.asarray(known))


def _fit_flows(
    e: PageEvidence, prior: FocalPrior, strips: StripPage | None, p: CurvedParameters
) -> FittedSurface:
    """The best of several starts on the flows alone, the focal length of flat ones being held at first."""
    held, hull = min(prior.deviation, p.start_focal_deviation), page_hull(e.characters)
    few = PageObservations(
        thin(e.major, p.start_samples), thin(e.minor, p.start_samples), NO_LINES, hull, prior.log_focal, held
    )
    soft = FittingParameters(max_evaluations=12)
    hard = FittingParameters(max_evaluations=12, cauchy_flows=True)
    starts = [
        (start_surface(e.vanishing_points, prior, e.characters, skew, p), few) for skew in p.start_skews_rad
    ]
    if strips is not None:
        free = replace(few, focal_deviation=prior.deviation)
        starts.append((start_from_sheet(bend_of_strips(strips), e.characters, p), free))
    # A strong bend is out of sight of the hard loss, and pictures' flows draw the soft one.
    fits = [fit_surface(start, seen, hard) for start, seen in starts]
    fits += [fit_surface(fit_surface(start, seen, soft).start, seen, hard) for start, seen in starts]
    likely = [fit for fit in fits if implausibility(fit.surface, e.characters, p) is None]
    best = min(likely or fits, key=lambda fit: fit.cost)
    observed = PageObservations(e.major, e.minor, NO_LINES, hull, prior.log_focal, prior.deviation)
    return fit_surface(
        recentre(best, e.characters, p), observed, FittingParameters(cauchy_flows=True, max_evaluations=20)
    )


def _fit_lines(
    e: PageEvidence, prior: FocalPrior, fitted: FittedSurface, p: CurvedParameters
) -> tuple[FittedSurface, LineObservations]:
    """Two rounds: the lines are traced again in the first round's view, with the deviations it has shown."""
    parameters, lines, hull = FittingParameters(cauchy_flows=True), NO_LINES, page_hull(e.characters)
    for _ in range(2):
        lines = trace_by_characters(e.text, e.view, fitted.surface)
        observed = PageObservations(e.major, e.minor, lines, hull, prior.log_focal, prior.deviation)
        fitted = fit_surface(recentre(fitted, e.characters, p), observed, parameters)
        if implausibility(fitted.surface, e.characters, p) is not None:
            break
        parameters = rescale_deviations(parameters, fitted)
    return fitted, lines


def implausibility(surface: DevelopableSurface, characters: Points, p: CurvedParameters) -> str | None:
    """Why no camera could see this surface under these characters (N, 2), centred; None if one could.

    Nearly every character has its place, before the camera, on the front, where rulings do not cross, and at a
    believable magnification.
    """
    at = surface.unroll(characters)
    det = np.linalg.det(at.jacobians)
    growth = 1 + at.sheet[:, 1] * surface.slope_rate(at.sheet[:, 0])
    with np.errstate(invalid="ignore"):
        good = np.isfinite(at.page).all(axis=1) & (at.X[:, 2] > 1e-3) & (det > 0) & (growth > 0.05)
    if good.mean() < p.min_visible:
        return "part of the text would be hidden or folded over"
    low, high = np.percentile(np.sqrt(det[good]), [1, 99])
    if high >= p.max_magnification_ratio * low:
        return f"some text would be enlarged {high / low:.0f} times as much as other text"
    sight = at.X[good] / np.linalg.norm(at.X[good], axis=1, keepdims=True)
    N = surface.normals(characters[good])
    tilt = np.arccos(np.clip(np.einsum("ij,ij->i", N, sight), -1, 1))
    if np.percentile(tilt, 97) >= p.max_tilt_rad:
        return "part of the text would be seen edge-on"
    return None


def flow_deviation(
    page_map: PageMap, major: FlowSamples, minor: FlowSamples, minor_share: float = 0.3
) -> float:
    """Mean deviation (rad) of the flows from horizontal and vertical on the flat page, the worst tenth left out."""
    along = mean_deviation(page_map.jacobians(major.points), major, 0.0)
    return along + minor_share * mean_deviation(page_map.jacobians(minor.points), minor, np.pi / 2)
