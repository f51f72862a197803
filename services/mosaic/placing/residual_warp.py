"""What homographies leave between photos of a gently curved page, taken up by smooth displacements.

The dissertation leaves this open (4.6). Every view gets a displacement on a coarse grid; all are sought together, by
linear least squares over the matches of all pairs, so that no photo is bent to fit one that is itself out of place.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, vstack
from scipy.sparse.linalg import splu

from services.arrays import Floats, Homography, Mask, Points, Vector
from services.geometry.homographies import jacobians, transform_points
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.placing.placement import DisplacementField
from services.mosaic.registration.pair_registration import PairRegistration
from services.robust import MEDIAN_LENGTH, cauchy_weights

Nodes = NDArray[np.intp]
"""Numbers of nodes, any shape."""


@dataclass(frozen=True, slots=True)
class ResidualWarpParameters:
    """Lengths are relative to the text height, shares to one."""

    node_spacing: float = 4.0
    """Pages curve over tens of text heights, creases over a few; blocks lie every two or so."""
    most_nodes: int = 24
    """Along a side."""
    most_nodes_in_all: int = 3000
    """Of all views, so that 16 photos take a second or two; about."""
    reach: float = 0.1
    """Of a view's diagonal: over this a displacement changes and, beyond the overlaps, dies out."""
    worthwhile: float = 0.02
    """RMS that is worth it: half a pixel at 300 dpi."""
    gain: float = 0.7
    """Share that may be left of the RMS of matches that were held out."""
    harm: float = 1.1
    """No pair's may rise by more, if it matters."""
    fewest: int = 8
    """Held-out matches of a pair that has a say."""
    held_out_cell: float = 3.0
    """Matches are held out by cells a little larger than their blocks, one in five."""
    trimmed: float = 0.75
    """Share of the matches that an RMS is taken of: the rest may be wrong."""
    greatest: float = 1.0
    """Displacement; more is no residual."""
    greatest_of_diagonal: float = 0.02
    """The same, of the view's diagonal."""
    greatest_gradient: float = 0.05
    """Of a displacement: far from a fold, and the inverse's fixed point gains more than a digit a step."""
    loss_width: float = 2.385
    """Cauchy's width over the standard deviation: 95 % efficiency on normal errors (Holland and Welsch 1977)."""
    least_deviation: float = 0.001
    """Block matching is no better."""
    reweightings: int = 4
    """The weights hardly change after."""
    stiffer: float = 5.0
    """Where the bounds do not hold the fields are made stiffer by this factor, twice, before none is taken."""


@dataclass(frozen=True, slots=True, eq=False)
class ResidualWarp:
    """Photo index -> its displacement; None for all where it was not worth it or was not borne out.

    `before_px` and `after_px` are RMS distances, mosaic pixels, of those matches of the worst pair that the
    displacements were not fitted to.
    """

    displacements: dict[int, DisplacementField | None]
    before_px: float
    after_px: float


@dataclass(frozen=True, slots=True, eq=False)
class _Grid:
    """Nodes of a view, from `first` on among all."""

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
    """All matches: what separates them (N, 2), mosaic pixels, how the nodes' displacements would, and of which pair."""

    apart: Points
    pair: Nodes
    rows: csr_array
    confidence: Vector
    held_out: Mask


def estimate_residual_warp(
    photos: Mapping[int, FlatPhoto],
    H_mosaic_flat: Mapping[int, Homography],
    pairs: Sequence[PairRegistration],
    parameters: ResidualWarpParameters | None = None,
) -> ResidualWarp:
    """Displacements of the views that close what `H_mosaic_flat` leave between the matches of `pairs`.

    `pairs` are those that the adjustment did not find contradicted. The displacements keep within a text height, are
    far from folding, and die out away from the overlaps, so that the page's frame stays.
    """
    p = parameters or ResidualWarpParameters()
    none = dict.fromkeys(H_mosaic_flat)
    pairs = [pair for pair in pairs if len(pair.weights)]
    if not pairs:
        return ResidualWarp(dict(none), 0.0, 0.0)
    scales = {k: _scale(photos[k], H) for k, H in H_mosaic_flat.items()}
    text_height = float(np.median([photos[k].text_height_px * s for k, s in scales.items()]))
    grids = _grids(photos, H_mosaic_flat, p)
    diagonal = float(np.mean([np.hypot(*photos[k].size) * s for k, s in scales.items()]))
    greatest = min(p.greatest * text_height, p.greatest_of_diagonal * diagonal)
    matches = _gather(grids, H_mosaic_flat, pairs, p.held_out_cell * text_height)
    # Farther apart than two displacements may bring together: wrong.
    possible = np.hypot(*matches.apart.T) < 2 * greatest
    fitted, held_out = possible & ~matches.held_out, possible & matches.held_out
    of_pairs = _pair_rms(matches.apart, matches.pair, held_out, p)
    worst = int(np.argmax(of_pairs))
    before = float(of_pairs[worst])
    if before < p.worthwhile * text_height:
        return ResidualWarp(dict(none), before, before)
    priors = _priors(grids, scales, p)
    for stiffness in (1.0, p.stiffer, p.stiffer**2):
        weighed = priors * (stiffness / before) ** 2
        nodes = _fit(matches, fitted, weighed, text_height, p)
        left = _pair_rms(matches.apart + matches.rows @ nodes, matches.pair, held_out, p)
        after = float(left[worst])
        harmed = left > np.maximum(p.harm * of_pairs, p.worthwhile * text_height)
        if after > p.gain * before or harmed.any():
            break
        nodes = _fit(matches, possible, weighed, text_height, p)
        fields = {k: _field(grid, H_mosaic_flat[k], nodes) for k, grid in grids.items()}
        gentle = max(_gradient(field) for field in fields.values()) <= p.greatest_gradient
        if gentle and np.hypot(*nodes.T).max() <= greatest:
            return ResidualWarp(dict(fields), before, after)
    return ResidualWarp(dict(none), before, before)


