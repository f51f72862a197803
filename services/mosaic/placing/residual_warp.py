"""Smooth displacements that correct the residuals of homographies between photos of a gently curved page.

The dissertation leaves this open (4.6). Every view gets a displacement on a coarse grid. All are estimated together, by
linear least squares over the matches of all pairs, so that no photo is warped to fit another one with an error.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, vstack
from scipy.sparse.linalg import splu

from services.arrays import Floats, Homography, Mask, Points, Vector
from services.geometry.homographies import jacobians, transform_points
from services.mosaic.flat_photo import FlatPhoto, trust_by_error
from services.mosaic.placing.homography_bundle import LEAST_DEVIATION_PX
from services.mosaic.placing.placement import DisplacementField
from services.mosaic.registration.pair_registration import PairRegistration
from services.robust import CAUCHY_WIDTH, MEDIAN_LENGTH, cauchy_weights
from services.sheet.ridged_page import IMPROVEMENT

Nodes = NDArray[np.intp]
"""Indices of nodes, any shape."""

HELD_OUT_CELLS = 5
"""One cell in this number is held out."""


# Lengths are relative to the text height; shares are 0-1.
NODE_SPACING = 4.0
"""Pages curve over tens of text heights, creases over a few; block matches are about two apart."""
MOST_NODES_IN_ALL = 3000
"""Largest number of nodes of all views, approximately; 16 photos then take a second or two."""
REACH = 0.1
"""Length, relative to a view's diagonal, over which a displacement changes and, outside of overlaps, vanishes."""
WORTHWHILE = 0.02
"""Least RMS worth a correction: half a pixel at 300 dpi."""
FEWEST = 8
"""Least number of held-out matches of a pair that is evaluated."""
HELD_OUT_CELL = 3.0
"""Cells by which matches are held out, one in five; slightly larger than the matched blocks."""
TRIMMED = 0.75
"""Share of the matches, the best ones, in an RMS: the others may be wrong."""
GREATEST_GRADIENT = 0.05
"""Largest gradient of a displacement: far from a fold, and the inverse gains more than a digit per step."""
REWEIGHTINGS = 4
"""Number of reweightings; afterwards weights hardly change."""


@dataclass(frozen=True, slots=True, eq=False)
class ResidualWarp:
    """Photo index -> its displacement; None for all photos if displacements did not help on held-out matches.

    `before_px` and `after_px` are RMS distances of the worst pair's held-out matches, mosaic pixels.
    """

    displacements: dict[int, DisplacementField | None]
    before_px: float
    after_px: float


