"""Where the sheet ends in a flat view that shows too much: its edge, the page stack under it, or the gutter.

These are long, nearly straight lines or steps of brightness beside the text that run on beyond it at its head and
foot, where rules, frames and pictures end with the print. Paths of such steps are found band by band with dynamic
programming; the innermost path that is supported nearly everywhere is taken.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Mask, Points, RgbImage, Vector


@dataclass(frozen=True, slots=True)
class SheetEdgesParameters:
    """Contrasts are differences of the logarithm of brightness; lengths are pixels or as told."""

    sigma_px: float = 1.2
    """Of the Gaussian whose derivative measures steps."""
    band_px: int = 12
    """Rows that are averaged: at a slope of 8 degrees an edge moves by less than two pixels on them."""
    max_shift_px: int = 2
    """From band to band."""
    shift_cost: float = 0.02
    """Of a pixel's shift, in bands of full support: straight paths win among equals."""
    weight_beyond: float = 0.3
    """Of a band beside no text when paths are chosen."""
    unseen_cost: float = 0.1
    """Of a band where the photo ends, in bands of full support."""
    min_seen: float = 0.6
    """Share of an edge along the text that the photo shows."""
    candidates: int = 12
    distinct_px: int = 3
    """Paths nearer to each other are one."""
    contrast: float = 0.03
    """A band supports an edge fully from this contrast on."""
    level_contrast: float = 0.15
    """The same for the upper and the lower edge: creases that run across a letter are fainter."""
    noise_factor: float = 4.0
    """Steps count from this many times the middle response of blank paper on."""
    support: float = 0.8
    """Mean support along the text that makes an edge certain."""
    beyond: float = 0.05
    """Of the text's length: an edge runs on by this much beyond it, at both ends where the photo shows them."""
    beyond_support: float = 0.6
    share_of_view: float = 0.55
    """An edge at the left or right is at least this share of what the photo shows along it."""
    level_share_of_view: float = 0.85
    """The same for the upper and lower edge."""
    max_slope: float = float(np.tan(np.deg2rad(8.0)))
    straightness_px: float = 2.0
    """Median distance of an edge from the parabola through it."""
    outliers: float = 1.0
    """Per cent of the characters that may lie beyond an edge, where a desk or the edges of a page stack follow it."""
    stack_edges: int = 2
    """So many more edges beyond make a page stack."""
    ground_contrast: float = 0.15
    fading: float = 0.3
    """Of an edge's median step along the text: where it is less, the edge has ended."""
    desk_contrast: float = 0.4
    """A ground that differs more is no tint on the sheet."""
    end_contrast: float = 0.08
    """The ground beyond the end of a sheet's edge differs by this from the one beside it."""
    ground_px: tuple[int, int] = (4, 10)
    """The ground beside an edge is compared at these distances."""
    outer_percentile: float = 25.0
    """Of an edge's columns along the text, counted from outside: where a sloping edge is cut."""
    blank_percentile: float = 30.0
    """Of all responses in the margin: what blank paper shows."""
    black: float = 8.0
    """Gray levels added before the logarithm."""
    corner_bands: float = 1.5
    """The upper and the lower edge meet the end of an upright one within so many bands."""
    min_characters: int = 30
    min_bands: int = 6
    min_margin_px: int = 8
    rim: float = 0.004
    """Of the view's long side, by which the edges lie outside of what was found."""


@dataclass(frozen=True, slots=True)
class SheetEdges:
    """Where the sheet ends, pixels of the view; None on sides where nothing certain is seen."""

    left: float | None = None
    top: float | None = None
    right: float | None = None
    bottom: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _Margin:
    """One side of the view, turned so that the sheet's edge is upright and the text lies to the right.

    `text` (N, 2) are its characters (column, row), `along` the first and last row of text.
    """

    brightness: Floats
    shown: Mask
    text: Points
    along: tuple[float, float]
    level: bool

    def mirrored(self) -> "_Margin":
        """The opposite side."""
        last = self.brightness.shape[1] - 1
        text = np.stack([last - self.text[:, 0], self.text[:, 1]], axis=1)
        return _Margin(self.brightness[:, ::-1], self.shown[:, ::-1], text, self.along, self.level)


