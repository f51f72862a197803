"""The hypothesis that the photo is the flat page already, but for a turn: what must be beaten before a page is bent.

Scans, screenshots, pages of PDFs and pages that an app has cropped are flat and fill their pictures. A plane or a bent
sheet that is fitted to them follows the noise of their print. So the photo itself is the first hypothesis. It loses
only by evidence beyond that evidence's own noise: sides of a sheet in view, lines or strokes that converge, lines that
bend.
"""

from dataclasses import replace

import numpy as np

from services.contract.rectify import Origin, RectifyParameters, Rotation, TypesetPage
from services.geometry.focal_prior import FocalPrior
from services.geometry.page_map import PlaneMap
from services.geometry.photo_frame import PhotoFrame
from services.imaging.channels import luminance
from services.imaging.drawn_edges import drawn_box, is_drawn
from services.imaging.ground import Ground, find_ground
from services.imaging.illumination import divide_by_light, reduced_light
from services.imaging.reduction import Halves, reduce_image
from services.rectify.analysis.found_text import AnalysisParameters
from services.rectify.analysis.page_analysis import PageAnalysis
from services.rectify.analysis.photo_border import HUGGING
from services.rectify.analysis.slanted_print import without_slanted_print
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.shape_choice.text_check import SHEET_CONFIDENCE, is_level_in_view
from services.sheet.evidence import PageEvidence
from services.sheet.outline.results import BELIEVED_CONFIDENCE, WHOLE_SIDE, SheetOutline
from services.sheet.plane.departure import Departure, Measured, measure_departure, perspective_by_flow
from services.sheet.plane.flat_photo import PhotoAsPage
from services.sheet.plane.flat_text import flatten_text
from services.sheet.plane.pose import level_plane
from services.sheet.ridged_page import sides_bend
from services.sheet.tracing.level_rows import shows_print
from services.sheet.tracing.line_tracing import FEW_LINES
from services.sheet.tracing.page_lines import with_rules
from services.texture_flow.text_identification import detect_ink

# What beats the hypothesis. Perspective and bends are RMS displacements of the print as shares of the width.
VISIBLE = 0.0023
"""On 25 pages that an app has cropped, and an old book on a scanner, perspective moves the print by up to 0.0022, a
bend by up to 0.0014; on photos that are visibly not flat both together do by 0.0024 and more."""
DEVIATIONS = 4.0
"""Standard deviations that it must have too: neighbouring directions share ink, so these are too small."""
CLEAR_FLOW = 3.0
"""If the directions of the text alone show so many times that, no line is traced."""
VISIBLE_TURN_RAD = float(np.deg2rad(0.5))
"""A page that is turned by less keeps its own pixels."""
MOST_TURN_RAD = float(np.deg2rad(15.0))
"""Of a page that fills its picture; print that is turned by more is slanted on its page."""
WHOLE_CONFIDENCE = 0.7
"""... or this one, where all of its sides were seen nearly from end to end: gently bent sheets on a desk have 0.79 to
0.86 and all of them. Of 54 scans and cropped pages 52 have no outline, and those of two lie along the photo's frame. Of
a sheet that goes on beyond the photo, whose other sides are seen so far, a believed outline is enough."""

BENT_RIM = 0.01
"""RMS bend of a sheet's side, as a share of its size, from which on it is seen at the frame, too: cropped pages and
scans have up to 0.0066, a crumpled sheet that fills its photo 0.028."""


def may_be_flat(parameters: RectifyParameters) -> bool:
    """Whether the photo itself may be the page: neither a bent page nor a part of the photo is asked for."""
    return parameters.kind != "curved" and parameters.region is None


