"""Text lines traced through a flat view that is not quite flat yet, as observations in the photo.

A first model of the page straightens its lines to about a degree; in that view characters chain into lines as on a
flat page, and what is left of the bend shows in their baselines and x-height lines. Both are followed piecewise and
mapped back to the photo, where they are what the surface is fitted to.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Mask, Points, Vector
from services.geometry.page_map import PageMap
from services.geometry.photo_frame import PhotoFrame
from services.imaging.node_grid import band_nodes, between_nodes, node_grid, take_values
from services.imaging.row_bands import row_bands
from services.order_statistics import median
from services.robust import geman_mcclure_weights
from services.sheet.developable.observations import NO_LINES, LineObservations, Run
from services.sheet.tracing.baselines import (
    BATCH,
    EDGE_ROUNDS,
    MIN_LENGTH,
    Baselines,
    CharacterRows,
    chain_characters,
    find_margins,
    group_alike,
    group_paragraphs,
)
from services.sheet.tracing.page_text import TracedText

FEW_LINES = 10
"""Fewer lines show little of a page's shape."""
STRAIGHT = 0.04
"""RMS deviation of text lines from straight ones, in text heights, that flat pages have too; it is not visible."""
NO_WORSE = 1.05
"""Factor on the straightness of lines that a fit may leave: what tracing them in two views differs by."""


# Lengths are multiples of the text height.
PIECE = 9.0
"""Length of the piece of a line that gives one point."""
MIN_PIECE_CHARACTERS = 4
ORDER = 5
"""Highest order of the polynomial that separates a line's characters from descenders and strays."""
SCALE = 0.12
"""Of Geman and McClure's loss in that fit."""
KEPT_SHARE = 0.9
"""Of the points of lines: the others may be strays."""
BENDS = (5, 2)
"""Orders of a smooth field of shifts along and across the lines: more than smooth sheets have on one page."""
DEVIATION_FLOOR = 0.02
"""Of a piece's place: what characters differ in by design."""


@dataclass(frozen=True, slots=True, eq=False)
class FlatInk:
    """Ink (H, W) in a flat view; page point (u, v) lies at pixel (u, v) `scale` - `offset`."""

    ink: Mask
    scale: float
    offset: tuple[float, float]

    def to_page(self, pixels: Points) -> Points:
        """Page points (N, 2) of pixels (N, 2)."""
        return np.asarray((pixels + self.offset) / self.scale)


def sampling_maps(
    page_map: PageMap,
    width: int,
    height: int,
    scale: float,
    offset: tuple[float, float],
    H_image_centred: Floats,
) -> Iterator[tuple[slice, NDArray[np.float32]]]:
    """Yield bands of a flat view: rows, and the points (rows, width, 2) of the image that their pixels show.

    `H_image_centred` (3, 3) scales and shifts the photo's centred coordinates. The map is exact at nodes and bilinear
    between them.
    """
    grid, shape = node_grid(0, 0, width, height)
    centred = page_map.to_photo((grid + np.array(offset)) / scale)
    nodes = (centred * H_image_centred[0, 0] + H_image_centred[:2, 2]).reshape(*shape, 2).astype(np.float32)
    for band, _, _ in row_bands(height, 0):
        rows = band.stop - band.start
        yield band, between_nodes(nodes[band_nodes(band.start, rows)], width, rows)


def flatten_ink(
    ink: Mask, H_reduced_centred: Floats, page_map: PageMap, text: Points, text_height: float
) -> FlatInk:
    """Ink of the reduced photo in the flat view of `page_map`, at about the photo's resolution.

    `text` (N, 2) are characters and `text_height` their size, both in centred units.
    """
    page = page_map.to_page(text)
    known = np.isfinite(page).all(axis=1)
    page, J = page[known], page_map.jacobians(text[known])
    density = float(H_reduced_centred[0, 0]) / float(np.sqrt(np.median(np.abs(np.linalg.det(J)))))
    low, high = np.percentile(page, 0.5, axis=0), np.percentile(page, 99.5, axis=0)
    margin = 3 * text_height * float(H_reduced_centred[0, 0]) / density
    low, high = low - margin, high + margin
    scale = 1.2 * density
    scale = min(scale, float(np.sqrt(8e6 / np.prod(high - low))))  # bounded for every model
    width, height = (max(int(np.ceil(v)), 1) for v in (high - low) * scale)
    offset = (float(low[0]) * scale, float(low[1]) * scale)
    dark, flat = ink.astype(np.uint8) * 255, np.empty((height, width), bool)
    for band, at in sampling_maps(page_map, width, height, scale, offset, H_reduced_centred):
        flat[band] = take_values(dark, at, cv2.INTER_LINEAR, cv2.BORDER_CONSTANT) > 127
    return FlatInk(flat, scale, offset)


