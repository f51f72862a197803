"""The frontal frame of the page, estimated from all photos.

In the dissertation the page's frame is that of the base photo's rectification, so mosaics with different bases differ
by a projective map (4.5). Here all rectifications contribute: each flat view is frontal except for an error of its own,
so the page's frame is the one in which all views together are closest to similarities.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Homography, Mask, Points, Vector
from services.geometry.homographies import denominators, scaling, transform_points, translation
from services.geometry.page_frame import LONGEST_SIDE_PX
from services.mosaic.flat_photo import FlatPhoto, trust_by_error
from services.robust import cauchy_weights, geman_mcclure_weights

Complex = NDArray[np.complex128]


# Departures are RMS, relative to half a view's diagonal.
USUAL_DEPARTURE = 0.004
"""Departure of a good rectification; views with a larger one get less trust."""
SPREAD = 2.0
"""Factor on the departure of most views; it replaces the usual departure if all are worse."""
MAJORITY = 0.6
"""Share of a majority: two of three, three of four; two against two are no majority."""
USUAL_TURN_DEG = 0.5
"""Usual deviation of the text direction."""
DETAIL_SHARE = 0.85
"""Share of the area that keeps all its pixels, as in framing; with few photos it includes the finest one."""
MAX_GROWTH = 4.0
"""Largest ratio of mosaic pixels to those of all photos; photos along a diagonal leave empty corners."""
MAX_PIXELS = 1e8
"""Largest mosaic: about 16 photos of 12 megapixels with the usual overlap."""
MOST_STEPS = 60
"""Largest number of iterations; reweighting gains about a digit in three steps."""


@dataclass(frozen=True, slots=True, eq=False)
class FrontalFrame:
    """Frame of the page: `width` x `height` mosaic pixels.

    Attributes
    ----------
    H_mosaic_world : world of the adjustment -> mosaic pixels.
    departures : photo index -> RMS distance of its view from a similarity, relative to half the view's diagonal.
    trust : photo index -> its weight in the estimate, 0-1; the sum is 1.
    """

    H_mosaic_world: Homography
    width: int
    height: int
    departures: dict[int, float]
    trust: dict[int, float]


@dataclass(frozen=True, slots=True, eq=False)
class ViewInWorld:
    """Points of a view, as many as of any other: normalised (N,), complex, with half its diagonal as unit, and in the
    world (N, 2).
    """

    normalised: Complex
    world: Points
    half_diagonal_px: float


@dataclass(frozen=True, slots=True, eq=False)
class Agreement:
    """The frame, and for each view (n,): its best similarity as a complex factor (normalised over frontal), its RMS
    departure from that relative to half its diagonal, and its weight.
    """

    H_frontal_world: Homography
    factors: Complex
    departures: Vector
    trust: Vector


def agree_on_frontal_frame(
    photos: Mapping[int, FlatPhoto], H_world_flat: Mapping[int, Homography]
) -> FrontalFrame:
    """The frontal frame of `photos`; `H_world_flat` places each view, up to one common homography.

    The text of most photos is parallel to x. The photo with the finest detail keeps its resolution. The shown area
    starts at 0. The result does not depend on the order of the photos.
    """
    order = list(H_world_flat)
    weights = np.array([max(photos[k].weight, 1e-9) for k in order])
    weights *= trust_by_error([photos[k] for k in order])
    outlines = [_outline(photos[k].shown) for k in order]
    views = [_view(outline, H_world_flat[k]) for k, outline in zip(order, outlines, strict=True)]
    agreed = agree_on_views(views, weights / weights.sum())
    H_frontal_flat = [agreed.H_frontal_world @ H_world_flat[k] for k in order]
    # Frontal units per flat pixel.
    scales = np.array([1 / (abs(a) * v.half_diagonal_px) for a, v in zip(agreed.factors, views, strict=True)])
    areas = np.array([float(photos[k].shown.sum()) for k in order])
    turn = _turn(-np.angle(agreed.factors), agreed.trust, weights, areas)
    native = np.array([photos[k].native_scale for k in order])
    scale = _percentile(1 / (scales * native), areas * scales**2, DETAIL_SHARE)
    upright = np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    low, high = _bounds([upright @ H for H in H_frontal_flat], outlines)
    extent = np.maximum(high - low, 1e-9)
    photo_pixels = sum(float(photos[k].photo.shape[0] * photos[k].photo.shape[1]) for k in order)
    scale = min(
        scale,
        float(np.sqrt(min(MAX_PIXELS, MAX_GROWTH * photo_pixels) / (extent[0] * extent[1]))),
        LONGEST_SIDE_PX / float(extent.max()),
    )
    H = scaling(scale) @ translation(-float(low[0]), -float(low[1])) @ upright @ agreed.H_frontal_world
    # The tolerance keeps the last pixel centre despite rounding errors.
    width, height = (int(np.floor(e * scale + 1e-3)) + 1 for e in extent)
    return FrontalFrame(
        H,
        width,
        height,
        dict(zip(order, agreed.departures.tolist(), strict=True)),
        dict(zip(order, agreed.trust.tolist(), strict=True)),
    )


def _outline(shown: Mask) -> Points:
    """First and last shown pixels (N, 2) of every row and column; they contain all corners of the shown part."""
    if not shown.any():
        shown = np.ones_like(shown)
    # Along rows of bytes the first one is found at once, along columns one by one.
    rows, left, right = _ends(shown.view(np.uint8))
    columns, top, bottom = _ends(np.asarray(cv2.transpose(shown.view(np.uint8)), np.uint8))
    x = np.concatenate([left, right, columns, columns])
    y = np.concatenate([rows, rows, top, bottom])
    return np.stack([x, y], axis=1).astype(np.float64)


def _ends(shown: NDArray[np.uint8]) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Rows (N,) of `shown` (h, w) 0/1 with anything, and the first and last column of each."""
    first = shown.view(np.bool_).argmax(axis=1)
    last = shown.shape[1] - 1 - np.asarray(cv2.flip(shown, 1)).view(np.bool_).argmax(axis=1)
    rows = np.flatnonzero(shown[np.arange(len(shown)), first])
    return rows, first[rows], last[rows]


