"""A quick look at a photo: where its page is, from a reduced photo and without drawing.

The sides of the sheet decide where all four are certain, because they are found in less time than the directions of the
text; a bent sheet is then a mesh between its sides. Else the text decides: a plane, or a bent sheet by one short fit.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial import cKDTree

from services.arrays import Points, RgbImage
from services.contract.rectify import RectifyParameters
from services.errors import NoText
from services.geometry.focal_prior import FocalPrior
from services.geometry.page_map import PlaneMap
from services.geometry.photo_frame import PhotoFrame
from services.imaging.paper import PaperParameters
from services.imaging.reduction import Halves
from services.notices import Notice
from services.rectify.analysis.focal_length import requested_prior
from services.rectify.analysis.found_text import AnalysisParameters, FoundText, find_text
from services.rectify.analysis.page_analysis import PageAnalysis, analyse_text
from services.rectify.analysis.page_choice import choose_page
from services.rectify.analysis.print_sample import print_heights
from services.rectify.page_description import describe_page
from services.rectify.pipeline import FACING_PAGE
from services.rectify.results import Orientation, PrintSample, RectifyResult
from services.rectify.shape_choice.flat_hypothesis import (
    blank_flat_page,
    flat_page,
    may_be_flat,
    sheet_in_view,
)
from services.rectify.shape_choice.quick_bend import bend_quickly
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.shape_choice.textless import planar_page
from services.rectify.stage_clock import StageClock
from services.rectify.view.paper_end import find_paper_end, is_believed
from services.rectify.view.paper_fit import fit_to_paper
from services.rectify.view.print_kept import grow_to_print, kept_print, share_kept, sheet_print
from services.rectify.view.sheet_cut import cut_to_outline
from services.sheet.outline.candidates import CandidateParameters
from services.sheet.outline.detection import OutlineParameters, find_outline
from services.sheet.outline.rays import RayParameters
from services.sheet.outline.results import SheetOutline
from services.sheet.plane.outline_plane import OutlinePlane, read_sides
from services.sheet.plane.planarity import apparent_kind
from services.sheet.plane.pose import PoseParameters, choose_pose, start_plane
from services.sheet.ridged.cylinder_start import cylinder_between_sides
from services.sheet.ridged.start import mesh_between_sides
from services.sheet.ridged_page import (
    RidgedPage,
    complete_corners,
    sides_bend,
    turn_outline,
)
from services.texture_flow.field import FlowSamples
from services.texture_flow.major import MajorFlowParameters
from services.texture_flow.minor import MinorFlowParameters
from services.texture_flow.text_identification import keep_characters

SEEMS_CURVED = Notice(
    "curved-page",
    "the page seems curved; a preview shows its best planar view, and the whole work may flatten it better.",
)
PREVIEW_PX = 1200
"""Least long side of the reduced photo: letters must be large enough that their blur can be measured."""


@dataclass(frozen=True, slots=True)
class PreviewParameters:
    """What is left out, compared with the full work."""

    analysis: AnalysisParameters = field(
        default_factory=lambda: AnalysisParameters(
            long_side_px=800,
            least_reduction=0.8,
            major=MajorFlowParameters(
                coarse_block=7.0,
                coarse_step_rad=np.deg2rad(7.5),
                fine_step_rad=np.deg2rad(1.2),
                across_sampling=8.0,
                max_samples=250,
                repeats=1,
                field_spacing=4.0,
            ),
            minor=MinorFlowParameters(max_edges=40_000, band_rows=48, band_share=0.5),
            paper=PaperParameters(long_side_px=280),
        )
    )
    """Print of 10 points on a full page is 5 px high then, enough to be found. The lines of a page have few bends, so
    that fewer windows show their directions; the strokes' directions need all of their blocks, but not all edges. To
    reduce the photo for strokes by a factor near 1 takes more time than it saves."""
    pose: PoseParameters = field(default_factory=lambda: PoseParameters(rounds=1))
    outline: OutlineParameters = field(
        default_factory=lambda: OutlineParameters(
            candidates=CandidateParameters(
                rays=RayParameters(rays=120, samples=96, max_shift=6), most_cut=0.15
            ),
            improved=False,
            tried=1,
            well_rated=0.55,
            least_rating=0.5,
            most_cut=0.1,
        )
    )
    straight_side: float = 0.004
    """RMS bend of a side, as a share of the sheet's size, above which the sheet counts as bent."""
    cells: int = 16
    """Columns of the mesh of a bent sheet."""
    neighbours: int = 3
    """Of a character, whose directions vote for that of the text lines."""
    direction_bins: int = 36