def trace_by_characters(text: TracedText, view: PhotoFrame, page_map: PageMap) -> LineObservations:
    """The page's text lines, traced in the flat view of `page_map`, in centred coordinates of the photo."""
    characters, height = view.to_centred(text.characters), text.height_px / view.unit_px
    flat = flatten_ink(text.ink, text.H_reduced_centred(view), page_map, characters, height)
    return trace_lines(flat, page_map)


def trace_lines(flat: FlatInk, page_map: PageMap) -> LineObservations:
    """Observations of all text lines of the flat view, in centred coordinates of the photo."""
    return trace_rows(chain_characters(flat.ink), page_map, flat.scale, flat.offset)


def trace_rows(
    found: CharacterRows, page_map: PageMap, scale: float = 1.0, offset: tuple[float, float] = (0.0, 0.0)
) -> LineObservations:
    """Observations of rows of characters in a flat view, in centred coordinates of the photo.

    Pixel (x, y) of the view shows the page point ((x, y) + `offset`) / `scale`.
    """
    pieces: list[Floats] = []
    index: list[NDArray[np.intp]] = []
    ends: list[tuple[float, float, float, float, float]] = []
    lines = 0
    for traced in _trace_rows(found):
        # Baseline and x-height line are two lines of their own: blur moves the two apart.
        for edge in (traced.base, traced.crown):
            pieces.append(edge)
            index.append(np.full(len(edge), lines))
            lines += 1
        ends.append(traced.row)
    if not pieces:
        return NO_LINES
    points = np.concatenate(pieces)
    return observe_lines(
        points[:, :2], np.concatenate(index), points[:, 2], np.array(ends), page_map, scale, offset
    )