@dataclass(frozen=True, slots=True)
class _Edge:
    """Column of an upright edge, and the first and last row where it is seen."""

    place: float
    first: float
    last: float


def find_sheet_edges(
    view: RgbImage,
    text_points: Points,
    text_height_px: float,
    seen: Mask | None = None,
    parameters: SheetEdgesParameters | None = None,
) -> SheetEdges:
    """Edges of the sheet in the flat `view` (H, W, 3), beyond its text.

    `text_points` (N, 2) are centres of the characters, which may include some that are none, `text_height_px` is
    their size, and `seen` (H, W) tells the pixels that the photo shows; all if it is None. Of every side the
    innermost certain edge is taken, None rather than a guess.
    """
    p = parameters or SheetEdgesParameters()
    height, width = view.shape[:2]
    text = text_points[np.isfinite(text_points).all(axis=1)]
    if len(text) < p.min_characters:
        return SheetEdges()
    brightness = np.log(view.astype(np.float32).mean(axis=2) + p.black)
    shown = np.ones((height, width), bool) if seen is None else seen
    low = np.percentile(text, p.outliers, axis=0) - text_height_px
    high = np.percentile(text, 100 - p.outliers, axis=0) + text_height_px
    upright = _Margin(brightness, shown, text, (float(low[1]), float(high[1])), level=False)
    left = _innermost_edge(upright, float(low[0]), p)
    right = _innermost_edge(upright.mirrored(), width - 1 - float(high[0]), p)
    first = 0 if left is None else max(int(left.place), 0)
    last = width if right is None else width - max(int(right.place), 0)
    level = _Margin(
        brightness[:, first:last].T,
        shown[:, first:last].T,
        (text - [first, 0])[:, ::-1],
        (float(low[0]) - first, float(high[0]) - first),
        level=True,
    )
    top = _innermost_edge(level, float(low[1]), p)
    bottom = _innermost_edge(level.mirrored(), height - 1 - float(high[1]), p)
    # At a corner of the sheet its upright edges end, at a coloured band across the page they go on.
    upright_edges = [edge for edge in (left, right) if edge is not None]
    corner = p.corner_bands * p.band_px
    if top is not None and not any(edge.first >= top.place - corner for edge in upright_edges):
        top = None
    if bottom is not None and not any(
        edge.last <= height - 1 - bottom.place + corner for edge in upright_edges
    ):
        bottom = None
    rim = p.rim * max(height, width)
    return SheetEdges(
        None if left is None else left.place - rim,
        None if top is None else top.place - rim,
        None if right is None else width - 1 - right.place + rim,
        None if bottom is None else height - 1 - bottom.place + rim,
    )


def _innermost_edge(margin: _Margin, limit: float, p: SheetEdgesParameters) -> _Edge | None:
    """The certain edge next to, and left of, column `limit`."""
    columns = min(int(limit), margin.brightness.shape[1])
    if columns < p.min_margin_px:
        return None
    beside = min(columns + 2 * p.ground_px[1], margin.brightness.shape[1])
    brightness, shown = margin.brightness[:, :beside], margin.shown[:, :beside]
    steps, weight = _band_steps(brightness, shown, p)
    steps, weight = steps[:, :columns], weight[:, :columns]
    rows = (np.arange(len(steps)) + 0.5) * p.band_px
    text = (rows >= margin.along[0]) & (rows <= margin.along[1])
    if text.sum() < p.min_bands or not (weight > 0).any():
        return None
    noise = float(np.percentile(np.abs(steps[weight > 0]), p.blank_percentile))
    contrast = max(p.level_contrast if margin.level else p.contrast, p.noise_factor * noise)
    paths: list[NDArray[np.intp]] = []
    extents: list[tuple[float, float]] = []
    ground = brightness[: len(steps) * p.band_px].reshape(len(steps), p.band_px, -1)
    ground = np.median(ground, axis=1)
    for sign in (1.0, -1.0):
        support = np.clip(sign * steps / contrast, 0.0, 1.0)
        for path in _paths(support, weight, text, p):
            if not _is_certain(path, support, weight, rows, margin, p):
                continue
            extent = _extent(sign * steps[np.arange(len(path)), path], text, contrast, p)
            if not _ends_on_paper(path, extent, ground, weight, p):
                paths.append(path)
                extents.append((float(rows[extent[0]]), float(rows[extent[1]])))
    places = np.array([np.percentile(path[text], p.outer_percentile) for path in paths])
    for k in np.argsort(-places):
        beyond = margin.text[:, 0] < np.interp(margin.text[:, 1], rows, paths[k])
        apart = np.unique(np.round((places[k] - places[places < places[k]]) / p.distinct_px))
        if (
            not beyond.any()
            or (apart > 1).sum() >= p.stack_edges
            or _ground_differs(paths[k][text], ground[text], p)
        ):
            return _Edge(float(places[k]), *extents[k])
    return None


