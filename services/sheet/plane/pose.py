"""Choice of the pose by the evidence: refined, closed form, or a rotation within the photo without tilt."""

from dataclasses import replace

import numpy as np

from services.arrays import Points
from services.geometry.camera import rotation_from_vector
from services.geometry.focal_prior import FOCAL, MEASURED, FocalPrior, typical_focal_prior
from services.geometry.homographies import denominators, jacobians
from services.geometry.planar import MAX_TILT_RAD, PagePlane, estimate_plane
from services.notices import Notice
from services.sheet.evidence import PageEvidence
from services.sheet.plane.flat_lines import for_text, observe_lines, rescale_deviations
from services.sheet.plane.flat_text import FlatText, flatten_text
from services.sheet.plane.outline_plane import SheetSides
from services.sheet.plane.planar_page import PlanarPage
from services.sheet.plane.refinement import RefinedPlane, joint_cost, refine_plane
from services.sheet.plane.straight_lines import StraightLines, along_axes, side_directions
from services.sheet.shape import EXIF_CONTRADICTED, ShapeSource
from services.sheet.surfaces import MAX_MAGNIFICATION_RATIO
from services.sheet.tracing.line_tracing import FEW_LINES
from services.texture_flow.field import FlowSamples, angle_difference, mean_deviation

TEXT_BELIEVED = Notice(
    "outline-disagrees",
    "the sheet's edges are not those of a rectangle on which its text is level (a wrong edge, or no flat rectangle); "
    "the text was used.",
)
EDGES_BELIEVED = Notice(
    "outline-disagrees",
    "the little text that was seen does not fit the sheet's straight edges; the edges were used.",
)

STRAY_PERCENT = 1.0
"""Share of the characters, at either end of the enlargements, that may be specks far from the text."""
SMALL_DEVIATION_RAD = 1e-4
"""Deviations of the flows that differ by less are equal."""


# When a pose is accepted.
GAIN = 0.9
MINOR_SHARE = 0.3
"""Weight of the deviation of the minor flow; that of the major flow is 1."""
ASPECT_DEVIATION = 0.03
"""Above this the width-to-height ratio is called uncertain."""
SIDE_DEVIATIONS = 4.0
PAIR = 2
"""Sides that show no plane alone. If that of text and sides together has them along its axes, text needs no support by
the flows."""
SIDE_RAD = np.deg2rad(1.0)
"""A side of the sheet that is off by more than both disagrees with the text."""
LEVEL_RAD = np.deg2rad(0.5)
"""Nine of ten lines of a view that are less inclined than this are found alike in a better view: `detect_baselines`
holds for a degree."""
TEXT_RAD = np.deg2rad(1.5)
"""If the plane of the sheet's sides leaves the text lines less level than another plane by this, text and sides
disagree."""
STRAY_RAD = np.deg2rad(8.0)
"""If the plane of the sheet's sides leaves the lines less level than this on average, they are drawings or the
grain of a desk. Text lines of bent and crumpled sheets are within 3 degrees."""
ASLANT_RAD = np.deg2rad(5.0)
"""A larger angle between the print and its sheet is reported as a warning."""


ROUNDS = 2
"""Fits to traced text lines: one starts from the closed form, and another one traces lines in its view."""


def level_plane(major: FlowSamples, prior: FocalPrior) -> PagePlane:
    """The photo turned so that most of its text lines are level, without tilt."""
    angle = most_common_direction(major)
    c, s = np.cos(angle), np.sin(angle)
    return PagePlane(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), float(np.exp(prior.log_focal)))


def start_plane(evidence: PageEvidence, prior: FocalPrior) -> PagePlane:
    """The plane of the vanishing points in closed form; without tilt where no camera sees that."""
    start = estimate_plane(evidence.vanishing_points, prior)
    return start if is_plausible(start, evidence.characters) else level_plane(evidence.major, prior)


def level_text(plane: PagePlane, major: FlowSamples) -> PagePlane:
    """`plane` turned about its normal so that most of its text lines are level."""
    H = np.linalg.inv(plane.H_centred_plane)
    tangent = np.stack([np.cos(major.angles), np.sin(major.angles)], axis=1)
    t = np.einsum("nij,nj->ni", jacobians(H, major.points), tangent)
    angles = angle_difference(np.arctan2(t[:, 1], t[:, 0]), 0.0)
    turn = most_common_direction(FlowSamples(major.points, angles, major.weights))
    return PagePlane(plane.rotation @ rotation_from_vector(np.array([0.0, 0.0, turn])), plane.focal)


def most_common_direction(samples: FlowSamples, width_rad: float = np.deg2rad(2.0)) -> float:
    """Mode of the directions, rad in [-pi/2, pi/2): unlike the mean it does not depend on a facing page."""
    near = np.exp(-0.5 * (angle_difference(samples.angles[:, None], samples.angles[None]) / width_rad) ** 2)
    top = samples.angles[int(np.argmax(near @ samples.weights))]
    deviation = angle_difference(samples.angles, float(top))
    weight = samples.weights * (np.abs(deviation) < 2 * width_rad)
    return float(angle_difference(np.array([top + np.average(deviation, weights=weight)]), 0.0)[0])


