"""Matches of photos in other views of them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from services.arrays import Homography
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.registration.pair_registration import PairRegistration


def match_again(
    pairs: Sequence[PairRegistration],
    photos: Mapping[int, FlatPhoto],
    laid: Mapping[int, FlatPhoto],
    H_world_flat: Mapping[int, Homography],
) -> tuple[PairRegistration, ...]:
    """The matches of `photos` in the views `laid` that replace theirs, whose places on the page are known."""
    moved = []
    for pair in pairs:
        ends = [
            laid[index].frame.to_flat(photos[index].to_photo(points))
            for index, points in ((pair.a, pair.points_a), (pair.b, pair.points_b))
        ]
        known = np.isfinite(np.concatenate(ends, axis=1)).all(axis=1)
        moved.append(
            replace(
                pair,
                H_a_b=np.linalg.solve(H_world_flat[pair.a], H_world_flat[pair.b]),
                points_a=ends[0][known],
                points_b=ends[1][known],
                weights=pair.weights[known],
            )
        )
    return tuple(moved)
