"""A page's shape with little work, for a preview: by the sides of the sheet alone, or by the directions of its text.

The whole work fits the sheet to sides, directions and traced text lines, from several starts. Here a bent sheet is the
mesh between its sides, or one short fit to few directions; where that does not explain clearly more than a plane, it is
not used.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from services.arrays import Points
from services.contract.rectify import PageKind
from services.geometry.focal_prior import FOCAL, FocalPrior
from services.geometry.page_map import PageMap, PlaneMap
from services.geometry.photo_frame import PhotoFrame
from services.notices import Notice
from services.rectify.shape_choice.choice import CURVED_GAIN
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.shape_choice.textless import planar_page
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
from services.sheet.outline.results import SheetOutline
from services.sheet.plane.outline_plane import OutlinePlane, read_sides
from services.sheet.plane.planarity import apparent_kind
from services.sheet.plane.pose import choose_pose, start_plane
from services.sheet.ridged.cylinder_start import cylinder_between_sides
from services.sheet.ridged.start import mesh_between_sides
from services.sheet.ridged_page import RidgedPage, sides_bend, turn_outline
from services.sheet.shape import PageShape

# Size of the fit, and when it is believed.
BENDS = 8
SAMPLES = 120
"""Of each flow."""
EVALUATIONS = 20
"""At most; with 6 bends and 10 evaluations the mesh is a fifth farther off."""
LEAST_GAIN = 1e-2
"""The fit ends when a step lowers the cost by a smaller share: a third of the time, and the mesh is as near."""

SEEMS_CURVED = Notice(
    "curved-page",
    "the page seems curved; a preview shows its best planar view, and the whole work may flatten it better.",
)
STRAIGHT_SIDE = 0.004
"""RMS bend of a side, as a share of the sheet's size, above which the sheet counts as bent."""
CELLS = 16
"""Columns of the mesh of a bent sheet."""
NEIGHBOURS = 3
"""Of a character, whose directions vote for that of the text lines."""
DIRECTION_BINS = 36


def sheet_between_sides(
    outline: SheetOutline, view: PhotoFrame, prior: FocalPrior, kind: PageKind, characters: Points
) -> ShapedPage | None:
    """The sheet within a believed `outline`, its print turned as its `characters` (N, 2) run; None where it is none."""
    direction = line_direction(characters) if len(characters) else 0.0
    bent = sides_bend(outline) > STRAIGHT_SIDE if kind == "auto" else kind == "curved"
    if bent:
        # An opened book that goes on beyond the photo has such an outline too: its text tells the pages apart.
        if not np.isfinite(outline.corners).all():
            return None
        mesh = _bent_sheet(outline, view, prior, direction)
        return None if mesh is None else ShapedPage(view, mesh, mesh.notices, outline)
    sheet = read_sides(outline, view, prior)
    if sheet is None or sheet.plane is None:
        return None
    plane = sheet.plane
    if _runs_down(plane, direction):
        # Lines of text run along the sides that the photo shows as left and right.
        turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        plane = replace(plane, plane=replace(plane.plane, rotation=plane.plane.rotation @ turn))
    flat = planar_page(plane, prior, "outline", sheet)
    return ShapedPage(sheet.view, flat, flat.notices, outline)


def _runs_down(plane: OutlinePlane, direction_rad: float) -> bool:
    """Whether a line of this direction, in the middle of the photo, is nearer to the plane's y axis than to x."""
    H = plane.plane.H_centred_plane
    middle = np.linalg.inv(H) @ np.array([0.0, 0.0, 1.0])
    middle = middle / middle[2]
    axes = []
    for step in np.eye(3)[:2]:
        ahead = H @ (middle + 1e-3 * step)
        axes.append(np.arctan2(ahead[1], ahead[0]))
    off = [abs(np.sin(axis - direction_rad)) for axis in axes]
    return bool(off[1] < off[0])


def _bent_sheet(
    outline: SheetOutline, view: PhotoFrame, prior: FocalPrior, direction_rad: float
) -> RidgedPage | None:
    """The mesh between the sides as it is, which the whole work only starts from."""
    corners, order = turn_outline(outline.corners, direction_rad)
    corners = view.to_centred(corners)
    sides = tuple(view.to_centred(outline.sides[k].points) for k in order)
    mesh = cylinder_between_sides(corners, sides, prior.log_focal, prior.deviation, CELLS)
    if mesh is None:
        mesh = mesh_between_sides(corners, sides, float(np.exp(prior.log_focal)), CELLS)
    return None if mesh is None else RidgedPage(mesh, mesh, prior.source)


def brief_shape(evidence: PageEvidence, prior: FocalPrior, kind: PageKind) -> PageShape:
    """The shape by the text's directions: a plane, or a bent sheet where a short fit explains them better."""
    seems = apparent_kind(evidence, kind)
    if seems == "curved":
        bent = bend_quickly(evidence, prior, PlaneMap(start_plane(evidence, prior).H_centred_plane))
        if bent is not None:
            return bent
    pose = choose_pose(evidence, prior, rounds=1)
    return pose if seems == "planar" else replace(pose, notices=(SEEMS_CURVED, *pose.notices))


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


def line_direction(characters: Points) -> float:
    """Most frequent direction (rad, up to a half turn) from a character (N, 2) to its nearest neighbours.

    Characters of a line are nearer to each other than lines, so this is the direction of the lines, to some degrees.
    """
    _, index = cKDTree(characters).query(characters, k=min(NEIGHBOURS + 1, len(characters)))
    way = (characters[index[:, 1:]] - characters[:, None]).reshape(-1, 2)
    angles = np.arctan2(way[:, 1], way[:, 0]) % np.pi
    width = np.pi / DIRECTION_BINS
    counts = np.bincount((angles / width).astype(int) % DIRECTION_BINS, minlength=DIRECTION_BINS)
    counts = counts + np.roll(counts, 1) + np.roll(counts, -1)
    return float((np.argmax(counts) + 0.5) * width)
