"""Which text belongs to the page: what lies beyond a gutter, or beyond the sheet's edge, is left out.

A photo of an opened book shows part of the facing page, whose text has another direction and lies on another surface.
Text is taken to lie on two pages only if there is a long edge of brightness between them (a gutter, a shadow, the rim
of a page) that continues beyond the text, what is beyond it forms lines, and there is another sign: the lines change
their direction across it, or the text beyond it is cut off by the end of the photo. Beyond the edge of a receipt there
may be many specks of a desk, whose grain has its own direction and reaches the end of the photo. Flat columns have no
other sign. Columns of a page that is bent strongly between them, or in whose gutter a shadow ends, may have all; but
they are set closer together than two pages, between which there are two margins.
"""

from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Points, RgbImage, Vector
from services.geometry.homographies import from_resized, to_resized
from services.imaging.channels import log_brightness
from services.imaging.long_edges import LONG_SIDE_PX, LongEdge, LongEdgeParameters, find_long_edges
from services.imaging.paper import Paper, PaperParameters
from services.imaging.reduction import Halves, reduce_image
from services.order_statistics import percentile
from services.rectify.analysis.found_text import STRAY_SHARE
from services.rectify.analysis.gutter import (
    PAGE_GAP,
    Gutter,
    direction_jump,
    find_gutter,
    row_gap,
)
from services.rectify.analysis.photo_border import NEAR_BORDER
from services.sheet.tracing.baselines import chain_boxes
from services.side_by_side import SideStep
from services.texture_flow.field import FlowSamples, angle_difference
from services.texture_flow.text_identification import FEWEST_CHARACTERS

Chosen = NDArray[np.bool_]


EDGES = LongEdgeParameters(contrast=0.05, noise_factor=0.0, candidates=60, sheet_on_either_side=True)
SAME_PAPER = PaperParameters(text_contrast=0.35)


# Lengths are multiples of the text height, contrasts differences of the logarithm of brightness.
SLOPES = (-0.2, 0.0, 0.2)
"""Of edges against the strokes; an edge may lean by 0.14 more."""
NEAR = 0.5
NEAR_SHARE = 0.004
"""Largest share of the characters that are nearer than `near` to an edge between pages."""
FEW = 0.03
"""A smaller share of the characters is not a page."""
FEW_ON_DESK = 0.1
"""Neither is a smaller share that does not lie on paper like the main page's."""
FEW_CONTRAST = 0.3
"""Few characters are left out when the ground beyond the edge differs by this from the paper before it."""
CUT_CONTRAST = 0.1
"""Least contrast of an edge, if the text beyond it is cut off by the end of the photo."""
JUMP_RAD = float(np.deg2rad(8.0))
COLUMN_JUMP_RAD = float(np.deg2rad(30.0))
"""Unless the lines change their direction by this: bent columns show up to 24 degrees."""
CUT_SHARE = 0.3
"""Of a page's lines that are cut off."""
CUT_WORTH = 0.5
"""Of a character on a page that is cut off, when the main page is chosen."""
IN_LINES = 0.4
"""Least share of the characters of a facing page that form lines, along its own direction and along the main page's.
On 17 facing pages 0.57 to 0.94, on two of which 25 letters are seen 0.24; grain of desks 0.0 to 0.26, ..."""
MOST_TURN_RAD = float(np.deg2rad(60.0))
"""... and 0.15 and 0.45 where its direction differs from that of the main page by 80 and 70 degrees: facing pages lean
by 48 degrees at most."""
SAME_PAPER_SHARE = 0.5
"""Of the characters beyond an edge, when they lie on paper like the main page's."""


