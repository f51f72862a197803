"""The shape of a curved page: start, fit and check of the global developable surface."""

from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar, Literal

import numpy as np

from services.arrays import Floats, Points, Vector
from services.contract.rectify import Crop
from services.geometry.focal_prior import (
    FOCAL,
    MEASURED,
    FocalLengthSource,
    FocalPrior,
    typical_focal_prior,
)
from services.geometry.hulls import text_hull
from services.geometry.page_map import PageMap
from services.geometry.photo_frame import PhotoFrame
from services.geometry.planar import estimate_plane
from services.geometry.vanishing_points import FlowVanishingPoints
from services.notices import Notice
from services.order_statistics import percentile
from services.sheet.developable.fitting import FittedSurface, SurfaceStart, fit_surface, rescale_deviations
from services.sheet.developable.observations import (
    NO_EDGES,
    NO_LINES,
    SLANT_MEAN_RAD,
    LineObservations,
    PageObservations,
    SideObservations,
)
from services.sheet.developable.print_residuals import FittingParameters
from services.sheet.developable.residuals import BENDS
from services.sheet.developable.surface import BendBasis, DevelopableSurface, bend_basis
from services.sheet.developable.variation import TURN
from services.sheet.evidence import PageEvidence
from services.sheet.framing import CurvedFrame, frame_curved_page
from services.sheet.line_residual import morph_to_lines
from services.sheet.shape import EXIF_CONTRADICTED, NoShape, ShapeSource
from services.sheet.sheet_edges import measure_sides
from services.sheet.surfaces import MAX_MAGNIFICATION_RATIO, StripsSurface
from services.sheet.tracing.line_tracing import STRAIGHT, measure_straightness
from services.sheet.tracing.page_lines import trace_lines
from services.side_by_side import SideStep
from services.texture_flow.field import FlowSamples, mean_deviation

# How the fit of the surface starts, and when its result is accepted.
MARGIN = 0.25
"""The bend continues beyond the text by this share of its width."""
BORDER = 0.03
"""The same beyond the sheet's sides, where they are seen."""
REACH = 0.4
"""Beyond the bend the surface is straight, and tabulated over this share more."""
START_SKEWS_RAD = (0.0, np.pi / 2)
"""Rulings of the flat starts: across the text lines and along them."""
START_SAMPLES = 200
START_GAIN = 3e-3
"""Relative gain of the cost below which a start ends: it is compared, and the best one goes on."""
GOOD_SHARE = 0.08
"""Cost of a start for each sample of the flows, below which no other rulings are tried. Right starts of 13
simulated photos leave 0.015 to 0.12, wrong ones 0.13 to 4."""
MAX_TILT_RAD = np.deg2rad(80.0)
STRIPS = 40
"""Number of strips that describe the surface in the answer."""
SIDE_SLACK = (8.0, 1.0, 1.0)
"""Rounds of tracing and fitting the lines (of 12 simulated cones one needed the third), each with this factor on
the deviations of the sides: their robust loss does not draw a surface that is far from them."""
ROUND_BENDS = (12, 24, 24)
"""Splines of the bend in these rounds: creases are narrow, and are found from where the sheet is nearly right."""
START_BENDS = ROUND_BENDS[0]
"""The same while the flows alone are fitted."""
MAX_SIDES = 0.0025
"""RMS distance of the sides from straight ones, as a share of the sheet's size, in the end: 0.00003 to
0.0003 on 18 smooth sheets, 0.0003 to 0.0018 on those folded in thirds, 0.0009 to 0.017 on crumpled and crossed
ones."""
MIN_VISIBLE = 0.97
"""Share of the characters that the surface must place."""