def flat_page(
    photo: Halves,
    analysis: PageAnalysis,
    outline: SheetOutline | None,
    view: PhotoFrame,
    prior: FocalPrior,
    *,
    origin: Origin,
) -> ShapedPage | None:
    """The `photo` as the page itself; None if the evidence shows another shape.

    `analysis` is that of its text, `outline` the sheet's if one was found, `prior` that of the focal length. A picture
    that a program has drawn has no perspective, and no turn but a quarter.
    """
    drawn = origin == "photo" and is_drawn(photo.image)
    typeset = isinstance(origin, TypesetPage)
    certain = drawn or typeset
    in_view = sheet_in_view(outline, view, origin=origin) and not ends_at_band(photo, outline)
    if (analysis.facing_page and not typeset) or (in_view and not certain):
        return None
    evidence = without_slanted_print(analysis).evidence(view)
    plane = level_plane(evidence.major, prior)
    skew = float(np.arctan2(plane.rotation[1, 0], plane.rotation[0, 0]))
    upright = _from_axis(skew)
    if abs(upright) > MOST_TURN_RAD and not drawn:
        # Print that is aslant on an upright page, or an upright photo of a page that lies aslant?
        return blank_flat_page(photo, outline, view, prior, origin=origin)
    flow = perspective_by_flow(evidence.major, evidence.characters, view, skew)
    if not certain and flow is not None and _is_sure(flow, CLEAR_FLOW * VISIBLE):
        return None
    lines = flatten_text(evidence.text, view, plane).lines
    # Rules and staff lines bend where few lines of text show it.
    print_lines = with_rules(lines, evidence.text, view, PlaneMap(plane.H_centred_plane))
    departure = measure_departure(
        print_lines, evidence.strokes, evidence.characters, view, skew, analysis.text_height_px
    )
    if not certain and is_beaten(departure):
        return None
    # Of light print on dark paper the negative has the ground: what is dark and narrow on paper is print.
    printed = photo if analysis.positive is None else Halves(np.asarray(255 - photo.image, np.uint8))
    ground, count = find_ground(printed), lines.count // 2
    shape = _flat_photo(ground, departure.skew_rad, count, view, prior, origin=origin)
    if drawn:
        turn = shape.turn_rad - _from_axis(shape.turn_rad)
        corners = None if outline is None else np.asarray(outline.polygon)
        shape = replace(shape, turn_rad=turn, box=drawn_box(photo.image, corners), keeps_size=True)
    if origin == "photo" and not _is_print(photo, evidence, shape, ground):
        return None
    hugging = outline if not drawn and outline is not None and _hugs_frame(outline, view) else None
    return ShapedPage(
        view,
        shape,
        (),
        hugging,
        analysis,
        evidence.vanishing_points,
        ground=_paper(ground, shape),
        departure=0.0 if certain else sure_departure(departure),
        turn=_turn(origin),
    )


def blank_flat_page(
    photo: Halves,
    outline: SheetOutline | None,
    view: PhotoFrame,
    prior: FocalPrior,
    *,
    origin: Origin,
) -> ShapedPage | None:
    """The `photo` as the page itself, whose text shows no direction; None if it is not known to be a page.

    A page of a PDF is one without any text; another picture must have level print on one ground.
    """
    if origin == "photo" and sheet_in_view(outline, view, origin=origin):
        return None
    ground = find_ground(photo)
    if origin == "photo" and (ground is None or not photo_shows_print(photo)):
        return None
    shape = _flat_photo(ground, 0.0, 0, view, prior, origin=origin)
    return ShapedPage(view, shape, (), ground=_paper(ground, shape), turn=_turn(origin))


def _turn(origin: Origin) -> Rotation | None:
    """The clockwise turn after which a printed page is upright."""
    return origin.turn if isinstance(origin, TypesetPage) else None


def sheet_in_view(outline: SheetOutline | None, view: PhotoFrame, *, origin: Origin) -> bool:
    """Whether the sides of a sheet are in view, and not only slivers of a desk at the photo's frame.

    Of a sheet that is clearly bent all round, they are seen at the frame as well.
    """
    if outline is None:
        return False
    in_view = [side.seen for side in outline.sides if side.seen > 0.0]
    least = SHEET_CONFIDENCE
    all_seen = min(side.seen for side in outline.sides) >= WHOLE_SIDE
    if all_seen:
        least = WHOLE_CONFIDENCE
    elif min(in_view, default=0.0) >= WHOLE_SIDE:
        least = BELIEVED_CONFIDENCE
    if outline.confidence < least:
        return False
    if _hugs_frame(outline, view) and not (all_seen and sides_bend(outline) > BENT_RIM):
        return False
    if origin == "photo":
        return True
    # Sides along the axes of a page of a PDF are those of a picture on it.
    ways = np.roll(outline.corners, -1, axis=0) - outline.corners
    slopes = np.abs(ways).min(axis=1) / np.maximum(np.abs(ways).max(axis=1), 1e-9)
    return not bool((slopes < VISIBLE_TURN_RAD).all())


