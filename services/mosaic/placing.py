"""From pairs of photos to the place of each on the page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from services.geometry.homographies import resizing
from services.mosaic.adjustment import adjust_globally
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.frontal_frame import agree_on_frontal_frame
from services.mosaic.pair_registration import PairRegistration
from services.mosaic.photo_graph import choose_part, connect_photos
from services.mosaic.placement import Placement
from services.mosaic.residual_warp import estimate_residual_warps

MOST_PIXELS = 80e6
"""A3 at 600 dots per inch; a page of more is drawn smaller."""
LONGEST_SIDE_PX = 20000.0


@dataclass(frozen=True, slots=True, eq=False)
class PlacedPart:
    """The photos that make the page, by index, in the mosaic's pixels of a page `width` x `height`."""

    base: int
    placements: Mapping[int, Placement]
    pairs: tuple[PairRegistration, ...]
    width: int
    height: int


def place_photos(
    photos: Mapping[int, FlatPhoto], pairs: Sequence[PairRegistration], base: int | None
) -> PlacedPart:
    """The part of the photos that becomes the page, adjusted as a whole.

    Pairs that the others contradict are left out, and photos that only they connected with them.

    Raises
    ------
    NotOverlapping
        When that part is a single photo.
    """
    agreeing = tuple(pairs)
    while True:
        parts = connect_photos(photos, [(pair.a, pair.b) for pair in agreeing])
        part, chosen = choose_part(parts, photos, base)
        within = tuple(pair for pair in agreeing if pair.a in part)
        adjustment = adjust_globally({index: photos[index].size for index in part}, within)
        contradicted = {(pair.a, pair.b) for pair in adjustment.pairs if pair.contradicted}
        if not contradicted:
            break
        agreeing = tuple(pair for pair in agreeing if (pair.a, pair.b) not in contradicted)
    frontal = agree_on_frontal_frame([photos[index] for index in part], adjustment.H_world_flat)
    factor = min(
        1.0,
        float(np.sqrt(MOST_PIXELS / (frontal.width * frontal.height))),
        LONGEST_SIDE_PX / max(frontal.width, frontal.height),
    )
    H_mosaic_world = resizing(factor) @ frontal.H_frontal_world
    placements = estimate_residual_warps(
        [photos[index] for index in part],
        {index: Placement(H_mosaic_world @ adjustment.H_world_flat[index]) for index in part},
        within,
    )
    width, height = (max(round(side * factor), 1) for side in (frontal.width, frontal.height))
    return PlacedPart(chosen, placements, within, width, height)