@dataclass(frozen=True, slots=True, eq=False)
class CurvedPage:
    """The map that flattens a curved page, its shape in strips, and the evidence for it.

    `fitted` is the fit of the map's global surface, `lines` the straight print and `edges` the sides of the sheet that
    it was fitted to, and `strips` describe it. `deviation` is the mean deviation (rad) of the flows from horizontal and
    vertical in the flat view, `line_straightness` the RMS deviation, in text heights, of the lines from straight ones,
    before the small residual (NaN if unknown).
    """

    page_map: PageMap
    strips: StripsSurface
    focal_source: FocalLengthSource
    line_count: int
    deviation: float
    line_straightness: float
    notices: tuple[Notice, ...]
    fitted: FittedSurface
    lines: LineObservations
    edges: SideObservations = NO_EDGES
    kind: ClassVar[Literal["curved"]] = "curved"
    sides_believed: ClassVar[bool] = False
    sheet_aspect: ClassVar[None] = None
    log_aspect_deviation: ClassVar[float] = 0.0
    ends_at_sides: ClassVar[bool] = False

    @property
    def sources(self) -> tuple[ShapeSource, ...]:
        """See `PageShape`."""
        return ("text", "outline") if len(self.edges.points) else ("text",)

    @property
    def focal(self) -> float:
        """See `PageShape`."""
        return self.fitted.surface.focal

    @property
    def log_focal_deviation(self) -> float:
        """See `PageShape`."""
        return self.fitted.log_focal_deviation

    def in_space(self, centred: Points) -> Floats:
        """See `PageShape`."""
        return self.fitted.surface.unroll(centred).X

    def surface(self, view: PhotoFrame) -> StripsSurface:
        """See `PageShape`."""
        return self.strips

    def frame(
        self, view: PhotoFrame, points: Points, text_height_px: float, paper: Points | None, crop: Crop
    ) -> CurvedFrame:
        """See `PageShape`."""
        return frame_curved_page(self.page_map, view, points, text_height_px, paper, only_text=crop == "text")


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
    # A direction R is seen at K R; the ruling's direction in the photo is the derivative of the projection.
    way = X[:, 2:] * R[:, :2] - X[:, :2] * R[:, 2:]
    focal_px = surface.focal * view.unit_px
    points = focal_px * X[:, :2] / X[:, 2:] + view.centre
    vanishing = np.column_stack([focal_px * R[:, :2] + np.array(view.centre) * R[:, 2:], R[:, 2]])
    normals = surface.normals_at(0.5 * (s[1:] + s[:-1])).astype(np.float64)
    return StripsSurface(normals, points, np.arctan2(way[:, 1], way[:, 0]) % np.pi, vanishing)


