"""Long edges in an image: steps of brightness along straight or slightly curved lines that extend beyond the text.

Edges of sheets, edges of pages in a stack, and gutters are such lines. Rules, frames and pictures end with the print.
Steps are averaged over bands of rows. Dynamic programming finds paths through the bands, and a path is accepted if
nearly all of its bands support it.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Mask, Vector
from services.imaging.channels import only_where
from services.imaging.grid_paths import SHIFT_COST, accumulate_to_row, trace_back
from services.order_statistics import median, median_along

GROUND_SHARE = 0.8
"""Of the text's length, on which the ground beyond an edge is another one."""
LONG_SIDE_PX = 700
"""Of the copy in which they are sought: the pixels below are its."""


@dataclass(frozen=True, slots=True)
class LongEdgeParameters:
    """Contrasts are differences of the logarithm of brightness."""

    sigma_px: float = 1.2
    """Standard deviation of the Gaussian whose derivative measures steps."""
    band_px: int = 12
    """Number of averaged rows: at a slope of 8 degrees an edge moves by less than two pixels over them."""
    max_shift_px: int = 2
    """From band to band."""
    weight_beyond: float = 0.3
    """Weight of a band without adjacent text in the choice of paths."""
    unseen_cost: float = 0.1
    """Cost of a band outside of the photo, in bands of full support."""
    min_seen: float = 0.6
    """Least share of an edge along the text that the photo shows."""
    candidates: int = 12
    """Largest number of paths of each sign, from the right."""
    distinct_px: int = 3
    """Paths closer to each other than this count as one."""
    contrast: float = 0.03
    """Contrast from which a band supports an edge fully."""
    noise_factor: float = 4.0
    """Least step relative to the median response of blank paper."""
    blank_percentile: float = 30.0
    """Percentile of all responses that represents blank paper."""
    support: float = 0.8
    """Least mean support along the text of an accepted edge."""
    beyond: float = 0.05
    """Least extension of an edge beyond the text at both ends inside the photo, relative to the text's length."""
    beyond_support: float = 0.6
    share_of_view: float = 0.55
    """Least length of an edge relative to what the photo shows along it."""
    max_slope: float = float(np.tan(np.deg2rad(8.0)))
    straightness_px: float = 2.0
    """Median distance of an edge from the parabola through it."""
    fading: float = 0.3
    """Of an edge's median step along the text: where it is less, the edge has ended."""
    desk_contrast: float = 0.4
    """A ground that differs more is no tint on the sheet."""
    end_contrast: float = 0.08
    """The ground beyond the end of a sheet's edge differs by this from the ground along it."""
    ground_px: tuple[int, int] = (4, 10)
    """Distances from an edge at which the background on its sides is measured."""
    sheet_on_either_side: bool = False
    """False: the sheet is on the right."""
    min_bands: int = 6


@dataclass(frozen=True, slots=True, eq=False)
class LongEdge:
    """One edge: its column (bands,) at every row of `rows` (bands,), along the text where `beside_text` (bands,).

    It is seen from row `first` to row `last`; `left_ground` and `right_ground` (bands,) are the logarithms of
    brightness on its sides.
    """

    columns: NDArray[np.intp]
    rows: Vector
    beside_text: NDArray[np.bool_]
    first: float
    last: float
    left_ground: Vector
    right_ground: Vector

    def at(self, rows: Vector) -> Vector:
        """Columns (N,) of the edge at `rows` (N,)."""
        return np.asarray(np.interp(rows, self.rows, self.columns))

    def ground_differs(self, contrast: float) -> bool:
        """Whether one side is brighter by `contrast` than the other on `GROUND_SHARE` of the text's length."""
        difference = (self.left_ground - self.right_ground)[self.beside_text]
        return bool(max((difference > contrast).mean(), (difference < -contrast).mean()) > GROUND_SHARE)


