"""The pose that is used: refined, closed form, or a mere turn, whichever the evidence supports."""

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from services.arrays import Floats, Homography, Mask, Points
from services.geometry.homographies import (
    denominators,
    jacobians,
    resizing,
    scaling,
    transform_points,
    translation,
)
from services.rectify.analysis import PageAnalysis
from services.rectify.baselines import detect_baselines
from services.rectify.planar import (
    FlowVanishingPoints,
    FocalLengthSource,
    FocalPrior,
    PagePlane,
    PhotoFrame,
    estimate_plane,
    typical_focal_prior,
)
from services.rectify.refinement import RefinedPlane, for_text, observe_lines, refine_plane, widen
from services.rectify.results import Notice
from services.texture_flow.field import FlowSamples, angle_difference

EXIF_CONTRADICTED = Notice(
    "exif-contradicted",
    "the page's perspective does not fit the focal length in the EXIF data (cropped or resized after it was taken?), "
    "which was left out of account.",
)


@dataclass(frozen=True, slots=True)
class PoseParameters:
    """When a pose is believed."""

    max_magnification_ratio: float = 6.0
    """Largest over smallest enlargement over the text; a page at 60 degrees just reaches it."""
    max_tilt_rad: float = np.deg2rad(65.0)
    gain: float = 0.9
    curved_gain: float = 0.6
    """A tilt must bring the flows' mean deviation below this share of a mere turn's; more so on a curved page,
    whose vanishing points mean little."""
    minor_share: float = 0.3
    """Weight of the minor flow's deviation beside the major flow's."""
    exif_contradiction: float = 3.0
    """A page that draws the focal length this many deviations away from EXIF's was cropped or zoomed afterwards."""
    seen_focal_deviation: float = 0.25
    """The focal length is called estimated when the page alone fixes its logarithm better than this."""
    aspect_deviation: float = 0.03
    """Above this the width-to-height ratio is called uncertain."""


@dataclass(frozen=True, slots=True, eq=False)
class PagePose:
    """The chosen plane in pixels: `H_photo_plane`, `normal` in the camera frame, and what to say about it."""

    H_photo_plane: Homography
    normal: tuple[float, float, float]
    focal_length_px: float
    focal_source: FocalLengthSource
    notices: tuple[Notice, ...]
    line_count: int
    deviation: float
    """Mean deviation (rad) of the flows from horizontal and vertical in the flat view."""


def level_plane(major: FlowSamples, prior: FocalPrior) -> PagePlane:
    """The gentlest change: the photo turned so that most of its text lines are level, no tilt."""
    angle = most_common_direction(major)
    c, s = np.cos(angle), np.sin(angle)
    return PagePlane(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), float(np.exp(prior.log_focal)))


def most_common_direction(samples: FlowSamples, width_rad: float = np.deg2rad(2.0)) -> float:
    """Mode of the directions, rad in [-pi/2, pi/2): unlike the mean it is not drawn by a facing page."""
    near = np.exp(-0.5 * (angle_difference(samples.angles[:, None], samples.angles[None]) / width_rad) ** 2)
    top = samples.angles[int(np.argmax(near @ samples.weights))]
    deviation = angle_difference(samples.angles, float(top))
    weight = samples.weights * (np.abs(deviation) < 2 * width_rad)
    return float(angle_difference(np.array([top + np.average(deviation, weights=weight)]), 0.0)[0])


def flow_deviation(plane: PagePlane, major: FlowSamples, minor: FlowSamples, minor_share: float) -> float:
    """Mean deviation (rad) of the flows from horizontal and vertical in the flat view, the worst tenth left out."""
    H = np.linalg.inv(plane.H_centred_plane)
    return trimmed_deviation(jacobians(H, major.points), major, 0.0) + minor_share * trimmed_deviation(
        jacobians(H, minor.points), minor, np.pi / 2
    )


def trimmed_deviation(J: Floats, samples: FlowSamples, axis: float) -> float:
    """Mean angle (rad) between `samples`, mapped by `J` (N, 2, 2), and `axis`, the worst tenth left out."""
    tangent = np.stack([np.cos(samples.angles), np.sin(samples.angles)], axis=1)
    t = np.einsum("nij,nj->ni", J, tangent)
    deviation = np.abs(angle_difference(np.arctan2(t[:, 1], t[:, 0]), axis))
    return float(np.mean(np.sort(deviation)[: max(int(0.9 * len(deviation)), 1)]))


def is_plausible(plane: PagePlane, text_points: Points, parameters: PoseParameters) -> bool:
    """No vanishing line through the text, no extreme tilt, no extreme magnification (centred coordinates)."""
    H = np.linalg.inv(plane.H_centred_plane)
    w = denominators(H, text_points)
    if not np.isfinite(H).all() or (np.sign(w) != np.sign(w[0])).any():
        return False
    enlargement = np.sqrt(np.abs(np.linalg.det(jacobians(H, text_points))))
    low, high = np.percentile(enlargement, [1, 99])
    tilt = float(np.arccos(np.clip(abs(plane.rotation[2, 2]), 0.0, 1.0)))
    return bool(high < parameters.max_magnification_ratio * low and tilt < parameters.max_tilt_rad)