def preview_page(
    photo: RgbImage,
    parameters: RectifyParameters,
    exif_focal_length_px: float | None = None,
    is_document: bool = False,
) -> RectifyResult:
    """Where the page lies in a reduced `photo` (H, W, 3): the result of `rectify` with a blank image.

    All lengths, also those of `parameters`, are in pixels of this photo; `enlarge` gives those of the larger one.

    Raises
    ------
    NoText
        When neither text nor the sides of a sheet show the page's shape.
    """
    p = PreviewParameters()
    clock = StageClock()
    view = PhotoFrame(photo.shape[1], photo.shape[0])
    prior = requested_prior(view, parameters, exif_focal_length_px)
    halves = Halves(photo)
    with clock.stage("text"):
        text, refusal = _find_text(halves, parameters, p)
    outline: SheetOutline | None = None
    if parameters.region is None:
        with clock.stage("outline"):
            characters = None if text is None else text.characters
            height_px = None if text is None else text.text_height_px
            outline = find_outline(halves, characters, height_px, p.outline)
    page: ShapedPage | None
    with clock.stage("shape"):
        in_view = sheet_in_view(outline, view, is_document=is_document)
        page = _sheet_between_sides(outline, view, prior, text, parameters, p) if in_view else None
        if page is None and text is None and may_be_flat(parameters):
            page = blank_flat_page(halves, outline, view, prior, is_document=is_document)
    if page is None:
        if text is None:
            raise refusal or NoText("neither text nor a sheet's edges are seen.")
        page = _page_of_text(
            halves, text, view, prior, outline, parameters, clock, p, is_document=is_document
        )
    with clock.stage("framing"):
        boxes = sheet_print(page)
        end = find_paper_end(page, parameters.crop, boxes)
        frame = page.frame(end.reach, parameters.crop)
        if parameters.crop == "sheet" and page.outline is not None:
            frame, _ = cut_to_outline(frame, page.outline, page.characters, believed=end.believed)
        frame = grow_to_print(frame, boxes, page.text_height_px)
        kept = share_kept(boxes, kept_print(frame, boxes))
        stretch = None
        if parameters.crop == "sheet":
            frame, stretch = fit_to_paper(frame, page, parameters.paper)
    # Nothing is drawn: one white pixel has the size of the view.
    blank = np.broadcast_to(np.full((1, 1, 3), 255, np.uint8), (frame.height, frame.width, 3))
    printed = None if text is None else PrintSample(text.characters, print_heights(text.text) / text.factor)
    turn = Orientation(0, False, None)
    described = describe_page(page, blank, frame, turn, page.notices, clock, printed, (kept, None))
    return replace(described, stretch=stretch)


def _find_text(
    photo: Halves, parameters: RectifyParameters, p: PreviewParameters
) -> tuple[FoundText | None, NoText | None]:
    try:
        return find_text(photo, parameters.region, p.analysis), None
    except NoText as refusal:
        return None, refusal


def _sheet_between_sides(
    outline: SheetOutline | None,
    view: PhotoFrame,
    prior: FocalPrior,
    text: FoundText | None,
    parameters: RectifyParameters,
    p: PreviewParameters,
) -> ShapedPage | None:
    """The sheet by its four sides; None where they are not certain."""
    characters = np.zeros((0, 2)) if text is None else text.characters
    if outline is None or not is_believed(outline, characters):
        return None
    direction = 0.0 if text is None else line_direction(text.characters, p)
    bent = sides_bend(outline) > p.straight_side if parameters.kind == "auto" else parameters.kind == "curved"
    if bent:
        mesh = _bent_sheet(outline, view, prior, direction, p)
        return None if mesh is None else ShapedPage(view, mesh, mesh.notices, outline)
    sheet = read_sides(outline, view, prior)
    if sheet is None or sheet.plane is None:
        return None
    plane = sheet.plane
    if _runs_down(plane, sheet.view, direction):
        # Lines of text run along the sides that the photo shows as left and right.
        turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        plane = replace(plane, plane=replace(plane.plane, rotation=plane.plane.rotation @ turn))
    flat = planar_page(plane, prior, "outline", sheet)
    return ShapedPage(sheet.view, flat, flat.notices, outline)