def find_long_edges(
    brightness: Floats,
    shown: Mask,
    along: tuple[float, float],
    columns: int,
    p: LongEdgeParameters,
) -> list[LongEdge]:
    """Upright edges in the first `columns` columns of `brightness` (H, W), the logarithm of a picture.

    `shown` (H, W) marks the pixels that the photo shows, `along` the first and last row of the text.
    """
    steps, weight = _band_steps(brightness, shown, p)
    steps, weight = steps[:, :columns], weight[:, :columns]
    rows = (np.arange(len(steps)) + 0.5) * p.band_px
    text = (rows >= along[0]) & (rows <= along[1])
    if text.sum() < p.min_bands or not (weight > 0).any():
        return []
    contrast = p.contrast
    if p.noise_factor > 0:
        noise = float(np.percentile(np.abs(steps[weight > 0]), p.blank_percentile))
        contrast = max(contrast, p.noise_factor * noise)
    found = []
    supports = np.stack([np.clip(sign * steps / contrast, 0.0, 1.0) for sign in (1.0, -1.0)])
    for sign, support, paths in zip((1.0, -1.0), supports, _paths(supports, weight, text, p), strict=True):
        certain = _certain(paths, support, weight, rows, along, p)
        grounds = (_ground_beside(certain, brightness, side, p) for side in (-1, 1))
        for path, left, right in zip(certain, *grounds, strict=True):
            first, last = _extent(sign * steps[np.arange(len(path)), path], text, contrast, p)
            edge = LongEdge(path, rows, text, float(rows[first]), float(rows[last]), left, right)
            if not _ends_on_paper(edge, (first, last), weight, p):
                found.append(edge)
    return found


def _extent(
    steps: Vector, text: NDArray[np.bool_], contrast: float, p: LongEdgeParameters
) -> tuple[int, int]:
    """First and last band where a path, with the `steps` (bands,) on it, is seen.

    It is followed from the text to where two bands in a row have no step, or one that is much fainter than along
    the text (a path finds some step everywhere on a desk).
    """
    there = steps > max(0.5 * contrast, p.fading * median(steps[text]))
    lost = ~(there[:-1] | there[1:])
    inner = np.flatnonzero(text)
    above = np.flatnonzero(lost[: inner[0]])
    below = np.flatnonzero(lost[inner[-1] :])
    first = above[-1] + 2 if len(above) else 0
    last = inner[-1] + below[0] if len(below) else len(steps) - 1
    return int(first), int(last)


def _ground_beside(
    paths: NDArray[np.intp], brightness: Floats, side: int, p: LongEdgeParameters
) -> NDArray[np.float32]:
    """Ground (K, N) next to column `paths[k, n]` in band n of `brightness` (H, W): medians; `side` -1 is left."""
    near, far = p.ground_px
    at = np.clip(paths[..., None] + side * np.arange(near, far), 0, brightness.shape[1] - 1)
    rows = np.arange(paths.shape[1] * p.band_px).reshape(-1, p.band_px)
    values = brightness[rows[None, :, :, None], at[:, :, None, :]]
    return np.asarray(median_along(median_along(values, 2), 2), np.float32)


def _ends_on_paper(edge: LongEdge, extent: tuple[int, int], weight: Floats, p: LongEdgeParameters) -> bool:
    """Whether the ground beyond the edge's ends is that along it: a frame or a tinted box on the sheet.

    At a corner of the sheet another ground follows; a sheet on a ground that differs much from it is no tinted box.
    """
    first, last = extent
    sides = [(edge.right_ground, edge.left_ground)]
    if p.sheet_on_either_side:
        sides.append((edge.left_ground, edge.right_ground))
    inside = slice(first, last + 1)
    if abs(median((edge.left_ground - edge.right_ground)[inside])) > p.desk_contrast:
        return False
    for end, way in ((first, -1), (last, 1)):
        after = end + way * np.arange(2, 5)
        after = after[(after >= 0) & (after < len(edge.rows))]
        after = after[weight[after, edge.columns[after]] > 0]
        before = end - way * np.arange(1, 4)
        for sheet, other in sides:
            if len(after) and abs(median(sheet[after]) - median(other[before])) < p.end_contrast:
                return True
    return False


def _band_steps(brightness: Floats, shown: Mask, p: LongEdgeParameters) -> tuple[Floats, Floats]:
    """Contrast of a step at every column of every band of rows, and whether it can be seen there (1 or 0)."""
    reach = int(4 * p.sigma_px) + 1
    x = np.arange(-reach, reach + 1, dtype=np.float64)
    gauss = np.exp(-0.5 * (x / p.sigma_px) ** 2)
    kernel = x * gauss / (gauss.sum() * p.sigma_px**2)
    # A step of contrast c has the derivative c / (sqrt(2 pi) sigma) at its place.
    kernel *= np.sqrt(2 * np.pi) * p.sigma_px
    bands = len(brightness) // p.band_px
    rows = bands * p.band_px
    step: NDArray[np.float32] = np.asarray(
        cv2.filter2D(
            np.ascontiguousarray(brightness[:rows]),
            cv2.CV_32F,
            kernel[None].astype(np.float32),
            borderType=cv2.BORDER_REPLICATE,
        ),
        np.float32,
    )
    near = np.ones((1, 2 * reach + 1), np.uint8)
    clear = np.asarray(
        cv2.erode(
            np.ascontiguousarray(shown[:rows]).astype(np.uint8),
            near,
            borderType=cv2.BORDER_CONSTANT,
            borderValue=1,
        ),
        np.uint8,
    )
    shape = (bands, p.band_px, brightness.shape[1])
    count = clear.reshape(shape).sum(axis=1, dtype=np.uint8).astype(np.float64)
    total = only_where(clear, step).reshape(shape).sum(axis=1).astype(np.float64)
    return total / np.maximum(count, 1), (count >= 0.75 * p.band_px).astype(np.float64)


