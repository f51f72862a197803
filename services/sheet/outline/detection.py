"""The outline of the sheet in a photo."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain

import cv2
import numpy as np
from scipy.spatial import cKDTree

from services.arrays import Points, RgbImage
from services.geometry.homographies import from_resized
from services.imaging.reduction import Halves
from services.sheet.outline.band_beyond import band_side, is_seen_whole, round_bands
from services.sheet.outline.beyond_photo import follow_to_border
from services.sheet.outline.candidates import (
    PARTED,
    Candidate,
    CandidateParameters,
    find_candidates,
    improve_candidate,
)
from services.sheet.outline.corners import (
    Corners,
    guide_sides,
    locate_corners,
    meet_sides,
    split_sides,
)
from services.sheet.outline.cut_corners import end_before_cut_corners
from services.sheet.outline.edges import (
    EdgePoints,
    follow_edge,
    leave_out_border,
    leave_out_strays,
    measure_closed_edge,
    measure_sides,
    resample_closed,
)
from services.sheet.outline.print_place import place_print
from services.sheet.outline.reduced_photo import LEAST_SIDE_PX, ReducedPhoto, medium_photo, reduce_photo
from services.sheet.outline.results import (
    BELIEVED_CONFIDENCE,
    CERTAIN_CONFIDENCE,
    LEAST_CONFIDENCE,
    SIDE_POINTS,
    SheetOutline,
    SheetSide,
)
from services.sheet.outline.scoring import rate_curve, rate_outline
from services.sheet.outline.smooth_sides import smooth_sides

SAME_PX = 2.0
"""Pixels of the reduced photo. Where a curve is not further from a better one it is followed to the same edge, which is
sought that far to either side ..."""
SAME_SHARE = 0.9
"""... and where this share of it is, and nothing is four times as far off, a believed outline is the better one."""
RATED_SHARE = 0.5
"""Of the photo, as which a smaller sheet is rated where nothing outside of it is looked for."""
INNER_AREA = 0.99
"""Share of the area of an outline, of one that lies inside of it and leaves out a band of the page."""
INNER_ODDS = 3.0
"""Such an outline must have higher odds by this factor: the border of a heading on a ground of its own is an edge too,
and the better one, if the ground is paler."""
DENSER = 8
"""Points of a curve that others are compared with, for each of its own."""


@dataclass(frozen=True, slots=True)
class OutlineParameters:
    """Where candidates are searched, and when the search ends."""

    candidates: CandidateParameters = field(default_factory=CandidateParameters)
    improved: bool = True
    """Whether curves near the best candidate are searched too: a fifth of the time, for sheets whose parts differ."""
    tried: int = 7
    """Candidates that are measured in the photo, until one is certain: they are better evidence than ratings."""
    follows: bool = True
    """Whether sides of a sheet with print are followed to the photo's border: print must show that there is a sheet."""
    well_rated: float = 0.75
    """A candidate with this rating leaves no doubt about where the sheet is."""
    least_rating: float = 0.0
    """Candidates with a lower rating are not measured, ..."""
    most_cut: float = 0.5
    """... nor are those of which the photo cuts off a larger share: no candidate with more than 0.39 was believed on
    143 photos."""


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredOutline:
    """The `outline` near a `candidate`; its four sides, `ended` where they run along the end of the photo.

    `goes_on` says that two sides were followed to the photo's border, beyond which the sheet goes on.
    """

    outline: SheetOutline
    candidate: Candidate
    ended: tuple[EdgePoints, ...]
    goes_on: bool = False

    @property
    def confidence(self) -> float:
        """That of the outline, 0-1, as outlines of one photo are compared."""
        return self.outline.confidence

    @property
    def odds(self) -> float:
        """That the outline is right, to that it is wrong."""
        return self.confidence / max(1.0 - self.confidence, 1e-9)


_Measure = Callable[[Candidate], MeasuredOutline | None]