def _runs_down(plane: OutlinePlane, view: PhotoFrame, direction_rad: float) -> bool:
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
    outline: SheetOutline, view: PhotoFrame, prior: FocalPrior, direction_rad: float, p: PreviewParameters
) -> RidgedPage | None:
    """The mesh between the sides as it is, which the whole work only starts from."""
    whole = complete_corners(outline)
    if whole is None:
        return None
    corners, order = turn_outline(whole, direction_rad)
    corners = view.to_centred(corners)
    sides = tuple(view.to_centred(outline.sides[k].points) for k in order)
    mesh = cylinder_between_sides(corners, sides, prior.log_focal, prior.deviation, p.cells)
    if mesh is None:
        mesh = mesh_between_sides(corners, sides, float(np.exp(prior.log_focal)), p.cells)
    return None if mesh is None else RidgedPage(mesh, mesh, prior.source)


def _page_of_text(
    photo: Halves,
    text: FoundText,
    view: PhotoFrame,
    prior: FocalPrior,
    outline: SheetOutline | None,
    parameters: RectifyParameters,
    clock: StageClock,
    p: PreviewParameters,
    *,
    is_document: bool,
) -> ShapedPage:
    """The page by its text: the photo itself, a plane, or a bent sheet where a short fit explains the text better."""
    with clock.stage("texture_flow"):
        analysis = analyse_text(text, p.analysis)
    if parameters.region is None:
        with clock.stage("text"):
            analysis = _without_facing_page(photo, text, analysis)
    seen: tuple[Notice, ...] = ()
    if analysis.facing_page:
        # The outline of an opened book is not that of a single page.
        seen, outline = (FACING_PAGE,), None
    with clock.stage("shape"):
        flat = None
        if may_be_flat(parameters):
            flat = flat_page(photo, analysis, outline, view, prior, is_document=is_document)
        if flat is not None:
            return flat
        evidence = analysis.evidence(view)
        seems = apparent_kind(evidence, parameters.kind)
        if seems == "curved":
            plane = PlaneMap(start_plane(evidence, prior, p.pose).H_centred_plane)
            bent = bend_quickly(evidence, prior, plane)
            if bent is not None:
                return ShapedPage(view, bent, seen, outline, analysis, evidence.vanishing_points)
        pose = choose_pose(evidence, prior, p.pose)
    notices = (*seen, *pose.notices) if seems == "planar" else (*seen, SEEMS_CURVED, *pose.notices)
    return ShapedPage(view, pose, notices, outline, analysis, evidence.vanishing_points)


def _without_facing_page(photo: Halves, text: FoundText, analysis: PageAnalysis) -> PageAnalysis:
    """`analysis` of the main page, without the text of a facing one."""
    major, minor = analysis.major, analysis.minor
    choice = choose_page(photo, text.characters, text.text_height_px, major, minor, text.paper)
    if not choice.facing_page:
        return analysis
    # What was measured beside a character of the page is the page's: nothing is measured again.
    nearest = cKDTree(text.characters)

    def own(samples: FlowSamples) -> FlowSamples:
        return samples.select(choice.kept[nearest.query(samples.points)[1]])

    return replace(
        analysis,
        text=keep_characters(analysis.text, choice.kept),
        major=own(major),
        minor=None if minor is None else own(minor),
        gutter=choice.gutter_beside(text.characters[choice.kept]),
    )


def line_direction(characters: Points, parameters: PreviewParameters | None = None) -> float:
    """Most frequent direction (rad, up to a half turn) from a character (N, 2) to its nearest neighbours.

    Characters of a line are nearer to each other than lines, so this is the direction of the lines, to some degrees.
    """
    p = parameters or PreviewParameters()
    _, index = cKDTree(characters).query(characters, k=min(p.neighbours + 1, len(characters)))
    way = (characters[index[:, 1:]] - characters[:, None]).reshape(-1, 2)
    angles = np.arctan2(way[:, 1], way[:, 0]) % np.pi
    width = np.pi / p.direction_bins
    counts = np.bincount((angles / width).astype(int) % p.direction_bins, minlength=p.direction_bins)
    counts = counts + np.roll(counts, 1) + np.roll(counts, -1)
    return float((np.argmax(counts) + 0.5) * width)