def _paths(
    supports: Floats, weight: Floats, text: NDArray[np.bool_], p: LongEdgeParameters
) -> list[NDArray[np.intp]]:
    """For each sign the paths (K, bands) of columns down all bands whose support along the text may be enough.

    `supports` (2, bands, columns) are those of steps of either sign. Paths are sorted, innermost first.
    """
    share = np.where(text, 1.0, p.weight_beyond)[:, None]
    score = np.where(weight > 0, supports - p.support, -p.unseen_cost) * share
    inner = np.flatnonzero(text)
    middle = int(inner[len(inner) // 2])
    down, up = accumulate_to_row(score, middle, p.max_shift_px, SHIFT_COST)
    through = down[:, -1] + up[:, -1] - score[:, middle]
    peak = through >= cv2.dilate(through, np.ones((1, 2 * p.distinct_px + 1), np.uint8))
    found = []
    for sign, candidates in enumerate(peak & (through > 0)):
        columns = np.flatnonzero(candidates)[::-1][: p.candidates]
        grids = np.full(len(columns), sign)
        above, below = (trace_back(half, grids, columns, p.max_shift_px, SHIFT_COST) for half in (down, up))
        found.append(np.concatenate([above, below[:, :-1][:, ::-1]], axis=1))
    return found


def _certain(
    paths: NDArray[np.intp],
    support: Floats,
    weight: Floats,
    rows: Vector,
    along: tuple[float, float],
    p: LongEdgeParameters,
) -> NDArray[np.intp]:
    """Straight ones of `paths` (K, bands) that are supported along the text, beyond it and over most of the view."""
    bands = np.arange(len(rows))
    value, seen = support[bands, paths], weight[bands, paths] > 0
    text = (rows >= along[0]) & (rows <= along[1])
    reach = max(p.beyond * (along[1] - along[0]), 2.0 * p.band_px)
    above = (rows < along[0]) & (rows >= along[0] - reach)
    below = (rows > along[1]) & (rows <= along[1] + reach)
    all_seen = weight.max(axis=1) > 0
    # Share of the text that is seen, support along it, and over the view.
    certain = (text & seen).sum(axis=1) >= p.min_seen * text.sum()
    certain &= _mean_where(value, text & seen) >= p.support
    certain &= (value * seen).sum(axis=1) >= p.share_of_view * all_seen.sum()
    ends = [end & seen for end in (above, below)]
    known = np.stack([end.sum(axis=1) >= 2 for end in ends])
    good = np.stack([_mean_where(value, end) >= p.beyond_support for end in ends])
    certain &= known.any(axis=0) & (good | ~known).all(axis=0)
    found = [
        k for k in np.flatnonzero(certain) if _is_straight(paths[k], value[k], text & seen[k], rows, along, p)
    ]
    return paths[np.array(found, np.intp)]


def _mean_where(values: Floats, chosen: Mask) -> Vector:
    """Mean (K,) of the `chosen` of each row of values (K, N); 0 of none."""
    return np.asarray((values * chosen).sum(axis=1) / np.maximum(chosen.sum(axis=1), 1))


def _is_straight(
    path: NDArray[np.intp],
    value: Vector,
    along_text: NDArray[np.bool_],
    rows: Vector,
    along: tuple[float, float],
    p: LongEdgeParameters,
) -> bool:
    """Whether a path (bands,), supported by `value` (bands,), is near a parabola that leans little."""
    good = along_text & (value > 0.3)
    middle, unit = 0.5 * (along[0] + along[1]), max(0.5 * (along[1] - along[0]), 1.0)
    t = (rows[good] - middle) / unit
    design = np.stack([np.ones_like(t), t, t * t], axis=1)
    c = np.linalg.lstsq(design, path[good].astype(np.float64), rcond=None)[0]
    slope = max(abs(c[1] - 2 * c[2]), abs(c[1] + 2 * c[2])) / unit
    away = np.abs(design @ c - path[good])
    return bool(slope <= p.max_slope and median(away) <= p.straightness_px)