def flow_deviation(plane: PagePlane, major: FlowSamples, minor: FlowSamples, minor_share: float) -> float:
    """Mean deviation (rad) of the flows from horizontal and vertical in the flat view, the worst tenth left out."""
    H = np.linalg.inv(plane.H_centred_plane)
    return mean_deviation(jacobians(H, major.points), major, 0.0) + minor_share * mean_deviation(
        jacobians(H, minor.points), minor, np.pi / 2
    )


def is_plausible(plane: PagePlane, text_points: Points) -> bool:
    """No vanishing line through the text, no extreme tilt, no extreme magnification (centred coordinates)."""
    H = np.linalg.inv(plane.H_centred_plane)
    w = denominators(H, text_points)
    if not np.isfinite(H).all() or (np.sign(w) != np.sign(w[0])).any():
        return False
    enlargement = np.sqrt(np.abs(np.linalg.det(jacobians(H, text_points))))
    low, high = np.percentile(enlargement, [STRAY_PERCENT, 100.0 - STRAY_PERCENT])
    tilt = float(np.arccos(np.clip(abs(plane.rotation[2, 2]), 0.0, 1.0)))
    return bool(high < MAX_MAGNIFICATION_RATIO * low and tilt < MAX_TILT_RAD)


def refine_pose(
    evidence: PageEvidence,
    prior: FocalPrior,
    start: PagePlane,
    sides: StraightLines | None = None,
    rounds: int = ROUNDS,
) -> tuple[RefinedPlane, FlatText]:
    """Refine a pose in rounds: each detects text lines in the view of the one before, and uses its deviations.

    Lines that were level in the view of a round are not detected again in the next. The last view is returned too.
    """
    e, parameters = evidence, for_text(evidence.text.height_px)
    flat = flatten_text(e.text, e.view, start)
    for number in range(rounds):
        seen = observe_lines(flat.baselines, flat.H_centred_flat, parameters)
        found = refine_plane(start, prior, e.major, e.minor, e.vanishing_points, seen, parameters, sides)
        if number + 1 == rounds or not is_plausible(found.plane, e.characters):
            break
        parameters, start = rescale_deviations(parameters, found.scales), found.plane
        if not flat.baselines.level_within(LEVEL_RAD):
            flat = flatten_text(e.text, e.view, start)
    return found, flat


def refine_with_sides(
    evidence: PageEvidence,
    prior: FocalPrior,
    start: PagePlane,
    sheet: SheetSides | None,
    rounds: int = ROUNDS,
) -> tuple[RefinedPlane, FlatText, bool]:
    """The refined plane, the text in its last view, and whether the sides of the `sheet` agree with the plane.

    From a wrong start the robust loss makes the sides outliers, so the plane of the sides is a second start. If the
    sides agree with its result, that is returned; else the plane of least cost of flows and sides together. A format
    that is likely by the sides has no say where text and sides disagree under the focal length that it needs.
    """
    e = evidence
    if sheet is None:
        return *refine_pose(e, prior, start, rounds=rounds), False
    focal = sheet.focal_prior(prior)
    found: list[tuple[float, RefinedPlane, FlatText, bool]] = []
    for first in (start,) if sheet.plane is None else (sheet.plane.plane, start):
        level = level_text(first, e.major)
        if not is_plausible(level, e.characters):
            continue
        sides = along_axes(level, sheet.lines)
        refined, flat = refine_pose(e, focal, level, sides, rounds)
        agree = sides_agree(refined, sides)
        cost = joint_cost(refined, e.major, e.minor, e.vanishing_points, sides)
        found.append((cost, refined, flat, agree))
        if agree and len(sides) > 2:
            break
    if focal is not prior and not any(agree for *_, agree in found):
        return refine_with_sides(e, prior, start, replace(sheet, belief=None), rounds)
    if not found:
        return *refine_pose(e, prior, start, rounds=rounds), False
    _, refined, flat, agree = min(found, key=lambda candidate: candidate[0])
    return refined, flat, agree


def sides_agree(refined: RefinedPlane, sides: StraightLines) -> bool:
    """Whether all of the sheet's sides lie along the page's axes, as far as they are known."""
    off = np.abs(side_directions(refined.plane, sides, refined.skew_rad))
    return bool((off < np.maximum(SIDE_RAD, SIDE_DEVIATIONS * sides.direction_deviations_rad)).all())