def find_outline(
    photo: RgbImage | Halves,
    characters: Points | None = None,
    parameters: OutlineParameters | None = None,
    reduced: ReducedPhoto | None = None,
) -> SheetOutline | None:
    """The sheet's boundary in `photo` (H, W, 3); None where no sheet's edge is seen.

    Parameters
    ----------
    characters
        (N, 2) centres of printed characters, photo pixels, where text was found.
    reduced
        What `reduce_photo` makes of the photo, where that is known.
    """
    p = parameters or OutlineParameters()
    halves = Halves.of(photo)
    if min(halves.image.shape[:2]) < LEAST_SIDE_PX:
        return None
    reduced = reduced or reduce_photo(halves)
    candidates: list[Candidate] = []
    on_sheet: Points = np.zeros((0, 2))
    # Print shows that there is a sheet: without, furniture parts the colours as well.
    parted = 0.0 if characters is None else PARTED
    for print_places in (characters, None):
        place = place_print(reduced, print_places)
        on_sheet = place.characters if len(place.characters) else on_sheet
        rate = partial(rate_curve, reduced, place.characters)
        candidates += find_candidates(reduced, place, rate, p.candidates, parted)
        candidates.sort(key=lambda c: c.rank, reverse=True)
        # Texture of a desk may have been found as print; then the middle of the photo is the better start.
        certain = candidates[0].rating >= p.well_rated or candidates[0].cut > p.candidates.most_cut
        if certain or characters is None:
            break
    if p.improved and candidates[0].cut <= p.most_cut:
        candidates += improve_candidate(reduced, candidates[0], rate, p.candidates, parted)
    candidates.sort(key=lambda c: c.rank, reverse=True)
    # One curve is often found twice.
    distinct = [c for k, c in enumerate(candidates) if k == 0 or candidates[k - 1].rating != c.rating]
    sought = [c for c in distinct[: p.tried] if c.rating >= p.least_rating and c.cut <= p.most_cut]
    if not sought:
        return None
    measure = partial(
        measure_candidate,
        halves.image,
        reduced,
        medium_photo(halves),
        parameters=p,
        shows_print=len(on_sheet) > 0,
    )
    best = _surest(sought, measure, lambda measured: _rate_of_view(measured, reduced, on_sheet))
    if best is None:
        return None
    if len(on_sheet):
        best = _with_band(best, sought, halves.image, reduced, rate, measure)
        best = _rate_of_view(best, reduced, on_sheet)
    outline = best.outline
    return None if outline.confidence < LEAST_CONFIDENCE else end_before_cut_corners(outline)


def _surest(
    sought: list[Candidate], measure: _Measure, rate_of_view: Callable[[MeasuredOutline], MeasuredOutline]
) -> MeasuredOutline | None:
    """The surest outline near the candidates that are `sought`; they are measured until one is certain."""
    best: MeasuredOutline | None = None
    found: list[cKDTree] = []
    for candidate in sought:
        if any(_is_same(candidate, known) for known in found):
            continue
        measured = measure(candidate)
        if measured is not None and measured.goes_on:
            measured = rate_of_view(measured)
        if measured is not None and measured.confidence >= BELIEVED_CONFIDENCE:
            found.append(cKDTree(resample_closed(candidate.curve, DENSER * len(candidate.curve))))
        if measured is not None and (best is None or is_surer(measured, best)):
            best = measured
        if best is not None and best.confidence >= CERTAIN_CONFIDENCE:
            break
    return best


def _with_band(
    best: MeasuredOutline,
    sought: list[Candidate],
    photo: RgbImage,
    reduced: ReducedPhoto,
    rate: Callable[[Points], float],
    measure: _Measure,
) -> MeasuredOutline:
    """The `best` outline, or one round a band beside it, of those that were `sought` or that its sides lead to."""
    if not is_seen_whole(best.outline):
        return best
    sides = [side.points for side in best.outline.sides]
    on_reduced = [reduced.from_photo(side) for side in sides]
    window = reduced.window_of(photo.shape, 1.0)
    led = (reduced.from_photo(curve) for curve in round_bands(photo, best.ended, window))
    found: list[tuple[MeasuredOutline, int]] = []
    for candidate in chain(sought, (Candidate(curve, rate(curve), 0.0) for curve in led)):
        if band_side(candidate.curve, on_reduced) is None:
            continue
        measured = measure(candidate)
        if measured is not None and is_seen_whole(measured.outline):
            band = band_side(measured.outline.polygon, sides)
            found += [] if band is None else [(measured, band)]
    if not found:
        return best
    outer, band = max(found, key=lambda each: each[0].confidence)
    # Where there is no band the first outline is the better one.
    others = [best.ended[(band + n) % 4].points for n in (1, 2, 3)]
    curve = reduced.from_photo(np.concatenate([*others, outer.ended[band].points]))
    joined = measure(Candidate(curve, rate(curve), 0.0))
    if joined is None or not is_seen_whole(joined.outline):
        return outer
    return joined if band_side(joined.outline.polygon, sides) == band else outer


def _rate_of_view(measured: MeasuredOutline, reduced: ReducedPhoto, on_sheet: Points) -> MeasuredOutline:
    """The outline with a confidence to which size, and what is out of view, say nothing.

    They tell which of two outlines is the sheet's, not whether one that holds the print (N, 2), `on_sheet`, is.
    """
    curve, goes_on = measured.candidate.curve, measured.goes_on
    if goes_on:
        curve = reduced.from_photo(measured.outline.polygon)
    rating = rate_curve(reduced, on_sheet, curve, RATED_SHARE, of_view=goes_on)
    candidate = replace(measured.candidate, rating=max(measured.candidate.rating, rating))
    confidence = rate_outline(
        measured.ended, measured.outline.corners, candidate.rating, of_view=True, goes_on=goes_on
    )
    outline = replace(measured.outline, confidence=confidence)
    return replace(measured, outline=outline, candidate=candidate)