@dataclass(frozen=True, slots=True, eq=False)
class PageChoice:
    """Which characters (N,) are on the main page, and which on the facing page, if one was found.

    `gutters` are lines (M, 2) between both pages in photo pixels, from end to end of the photo. Edges of a shadow or of
    a page stack are among them.
    """

    kept: Chosen
    facing: Chosen
    gutters: tuple[Points, ...] = ()

    @property
    def facing_page(self) -> bool:
        """Whether a facing page was found."""
        return len(self.gutters) > 0

    def gutter_beside(self, page: Points) -> Points | None:
        """Of the gutters the one farthest from the text `page` (N, 2): nothing of its page lies beyond that."""
        middle = page.mean(axis=0)
        return max(
            self.gutters, key=lambda line: float(np.linalg.norm(line - middle, axis=1).min()), default=None
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Text:
    """Characters (N, 2) and major flow in photo pixels, of `height` px, in a photo of `size` (width, height).

    `boxes` (N, 2) are widths and heights of the characters, photo pixels; `direction` (rad) is that of text lines.
    """

    characters: Points
    boxes: Floats
    height: float
    major: FlowSamples
    size: tuple[int, int]
    direction: float


@dataclass(frozen=True, slots=True, eq=False)
class _Divide:
    """A long edge, its `line` (K, 2), and the signed distance from it of characters (N,) and flow samples (M,).

    All in photo pixels; rows are distances along it.
    """

    edge: LongEdge
    line: Points
    characters: Vector
    character_rows: Vector
    samples: Vector
    sample_rows: Vector


def choose_page(
    photo: RgbImage | Halves,
    characters: Points,
    boxes: Floats,
    text_height_px: float,
    major: FlowSamples,
    minor: FlowSamples | None,
    paper: Paper,
    *,
    is_spread: bool = False,
) -> PageChoice:
    """Choose the characters of the main page, and those of a facing page.

    Parameters
    ----------
    photo
        (H, W, 3) RGB.
    characters
        (N, 2) centres in photo pixels.
    boxes
        (N, 2) widths and heights of the characters in photo pixels.
    text_height_px
        Size of the characters.
    major, minor
        Texture flows in photo pixels; `minor` is None where no strokes were found.
    paper
        The paper that the text is on.
    is_spread
        The photo is known to show an opened book: then a gutter is searched also where no long edge shows it.

    Returns
    -------
    PageChoice
        Which characters are on which page, and the lines between the pages.
    """
    halves = Halves.of(photo)
    size = (halves.image.shape[1], halves.image.shape[0])
    direction = _reading_direction(major, minor)
    text = _Text(characters, boxes, text_height_px, major, size, direction)
    divides = _divides(halves, text)
    everything = np.ones(len(characters), bool)
    choice = _divide(everything, divides, text, paper)
    if is_spread and not choice.facing_page:
        gutter = find_gutter(halves.image, characters, text_height_px, major, direction)
        choice = choice if gutter is None else _split(gutter, choice.kept, text)
    if choice.facing_page:
        # Characters beyond the facing page's own edges are not on it.
        facing = choice.facing & _divide(choice.facing, divides, text, paper).kept
        return PageChoice(choice.kept, facing, choice.gutters)
    if (~choice.kept).sum() <= STRAY_SHARE * len(characters):
        return PageChoice(everything, choice.facing)
    return choice


def _divide(candidates: Chosen, divides: list[_Divide], text: _Text, paper: Paper) -> PageChoice:
    """The main page among the `candidates` (N,), and the facing page."""
    kept, facing = candidates.copy(), np.zeros(len(candidates), bool)
    gutters: tuple[Points, ...] = ()
    smaller = [min((d.characters < 0).sum(), (d.characters > 0).sum()) for d in divides]
    for k in np.argsort(smaller)[::-1]:
        right = divides[k].characters > 0
        sides = (kept & ~right, kept & right)
        if not sides[0].any() or not sides[1].any():
            continue
        main, other = sorted(sides, key=lambda side: -_worth(side, text))
        if main.sum() < FEWEST_CHARACTERS:
            continue
        on_paper = float(paper.holds(text.characters[other], SAME_PAPER).mean()) >= SAME_PAPER_SHARE
        is_few = other.sum() <= (FEW if on_paper else FEW_ON_DESK) * len(candidates)
        if is_few and divides[k].edge.ground_differs(FEW_CONTRAST):
            kept &= ~other
        elif not is_few and _is_another_page(divides[k], other, text):
            kept &= ~other
            if not _forms_lines(divides[k], other, text):
                continue
            # Edges are sorted by how well they separate the pages: the first one is the gutter.
            if not gutters:
                facing, gutters = other, _lines_between(main, other, divides)
    return PageChoice(kept, facing, gutters)


def _lines_between(main: Chosen, other: Chosen, divides: list[_Divide]) -> tuple[Points, ...]:
    """All divides that have the one page on one side and the other on the other."""
    lines = []
    for divide in divides:
        beyond = (divide.characters > 0) == (float(np.median(divide.characters[other])) > 0)
        if beyond[other].all() and not beyond[main].any():
            lines.append(divide.line)
    return tuple(lines)


def _split(gutter: Gutter, kept: Chosen, text: _Text) -> PageChoice:
    sides = (kept & ~gutter.right, kept & gutter.right)
    main, other = sorted(sides, key=lambda side: -_worth(side, text))
    return PageChoice(main, other, (gutter.line,))


def _reading_direction(major: FlowSamples, minor: FlowSamples | None) -> float:
    """Mean direction of text lines, rad: across the strokes where they were seen, since gutters run along these."""
    flow, turn = (major, 0.0) if minor is None or len(minor) < 4 else (minor, np.pi / 2)
    return _mean_direction(flow, turn)


def _mean_direction(flow: FlowSamples, turn: float = 0.0) -> float:
    """Mean direction of a flow, turned by an angle; rad."""
    return 0.5 * float(np.angle(np.sum(flow.weights * np.exp(2j * (flow.angles + turn)))))


def _divides(photo: Halves, text: _Text) -> list[_Divide]:
    """Long edges across the text lines, near to which there are almost no characters."""
    factor = min(1.0, LONG_SIDE_PX / max(text.size))
    small = reduce_image(photo, factor, least_side_px=8, fine=False)
    brightness = log_brightness(small)
    cos, sin = np.cos(text.direction), np.sin(text.direction)

    def divides_at(slope: float) -> list[_Divide]:
        return _divides_along(brightness, factor, text, (cos, sin), slope)

    others = [SideStep(partial(divides_at, slope)) for slope in SLOPES[1:]]
    return divides_at(SLOPES[0]) + [divide for step in others for divide in step.result()]


def _divides_along(
    brightness: NDArray[np.float32], factor: float, text: _Text, direction: tuple[float, float], slope: float
) -> list[_Divide]:
    """Those of about this `slope` against the strokes, in the `brightness` (h, w) of the photo resized by `factor`.

    `direction` is the cosine and sine of the text lines' direction.
    """
    size = (brightness.shape[1], brightness.shape[0])
    cos, sin = direction
    found = []
    A = np.array([[1.0, -slope], [0.0, 1.0]]) @ np.array([[cos, sin], [-sin, cos]])
    corners = np.array([[0, 0], [size[0], 0], [0, size[1]], size]) @ A.T
    low = corners.min(axis=0)
    width, height = (int(v) for v in np.ceil(corners.max(axis=0) - low))
    turn = np.column_stack([A, -low])
    turned = cv2.warpAffine(brightness, turn, (width, height), flags=cv2.INTER_LINEAR)
    inside = np.pad(np.ones((size[1] - 4, size[0] - 4), np.uint8), 2)
    shown = cv2.warpAffine(inside, turn, (width, height), flags=cv2.INTER_NEAREST).astype(bool)

    def place(points: Points) -> Points:
        return np.asarray(to_resized(points, factor) @ A.T - low)

    def replace(points: Points) -> Points:
        return from_resized((points + low) @ np.linalg.inv(A).T, factor)

    at, samples = place(text.characters), place(text.major.points)
    along = (float(percentile(at[:, 1], 2)), float(percentile(at[:, 1], 98)))
    for edge in find_long_edges(np.asarray(turned), shown, along, width, EDGES):
        away = (at[:, 0] - edge.at(at[:, 1])) / factor
        if (np.abs(away) < NEAR * text.height).sum() <= NEAR_SHARE * len(at):
            across = (samples[:, 0] - edge.at(samples[:, 1])) / factor
            rows = np.linspace(0, height - 1, 60)
            line = replace(np.column_stack([edge.at(rows), rows]))
            found.append(_Divide(edge, line, away, at[:, 1] / factor, across, samples[:, 1] / factor))
    return found


def _at_end_of_photo(side: Chosen, text: _Text) -> float:
    """Share of the lines of a page's characters that reach the end of the photo."""
    points, reach = text.characters[side], NEAR_BORDER * text.height
    last = np.array(text.size) - 1
    share = 0.0
    for axis in (0, 1):
        lines = np.floor(points[:, 1 - axis] / reach)
        for near in (points[:, axis] < reach, points[:, axis] > last[axis] - reach):
            share = max(share, len(np.unique(lines[near])) / len(np.unique(lines)))
    return share


def _worth(side: Chosen, text: _Text) -> float:
    """How much of the photo's subject a page is: its characters, less when it is cut off or far from the middle."""
    if not side.any():
        return 0.0
    middle = np.array(text.size) / 2
    away = np.linalg.norm(text.characters[side].mean(axis=0) - middle) / np.linalg.norm(middle)
    whole = CUT_WORTH if _at_end_of_photo(side, text) > CUT_SHARE else 1.0
    return float(side.sum() * whole * np.exp(-(away**2)))


def _forms_lines(divide: _Divide, other: Chosen, text: _Text) -> bool:
    """Whether what lies beyond an edge forms lines: in the direction of the page before it, and in its own."""
    beyond = np.sign(divide.samples) == np.sign(np.median(divide.characters[other]))
    own = text.major.select(beyond)
    direction = _mean_direction(own) if len(own) else text.direction
    if np.abs(angle_difference(np.asarray(direction), text.direction)) > MOST_TURN_RAD:
        return False
    return all(_share_in_lines(text, other, angle) >= IN_LINES for angle in (text.direction, direction))


def _share_in_lines(text: _Text, chosen: Chosen, direction_rad: float) -> float:
    """Share of the `chosen` characters (N,) that stand in lines along a direction."""
    cos, sin = np.cos(direction_rad), np.sin(direction_rad)
    centres = text.characters[chosen] @ np.array([[cos, -sin], [sin, cos]])
    sizes = text.boxes[chosen] @ np.abs([[cos, -sin], [sin, cos]])
    rows = chain_boxes(np.column_stack([centres - sizes / 2, sizes])).rows
    return sum(map(len, rows)) / len(centres)


def _is_another_page(divide: _Divide, other: Chosen, text: _Text) -> bool:
    """Whether the lines change their direction at the edge, or those beyond it are cut off."""
    jump = direction_jump(divide.samples, divide.sample_rows, text.major, text.height)
    if row_gap(divide.characters, divide.character_rows, text.height) < PAGE_GAP:
        return jump > COLUMN_JUMP_RAD
    if jump > JUMP_RAD:
        return True
    cut_off = _at_end_of_photo(other, text) > CUT_SHARE
    return cut_off and divide.edge.ground_differs(CUT_CONTRAST)