def ends_at_band(photo: Halves, outline: SheetOutline | None) -> bool:
    """Whether a side of the outline is that of a coloured band: it crosses the photo level, and print is beyond it."""
    if outline is None:
        return False
    for k, side in enumerate(outline.sides):
        if not side.seen or outline.sides[k - 1].seen or outline.sides[(k + 1) % 4].seen:
            continue
        # Top and bottom, sides 0 and 2, run along x.
        along, across = side.points[:, k % 2], side.points[:, 1 - k % 2]
        if np.ptp(across) > VISIBLE_TURN_RAD * np.ptp(along):
            continue
        image = photo.image if k % 2 == 0 else photo.image.swapaxes(0, 1)
        beyond = image[: int(across.min())] if k in (0, 3) else image[int(across.max()) + 1 :]
        if len(beyond) and photo_shows_print(Halves(np.ascontiguousarray(beyond))):
            return True
    return False


def is_beaten(departure: Departure) -> bool:
    """Whether the print departs from a flat photo's visibly, by all together that is beyond its noise."""
    found = (departure.by_lines, departure.by_strokes, departure.by_bend)
    return bool(np.linalg.norm([part.value for part in found if part and _is_sure(part, 0.0)]) > VISIBLE)


def sure_departure(departure: Departure) -> float:
    """RMS displacement of the print, as a share of the width, that is beyond the noise of what shows it."""
    found = [
        part for part in (departure.by_lines, departure.by_strokes, departure.by_bend) if part is not None
    ]
    return float(np.sqrt(sum(max(part.value**2 - (DEVIATIONS * part.deviation) ** 2, 0.0) for part in found)))


def _is_print(photo: Halves, evidence: PageEvidence, shape: PhotoAsPage, ground: Ground | None) -> bool:
    """Whether there is print: lines of text or level rows of any print on one ground, or rows of text on any."""
    if ground is None:
        return is_level_in_view(evidence, shape)
    return shape.line_count >= FEW_LINES or photo_shows_print(photo)


def photo_shows_print(photo: Halves) -> bool:
    """Whether level rows of print, dark or light, are seen along one of the photo's axes."""
    gray = luminance(photo.image)
    small = reduce_image(gray, min(1.0, AnalysisParameters().long_side_px / max(gray.shape)))
    for seen in (small, np.asarray(255 - small, np.uint8)):
        ink = detect_ink(divide_by_light(seen, reduced_light(seen)))
        if shows_print(ink) or shows_print(np.ascontiguousarray(ink.T)):
            return True
    return False


def _is_sure(found: Measured, least: float) -> bool:
    """Whether what was found is visible, above `least`, and beyond its noise."""
    return abs(found.value) > max(least, DEVIATIONS * found.deviation)


def _hugs_frame(outline: SheetOutline, view: PhotoFrame) -> bool:
    """Whether each side of the outline lies near the photo's frame."""
    size = np.array([view.width - 1, view.height - 1], np.float64)
    gaps = np.minimum(outline.polygon, size - outline.polygon).min(axis=1)
    return bool(np.percentile(gaps, 95) < HUGGING * max(view.width, view.height))


def _from_axis(angle_rad: float) -> float:
    """`angle_rad` less the nearest quarter turn."""
    return float(angle_rad - np.round(angle_rad / (np.pi / 2)) * np.pi / 2)


def _flat_photo(
    ground: Ground | None,
    skew_rad: float,
    lines: int,
    view: PhotoFrame,
    prior: FocalPrior,
    *,
    origin: Origin,
) -> PhotoAsPage:
    """The photo turned by `skew_rad`, or by the nearest quarter turn where the difference is not visible."""
    off = _from_axis(skew_rad)
    turn = skew_rad if abs(off) > VISIBLE_TURN_RAD else skew_rad - off
    if isinstance(origin, TypesetPage):
        turn = 0.0
    box = None if ground is None else ground.box
    if origin != "photo":
        box = (0, 0, view.width - 1, view.height - 1)
    return PhotoAsPage(turn, float(np.exp(prior.log_focal)), box, lines, keeps_size=origin != "photo")


def _paper(ground: Ground | None, shape: PhotoAsPage) -> Ground | None:
    """The ground where slivers of it are to be left out: not on pages of documents."""
    return None if shape.keeps_size else ground
