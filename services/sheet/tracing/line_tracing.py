"""Text lines traced through a flat view that is not quite flat yet, as observations in the photo.

A first model of the page straightens its lines to about a degree; in that view characters chain into lines as on a
flat page, and what is left of the bend shows in their baselines and x-height lines. Both are followed piecewise and
mapped back to the photo, where they are what the surface is fitted to.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Mask, Points, Vector
from services.geometry.page_map import PageMap
from services.geometry.photo_frame import PhotoFrame
from services.robust import fit_reweighted, geman_mcclure_weights, narrowing
from services.sheet.developable.observations import NO_LINES, LineObservations, Run
from services.sheet.tracing.baselines import (
    Baselines,
    CharacterRows,
    chain_characters,
    find_margins,
    group_alike,
    group_paragraphs,
)
from services.sheet.tracing.page_text import PageText


@dataclass(frozen=True, slots=True)
class TracingParameters:
    """Lengths are multiples of the text height."""

    piece: float = 9.0
    """Length of the piece of a line that gives one point."""
    min_piece_characters: int = 4
    order: int = 5
    """Highest order of the polynomial that separates a line's characters from descenders and strays."""
    scale: float = 0.12
    """Of Geman and McClure's loss in that fit."""
    min_length: float = 6.0
    deviation_floor: float = 0.02
    """Of a piece's place: what characters differ in by design."""
    alike: float = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class FlatInk:
    """Ink (H, W) in a flat view; page point (u, v) lies at pixel (u, v) `scale` - `offset`."""

    ink: Mask
    scale: float
    offset: tuple[float, float]

    def to_page(self, pixels: Points) -> Points:
        """Page points (N, 2) of pixels (N, 2)."""
        return np.asarray((pixels + self.offset) / self.scale)