def _view(outline: Points, H_world_flat: Homography, points: int = 7) -> ViewInWorld:
    """A grid over the bounding box of `outline` (flat pixels)."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    grid = np.stack(np.meshgrid(*np.linspace(low, high, points).T), axis=-1).reshape(-1, 2)
    half_diagonal = max(0.5 * float(np.hypot(*(high - low))), 1.0)
    centred = (grid - 0.5 * (low + high)) / half_diagonal
    return ViewInWorld(
        centred[:, 0] + 1j * centred[:, 1], transform_points(H_world_flat, grid), half_diagonal
    )


def agree_on_views(views: list[ViewInWorld], weights: Vector) -> Agreement:
    """The frontal frame of `views` with `weights` (n,) of sum 1.

    Gauss-Newton on the departures from similarities, reweighted by the Geman-McClure loss. Each view's own similarity
    is eliminated (variable projection, with Kaufman's Jacobian). Four parameters of the frame remain: aspect, shear and
    two of foreshortening.
    """
    H = _frontal_of(views[int(np.argmax(weights))])
    every = transform_points(H, np.concatenate([view.world for view in views]))
    middle, extent = every.mean(axis=0), float(np.abs(every - every.mean(axis=0)).max())
    H = scaling(1 / extent) @ translation(-float(middle[0]), -float(middle[1])) @ H
    normalised, world = (
        np.stack([view.normalised for view in views]),
        np.stack([view.world for view in views]),
    )
    trust = weights
    for _ in range(MOST_STEPS):
        z, motions = _motions(H, world)
        factors, r, J = departures_from_similarity(z, normalised, motions)
        departures = np.sqrt((np.abs(r) ** 2).mean(axis=1))
        weighted = J.conj() * (trust / z.shape[1])[:, None, None]
        A = 1e-12 * np.eye(4) + np.einsum("njk,njl->kl", weighted, J, optimize=True).real
        aspect, shear, across, down = np.linalg.solve(A, -np.einsum("njk,nj->k", weighted, r).real)
        H = np.array([[1 + aspect, shear, 0], [shear, 1 - aspect, 0], [across, down, 1]]) @ H
        before, trust = trust, _trusted(departures, weights)
        if max(np.abs([aspect, shear, across, down]).max(), np.abs(trust - before).max()) < 1e-12:
            break
    return Agreement(H, factors, departures, trust)


def departures_from_similarity(
    z: Complex, normalised: Complex, motions: Complex
) -> tuple[Complex, Complex, Complex]:
    """Best similarities of views, as factors (n,), what they leave (n, N), and its derivatives (n, N, K).

    Points `z` (n, N), which move by `motions` (n, N, K), are mapped to those of the `normalised` views (n, N).
    """
    around, there = z - z.mean(axis=1, keepdims=True), normalised - normalised.mean(axis=1, keepdims=True)
    squares = (np.abs(around) ** 2).sum(axis=1)
    factors = (around.conj() * there).sum(axis=1) / squares
    moved = motions - motions.mean(axis=1, keepdims=True)
    along = np.einsum("nj,njk->nk", around.conj(), moved) / squares[:, None]
    derivatives = -factors[:, None, None] * (moved - around[..., None] * along[:, None])
    return factors, there - factors[:, None] * around, derivatives


def _frontal_of(view: ViewInWorld) -> Homography:
    """The homography world -> normalised points that makes one view a similarity."""
    x, y, u, v = *view.world.T, view.normalised.real, view.normalised.imag
    zero, one = np.zeros_like(x), np.ones_like(x)
    shift, size = view.world.mean(axis=0), float(np.abs(view.world - view.world.mean(axis=0)).max())
    x, y = (x - shift[0]) / size, (y - shift[1]) / size
    rows = np.concatenate(
        [
            np.stack([x, y, one, zero, zero, zero, -u * x, -u * y, -u], axis=1),
            np.stack([zero, zero, zero, x, y, one, -v * x, -v * y, -v], axis=1),
        ]
    )
    H = np.linalg.svd(rows)[2][-1].reshape(3, 3)
    return np.asarray(H @ scaling(1 / size) @ translation(-float(shift[0]), -float(shift[1])))


def _motions(H: Homography, world: Floats) -> tuple[Complex, Complex]:
    """Frontal points (n, N) of `world` (n, N, 2), and their derivatives (n, N, 4) by aspect, shear and foreshortening
    across and down.
    """
    x, y = transform_points(H, world.reshape(-1, 2)).T.reshape(2, *world.shape[:2])
    z = x + 1j * y
    return z, np.stack([x - 1j * y, y + 1j * x, -x * z, -y * z], axis=2)


def _trusted(departures: Vector, weights: Vector) -> Vector:
    """Weights (n,) of the views, smaller for a larger departure than most. With two views neither is preferred."""
    if len(weights) < 3:
        return weights
    usual = max(USUAL_DEPARTURE, SPREAD * _percentile(departures, weights, MAJORITY))
    trust = weights * geman_mcclure_weights(departures, usual)
    return np.asarray(trust / trust.sum())


def _turn(angles: Vector, trust: Vector, weights: Vector, areas: Vector) -> float:
    """Direction of the page's x axis, radians: the views' mean modulo quarter turns, and the quarter of most text."""
    usual = np.radians(USUAL_TURN_DEG)
    mean = float(np.angle((trust * np.exp(4j * angles)).sum())) / 4
    for _ in range(MOST_STEPS):
        off = np.angle(np.exp(4j * (angles - mean))) / 4
        robust = trust * cauchy_weights(off, usual) if len(angles) > 2 else trust
        change = float((robust * off).sum() / robust.sum())
        mean += change
        if abs(change) < 1e-13:
            break
    quarters = np.round((angles - mean) / (np.pi / 2)).astype(int) % 4
    # If two quarters have equally many characters, the photo of larger weight decides, then the larger area.
    votes = [
        (
            float(weights[quarters == q].sum()),
            float(weights[quarters == q].max()),
            float(areas[quarters == q].sum()),
            q,
        )
        for q in range(4)
        if (quarters == q).any()
    ]
    return mean + max(votes)[3] * np.pi / 2


def _percentile(values: Vector, weights: Vector, share: float) -> float:
    """The smallest of `values` with at least `share` of the weight at or below it."""
    order = np.lexsort((weights, values))
    reached = np.cumsum(weights[order]) >= share * weights.sum() * (1 - 1e-9)
    return float(values[order][int(np.argmax(reached))])


def _bounds(maps: list[Homography], outlines: list[Points]) -> tuple[Floats, Floats]:
    """Lowest and highest coordinates (2,) of all outlines; points beyond a vanishing line do not count."""
    seen = []
    for H, outline in zip(maps, outlines, strict=True):
        w = denominators(H, outline)
        seen.append(transform_points(H, outline[w * np.median(w) > 1e-3 * np.median(w) ** 2]))
    every = np.concatenate(seen)
    return every.min(axis=0), every.max(axis=0)