@dataclass(frozen=True, slots=True, eq=False)
class _Grid:
    """Node grid of a view; its nodes are numbered from `first`."""

    first: int
    rows: int
    columns: int
    width: int
    height: int

    @property
    def count(self) -> int:
        """Number of nodes."""
        return self.rows * self.columns

    def points(self) -> Points:
        """Flat pixels (rows * columns, 2) of the nodes."""
        x, y = np.linspace(0, self.width - 1, self.columns), np.linspace(0, self.height - 1, self.rows)
        return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)

    def bilinear(self, flat: Points) -> tuple[Nodes, Floats]:
        """Nodes (N, 4) and their weights (N, 4) at flat pixels (N, 2); see `DisplacementField`."""
        x = np.clip(flat[:, 0] / max(self.width - 1, 1), 0, 1) * (self.columns - 1)
        y = np.clip(flat[:, 1] / max(self.height - 1, 1), 0, 1) * (self.rows - 1)
        i, j = np.minimum(x.astype(int), self.columns - 2), np.minimum(y.astype(int), self.rows - 2)
        s, t = x - i, y - j
        corner = self.first + j * self.columns + i
        nodes = np.stack([corner, corner + 1, corner + self.columns, corner + self.columns + 1], axis=1)
        return nodes, np.stack([(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t], axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class _Matches:
    """All matches: their separation (N, 2), mosaic pixels, its derivative by the nodes, and their pairs."""

    apart: Points
    pair: Nodes
    rows: csr_array
    confidence: Vector
    held_out: Mask


def estimate_residual_warp(
    photos: Mapping[int, FlatPhoto],
    H_mosaic_flat: Mapping[int, Homography],
    pairs: Sequence[PairRegistration],
) -> ResidualWarp:
    """Displacements of the views that reduce the residuals between the matches of `pairs`.

    Displacements are at most a text height, have no folds, and vanish away from overlaps, so that the page's frame does
    not change.

    Parameters
    ----------
    photos
        The placed photos by index.
    H_mosaic_flat
        Their homographies.
    pairs
        Registrations that the adjustment has not found contradicted.
    """
    none = dict.fromkeys(H_mosaic_flat)
    pairs = [pair for pair in pairs if len(pair.weights)]
    if not pairs:
        return ResidualWarp(dict(none), 0.0, 0.0)
    scales = {k: _scale(photos[k], H) for k, H in H_mosaic_flat.items()}
    text_height = float(np.median([photos[k].text_height_px * s for k, s in scales.items()]))
    grids = _grids(photos, H_mosaic_flat)
    matches = _gather(grids, H_mosaic_flat, pairs, HELD_OUT_CELL * text_height)
    # More than a text height is no residual: separated by more than two displacements can correct is a wrong match.
    possible = np.hypot(*matches.apart.T) < 2 * text_height
    fitted, held_out = possible & ~matches.held_out, possible & matches.held_out
    of_pairs = _pair_rms(matches.apart, matches.pair, held_out)
    worst = int(np.argmax(of_pairs))
    before = float(of_pairs[worst])
    if before < WORTHWHILE * text_height:
        return ResidualWarp(dict(none), before, before)
    trust = trust_by_error([photos[k] for k in grids])
    # The displacement to expect of a view is its error, so that a good view hardly moves beside a bad one.
    stiff = dict(zip(grids, np.sqrt(trust * np.mean(1 / trust)).tolist(), strict=True))
    priors = _priors(grids, scales, stiff) / before**2
    nodes = _fit(matches, fitted, priors)
    left = _pair_rms(matches.apart + matches.rows @ nodes, matches.pair, held_out)
    after = float(left[worst])
    if after > IMPROVEMENT * before or (left > np.maximum(of_pairs, WORTHWHILE * text_height)).any():
        return ResidualWarp(dict(none), before, before)
    nodes = _fit(matches, possible, priors)
    fields = {k: _field(grid, H_mosaic_flat[k], nodes) for k, grid in grids.items()}
    gentle = max(_gradient(field) for field in fields.values()) <= GREATEST_GRADIENT
    if not gentle or np.hypot(*nodes.T).max() > text_height:
        return ResidualWarp(dict(none), before, before)
    return ResidualWarp(dict(fields), before, after)


def _scale(photo: FlatPhoto, H_mosaic_flat: Homography) -> float:
    """Mosaic pixels per flat pixel at the centre of a view."""
    middle = 0.5 * (np.array([photo.size], np.float64) - 1)
    return float(np.sqrt(abs(np.linalg.det(jacobians(H_mosaic_flat, middle)[0]))))


def _grids(photos: Mapping[int, FlatPhoto], H_mosaic_flat: Mapping[int, Homography]) -> dict[int, _Grid]:
    spacings = {k: max(NODE_SPACING * photos[k].text_height_px, 1.0) for k in H_mosaic_flat}
    sides = {
        k: [max(int(np.ceil(side / spacings[k])) + 1, 4) for side in photos[k].size] for k in H_mosaic_flat
    }
    total = sum(columns * rows for columns, rows in sides.values())
    fewer = min(1.0, float(np.sqrt(MOST_NODES_IN_ALL / total)))
    grids, first = {}, 0
    for k, counts in sides.items():
        columns, rows = (max(round(count * fewer), 4) for count in counts)
        grids[k] = _Grid(first, rows, columns, *photos[k].size)
        first += grids[k].count
    return grids


def _gather(
    grids: Mapping[int, _Grid],
    H_mosaic_flat: Mapping[int, Homography],
    pairs: Sequence[PairRegistration],
    cell: float,
) -> _Matches:
    """Matches of all pairs. The position on the mosaic decides which ones are held out."""
    apart, middles, confidence, nodes, weights = [], [], [], [], []
    for pair in pairs:
        on_a = transform_points(H_mosaic_flat[pair.a], pair.points_a)
        on_b = transform_points(H_mosaic_flat[pair.b], pair.points_b)
        nodes_a, weights_a = grids[pair.a].bilinear(pair.points_a)
        nodes_b, weights_b = grids[pair.b].bilinear(pair.points_b)
        apart.append(on_a - on_b)
        middles.append(0.5 * (on_a + on_b))
        confidence.append(pair.weights)
        nodes.append(np.concatenate([nodes_a, nodes_b], axis=1))
        weights.append(np.concatenate([weights_a, -weights_b], axis=1))
    columns = np.concatenate(nodes)
    at = np.repeat(np.arange(len(columns)), columns.shape[1])
    total = sum(grid.count for grid in grids.values())
    rows = coo_array((np.concatenate(weights).ravel(), (at, columns.ravel())), shape=(len(columns), total))
    i, j = np.floor(np.concatenate(middles) / cell).astype(int).T
    return _Matches(
        np.concatenate(apart),
        np.repeat(np.arange(len(pairs)), [len(pair.weights) for pair in pairs]),
        rows.tocsr(),
        np.concatenate(confidence),
        (i + 2 * j) % HELD_OUT_CELLS == 0,
    )


def _priors(grids: Mapping[int, _Grid], scales: Mapping[int, float], stiff: Mapping[int, float]) -> csr_array:
    """Quadratic form of the cost of displacements: their size, slope and curvature over the reach, `stiff` times.

    Differences over h are expected to be h / reach, second differences (h / reach)^2. Therefore a field decreases to 0
    within about the reach outside of data, and hardly overshoots.
    """
    blocks = []
    total = sum(grid.count for grid in grids.values())
    for k, grid in grids.items():
        reach = REACH * np.hypot(grid.width, grid.height) * scales[k]
        ids = grid.first + np.arange(grid.count).reshape(grid.rows, grid.columns)
        h_x = (grid.width - 1) / (grid.columns - 1) * scales[k] / reach
        h_y = (grid.height - 1) / (grid.rows - 1) * scales[k] / reach
        # The sum over nodes approximates an integral over cells, in units of the reach.
        area = np.sqrt(h_x * h_y) * stiff[k]
        blocks += [
            _rows([ids], [area], total),
            _rows([ids[:, 1:], ids[:, :-1]], [area / h_x, -area / h_x], total),
            _rows([ids[1:], ids[:-1]], [area / h_y, -area / h_y], total),
            _rows([ids[:, 2:], ids[:, 1:-1], ids[:, :-2]], [area / h_x**2 * c for c in (1, -2, 1)], total),
            _rows([ids[2:], ids[1:-1], ids[:-2]], [area / h_y**2 * c for c in (1, -2, 1)], total),
            _rows(
                [ids[1:, 1:], ids[1:, :-1], ids[:-1, 1:], ids[:-1, :-1]],
                [np.sqrt(2) * area / (h_x * h_y) * c for c in (1, -1, -1, 1)],
                total,
            ),
        ]
    rows = csr_array(vstack(blocks))
    return csr_array(rows.T @ rows)


def _rows(nodes: list[Nodes], factors: list[float], total: int) -> csr_array:
    """Sparse rows that combine `nodes`, arrays of one shape, with `factors`."""
    columns = np.stack([n.ravel() for n in nodes], axis=1)
    at = np.repeat(np.arange(len(columns)), len(nodes))
    values = np.tile(np.asarray(factors, np.float64), len(columns))
    return coo_array((values, (at, columns.ravel())), shape=(len(columns), total)).tocsr()


def _fit(matches: _Matches, chosen: Mask, priors: csr_array) -> Points:
    """Displacements of all nodes (n, 2), mosaic pixels: reweighted least squares with the Cauchy loss.

    The loss width follows the spread of the residuals, so that a smooth pattern is fitted even if it is large.
    """
    rows, apart, confidence = matches.rows[chosen], matches.apart[chosen], matches.confidence[chosen]
    left = apart
    nodes = np.zeros((rows.shape[1], 2))
    for _ in range(REWEIGHTINGS):
        distance = np.hypot(*left.T)
        deviation = max(float(np.median(distance)) / MEDIAN_LENGTH, LEAST_DEVIATION_PX)
        weights = confidence * cauchy_weights(distance, CAUCHY_WIDTH * deviation) / deviation**2
        weighted = rows.multiply(weights[:, None]).tocsr()
        normal = splu((rows.T @ weighted + priors).tocsc(), permc_spec="MMD_AT_PLUS_A")
        nodes = normal.solve(-(weighted.T @ apart))
        left = apart + rows @ nodes
    return nodes


def _pair_rms(apart: Points, pair: Nodes, chosen: Mask) -> Vector:
    """RMS length of each pair's chosen vectors, of (N, 2), without the longest; 0 for too few."""
    rms = np.zeros(int(pair.max()) + 1)
    for k in range(len(rms)):
        squares = np.sort((apart[chosen & (pair == k)] ** 2).sum(axis=1))
        if len(squares) >= FEWEST:
            rms[k] = np.sqrt(squares[: int(np.ceil(TRIMMED * len(squares)))].mean())
    return rms


def _field(grid: _Grid, H_mosaic_flat: Homography, nodes: Points) -> DisplacementField:
    """The displacement in flat pixels of `nodes` (all, 2) in mosaic pixels."""
    own = nodes[grid.first : grid.first + grid.count]
    flat = np.linalg.solve(jacobians(H_mosaic_flat, grid.points()), own[:, :, None])[:, :, 0]
    return DisplacementField(flat.reshape(grid.rows, grid.columns, 2), grid.width, grid.height)


def _gradient(field: DisplacementField) -> float:
    """Largest gradient of the displacement between neighbouring nodes."""
    rows, columns = field.nodes.shape[:2]
    across = np.diff(field.nodes, axis=1) / (max(field.width - 1, 1) / (columns - 1))
    down = np.diff(field.nodes, axis=0) / (max(field.height - 1, 1) / (rows - 1))
    return float(max(np.linalg.norm(across, axis=2).max(), np.linalg.norm(down, axis=2).max()))