def _extent(
    steps: Vector, text: NDArray[np.bool_], contrast: float, p: SheetEdgesParameters
) -> tuple[int, int]:
    """First and last band where a path, with the `steps` (bands,) on it, is seen.

    It is followed from the text to where two bands in a row have no step, or one that is much fainter than along
    the text (a path finds some step everywhere on a desk).
    """
    there = steps > max(0.5 * contrast, p.fading * float(np.median(steps[text])))
    lost = ~(there[:-1] | there[1:])
    inner = np.flatnonzero(text)
    above = np.flatnonzero(lost[: inner[0]])
    below = np.flatnonzero(lost[inner[-1] :])
    first = above[-1] + 2 if len(above) else 0
    last = inner[-1] + below[0] if len(below) else len(steps) - 1
    return int(first), int(last)


def _beside(ground: Floats, columns: NDArray[np.intp], p: SheetEdgesParameters) -> tuple[Vector, Vector]:
    """Ground (N,) before and beyond column `columns[n]` in row n of `ground` (N, columns)."""
    near, far = p.ground_px
    last = ground.shape[1] - 1
    inner, outer = (
        np.take_along_axis(ground, np.clip(columns[:, None] + side * np.arange(near, far), 0, last), 1)
        for side in (1, -1)
    )
    return np.median(inner, axis=1), np.median(outer, axis=1)


def _ground_differs(path: NDArray[np.intp], ground: Floats, p: SheetEdgesParameters) -> bool:
    """Whether what lies beyond the path is brighter or darker than what lies before it, nearly everywhere."""
    inner, outer = _beside(ground, path, p)
    brighter, darker = ((sign * (inner - outer) > p.ground_contrast).mean() for sign in (1, -1))
    return bool(max(brighter, darker) > p.support)


def _ends_on_paper(
    path: NDArray[np.intp], extent: tuple[int, int], ground: Floats, weight: Floats, p: SheetEdgesParameters
) -> bool:
    """Whether the ground beyond the path's ends is that beside it: a frame or a tinted box on the sheet.

    At a corner of the sheet another ground follows; a sheet on a ground that differs much from it is no tinted box.
    """
    inner, outer = _beside(ground, path, p)
    first, last = extent
    inside = slice(first, last + 1)
    if np.abs(np.median(inner[inside] - outer[inside])) > p.desk_contrast:
        return False
    for end, way in ((first, -1), (last, 1)):
        after = end + way * np.arange(2, 5)
        after = after[(after >= 0) & (after < len(path))]
        after = after[weight[after, path[after]] > 0]
        before = end - way * np.arange(1, 4)
        if len(after) and np.abs(np.median(inner[after]) - np.median(outer[before])) < p.end_contrast:
            return True
    return False


def _band_steps(brightness: Floats, shown: Mask, p: SheetEdgesParameters) -> tuple[Floats, Floats]:
    """Contrast of a step at every column of every band of rows, and whether it can be seen there (1 or 0)."""
    reach = int(4 * p.sigma_px) + 1
    x = np.arange(-reach, reach + 1, dtype=np.float64)
    gauss = np.exp(-0.5 * (x / p.sigma_px) ** 2)
    kernel = x * gauss / (gauss.sum() * p.sigma_px**2)
    # A step of contrast c has the derivative c / (sqrt(2 pi) sigma) at its place.
    kernel *= np.sqrt(2 * np.pi) * p.sigma_px
    bands = len(brightness) // p.band_px
    rows = bands * p.band_px
    step = cv2.filter2D(
        np.ascontiguousarray(brightness[:rows]),
        cv2.CV_32F,
        kernel[None].astype(np.float32),
        borderType=cv2.BORDER_REPLICATE,
    )
    near = np.ones((1, 2 * reach + 1), np.uint8)
    clear = cv2.erode(
        np.ascontiguousarray(shown[:rows]).astype(np.uint8),
        near,
        borderType=cv2.BORDER_CONSTANT,
        borderValue=1,
    )
    shape = (bands, p.band_px, brightness.shape[1])
    count = clear.reshape(shape).sum(axis=1).astype(np.float64)
    total = (step * clear).reshape(shape).sum(axis=1).astype(np.float64)
    return total / np.maximum(count, 1), (count >= 0.75 * p.band_px).astype(np.float64)