def start_surface(
    points: FlowVanishingPoints,
    prior: FocalPrior,
    characters: Points,
    skew_rad: float,
    bends: int = START_BENDS,
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
    slant = SLANT_MEAN_RAD
    parameters = np.concatenate([[prior.log_focal, skew_rad, 0.0, 0.0, slant], np.zeros(bends)])
    return SurfaceStart(plane.rotation, anchor, _basis_over(across, bends), parameters)


def _basis_over(across: Vector, bends: int) -> BendBasis:
    low, high = (float(v) for v in np.percentile(across, [0.5, 99.5]))
    margin = MARGIN * (high - low)
    spacing = min(1.0, (START_BENDS - 3) / (bends - 3))
    return bend_basis(low - margin, high + margin, bends, REACH, spacing)


def recentre(
    fitted: FittedSurface, characters: Points, edges: SideObservations = NO_EDGES, bends: int = START_BENDS
) -> SurfaceStart:
    """The fitted surface as a start whose `bends` span the characters, and the sheet where its `edges` are seen."""
    old = fitted.surface
    sheet = old.to_sheet(old.to_page(characters))
    basis = _basis_over(sheet[np.isfinite(sheet).all(axis=1), 0], bends)
    if len(edges.points):
        border = old.to_sheet(old.to_page(edges.points))[:, 0]
        low, high = (float(v) for v in np.nanpercentile(border, [5, 95]))
        margin = BORDER * (high - low)
        basis = bend_basis(low - margin, high + margin, bends, REACH, basis.spacing)
    k = np.interp(basis.nodes, old.basis.nodes, old.basis.values @ old.bends, left=0.0, right=0.0)
    spread = np.linalg.lstsq(basis.values, k * (np.abs(basis.values).sum(axis=1) > 0), rcond=None)[0]
    parameters = np.concatenate([fitted.start.parameters[: BENDS - TURN.stop], spread])
    return replace(fitted.start, basis=basis, parameters=parameters)


def page_hull(characters: Points, growth: float = 1.1) -> Points:
    """Convex hull (H, 2) of the text, enlarged by `growth`: the page is larger than its text."""
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
    evidence: PageEvidence,
    prior: FocalPrior,
    edges: SideObservations = NO_EDGES,
    flat_fit: FittedSurface | None = None,
) -> CurvedPage | NoShape:
    """Fit a bent sheet to the text of a page.

    The fit starts from flat sheets, first to the flows alone. Then the text lines are traced in the flat view, and
    flows and lines are fitted together, in rounds. Last, a small smooth residual is added to the map
    where lines are left that are not straight.

    Parameters
    ----------
    evidence
        Text and flows, in centred unit coordinates.
    prior
        Of the focal length.
    edges
        Sides of the sheet, which are fitted together with the lines.
    flat_fit
        What `fit_flows` has found, if it was asked before.

    Returns
    -------
    CurvedPage or NoShape
        The page, or the reason why no bent sheet is plausible.
    """
    e = evidence
    fitted = flat = flat_fit or fit_flows(e, prior)
    reason, contradicted = implausibility(fitted.surface, e.characters), False
    if reason is None:
        fitted, lines = _fit_lines(e, prior, fitted, edges)
        drawn = abs(float(np.log(fitted.surface.focal)) - prior.log_focal)
        if prior.source in MEASURED and drawn > FOCAL.exif_contradiction * prior.deviation:
            prior, contradicted = typical_focal_prior(), prior.source == "exif"
            fitted, lines = _fit_lines(e, prior, fitted, edges)
            drawn = abs(float(np.log(fitted.surface.focal)) - prior.log_focal)
        hopeless = _sides_hopeless(fitted.surface, edges)
        if not hopeless and prior.source == "assumed" and drawn > FOCAL.believable * prior.deviation:
            prior = FocalPrior(prior.log_focal, FOCAL.held_deviation, "assumed")
            # From where the focal length was not drawn yet: the bends go with it.
            fitted, lines = _fit_lines(e, prior, flat, edges)
        reason = implausibility(fitted.surface, e.characters)
        if reason is None and len(edges.points) and not measure_sides(fitted.surface, edges) < MAX_SIDES:
            reason = "no smooth sheet has its sides"
    if reason is not None:
        return NoShape(reason)
    straightness = measure_straightness(fitted.surface, lines)
    # What flat pages have too is of the print, not of the sheet.
    page_map = fitted.surface if straightness < STRAIGHT else morph_to_lines(fitted.surface, lines)
    return CurvedPage(
        page_map,
        describe_strips(fitted.surface, e.view, e.characters, STRIPS),
        prior.source_beside(fitted.log_focal_deviation),
        lines.count // 2,
        flow_deviation(page_map, e.major, e.minor),
        straightness,
        (EXIF_CONTRADICTED,) if contradicted else (),
        fitted,
        lines,
        edges,
    )


def fit_flows(e: PageEvidence, prior: FocalPrior) -> FittedSurface:
    """The surface that the flows alone show: the best of several flat starts, or the one that the evidence has."""
    observed = PageObservations(
        e.major, e.minor, NO_LINES, page_hull(e.characters), prior.log_focal, prior.deviation
    )
    if e.start:
        return fit_surface(e.start, observed, FittingParameters(cauchy_flows=True, max_evaluations=1))
    free = replace(observed, major=thin(e.major, START_SAMPLES), minor=thin(e.minor, START_SAMPLES))
    held = replace(free, focal_deviation=min(prior.deviation, FOCAL.held_deviation))
    soft = FittingParameters(max_evaluations=12, least_gain=START_GAIN)
    cauchy = replace(soft, cauchy_flows=True)
    starts = [start_surface(e.vanishing_points, prior, e.characters, skew) for skew in START_SKEWS_RAD]
    # Cauchy's loss, and a focal length near its prior, do not reach a strong bend. The soft L1 loss, and a free
    # focal length, are biased by the flows of pictures. So both are tried, for one direction of the rulings after
    # the other until one is clearly good.
    enough = GOOD_SHARE * (len(free.major) + len(free.minor))
    fits: list[FittedSurface] = []
    for start in starts:
        with SideStep(partial(fit_surface, start, held, cauchy)) as near_prior:
            drawn = fit_surface(fit_surface(start, free, soft).start, free, cauchy)
            fits += [near_prior.result(), drawn]
        if any(fit.cost < enough and implausibility(fit.surface, e.characters) is None for fit in fits):
            break
    likely = [fit for fit in fits if implausibility(fit.surface, e.characters) is None]
    best = min(likely or fits, key=lambda fit: fit.cost)
    return fit_surface(
        recentre(best, e.characters), observed, FittingParameters(cauchy_flows=True, max_evaluations=20)
    )


