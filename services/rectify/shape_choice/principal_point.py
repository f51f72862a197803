"""The principal point of a photo that was cropped (6.2), where the page shows it.

A camera's principal point is the middle of its photo; cropping moves the middle, not the point. A page shows it:

- A plane gives one equation by its two vanishing points: the optical centre sees both at right angles,
  (v_h - c) . (v_v - c) = -f^2. With f known beforehand (EXIF, the client), c lies on a circle through both axes of the
  photo, so a photo that was cropped along one axis shows by how much. Which axis it was, the plane does not show.
- A bent sheet shows c along the direction in which its normals turn; across it, only f and c together.

So the cropping is one of a few hypotheses: none, along x, along y, and, for a bent sheet under a known focal length,
both. Each is fitted with a prior of the offset. Its cost and the prior probability of such a photo decide. An
uncropped photo has one of a few aspect ratios; this separates hypotheses that the page alone does not.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from services.geometry.camera import PrincipalPointPrior
from services.geometry.focal_prior import FocalPrior, typical_focal_prior
from services.geometry.photo_frame import PhotoFrame
from services.geometry.planar import PagePlane, estimate_plane
from services.notices import Notice
from services.rectify.analysis.photo_border import find_cut_borders
from services.sheet.curved_page import CurvedPage, page_hull
from services.sheet.developable.fitting import SurfaceStart, fit_surface, free_gain, rescale_deviations
from services.sheet.developable.observations import PageObservations
from services.sheet.developable.print_residuals import FittingParameters
from services.sheet.evidence import PageEvidence
from services.sheet.plane.flat_lines import for_text, observe_lines
from services.sheet.plane.flat_lines import rescale_deviations as rescale_line_deviations
from services.sheet.plane.flat_text import flatten_text
from services.sheet.plane.planar_page import PlanarPage
from services.sheet.plane.pose import (
    is_plausible,
    level_plane,
    refine_pose,
)
from services.sheet.plane.refinement import refine_plane
from services.sheet.plane.straight_lines import HELD, OFF_CENTRE
from services.sheet.shape import EXIF_CONTRADICTED, PageShape
from services.texture_flow.field import FlowSamples
from services.texture_flow.vanishing_points import estimate_vanishing_points

Offset = tuple[float, float]


# Costs are negative log likelihoods, as those of the fits (half the sum of squared residuals).
SMALLEST = 0.06
LARGEST = 0.4
"""Range of accepted offsets: a smaller one does no harm, and more than half of a photo is not cut away."""
TENSION = 1.8
"""A plane whose focal length is fewer deviations from what is known of it shows no cropping."""
ONE_AXIS = 2.5
BOTH_AXES = 8.5
"""Most photos are not cropped, and few of those that are lose a corner."""
UNCUT_PRINT = 1.5
"""Where a photo was cut, print often runs up to its border."""
GAIN_SHARE = 0.08
GAIN_SHARE_ODD = 0.03
"""Least gain of a bent sheet, as a share of its cost: sheets and lenses differ a little from the model. Less is
required if no camera has the aspect ratio of the photo."""
ASPECTS = ((4 / 3, 0.0), (16 / 9, 1.6), (3 / 2, 2.8))
"""Of the photos that cameras take, with their costs: phones take 4:3 and some 16:9, larger cameras 3:2."""
ASPECT_DEVIATION = 0.04
UNUSUAL = 4.0
"""Cost of a focal length other than EXIF's (such photos were zoomed, or cut equally on all sides), and of an aspect
ratio that cameras do not have."""


@dataclass(frozen=True, slots=True, eq=False)
class MovedEvidence:
    """The evidence relative to the principal point that the page shows, and the prior of the focal length there.

    `notices` name what was not used.
    """

    evidence: PageEvidence
    prior: FocalPrior
    notices: tuple[Notice, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """Result of a hypothesis: the offset of the principal point, the cost of the fit, and a start for a bent sheet."""

    offset: Offset
    cost: float
    start: SurfaceStart | None = None
    other_focal: bool = False
    """Whether the focal length of EXIF was not used."""


@dataclass(frozen=True, slots=True, eq=False)
class _Fitting:
    """How hypotheses are fitted (without a prior on the principal point it is the middle), and from which offsets."""

    fit: Callable[[PrincipalPointPrior | None], _Fit]
    along_x: tuple[float, ...] = (0.0,)
    along_y: tuple[float, ...] = (0.0,)
    both: bool = False
    share: float = 0.0
    """Least gain, as a share of the cost with the principal point in the middle."""
    other_focal: Callable[[], float] | None = None
    """Cost with the principal point in the middle and without the focal length of EXIF."""


def find_principal_point(evidence: PageEvidence, prior: FocalPrior, shape: PageShape) -> MovedEvidence | None:
    """Find the principal point of a cropped photo, if the page shows clearly that it is not in the middle.

    Parameters
    ----------
    evidence
        Text and flows. The search starts from the middle of the photo, even if the principal point of `evidence` is
        elsewhere.
    prior
        Of the focal length.
    shape
        The shape that was fitted with the principal point in the middle.

    Returns
    -------
    MovedEvidence or None
        None if the middle explains the page, or the page does not decide: with an unknown focal length a steep view of
        a bent sheet is explained by both. If the middle explains the page except for the focal length of EXIF, the
        evidence is returned without that.
    """
    doubted = moved_by_sides = evidence.view.principal_point_px is not None
    if doubted:
        # The sides of the sheet have moved it to the nearest place that explains them; the text shows more.
        evidence = _seen_from_middle(evidence)
    fitting: _Fitting | None = None
    if prior.source == "assumed":
        return None
    plane = shape if isinstance(shape, PlanarPage) else None
    if isinstance(shape, CurvedPage) and not doubted:
        fitting = _sheet_fitting(evidence, prior, shape)
    elif plane is not None:
        doubted = doubted or is_odd(evidence.view)
        fitting = _plane_fitting(evidence, prior) if doubted or plane.focal_tension > TENSION else None
    found = None if fitting is None else _choose(fitting, evidence, prior)
    if found is None:
        return None
    if found.other_focal:
        fitted_so = plane is not None and plane.focal_source != "exif" and not moved_by_sides
        return None if fitted_so else MovedEvidence(evidence, typical_focal_prior(), (EXIF_CONTRADICTED,))
    return MovedEvidence(
        _relative_to(found.offset, evidence, found.start), prior_at(prior, evidence.view, found.offset)
    )


def _choose(fitting: _Fitting, e: PageEvidence, prior: FocalPrior) -> _Fit | None:
    """The hypothesis that costs least, None when that is the photo's middle."""
    view = e.view
    half = (0.5 * view.width / view.unit_px, 0.5 * view.height / view.unit_px) if prior.of_diagonal else None
    free, held = OFF_CENTRE, HELD
    cut = find_cut_borders(e.text.characters, e.text.height_px, view.width, view.height)
    hypotheses = [((free, held), (start, 0.0), ONE_AXIS) for start in fitting.along_x]
    hypotheses += [((held, free), (0.0, start), ONE_AXIS) for start in fitting.along_y]
    if fitting.both:
        hypotheses.append(((free, free), (0.0, 0.0), BOTH_AXES))
    centre = fitting.fit(None)
    bound = centre.cost * (1 - fitting.share)
    best, least = None, centre.cost + aspect_cost(view, (0.0, 0.0))
    if prior.source == "exif" and fitting.other_focal is not None:
        free_cost = fitting.other_focal()
        unlikely = free_cost + UNUSUAL + aspect_cost(view, (0.0, 0.0))
        if unlikely < least:
            best, least = _Fit((0.0, 0.0), free_cost, other_focal=True), unlikely
    tried: set[tuple[float, float]] = set()
    for deviations, start, rarity in hypotheses:
        free_fit = fitting.fit(PrincipalPointPrior(deviations, start, half))
        place = (round(free_fit.offset[0], 2), round(free_fit.offset[1], 2))
        if place in tried:  # two starts reached the same place
            continue
        tried.add(place)
        fits = [(free_fit, aspect_cost(view, free_fit.offset))]
        if held in deviations:
            for usual in usual_originals(view, free_fit.offset):
                near = PrincipalPointPrior(usual.deviations, usual.mean, half, usual.mean)
                fits.append((fitting.fit(near), usual.cost))
        for fit, unusual in fits:
            cost = fit.cost + unusual + rarity + (0.0 if cut_border(fit.offset) in cut else UNCUT_PRINT)
            believable = SMALLEST < max(map(abs, fit.offset)) < LARGEST
            if believable and fit.cost < bound and cost < least:
                best, least = fit, cost
    return best