def _paths(
    support: Floats, weight: Floats, text: NDArray[np.bool_], p: SheetEdgesParameters
) -> Iterator[NDArray[np.intp]]:
    """Paths (bands,) of columns down all bands, innermost first, whose support along the text may be enough."""
    share = np.where(text, 1.0, p.weight_beyond)[:, None]
    score = np.where(weight > 0, support - p.support, -p.unseen_cost) * share
    down, back = _accumulate(score, p)
    up, forth = (v[::-1] for v in _accumulate(score[::-1], p))
    inner = np.flatnonzero(text)
    middle = int(inner[len(inner) // 2])
    through = down[middle] + up[middle] - score[middle]
    peak = through >= cv2.dilate(through[None], np.ones((1, 2 * p.distinct_px + 1), np.uint8))[0]
    for column in np.flatnonzero(peak & (through > 0))[::-1][: p.candidates]:
        path = np.empty(len(support), np.intp)
        path[middle] = column
        for band in range(middle, 0, -1):
            path[band - 1] = back[band, path[band]]
        for band in range(middle, len(support) - 1):
            path[band + 1] = forth[band, path[band]]
        yield path


def _accumulate(score: Floats, p: SheetEdgesParameters) -> tuple[Floats, NDArray[np.intp]]:
    """Best sums of `score` (bands, columns) over paths from the first band, and the columns whence they come."""
    bands, columns = score.shape
    best, back = score.copy(), np.zeros((bands, columns), np.intp)
    shifts = np.arange(-p.max_shift_px, p.max_shift_px + 1)
    whence = np.clip(np.arange(columns) + shifts[:, None], 0, columns - 1)
    for band in range(1, bands):
        before = best[band - 1][whence] - p.shift_cost * np.abs(shifts)[:, None]
        chosen = np.argmax(before, axis=0)
        best[band] += np.take_along_axis(before, chosen[None], axis=0)[0]
        back[band] = whence[chosen, np.arange(columns)]
    return best, back


def _is_certain(
    path: NDArray[np.intp],
    support: Floats,
    weight: Floats,
    rows: Vector,
    margin: _Margin,
    p: SheetEdgesParameters,
) -> bool:
    """Whether the path is supported along the text, beyond its ends and over most of the view, and is straight."""
    along, level = margin.along, margin.level
    bands = np.arange(len(path))
    value, seen = support[bands, path], weight[bands, path] > 0
    text = (rows >= along[0]) & (rows <= along[1])
    if (text & seen).sum() < p.min_seen * text.sum() or value[text & seen].mean() < p.support:
        return False
    reach = max(p.beyond * (along[1] - along[0]), 2.0 * p.band_px)
    ends = [(rows < along[0]) & (rows >= along[0] - reach), (rows > along[1]) & (rows <= along[1] + reach)]
    shown = [end & seen for end in ends]
    beyond = [value[end].mean() >= p.beyond_support for end in shown if end.sum() >= 2]
    if not beyond or not all(beyond):
        return False
    all_seen = weight.max(axis=1) > 0
    if value[seen].sum() < (p.level_share_of_view if level else p.share_of_view) * all_seen.sum():
        return False
    good = text & seen & (value > 0.3)
    curve = np.polynomial.Polynomial.fit(rows[good], path[good].astype(np.float64), 2)
    slope = np.abs(curve.deriv()(np.array(along))).max()
    return bool(
        slope <= p.max_slope and np.median(np.abs(curve(rows[good]) - path[good])) <= p.straightness_px
    )
