"""Whole photos of a sheet that was bent between them: where two show the same, the better one alone is drawn.

Words of views that disagree lie beside each other; drawn side by side they are cut and doubled.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.light.hidden_parts import yielding_part
from services.mosaic.photo_graph import overlap_fraction
from services.mosaic.placed_photo import PlacedPhoto
from services.mosaic.placing.adjustment import residual_px
from services.mosaic.placing.joint_sheet import MOST_LEFT
from services.mosaic.placing.placed_part import PlacedPart
from services.mosaic.placing.placement import Placement
from services.notices import Notice

TORN = 0.1
"""RMS distance of matches, text heights, from which what differs at one place is other print, and nothing hides it:
single words lie several times further apart."""
WHOLE_OVERLAP = 0.8
"""Share of the smaller photo that both show. Parts of a page need each other, whatever they disagree in."""


@dataclass(frozen=True, slots=True)
class Disagreement:
    """Photo `index` shows the page otherwise than the better photo `leader`; `apart` in text heights."""

    index: int
    leader: int
    apart: float


def find_disagreements(part: PlacedPart, text_height_px: float, base: int | None) -> list[Disagreement]:
    """For each photo that disagrees with a better one, the best of these; `base` is the one that a person prefers."""
    found: dict[int, Disagreement] = {}
    for pair in part.pairs:
        a, b = part.photos[pair.a], part.photos[pair.b]
        apart = residual_px(pair, part.placements[pair.a], part.placements[pair.b]) / text_height_px
        if apart <= MOST_LEFT or overlap_fraction(a, b, pair.H_a_b) < WHOLE_OVERLAP:
            continue
        leader, index = sorted((pair.a, pair.b), key=lambda index: _rank(part.photos[index], base))
        known = found.get(index)
        if known is None or _rank(part.photos[leader], base) < _rank(part.photos[known.leader], base):
            found[index] = Disagreement(index, leader, apart)
    return list(found.values())


def straighten_leaders(part: PlacedPart, found: Sequence[Disagreement]) -> PlacedPart:
    """The part in which leaders are not displaced towards what is torn from them."""
    leaders = {each.leader for each in found if each.apart > TORN}
    return replace(
        part,
        placements={
            index: Placement(placement.H_mosaic_flat) if index in leaders else placement
            for index, placement in part.placements.items()
        },
    )


def let_lead(placed: Sequence[PlacedPhoto], found: Sequence[Disagreement]) -> tuple[PlacedPhoto, ...]:
    """The photos, those that disagree used only where their leader shows nothing, or something hides the page there."""
    photos: dict[int, PlacedPhoto] = {photo.flat.index: photo for photo in placed}
    torn = {index for each in found if each.apart > TORN for index in (each.index, each.leader)}
    for index in torn:
        photo = photos[index]
        if photo.hidden is not None:
            nothing = np.zeros_like(photo.hidden.cells)
            photos[index] = replace(photo, hidden=replace(photo.hidden, cells=nothing))
    for each in found:
        own, leader = photos[each.index].hidden, photos[each.leader].hidden
        if own is not None and leader is not None:
            photos[each.index] = replace(photos[each.index], yielding=yielding_part(own, leader))
    return tuple(photos[photo.flat.index] for photo in placed)


def disagreement_notices(found: Sequence[Disagreement]) -> list[Notice]:
    """For each photo that disagrees, a notice that names both."""
    return [
        Notice(
            "sheet-moved",
            f"images[{each.index}] shows the sheet bent in another way than images[{each.leader}]: it adds only what "
            f"images[{each.leader}] does not show. Keep the sheet as it is between photos.",
        )
        for each in sorted(found, key=lambda each: each.index)
    ]


def _rank(photo: FlatPhoto, base: int | None) -> tuple[bool, float, int]:
    """Order of photos, the best first."""
    error = np.inf if photo.error_percent is None else photo.error_percent
    return photo.index != base, error, photo.index