def cut_border(offset: Offset) -> str:
    """The border of the photo at which most was cut off when the principal point lies at `offset`."""
    x, y = offset
    return ("left" if x < 0 else "right") if abs(x) > abs(y) else ("top" if y < 0 else "bottom")


def original_size(view: PhotoFrame, offset: Offset) -> tuple[float, float]:
    """Width and height of the photo before it was cropped on one side of each axis, in pixels."""
    return view.width + 2 * abs(offset[0]) * view.unit_px, view.height + 2 * abs(offset[1]) * view.unit_px


@dataclass(frozen=True, slots=True)
class UsualOriginal:
    """Where the principal point lies if the photo was cut from one of a usual aspect ratio, and what that costs."""

    mean: Offset
    deviations: Offset
    cost: float


def usual_originals(view: PhotoFrame, offset: Offset) -> list[UsualOriginal]:
    """The usual originals that are larger along the axis of an `offset`, cut on the same side."""
    axis = 0 if abs(offset[0]) > abs(offset[1]) else 1
    size, other = (view.width, view.height)[:: 1 if axis == 0 else -1]
    found: list[UsualOriginal] = []
    for ratio, cost in ASPECTS:
        for whole in (ratio * other, other / ratio):
            moved = 0.5 * (whole - size) / view.unit_px
            if SMALLEST < moved < LARGEST:
                mean, deviations = [0.0, 0.0], [HELD, HELD]
                mean[axis] = float(np.copysign(moved, offset[axis]))
                deviations[axis] = 0.5 * ASPECT_DEVIATION * whole / view.unit_px
                found.append(UsualOriginal((mean[0], mean[1]), (deviations[0], deviations[1]), cost))
    return found


