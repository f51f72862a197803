"""The frontal frame that all photos agree on.

In the dissertation the base photo's rectification is the page's, so that mosaics of different bases differ by a
projective map (4.5). Here every photo's rectification has a say: its flat view is frontal but for an error of its own,
so the page is the one frame in which all views together are as near to similarities as can be.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Homography, Mask, Points, Vector
from services.geometry.homographies import denominators, scaling, transform_points, translation
from services.mosaic.flat_photo import FlatPhoto
from services.robust import cauchy_weights, geman_mcclure_weights

Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class FrontalFrameParameters:
    """Departures are RMS, relative to half a view's diagonal."""

    usual_departure: float = 0.004
    """What a good rectification leaves; a view must depart further before it is trusted less."""
    spread: float = 2.0
    """Or this many times the departure that most keep within, where all are worse."""
    most: float = 0.6
    """Two of three, three of four: two against two are no majority."""
    usual_turn_deg: float = 0.5
    """The same for the direction of the text."""
    detail_share: float = 0.85
    """This share of the area keeps all its pixels, as in framing; with few photos the finest one is among it."""
    max_growth: float = 4.0
    """Mosaic pixels over those of all photos: photos that lie on a diagonal leave corners empty."""
    max_pixels: float = 1e8
    """Some 16 photos of 12 megapixels with the usual overlap."""
    max_side_px: int = 20000
    """As in framing."""
    most_steps: int = 60
    """Reweighting wins about a digit in three steps."""


@dataclass(frozen=True, slots=True, eq=False)
class FrontalFrame:
    """The page's frame: `width` x `height` mosaic pixels.

    Attributes
    ----------
    H_mosaic_world : world of the adjustment -> mosaic pixels.
    departures : photo index -> RMS distance of its view from a similarity, relative to half the view's diagonal.
    trust : photo index -> its share in the agreement, 0-1; they add up to 1.
    """

    H_mosaic_world: Homography
    width: int
    height: int
    departures: dict[int, float]
    trust: dict[int, float]


@dataclass(frozen=True, slots=True, eq=False)
class ViewInWorld:
    """Points of a view: normalised (N,), complex, with half its diagonal 1, and in the world (N, 2)."""

    normalised: Complex
    world: Points
    half_diagonal_px: float


@dataclass(frozen=True, slots=True, eq=False)
class Agreement:
    """The frame, and per view (n,): its best similarity as a complex factor (normalised over frontal), its departure
    from that, RMS relative to half its diagonal, and its share in the agreement.
    """

    H_frontal_world: Homography
    factors: Complex
    departures: Vector
    trust: Vector


def agree_on_frontal_frame(
    photos: Mapping[int, FlatPhoto],
    H_world_flat: Mapping[int, Homography],
    parameters: FrontalFrameParameters | None = None,
) -> FrontalFrame:
    """The frame that the views of `photos` agree on; `H_world_flat` places each, up to one homography of the world.

    The text of most photos reads along x, turned by no more than the agreement leaves; the photo with the finest detail
    keeps its pixels; what the photos show begins at 0. None of it depends on the order of photos.
    """
    p = parameters or FrontalFrameParameters()
    order = list(H_world_flat)
    weights = np.array([max(photos[k].weight, 1e-9) for k in order])
    outlines = [_outline(photos[k].shown) for k in order]
    views = [_view(outline, H_world_flat[k]) for k, outline in zip(order, outlines, strict=True)]
    agreed = agree_on_views(views, weights / weights.sum(), p)
    H_frontal_flat = [agreed.H_frontal_world @ H_world_flat[k] for k in order]
    # Frontal units per flat pixel.
    scales = np.array([1 / (abs(a) * v.half_diagonal_px) for a, v in zip(agreed.factors, views, strict=True)])
    areas = np.array([float(photos[k].shown.sum()) for k in order])
    turn = _turn(-np.angle(agreed.factors), agreed.trust, weights, areas, p)
    native = np.array([photos[k].native_scale for k in order])
    scale = _percentile(1 / (scales * native), areas * scales**2, p.detail_share)
    upright = np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    low, high = _bounds([upright @ H for H in H_frontal_flat], outlines)
    extent = np.maximum(high - low, 1e-9)
    photo_pixels = sum(float(photos[k].photo.shape[0] * photos[k].photo.shape[1]) for k in order)
    scale = min(
        scale,
        float(np.sqrt(min(p.max_pixels, p.max_growth * photo_pixels) / (extent[0] * extent[1]))),
        p.max_side_px / float(extent.max()),
    )
    H = scaling(scale) @ translation(-float(low[0]), -float(low[1])) @ upright @ agreed.H_frontal_world
    # The last pixel centre within the bounds, whatever the last digit.
    width, height = (int(np.floor(e * scale + 1e-3)) + 1 for e in extent)
    return FrontalFrame(
        H,
        width,
        height,
        dict(zip(order, agreed.departures.tolist(), strict=True)),
        dict(zip(order, agreed.trust.tolist(), strict=True)),
    )


