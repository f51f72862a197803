"""A bent sheet from the directions of its text alone, by one short fit: the shape of a preview.

The whole work fits the sheet to all directions and to the traced text lines, from several starts. Here one short fit to
few directions must do; where it does not explain clearly more than a plane, it is not used.
"""

from services.geometry.focal_prior import FOCAL, FocalPrior
from services.geometry.page_map import PageMap
from services.rectify.shape_choice.choice import CURVED_GAIN
from services.sheet.curved_page import (
    GOOD_SHARE,
    START_SKEWS_RAD,
    STRIPS,
    CurvedPage,
    describe_strips,
    flow_deviation,
    implausibility,
    page_hull,
    start_surface,
    thin,
)
from services.sheet.developable.fitting import FittedSurface, fit_surface
from services.sheet.developable.observations import NO_LINES, PageObservations
from services.sheet.developable.print_residuals import FittingParameters
from services.sheet.evidence import PageEvidence

# Size of the fit, and when it is believed.
BENDS = 8
SAMPLES = 120
"""Of each flow."""
EVALUATIONS = 20
"""At most; with 6 bends and 10 evaluations the mesh is a fifth farther off."""
LEAST_GAIN = 1e-2
"""The fit ends when a step lowers the cost by a smaller share: a third of the time, and the mesh is as near."""


def bend_quickly(evidence: PageEvidence, prior: FocalPrior, plane: PageMap) -> CurvedPage | None:
    """The bent sheet that the flows of `evidence` show; None where it explains them hardly better than the `plane`.

    The focal length stays that of the `prior`: few directions of a bent page do not show it.
    """
    e = evidence
    held = min(prior.deviation, FOCAL.held_deviation)
    observed = PageObservations(
        thin(e.major, SAMPLES),
        thin(e.minor, SAMPLES),
        NO_LINES,
        page_hull(e.characters),
        prior.log_focal,
        held,
    )
    fitting = FittingParameters(cauchy_flows=True, max_evaluations=EVALUATIONS, least_gain=LEAST_GAIN)
    enough = GOOD_SHARE * (len(observed.major) + len(observed.minor))
    likely: list[FittedSurface] = []
    for skew in START_SKEWS_RAD:
        start = start_surface(e.vanishing_points, prior, e.characters, skew, BENDS)
        fit = fit_surface(start, observed, fitting)
        if implausibility(fit.surface, e.characters) is None:
            likely.append(fit)
            if fit.cost < enough:
                break
    if not likely:
        return None
    best = min(likely, key=lambda fit: fit.cost)
    deviation = flow_deviation(best.surface, e.major, e.minor)
    if deviation > CURVED_GAIN * flow_deviation(plane, e.major, e.minor):
        return None
    return CurvedPage(
        best.surface,
        describe_strips(best.surface, e.view, e.characters, STRIPS),
        prior.source,
        0,
        deviation,
        float("nan"),
        (),
        best,
        NO_LINES,
    )
