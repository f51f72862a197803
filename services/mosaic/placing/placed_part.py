"""Placement of photos on the page, from their pairs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.photo_graph import choose_part, connect_photos
from services.mosaic.placing.adjustment import adjust_globally
from services.mosaic.placing.frontal_frame import agree_on_frontal_frame
from services.mosaic.placing.placement import Placement
from services.mosaic.placing.residual_warp import estimate_residual_warp
from services.mosaic.registration.pair_registration import PairRegistration


@dataclass(frozen=True, slots=True, eq=False)
class PlacedPart:
    """The photos of the page, by index, placed in the pixels of a page of `width` x `height`."""

    base: int
    placements: Mapping[int, Placement]
    pairs: tuple[PairRegistration, ...]
    width: int
    height: int


def place_photos(
    photos: Mapping[int, FlatPhoto], pairs: Sequence[PairRegistration], base: int | None
) -> PlacedPart:
    """The part of the photos that becomes the page, with all placements adjusted together.

    Pairs that contradict the others are left out, and photos that are connected only by them.

    Raises
    ------
    NotOverlapping
        When the part is a single photo.
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
    frontal = agree_on_frontal_frame({index: photos[index] for index in part}, adjustment.H_world_flat)
    H_mosaic_flat = {index: frontal.H_mosaic_world @ adjustment.H_world_flat[index] for index in part}
    warp = estimate_residual_warp({index: photos[index] for index in part}, H_mosaic_flat, within)
    placements = {index: Placement(H_mosaic_flat[index], warp.displacements[index]) for index in part}
    return PlacedPart(chosen, placements, within, frontal.width, frontal.height)