def choose_pose(
    evidence: PageEvidence,
    prior: FocalPrior,
    sheet: SheetSides | None = None,
    rounds: int = ROUNDS,
) -> PlanarPage:
    """Choose the pose of a page: refined, closed form, or a rotation without tilt, with the reason.

    Parameters
    ----------
    evidence
        Text, flows and vanishing points.
    prior
        Of the focal length.
    sheet
        Sides of the sheet, where they are seen. A plane that agrees with them needs no support by the flows, which
        are unreliable with sparse text.
    rounds
        Of the fit.

    Returns
    -------
    PlanarPage
        The plane and its notices.
    """
    e, major, minor = evidence, evidence.major, evidence.minor
    characters = e.characters
    level = level_plane(major, prior)
    start = start_plane(e, prior)
    refined, flat, agree = refine_with_sides(e, prior, start, sheet, rounds)
    notices: list[Notice] = []
    tension = focal_tension(refined, prior)
    drawn = abs(float(np.log(refined.plane.focal)) - prior.log_focal)
    if prior.source in MEASURED and drawn > FOCAL.exif_contradiction * prior.deviation:
        notices += [EXIF_CONTRADICTED] if prior.source == "exif" else []
        prior = typical_focal_prior()
        sheet = None if sheet is None else sheet.under(prior)
        refined, flat, agree = refine_with_sides(e, prior, refined.plane, sheet, rounds)
    plane = refined.plane
    gentle = flow_deviation(level, major, minor, MINOR_SHARE)
    trusted = agree and sheet is not None and (sheet.plane is not None or len(sheet.lines) == PAIR)
    if not is_plausible(plane, characters):
        plane, trusted = level, False
        notices.append(
            Notice(
                "implausible-pose",
                "the text's directions fit no plane seen by a camera; the photo was only turned.",
            )
        )
    elif (
        not trusted and flow_deviation(plane, major, minor, MINOR_SHARE) > GAIN * gentle + SMALL_DEVIATION_RAD
    ):
        plane = level
        notices.append(
            Notice(
                "already-flat", "no perspective was found that the page's text supports; it was only turned."
            )
        )
    sources: tuple[ShapeSource, ...] = ("text", "outline") if trusted else ("text",)
    skew = refined.skew_rad if trusted else 0.0
    by_sides = sheet.plane if trusted and sheet is not None else None
    if by_sides is not None and is_stray(refined, flow_deviation(plane, major, minor, 0.0)):
        plane, sources, skew = by_sides.plane, ("outline",), 0.0
    aspect = sheet.aspect_in(plane) if trusted and sheet is not None else None
    uncertain = refined.log_aspect_deviation if aspect is None else aspect.log_deviation
    if uncertain > ASPECT_DEVIATION and prior.source == "assumed" and plane is not level:
        by_format = aspect is not None and sheet is not None and sheet.focal_prior(prior) is not prior
        notices.append(aspect_uncertain(uncertain, by_format=by_format))
    if sheet is not None:
        lines, without = (
            min(flow_deviation(other, major, minor, 0.0) for other in planes)
            for planes in ((plane,), (level, start))
        )
        notices += disagreement(sheet, refined, trusted, lines, without)
    return PlanarPage(
        plane,
        prior.source if plane is level else prior.source_beside(refined.log_focal_deviation),
        tuple(notices),
        refined.lines,
        flow_deviation(plane, major, minor, MINOR_SHARE),
        sources,
        trusted and sheet is not None and sheet.straight,
        skew,
        float("inf") if plane is level else refined.log_focal_deviation,
        tension,
        flat.lines if plane is refined.plane else None,
        aspect,
        0.0 if plane is level else uncertain,
    )


def aspect_uncertain(log_deviation: float, *, by_format: bool = False) -> Notice:
    """What is said where the aspect has this deviation of its logarithm."""
    assumed = "the likeliest format of paper" if by_format else "a typical one"
    return Notice(
        "aspect-ratio-uncertain",
        f"this pose does not show the focal length, so {assumed} was assumed and the width-to-height ratio may be off "
        f"by about {100 * log_deviation:.0f} %; send focal_length_px or keep EXIF.",
    )


def is_stray(refined: RefinedPlane, deviation_rad: float) -> bool:
    """Whether the lines found on a sheet are not text, or too few to turn the view against the sides of the sheet."""
    aslant = abs(refined.skew_rad) > TEXT_RAD and refined.lines < FEW_LINES
    return deviation_rad > STRAY_RAD or aslant


def disagreement(
    sheet: SheetSides, refined: RefinedPlane, trusted: bool, lines: float, without: float
) -> list[Notice]:
    """Notices if text and outline disagree; the deviation (rad) of the text is `lines`, and `without` the sides."""
    if not trusted:
        return [TEXT_BELIEVED] if sheet.plane is not None else []
    if lines > without + TEXT_RAD or is_stray(refined, lines):
        return [EDGES_BELIEVED]
    if abs(refined.skew_rad) > ASLANT_RAD:
        return [
            Notice(
                "outline-disagrees",
                f"the print is aslant on its sheet, by {abs(np.degrees(refined.skew_rad)):.0f} degrees; the view "
                "is level with the print.",
            )
        ]
    return []


def focal_tension(refined: RefinedPlane, prior: FocalPrior) -> float:
    """Difference between the focal length of the prior and that of the observations alone, in standard deviations.

    The fit lies between both, inversely to their variances.
    """
    drawn = abs(float(np.log(refined.plane.focal)) - prior.log_focal)
    return drawn * float(np.hypot(prior.deviation, refined.log_focal_deviation)) / prior.deviation**2