def sampling_map(
    page_map: PageMap, width: int, height: int, scale: float, offset: tuple[float, float], step: int = 16
) -> Floats:
    """Photo points (height, width, 2) float32, centred, of all pixels of a flat view, bilinear from every `step`-th."""
    columns, rows = -(-width // step) + 1, -(-height // step) + 1
    x, y = np.meshgrid(np.arange(columns) * step, np.arange(rows) * step)
    grid = (np.stack([x.ravel(), y.ravel()], axis=1) + np.array(offset)) / scale
    seen = page_map.to_photo(grid).reshape(rows, columns, 2).astype(np.float32)
    u = (np.arange(width, dtype=np.float32) / step)[None].repeat(height, axis=0)
    v = (np.arange(height, dtype=np.float32) / step)[:, None].repeat(width, axis=1)
    return np.asarray(cv2.remap(seen, u, v, cv2.INTER_LINEAR))


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
    seen = sampling_map(page_map, width, height, scale, offset)
    at = seen * np.float32(H_reduced_centred[0, 0]) + H_reduced_centred[:2, 2].astype(np.float32)
    flat = cv2.remap(ink.astype(np.uint8) * 255, at[..., 0], at[..., 1], cv2.INTER_LINEAR)
    return FlatInk(flat > 127, scale, offset)


def trace_by_characters(text: PageText, view: PhotoFrame, page_map: PageMap) -> LineObservations:
    """The page's text lines, traced in the flat view of `page_map`, in centred coordinates of the photo."""
    characters, height = view.to_centred(text.characters), text.height_px / view.unit_px
    flat = flatten_ink(text.ink, text.H_reduced_centred(view), page_map, characters, height)
    return trace_lines(flat, page_map)


def trace_lines(
    flat: FlatInk, page_map: PageMap, parameters: TracingParameters | None = None
) -> LineObservations:
    """Observations of all text lines of the flat view, in centred coordinates of the photo."""
    p = parameters or TracingParameters()
    found = chain_characters(flat.ink)
    pieces: list[Floats] = []
    index: list[NDArray[np.intp]] = []
    ends: list[tuple[float, float, float, float, float]] = []
    lines = 0
    for members in found.rows:
        traced = _trace_row(found, members, p)
        if traced is None:
            continue
        base, crown, row = traced
        if not len(base) or not len(crown):
            continue
        # Baseline and x-height line are two lines of their own: blur moves the two apart.
        for edge in (base, crown):
            pieces.append(edge)
            index.append(np.full(len(edge), lines))
            lines += 1
        ends.append(row)
    if not pieces:
        return NO_LINES

    def in_photo(pixels: Points) -> Points:
        return page_map.to_photo(flat.to_page(pixels))

    points, line = np.concatenate(pieces), np.concatenate(index)
    seen = in_photo(points[:, :2])
    # A map may end with the text: what is traced beyond has no place in the photo.
    known = np.isfinite(seen).all(axis=1) & np.isfinite(page_map.to_page(seen)).all(axis=1)
    known &= np.isfinite(page_map.jacobians(seen)).all(axis=(1, 2))
    if not known.any():
        return NO_LINES
    seen, points, line = seen[known], points[known], line[known]
    placed = np.bincount(line, minlength=lines) > 0
    table = np.array(ends)
    order = np.argsort(table[:, 1] + table[:, 3])
    table = table[order]
    rows = Baselines(table[:, 0:2], table[:, 2:4], table[:, 4], np.ones(len(table)))
    # Even numbers are baselines; their rows were sorted for the grouping.
    paragraphs = [q for q in group_paragraphs(rows) if placed[2 * order[q.lines]].all()]
    runs = [Run(2 * order[q.lines], q.order.astype(np.float64)) for q in paragraphs]
    y = 0.5 * (rows.starts[:, 1] + rows.ends[:, 1])
    spacings = np.array([np.polyfit(q.order, y[q.lines], 1)[0] for q in paragraphs])
    margins = [in_photo(rows.starts[g]) for g in find_margins(rows, "left")]
    margins += [in_photo(rows.ends[g]) for g in find_margins(rows, "right")]
    margins = [m[np.isfinite(m).all(axis=1)] for m in margins]
    centre = seen[np.argmin(np.linalg.norm(seen - seen.mean(axis=0), axis=1))][None]
    px_per_unit = flat.scale * float(np.sqrt(np.abs(np.linalg.det(page_map.jacobians(centre)[0]))))
    # Deviations are across the line in the photo: the local scale of the map converts them.
    grow = np.linalg.norm(page_map.jacobians(seen)[:, 1], axis=1) * flat.scale
    return LineObservations(
        seen,
        line,
        points[:, 2] / grow,
        runs,
        group_alike(spacings, p.alike),
        [m for m in margins if len(m) > 1],
        float(np.median(rows.heights)) / px_per_unit,
    )


def _trace_row(
    found: CharacterRows, members: NDArray[np.intp], p: TracingParameters
) -> tuple[Floats, Floats, tuple[float, float, float, float, float]] | None:
    """Pieces (n, 3) of baseline and x-height line as (x, y, deviation), and the row's ends and height."""
    left, right = found.left[members], found.right[members]
    top, bottom = found.top[members], found.bottom[members]
    unit = float(np.median(bottom - top))
    x = 0.5 * (left + right)
    length = float(right.max() - left.min())
    if length < p.min_length * unit:
        return None
    order = int(np.clip(length / (12 * unit), 1, p.order))
    base, base_inliers = _follow(x, bottom, unit, order, p)
    crown, crown_inliers = _follow(x, top, unit, order, p)
    if base is None or crown is None:
        return None
    at = np.array([left.min(), right.max()])
    y = np.polynomial.chebyshev.chebval(_scaled(at, x), base)
    row = (float(at[0]), float(y[0]), float(at[1]), float(y[1]), unit)
    return _pieces(x, bottom, base_inliers, unit, p), _pieces(x, top, crown_inliers, unit, p), row


def _scaled(at: Vector, x: Vector) -> Vector:
    low, high = float(x.min()), float(x.max())
    return np.asarray(2 * (at - low) / max(high - low, 1e-9) - 1)


def _follow(
    x: Vector, y: Vector, unit: float, order: int, p: TracingParameters
) -> tuple[Floats | None, NDArray[np.bool_]]:
    """Chebyshev coefficients of the curve that most of the points (x, y) lie on, and these points."""
    design = np.polynomial.chebyshev.chebvander(_scaled(x, x), order)
    c: Vector = np.zeros(order + 1)
    c[0] = np.median(y)
    ridge = 1e-3 * len(x) * np.diag(np.arange(order + 1.0) ** 2)
    scale = narrowing(0.5 * unit, 0.7, p.scale * unit)
    c = fit_reweighted(
        design, y, geman_mcclure_weights, scale, 10, start=c, damping=ridge, weigh_damping=True
    )
    near = np.abs(y - design @ c) < 2 * p.scale * unit
    if near.sum() < max(0.35 * len(x), 4):
        return None, near
    return c, near


def _pieces(x: Vector, y: Vector, inliers: NDArray[np.bool_], unit: float, p: TracingParameters) -> Floats:
    """Mean places (n, 3) of the inliers of every piece: x, y and the deviation of y in pixels."""
    x, y = x[inliers], y[inliers]
    low, high = float(x.min()), float(x.max())
    count = max(round((high - low) / (p.piece * unit)), 1)
    piece = np.minimum(((x - low) / max(high - low, 1e-9) * count).astype(int), count - 1)
    number = np.bincount(piece, minlength=count)
    kept = number >= p.min_piece_characters
    n = np.maximum(number, 1)
    mean_x, mean_y = np.bincount(piece, x, count) / n, np.bincount(piece, y, count) / n
    spread = np.sqrt(np.maximum(np.bincount(piece, y * y, count) / n - mean_y**2, 0.0) + 0.25**2)
    deviation = np.hypot(spread / np.sqrt(n), p.deviation_floor * unit)
    return np.stack([mean_x, mean_y, deviation], axis=1)[kept]


def measure_straightness(page_map: PageMap, lines: LineObservations) -> float:
    """RMS distance of the points from their lines on the flat page, in text heights, the worst tenth left out.

    Infinite where most lines are broken to single points, as in a view that does not flatten them: these would seem
    straight.
    """
    if not lines.count:
        return 0.0
    if (np.bincount(lines.index)[lines.index] < 2).mean() > 0.5:
        return float("inf")
    v = page_map.to_page(lines.points)[:, 1]
    J = page_map.jacobians(lines.points)
    number = np.maximum(np.bincount(lines.index, minlength=lines.count), 1)
    level = np.bincount(lines.index, v, minlength=lines.count) / number
    height = lines.text_height * float(np.median(np.linalg.norm(J[:, 1], axis=1)))
    rest = np.sort(np.abs(v - level[lines.index]) / height)
    return float(np.sqrt(np.mean(rest[: max(int(0.9 * len(rest)), 1)] ** 2)))