def flatten_ink(analysis: PageAnalysis, view: PhotoFrame, plane: PagePlane) -> tuple[Mask, Homography]:
    """Ink of the text in the flat view of `plane`, at about the analysis' resolution, and H_centred_flat."""
    H_reduced_centred = resizing(analysis.factor) @ view.H_photo_centred
    H_reduced_plane = H_reduced_centred @ plane.H_centred_plane
    centres = analysis.text.components.centres
    text = transform_points(np.linalg.inv(H_reduced_plane), centres)
    density = np.sqrt(np.abs(np.linalg.det(jacobians(H_reduced_plane, text))))
    margin = 2 * analysis.text.text_height_px / float(np.median(density))
    low, high = text.min(axis=0) - margin, text.max(axis=0) + margin
    scale = 1.2 * float(np.median(density))
    scale = min(scale, float(np.sqrt(8e6 / np.prod(high - low))))  # bounded, whatever the plane
    H_flat_plane = scaling(scale) @ translation(-float(low[0]), -float(low[1]))
    width, height = (max(int(np.ceil(v)), 1) for v in (high - low) * scale)
    H_reduced_flat = H_reduced_plane @ np.linalg.inv(H_flat_plane)
    ink = cv2.warpPerspective(
        analysis.text.ink.astype(np.uint8) * 255,
        H_reduced_flat,
        (width, height),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
    )
    return ink > 127, np.linalg.inv(H_reduced_centred) @ H_reduced_flat


def refine_pose(
    analysis: PageAnalysis,
    view: PhotoFrame,
    prior: FocalPrior,
    major: FlowSamples,
    minor: FlowSamples,
    points: FlowVanishingPoints,
    start: PagePlane,
    p: PoseParameters,
) -> RefinedPlane:
    """Two rounds: the text lines are found again in the first round's view, with the deviations it has shown."""
    parameters = for_text(analysis.text_height_px)
    ink, H_centred_flat = flatten_ink(analysis, view, start)
    observations = observe_lines(detect_baselines(ink), H_centred_flat, parameters)
    first = refine_plane(start, prior, major, minor, points, observations, parameters)
    if not is_plausible(first.plane, text_points(analysis, view), p):
        return first
    parameters = widen(parameters, first.spreads)
    ink, H_centred_flat = flatten_ink(analysis, view, first.plane)
    observations = observe_lines(detect_baselines(ink), H_centred_flat, parameters)
    return refine_plane(first.plane, prior, major, minor, points, observations, parameters)


def text_points(analysis: PageAnalysis, view: PhotoFrame) -> Points:
    """Centres of the characters (N, 2) in centred unit coordinates."""
    return np.asarray((analysis.characters - view.centre) / view.unit_px)


def choose_pose(
    analysis: PageAnalysis,
    view: PhotoFrame,
    prior: FocalPrior,
    major: FlowSamples,
    minor: FlowSamples,
    points: FlowVanishingPoints,
    kind: Literal["planar", "curved"],
    parameters: PoseParameters | None = None,
) -> PagePose:
    """Pose of the page in `view`; flows in centred coordinates. Falls back to a mere turn, with the reason."""
    p = parameters or PoseParameters()
    characters = text_points(analysis, view)
    level = level_plane(major, prior)
    start = estimate_plane(points, prior)
    if not is_plausible(start, characters, p):
        start = level
    refined = refine_pose(analysis, view, prior, major, minor, points, start, p)
    notices: list[Notice] = []
    drawn = abs(float(np.log(refined.plane.focal)) - prior.log_focal)
    if prior.source == "exif" and drawn > p.exif_contradiction * prior.deviation:
        prior = typical_focal_prior()
        refined = refine_pose(analysis, view, prior, major, minor, points, refined.plane, p)
        notices.append(EXIF_CONTRADICTED)
    plane = refined.plane
    gain = p.curved_gain if kind == "curved" else p.gain
    gentle = flow_deviation(level, major, minor, p.minor_share)
    if not is_plausible(plane, characters, p):
        plane = level
        notices.append(
            Notice(
                "implausible-pose",
                "the text's directions fit no plane seen by a camera; the photo was only turned.",
            )
        )
    elif flow_deviation(plane, major, minor, p.minor_share) > gain * gentle + 1e-4:
        plane = level
        notices.append(
            Notice(
                "already-flat", "no perspective was found that the page's text supports; it was only turned."
            )
        )
    source = focal_source(refined, prior, p)
    if refined.log_aspect_deviation > p.aspect_deviation and prior.source == "assumed" and plane is not level:
        notices.append(
            Notice(
                "aspect-ratio-uncertain",
                "this pose does not show the focal length, so a typical one was assumed and the width-to-height ratio "
                f"may be off by about {100 * refined.log_aspect_deviation:.0f} %; send focal_length_px or keep EXIF.",
            )
        )
    N = plane.rotation[:, 2]
    return PagePose(
        view.H_photo_centred @ plane.H_centred_plane,
        (float(N[0]), float(N[1]), float(N[2])),
        plane.focal * view.unit_px,
        source if plane is not level else prior.source,
        tuple(notices),
        refined.lines,
        flow_deviation(plane, major, minor, p.minor_share),
    )


def focal_source(refined: RefinedPlane, prior: FocalPrior, parameters: PoseParameters) -> FocalLengthSource:
    """Where the focal length comes from: what was given, else what the page shows, else an assumption."""
    if prior.source == "assumed" and refined.log_focal_deviation < parameters.seen_focal_deviation:
        return "estimated"
    return prior.source