def is_surer(measured: MeasuredOutline, best: MeasuredOutline) -> bool:
    """Whether an outline is taken in place of the `best` one so far: one inside of that must be clearly surer."""
    inner = best.confidence >= LEAST_CONFIDENCE and _area(measured) < INNER_AREA * _area(best)
    return measured.odds > (INNER_ODDS if inner else 1.0) * best.odds


def _area(measured: MeasuredOutline) -> float:
    return float(cv2.contourArea(measured.outline.polygon.astype(np.float32)))


def _is_same(candidate: Candidate, known: cKDTree) -> bool:
    """Whether a candidate runs along a curve that was measured, of which there are dense points."""
    apart = known.query(candidate.curve)[0]
    return bool(np.quantile(apart, SAME_SHARE) <= SAME_PX and apart.max() <= 4 * SAME_PX)


def measure_candidate(
    photo: RgbImage,
    reduced: ReducedPhoto,
    medium: tuple[RgbImage, float],
    candidate: Candidate,
    parameters: OutlineParameters | None = None,
    *,
    shows_print: bool = False,
) -> MeasuredOutline | None:
    """The outline near a candidate, measured in the photo; None when it has no four sides.

    `medium` is the photo and its factor at which edges are followed before they are measured. A sheet that
    `shows_print` may go on beyond the photo; without, that is furniture.
    """
    p = parameters or OutlineParameters()
    half, f = medium
    start = (reduced.to_photo(candidate.curve) + 0.5) * f - 0.5
    window = reduced.window_of(half.shape, f)
    followed = follow_edge(half, start, window)
    edge = measure_closed_edge(half, followed, window)
    corners = split_sides(edge.points, edge.shown)
    if corners is None:
        return None
    order = _from_top_left(edge.points[corners.indices])
    corners = Corners(corners.indices[order], corners.misfit, corners.turns_rad[order])
    located = locate_corners(edge, corners)
    known = np.isfinite(located[:, 0])
    diagonal = float(np.linalg.norm(np.ptp(edge.points, axis=0))) / f
    window = reduced.window_of(photo.shape, 1.0)
    guides = guide_sides(edge, corners, located)
    smooth = smooth_sides(edge, corners)
    in_photo = [from_resized(guide, f) for guide in [*guides, *(smooth or [])]]
    measured = measure_sides(photo, in_photo, diagonal, window)
    measured, tried = measured[:4], measured[4:]
    if tried:
        chosen = np.array([t.support >= m.support for t, m in zip(tried, measured, strict=True)])
        measured = [t if better else m for t, m, better in zip(tried, measured, chosen, strict=True)]
        known = known | chosen | np.roll(chosen, 1)
    follows = shows_print and p.follows
    beyond = follow_to_border(photo, measured, diagonal, window) if follows else None
    if beyond is not None:
        measured, lost = beyond
        known[[k for side in lost for k in (side, (side + 1) % 4)]] = False
    if shows_print:
        measured = [leave_out_strays(side, diagonal, window) for side in measured]
    located = meet_sides(measured, known)
    sides = [_side(m) for m in measured]
    ended = [leave_out_border(side, diagonal, window) for side in measured] if shows_print else measured
    pieces = []
    for corner, m in zip(located, ended, strict=True):
        pieces += [corner[None]] if np.isfinite(corner).all() else []
        pieces.append(m.points)
    polygon = _inside(np.concatenate(pieces), window)
    confidence = rate_outline(ended, located, candidate.rating)
    outline = SheetOutline(located, (sides[0], sides[1], sides[2], sides[3]), confidence, polygon)
    return MeasuredOutline(outline, candidate, tuple(ended), beyond is not None)


def _inside(points: Points, window: tuple[float, float, float, float]) -> Points:
    return np.clip(points, np.array(window[:2]), np.array(window[2:]))


def _from_top_left(corners: Points) -> np.ndarray:
    """Order of clockwise `corners` (4, 2) that begins at the top left one."""
    first = int(np.argmin(corners.sum(axis=1)))
    return (first + np.arange(4)) % 4


def _side(edge: EdgePoints) -> SheetSide:
    """A side's seen points, about `SIDE_POINTS` of them when it is seen whole."""
    step = max(round(len(edge.points) / SIDE_POINTS), 1)
    kept = np.flatnonzero(edge.seen)
    kept = kept[(kept % step) == step // 2]
    points = edge.points[kept]
    straightness = 0.0
    if len(points) > 2:
        straightness = float(
            np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] / np.sqrt(len(points))
        )
    return SheetSide(points, edge.deviations[kept], float(edge.seen.mean()), straightness)