def _outline(shown: Mask) -> Points:
    """First and last shown pixels (N, 2) of every row and column: they hold all corners of the shown part."""
    if not shown.any():
        shown = np.ones_like(shown)
    height, width = shown.shape
    rows, columns = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(shown.any(axis=0))
    left, right = shown[rows].argmax(axis=1), width - 1 - shown[rows, ::-1].argmax(axis=1)
    top, bottom = shown[:, columns].argmax(axis=0), height - 1 - shown[::-1, columns].argmax(axis=0)
    x = np.concatenate([left, right, columns, columns])
    y = np.concatenate([rows, rows, top, bottom])
    return np.stack([x, y], axis=1).astype(np.float64)


def _view(outline: Points, H_world_flat: Homography, points: int = 7) -> ViewInWorld:
    """A grid over the box that `outline` (flat pixels) fills."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    grid = np.stack(np.meshgrid(*np.linspace(low, high, points).T), axis=-1).reshape(-1, 2)
    half_diagonal = max(0.5 * float(np.hypot(*(high - low))), 1.0)
    centred = (grid - 0.5 * (low + high)) / half_diagonal
    return ViewInWorld(
        centred[:, 0] + 1j * centred[:, 1], transform_points(H_world_flat, grid), half_diagonal
    )


def agree_on_views(
    views: list[ViewInWorld], weights: Vector, parameters: FrontalFrameParameters | None = None
) -> Agreement:
    """The frame that `views` of `weights` (n,), which add up to 1, agree on.

    Gauss-Newton on the departures from similarities, reweighted by Geman and McClure's loss.

    Each view's own similarity is eliminated (variable projection, with Kaufman's Jacobian), so that four parameters of
    the frame remain: its aspect, its shear and two of foreshortening.
    """
    p = parameters or FrontalFrameParameters()
    H = _frontal_of(views[int(np.argmax(weights))])
    every = transform_points(H, np.concatenate([view.world for view in views]))
    middle, extent = every.mean(axis=0), float(np.abs(every - every.mean(axis=0)).max())
    H = scaling(1 / extent) @ translation(-float(middle[0]), -float(middle[1])) @ H
    trust = weights
    for _ in range(p.most_steps):
        A, g = 1e-12 * np.eye(4), np.zeros(4)
        departures, factors = np.zeros(len(views)), np.zeros(len(views), np.complex128)
        for k, view in enumerate(views):
            z, motions = _motions(H, view.world)
            span, _ = np.linalg.qr(np.stack([np.ones_like(z), z], axis=1))
            r = view.normalised - span @ (span.conj().T @ view.normalised)
            around = z - z.mean()
            factors[k] = np.vdot(around, view.normalised) / np.vdot(around, around)
            departures[k] = np.sqrt((np.abs(r) ** 2).mean())
            J = -factors[k] * (motions - span @ (span.conj().T @ motions))
            A += trust[k] * (J.conj().T @ J).real / len(z)
            g -= trust[k] * (J.conj().T @ r).real / len(z)
        aspect, shear, across, down = np.linalg.solve(A, g)
        H = np.array([[1 + aspect, shear, 0], [shear, 1 - aspect, 0], [across, down, 1]]) @ H
        before, trust = trust, _trusted(departures, weights, p)
        if max(np.abs([aspect, shear, across, down]).max(), np.abs(trust - before).max()) < 1e-12:
            break
    return Agreement(H, factors, departures, trust)


def _frontal_of(view: ViewInWorld) -> Homography:
    """The homography that makes one view, by itself, a similarity: world -> its normalised points."""
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


def _motions(H: Homography, world: Points) -> tuple[Complex, Complex]:
    """Frontal points (N,) and their motions (N, 4) under aspect, shear and foreshortening across and down."""
    x, y = transform_points(H, world).T
    z = x + 1j * y
    return z, np.stack([x - 1j * y, y + 1j * x, -x * z, -y * z], axis=1)


def _trusted(departures: Vector, weights: Vector, p: FrontalFrameParameters) -> Vector:
    """Shares (n,) of the views: less for one that departs further than most. Of two, none can tell which is wrong."""
    if len(weights) < 3:
        return weights
    usual = max(p.usual_departure, p.spread * _percentile(departures, weights, p.most))
    trust = weights * geman_mcclure_weights(departures, usual)
    return np.asarray(trust / trust.sum())


def _turn(angles: Vector, trust: Vector, weights: Vector, areas: Vector, p: FrontalFrameParameters) -> float:
    """Direction of the page's x axis, radians: the views' mean modulo quarter turns, and the quarter of most text."""
    usual = np.radians(p.usual_turn_deg)
    mean = float(np.angle((trust * np.exp(4j * angles)).sum())) / 4
    for _ in range(p.most_steps):
        off = np.angle(np.exp(4j * (angles - mean))) / 4
        robust = trust * cauchy_weights(off, usual) if len(angles) > 2 else trust
        change = float((robust * off).sum() / robust.sum())
        mean += change
        if abs(change) < 1e-13:
            break
    quarters = np.round((angles - mean) / (np.pi / 2)).astype(int) % 4
    # Where two quarters hold as many characters, the heavier photo and then the larger area decides.
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
    """Lowest and highest coordinates (2,) of all outlines; what lies beyond a vanishing line is none."""
    seen = []
    for H, outline in zip(maps, outlines, strict=True):
        w = denominators(H, outline)
        seen.append(transform_points(H, outline[w * np.median(w) > 1e-3 * np.median(w) ** 2]))
    every = np.concatenate(seen)
    return every.min(axis=0), every.max(axis=0)
