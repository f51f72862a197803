"""Views of one plane with known homographies, and matches between them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from services.arrays import Homography, Points
from services.geometry.homographies import scaling, transform_points, translation
from services.mosaic.registration.pair_registration import PairRegistration

SIZE = (1600, 1200)
NORMALISED = np.array([[1e-3, 0, -0.8], [0, 1e-3, -0.6], [0, 0, 1.0]])


def imperfection(rng: np.random.Generator, size: float) -> Homography:
    """What an imperfect rectification leaves: normal errors of `size` in shear, aspect and foreshortening."""
    E = np.eye(3)
    E[:2, :2] += rng.normal(0, size, (2, 2))
    E[2, :2] = rng.normal(0, size, 2)
    return np.linalg.inv(NORMALISED) @ E @ NORMALISED


def grid_views(
    rng: np.random.Generator, rows: int, columns: int, overlap: float = 0.3, error: float = 0.01
) -> dict[int, Homography]:
    """`H_page_flat` of views of `SIZE` that overlap by about `overlap` of their sides."""
    views = {}
    for row in range(rows):
        for column in range(columns):
            x, y = column * SIZE[0] * (1 - overlap), row * SIZE[1] * (1 - overlap)
            views[len(views)] = (
                translation(x, y) @ scaling(np.exp(rng.uniform(-0.1, 0.1))) @ imperfection(rng, error)
            )
    return views


def grid(columns: int = 9, rows: int = 9, size: tuple[int, int] = SIZE) -> Points:
    """Points (rows * columns, 2) that cover a view."""
    x, y = np.linspace(0, size[0] - 1, columns), np.linspace(0, size[1] - 1, rows)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def match(
    rng: np.random.Generator,
    views: dict[int, Homography],
    a: int,
    b: int,
    noise_px: float = 0.0,
    count: int = 200,
    offset: tuple[float, float] = (0.0, 0.0),
) -> PairRegistration | None:
    """Matches in the overlap of two views, those of `b` displaced by `offset`; None where hardly any is."""
    points = grid(60, 60)
    there = transform_points(np.linalg.inv(views[b]) @ views[a], points)
    inside = (there >= 0).all(axis=1) & (there <= np.array(SIZE) - 1).all(axis=1)
    if inside.sum() < 40:
        return None
    chosen = rng.choice(np.flatnonzero(inside), min(count, int(inside.sum())), replace=False)
    noise = rng.normal(0, noise_px, (len(chosen), 2))
    # Registration's own fit is good to a pixel.
    near = translation(*(rng.normal(0, 1, 2) - offset))
    H_a_b = np.linalg.inv(views[a]) @ views[b] @ near
    return PairRegistration(
        a,
        b,
        H_a_b / H_a_b[2, 2],
        points[chosen],
        there[chosen] + noise + offset,
        np.ones(len(chosen)),
        500,
        100,
        10,
        0.9,
    )


def match_all(
    rng: np.random.Generator, views: dict[int, Homography], noise_px: float = 0.0, count: int = 200
) -> list[PairRegistration]:
    """All pairs that overlap."""
    pairs = [match(rng, views, a, b, noise_px, count) for a in views for b in views if a < b]
    return [pair for pair in pairs if pair is not None]


def renumber(pairs: Sequence[PairRegistration], numbers: Sequence[int]) -> list[PairRegistration]:
    """The same pairs of photos that were uploaded in another order: photo k has become `numbers[k]`."""
    renumbered = []
    for pair in pairs:
        a, b = int(numbers[pair.a]), int(numbers[pair.b])
        if a < b:
            renumbered.append(replace(pair, a=a, b=b))
            continue
        inverse = np.linalg.inv(pair.H_a_b)
        renumbered.append(
            replace(pair, a=b, b=a, H_a_b=inverse, points_a=pair.points_b, points_b=pair.points_a)
        )
    return renumbered