def _scale(photo: FlatPhoto, H_mosaic_flat: Homography) -> float:
    """Mosaic pixels per flat pixel in the middle of a view."""
    middle = 0.5 * (np.array([photo.size], np.float64) - 1)
    return float(np.sqrt(abs(np.linalg.det(jacobians(H_mosaic_flat, middle)[0]))))


def _grids(
    photos: Mapping[int, FlatPhoto], H_mosaic_flat: Mapping[int, Homography], p: ResidualWarpParameters
) -> dict[int, _Grid]:
    spacings = {k: max(p.node_spacing * photos[k].text_height_px, 1.0) for k in H_mosaic_flat}
    sides = {
        k: [int(np.clip(np.ceil(side / spacings[k]) + 1, 4, p.most_nodes)) for side in photos[k].size]
        for k in H_mosaic_flat
    }
    total = sum(columns * rows for columns, rows in sides.values())
    fewer = min(1.0, float(np.sqrt(p.most_nodes_in_all / total)))
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
    """Matches of all pairs; which of them are held out is told by where on the mosaic they lie."""
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
        (i + 2 * j) % 5 == 0,
    )


def _priors(grids: Mapping[int, _Grid], scales: Mapping[int, float], p: ResidualWarpParameters) -> csr_array:
    """Quadratic form of what a displacement of size 1 costs: its height, slope and curvature over the reach.

    Differences over h are expected to be h / reach, second ones (h / reach)^2: beyond the data a field then falls off
    within about the reach, and hardly overshoots.
    """
    blocks = []
    total = sum(grid.count for grid in grids.values())
    for k, grid in grids.items():
        reach = p.reach * np.hypot(grid.width, grid.height) * scales[k]
        ids = grid.first + np.arange(grid.count).reshape(grid.rows, grid.columns)
        h_x = (grid.width - 1) / (grid.columns - 1) * scales[k] / reach
        h_y = (grid.height - 1) / (grid.rows - 1) * scales[k] / reach
        # The sum over nodes approximates an integral over cells, in units of the reach.
        area = np.sqrt(h_x * h_y)
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


def _fit(
    matches: _Matches,
    chosen: Mask,
    priors: csr_array,
    text_height: float,
    p: ResidualWarpParameters,
) -> Points:
    """Displacements of all nodes (n, 2), mosaic pixels: reweighted least squares, Cauchy's loss.

    The width of the loss follows the spread of what is left, so that a smooth pattern, however far from the rest, is
    taken for what it is.
    """
    rows, apart, confidence = matches.rows[chosen], matches.apart[chosen], matches.confidence[chosen]
    left = apart
    nodes = np.zeros((rows.shape[1], 2))
    for _ in range(p.reweightings):
        distance = np.hypot(*left.T)
        deviation = max(float(np.median(distance)) / MEDIAN_LENGTH, p.least_deviation * text_height)
        weights = confidence * cauchy_weights(distance, p.loss_width * deviation) / deviation**2
        weighted = rows.multiply(weights[:, None]).tocsr()
        normal = splu((rows.T @ weighted + priors).tocsc(), permc_spec="MMD_AT_PLUS_A")
        nodes = normal.solve(-(weighted.T @ apart))
        left = apart + rows @ nodes
    return nodes


def _pair_rms(apart: Points, pair: Nodes, chosen: Mask, p: ResidualWarpParameters) -> Vector:
    """RMS length of each pair's chosen vectors, of (N, 2), without the longest; 0 where they are too few."""
    rms = np.zeros(int(pair.max()) + 1)
    for k in range(len(rms)):
        squares = np.sort((apart[chosen & (pair == k)] ** 2).sum(axis=1))
        if len(squares) >= p.fewest:
            rms[k] = np.sqrt(squares[: int(np.ceil(p.trimmed * len(squares)))].mean())
    return rms


def _field(grid: _Grid, H_mosaic_flat: Homography, nodes: Points) -> DisplacementField:
    """The displacement in flat pixels of `nodes` (all, 2) in mosaic pixels."""
    own = nodes[grid.first : grid.first + grid.count]
    flat = np.linalg.solve(jacobians(H_mosaic_flat, grid.points()), own[:, :, None])[:, :, 0]
    return DisplacementField(flat.reshape(grid.rows, grid.columns, 2), grid.width, grid.height)


def _gradient(field: DisplacementField) -> float:
    """Greatest change of the displacement over the way between neighbouring nodes."""
    rows, columns = field.nodes.shape[:2]
    across = np.diff(field.nodes, axis=1) / (max(field.width - 1, 1) / (columns - 1))
    down = np.diff(field.nodes, axis=0) / (max(field.height - 1, 1) / (rows - 1))
    return float(max(np.linalg.norm(across, axis=2).max(), np.linalg.norm(down, axis=2).max()))