def prior_at(prior: FocalPrior, view: PhotoFrame, offset: Offset) -> FocalPrior:
    """Prior of the focal length for a principal point at `offset`."""
    if not prior.of_diagonal:
        return prior
    growth = float(np.hypot(*original_size(view, offset))) / (2 * view.unit_px)
    return replace(prior, log_focal=prior.log_focal + float(np.log(growth)))


def aspect_cost(view: PhotoFrame, offset: Offset) -> float:
    """Cost of the aspect ratio that the photo would have had before it was cropped."""
    long, short = sorted(original_size(view, offset), reverse=True)
    aspect = float(np.log(long / short))
    usual = min(
        0.5 * ((aspect - float(np.log(ratio))) / ASPECT_DEVIATION) ** 2 + cost for ratio, cost in ASPECTS
    )
    return min(usual, UNUSUAL)


def is_odd(view: PhotoFrame) -> bool:
    """Whether no camera has the aspect ratio of the photo, so that it was probably cropped."""
    return aspect_cost(view, (0.0, 0.0)) > ONE_AXIS


def _sheet_fitting(e: PageEvidence, prior: FocalPrior, page: CurvedPage) -> _Fitting | None:
    """Fits of the bent sheet from the present one; None if a free principal point would gain too little."""
    fitted = page.fitted
    # Lines that are less straight than they were traced: creased sheets use every free parameter to explain them.
    if fitted.line_scale > 1.0:
        return None
    parameters = rescale_deviations(FittingParameters(cauchy_flows=True), fitted)
    middle = PageObservations(
        e.major,
        e.minor,
        page.lines,
        page_hull(e.characters),
        prior.log_focal,
        prior.deviation,
        page.edges,
    )
    anywhere = replace(middle, principal_point=PrincipalPointPrior((OFF_CENTRE, OFF_CENTRE)))
    odd = is_odd(e.view)
    if not odd and max(free_gain(fitted.start, anywhere, parameters)) < ONE_AXIS:
        return None

    def fit(principal_point: PrincipalPointPrior | None) -> _Fit:
        found = fit_surface(fitted.start, replace(middle, principal_point=principal_point), parameters)
        return _Fit(found.principal_point, found.cost, found.start)

    return _Fitting(fit, both=True, share=GAIN_SHARE_ODD if odd else GAIN_SHARE)


def _plane_fitting(e: PageEvidence, prior: FocalPrior) -> _Fitting:
    """Fits of the plane to flows and text lines, as these are traced where the focal length is free."""
    typical = typical_focal_prior()
    start = estimate_plane(e.vanishing_points, typical)
    if not is_plausible(start, e.characters):
        start = level_plane(e.major, typical)
    traced, _ = refine_pose(e, typical, start)
    parameters = rescale_line_deviations(for_text(e.text.height_px), traced.scales)
    flat = flatten_text(e.text, e.view, traced.plane)
    lines = observe_lines(flat.baselines, flat.H_centred_flat, parameters)

    def fit(principal_point: PrincipalPointPrior | None) -> _Fit:
        plane = PagePlane(traced.plane.rotation, float(np.exp(prior.log_focal)))
        found = refine_plane(
            plane, prior, e.major, e.minor, e.vanishing_points, lines, parameters, None, principal_point
        )
        return _Fit(found.principal_point, found.cost)

    def other_focal() -> float:
        flows = (e.major, e.minor, e.vanishing_points)
        return refine_plane(traced.plane, typical, *flows, lines, parameters).cost

    return _Fitting(fit, (-OFF_CENTRE, OFF_CENTRE), (-OFF_CENTRE, OFF_CENTRE), other_focal=other_focal)


def _seen_from_middle(e: PageEvidence) -> PageEvidence:
    """The evidence relative to the photo's middle."""
    middle = PhotoFrame(e.view.width, e.view.height)
    x, y = ((np.array(middle.centre) - e.view.centre) / e.view.unit_px).tolist()
    return _relative_to((x, y), e)


def _relative_to(offset: Offset, e: PageEvidence, start: SurfaceStart | None = None) -> PageEvidence:
    """All evidence relative to a principal point at `offset`."""

    def shift(flow: FlowSamples) -> FlowSamples:
        return FlowSamples(flow.points - offset, flow.angles, flow.weights)

    view, major, minor = e.view.moved(offset), shift(e.major), shift(e.minor)
    points = estimate_vanishing_points(major, minor)
    return PageEvidence(e.text, view, major, minor, points, e.has_strokes, start)