def observe_lines(
    pixels: Points,
    index: NDArray[np.intp],
    deviations_px: Vector,
    ends: Floats,
    page_map: PageMap,
    scale: float,
    offset: tuple[float, float],
    most_groups: int | None = None,
) -> LineObservations:
    """Traced lines of a flat view as observations in the photo, with their paragraphs, spacings and margins.

    Parameters
    ----------
    pixels, index, deviations_px
        Points (N, 2) of the view, their lines (N,), two of each row, baselines first, and their deviations (N,) across.
    ends
        (rows, 5): left and right end of each row's baseline as (x, y, x, y), and its height, in pixels.
    scale, offset
        Pixel (x, y) shows the page point ((x, y) + `offset`) / `scale`.
    most_groups
        Largest numbers of paragraphs and of margins that are used; those with most lines are kept.
    """

    def in_photo(at: Points) -> Points:
        return page_map.to_photo((at + offset) / scale)

    seen = in_photo(pixels)
    # A map may end with the text: what is traced beyond has no place in the photo.
    known = np.isfinite(seen).all(axis=1) & np.isfinite(page_map.to_page(seen)).all(axis=1)
    J = page_map.jacobians(seen)
    known &= np.isfinite(J).all(axis=(1, 2))
    if not known.any():
        return NO_LINES
    placed = np.bincount(index[known], minlength=2 * len(ends)) > 0
    order = np.argsort(ends[:, 1] + ends[:, 3])
    table = ends[order]
    rows = Baselines(table[:, 0:2], table[:, 2:4], table[:, 4], np.ones(len(table)))
    # Even numbers are baselines; their rows were sorted for the grouping.
    paragraphs = [q for q in group_paragraphs(rows) if placed[2 * order[q.lines]].all()]
    margins = [in_photo(rows.starts[g]) for g in find_margins(rows, "left")]
    margins += [in_photo(rows.ends[g]) for g in find_margins(rows, "right")]
    margins = [m[np.isfinite(m).all(axis=1)] for m in margins]
    if most_groups is not None:
        paragraphs = sorted(paragraphs, key=lambda q: -len(q.lines))[:most_groups]
        margins = sorted(margins, key=len, reverse=True)[:most_groups]
    y = 0.5 * (rows.starts[:, 1] + rows.ends[:, 1])
    spacings = np.array([np.polyfit(q.order, y[q.lines], 1)[0] for q in paragraphs])
    # Deviations are across the line in the photo: the local scale of the map converts them.
    grow = np.linalg.norm(J[known, 1], axis=1) * scale
    return LineObservations(
        seen[known],
        index[known],
        deviations_px[known] / grow,
        [Run(2 * order[q.lines], q.order.astype(np.float64)) for q in paragraphs],
        group_alike(spacings),
        [m for m in margins if len(m) > 1],
        float(np.median(rows.heights) / np.median(grow)),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _TracedRow:
    """Pieces (n, 3) of baseline and x-height line as (x, y, deviation), and the row's ends and height."""

    base: Floats
    crown: Floats
    row: tuple[float, float, float, float, float]


def _trace_rows(found: CharacterRows) -> list[_TracedRow]:
    """The rows of characters that are long enough and have both lines. All are fitted at once."""
    long = []
    for members in sorted(found.rows, key=len):
        unit = median(found.bottom[members] - found.top[members])
        if np.ptp(np.concatenate([found.left[members], found.right[members]])) >= MIN_LENGTH * unit:
            long.append((members, unit))
    traced: list[_TracedRow] = []
    first = 0
    for k in range(1, len(long) + 1):
        if k == len(long) or (k + 1 - first) * len(long[k][0]) > BATCH:
            traced += _trace_batch(found, long[first:k])
            first = k
    return traced


def _trace_batch(found: CharacterRows, rows: list[tuple[NDArray[np.intp], float]]) -> list[_TracedRow]:
    """Rows of a batch, given as numbers of their characters and text height."""
    size = np.array([len(members) for members, _ in rows])
    unit = np.array([height for _, height in rows])
    present = np.arange(size.max()) < size[:, None]
    member = np.zeros(present.shape, np.intp)
    member[present] = np.concatenate([members for members, _ in rows])
    left, right, top, bottom = (side[member] for side in (found.left, found.right, found.top, found.bottom))
    x = 0.5 * (left + right)
    low = np.where(present, x, np.inf).min(axis=1)
    extent = np.maximum(np.where(present, x, -np.inf).max(axis=1) - low, 1e-9)
    ends = np.stack(
        [np.where(present, left, np.inf).min(axis=1), np.where(present, right, -np.inf).max(axis=1)], axis=1
    )
    order = np.clip((ends[:, 1] - ends[:, 0]) / (12 * unit), 1, ORDER).astype(int)
    design = _chebyshev(2 * (x - low[:, None]) / extent[:, None] - 1, order) * present[:, :, None]
    base, on_base, based = _follow(design, bottom, present, unit, order)
    _, on_crown, crowned = _follow(design, top, present, unit, order)
    at_ends = _chebyshev(2 * (ends - low[:, None]) / extent[:, None] - 1, order)
    level = (at_ends @ base[:, :, None])[:, :, 0]
    traced = []
    for k in np.flatnonzero(based & crowned):
        n, height = size[k], float(unit[k])
        lower = _pieces(x[k, :n], bottom[k, :n], on_base[k, :n], height)
        upper = _pieces(x[k, :n], top[k, :n], on_crown[k, :n], height)
        if len(lower) and len(upper):
            row = (float(ends[k, 0]), float(level[k, 0]), float(ends[k, 1]), float(level[k, 1]), height)
            traced.append(_TracedRow(lower, upper, row))
    return traced


def _chebyshev(t: Floats, order: NDArray[np.intp]) -> Floats:
    """Chebyshev polynomials (L, N, order + 1) at `t` (L, N), without those above each row's `order` (L,)."""
    return np.asarray(np.polynomial.chebyshev.chebvander(t, ORDER) * _used(order)[:, None, :])


def _used(order: NDArray[np.intp]) -> Mask:
    return np.asarray(np.arange(ORDER + 1) <= order[:, None])


def _follow(
    design: Floats, y: Floats, present: Mask, unit: Vector, order: NDArray[np.intp]
) -> tuple[Floats, Mask, Mask]:
    """Chebyshev coefficients (L, order + 1) of the curves that most points of each row lie on.

    Also which points (L, N) these are, and for which rows (L,) there is such a curve. `design` (L, N, order + 1) and
    `y` (L, N) are zero where no point is `present`. Reweighted least squares under Geman and McClure's loss, whose
    scale narrows.
    """
    count = present.sum(axis=1)
    middle = np.nanmedian(np.where(present, y, np.nan), axis=1)
    y = (y - middle[:, None]) * present
    used = _used(order)
    ridge = 1e-3 * count[:, None] * np.arange(ORDER + 1.0) ** 2
    c = np.zeros(used.shape)
    for k in range(EDGE_ROUNDS):
        rest = y - (design @ c[:, :, None])[:, :, 0]
        scale = np.maximum(0.5 * 0.7**k, SCALE) * unit
        weights = present * geman_mcclure_weights(rest, scale[:, None])
        weighted = (design * weights[:, :, None]).transpose(0, 2, 1)
        held = ridge * (weights.sum(axis=1) / count)[:, None] + ~used
        A = weighted @ design + held[:, :, None] * np.eye(ORDER + 1)
        c = np.linalg.solve(A, weighted @ y[:, :, None])[:, :, 0]
    near = present & (np.abs(y - (design @ c[:, :, None])[:, :, 0]) < 2 * SCALE * unit[:, None])
    c[:, 0] += middle
    return c, near, near.sum(axis=1) >= np.maximum(0.35 * count, 4)


def _pieces(x: Vector, y: Vector, inliers: NDArray[np.bool_], unit: float) -> Floats:
    """Mean places (n, 3) of the inliers of every piece: x, y and the deviation of y in pixels."""
    x, y = x[inliers], y[inliers]
    low, high = float(x.min()), float(x.max())
    count = max(round((high - low) / (PIECE * unit)), 1)
    piece = np.minimum(((x - low) / max(high - low, 1e-9) * count).astype(int), count - 1)
    number = np.bincount(piece, minlength=count)
    kept = number >= MIN_PIECE_CHARACTERS
    n = np.maximum(number, 1)
    mean_x, mean_y = np.bincount(piece, x, count) / n, np.bincount(piece, y, count) / n
    spread = np.sqrt(np.maximum(np.bincount(piece, y * y, count) / n - mean_y**2, 0.0) + 0.25**2)
    deviation = np.hypot(spread / np.sqrt(n), DEVIATION_FLOOR * unit)
    return np.stack([mean_x, mean_y, deviation], axis=1)[kept]


def measure_straightness(page_map: PageMap, lines: LineObservations) -> float:
    """RMS distance of the points from their lines on the flat page, in text heights, the worst tenth left out.

    NaN where it is not known: without lines, and where most lines are broken to single points, as in a view that does
    not flatten them.
    """
    if not lines.count or (np.bincount(lines.index)[lines.index] < 2).mean() > 0.5:
        return float("nan")
    v = page_map.to_page(lines.points)[:, 1]
    J = page_map.jacobians(lines.points)
    height = lines.text_height * float(np.median(np.linalg.norm(J[:, 1], axis=1)))
    return _trimmed_rms(_about_line_means(v, lines) / height)


def left_by_bends(page_map: PageMap, lines: LineObservations) -> float:
    """Share of `measure_straightness` that the best smooth field of shifts leaves: no bent sheet leaves less.

    Noise of single points stays, whatever is fitted to it; a bend goes on along a line and from line to line.
    """
    page = page_map.to_page(lines.points)
    low, high = page.min(axis=0), page.max(axis=0)
    u, v = (2 * (page - low) / np.maximum(high - low, 1e-9) - 1).T
    along = np.polynomial.legendre.legvander(u, BENDS[0])[:, 1:]
    down = np.polynomial.legendre.legvander(v, BENDS[1])
    terms = (along[:, :, None] * down[:, None, :]).reshape(len(page), -1)
    design = np.stack([_about_line_means(term, lines) for term in terms.T], axis=1)
    rest = _about_line_means(v, lines)
    near = np.abs(rest) <= np.quantile(np.abs(rest), KEPT_SHARE)
    shifts = np.linalg.lstsq(design[near], rest[near], rcond=None)[0]
    return _trimmed_rms(rest - design @ shifts) / _trimmed_rms(rest)


def _about_line_means(values: Vector, lines: LineObservations) -> Vector:
    """`values` (M,) of the lines' points without the mean of each line."""
    number = np.maximum(np.bincount(lines.index, minlength=lines.count), 1)
    return np.asarray(values - (np.bincount(lines.index, values, lines.count) / number)[lines.index])


def _trimmed_rms(values: Vector) -> float:
    """RMS of `values` without those that are farthest from 0."""
    rest = np.sort(np.abs(values))
    return float(np.sqrt(np.mean(rest[: max(int(KEPT_SHARE * len(rest)), 1)] ** 2)))


def measure_bend(lines: LineObservations) -> float:
    """RMS distance of the points from straight lines in the photo, in text heights, the worst tenth left out.

    Each line's points get the straight line of least squares; lines of fewer than three points show no bend.
    """
    number = np.bincount(lines.index, minlength=lines.count)
    used = number[lines.index] > 2
    if not used.any():
        return 0.0
    index, points = lines.index[used], lines.points[used]
    x, y = ((c - (np.bincount(index, c, lines.count) / np.maximum(number, 1))[index]) for c in points.T)
    xx, yy, xy = (np.bincount(index, product, lines.count) for product in (x * x, y * y, x * y))
    along = 0.5 * np.arctan2(2 * xy, xx - yy)[index]
    return _trimmed_rms((y * np.cos(along) - x * np.sin(along)) / lines.text_height)