def _fit_lines(
    e: PageEvidence, prior: FocalPrior, fitted: FittedSurface, edges: SideObservations
) -> tuple[FittedSurface, LineObservations]:
    """Fit flows and lines in rounds: each traces the lines in the view of the one before, and uses its deviations."""
    parameters, lines, hull = FittingParameters(cauchy_flows=True), NO_LINES, page_hull(e.characters)
    for slack, bends in zip(SIDE_SLACK, ROUND_BENDS, strict=True):
        lines = trace_lines(e.text, e.view, fitted.surface)
        observed = PageObservations(e.major, e.minor, lines, hull, prior.log_focal, prior.deviation, edges)
        eased = replace(parameters, side_factor=slack * parameters.side_factor)
        fitted = fit_surface(recentre(fitted, e.characters, edges, bends), observed, eased)
        refused = implausibility(fitted.surface, e.characters) is not None
        # In a round with slack the sides have not been drawn yet: from 0.0103 one sheet came to 0.0001.
        if refused or (slack == 1.0 and _sides_hopeless(fitted.surface, edges)):
            break
        parameters = rescale_deviations(parameters, fitted)
    return fitted, lines


def _sides_hopeless(surface: DevelopableSurface, edges: SideObservations) -> bool:
    """Whether the sides are left so far from straight ones that no smooth sheet has them."""
    return len(edges.points) > 0 and measure_sides(surface, edges) > MAX_SIDES


def implausibility(surface: DevelopableSurface, characters: Points) -> str | None:
    """Why no camera could see this surface under these characters (N, 2), centred; None if one could.

    Nearly all characters must be in front of the camera, on the visible side, where rulings do not cross, and at a
    plausible magnification.
    """
    at = surface.unroll(characters)
    det = np.linalg.det(at.jacobians)
    growth = 1 + at.sheet[:, 1] * surface.slope_rate(at.sheet[:, 0])
    with np.errstate(invalid="ignore"):
        good = np.isfinite(at.page).all(axis=1) & (at.X[:, 2] > 1e-3) & (det > 0) & (growth > 0.05)
    if good.mean() < MIN_VISIBLE:
        return "part of the text would be hidden or folded over"
    enlargement = np.sqrt(det[good])
    low, high = (float(percentile(enlargement, share)) for share in (1, 99))
    if high >= MAX_MAGNIFICATION_RATIO * low:
        return f"some text would be enlarged {high / low:.0f} times as much as other text"
    sight = at.X[good] / np.linalg.norm(at.X[good], axis=1, keepdims=True)
    N = surface.normals(characters[good])
    tilt = np.arccos(np.clip(np.einsum("ij,ij->i", N, sight), -1, 1))
    if percentile(tilt, 97) >= MAX_TILT_RAD:
        return "part of the text would be seen edge-on"
    return None


def flow_deviation(
    page_map: PageMap, major: FlowSamples, minor: FlowSamples, minor_share: float = 0.3
) -> float:
    """Mean deviation (rad) of the flows from horizontal and vertical on the flat page, the worst tenth left out."""
    along = mean_deviation(page_map.jacobians(major.points), major, 0.0)
    return along + minor_share * mean_deviation(page_map.jacobians(minor.points), minor, np.pi / 2)
