"""Placement of photos on the page, from their pairs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from services.arrays import Homography
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.flattening import view_again
from services.mosaic.photo_graph import choose_part, connect_photos
from services.mosaic.placing.adjustment import adjust_globally
from services.mosaic.placing.frontal_frame import agree_on_frontal_frame
from services.mosaic.placing.joint_sheet import JointSheet, find_joint_sheet
from services.mosaic.placing.kept_paper import keeps_paper
from services.mosaic.placing.parts_sheet import find_sheet_of_parts
from services.mosaic.placing.placement import Placement
from services.mosaic.placing.residual_warp import estimate_residual_warp
from services.mosaic.placing.second_matches import match_again
from services.mosaic.placing.whole_photo import WholePhoto
from services.mosaic.registration.pair_registration import PairRegistration
from services.notices import Notice
from services.sheet.framing import CurvedFrame


@dataclass(frozen=True, slots=True, eq=False)
class PlacedPart:
    """The photos of the page, by index, placed in the pixels of a page of `width` x `height`.

    `joint` is the sheet that all of them show, through whose views they are drawn; None where each has its own.
    `notices` are of the page, not of single photos.
    """

    base: int
    photos: Mapping[int, FlatPhoto]
    placements: Mapping[int, Placement]
    pairs: tuple[PairRegistration, ...]
    width: int
    height: int
    joint: JointSheet | None = None
    notices: tuple[Notice, ...] = ()


def place_photos(
    photos: Mapping[int, FlatPhoto], pairs: Sequence[PairRegistration], base: int | None
) -> PlacedPart:
    """The part of the photos that becomes the page, with all placements adjusted together.

    Photos that show one bent sheet are laid on it.
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
    members = {index: photos[index] for index in part}
    placed = _place(chosen, members, adjustment.H_world_flat, within)
    joint = find_joint_sheet(members, within, placed.placements)
    if joint is None:
        joint = find_sheet_of_parts(members, within, placed.placements)
    if joint is not None and keeps_paper(joint.views, members):
        members, H_world_flat, within = _lay_on_sheet(joint, members, within)
        placed = replace(_place(chosen, members, H_world_flat, within), joint=joint)
    H_mosaic_flat = {index: placement.H_mosaic_flat for index, placement in placed.placements.items()}
    warp = estimate_residual_warp(members, H_mosaic_flat, within)
    placements = {index: Placement(H, warp.displacements[index]) for index, H in H_mosaic_flat.items()}
    return replace(placed, placements=placements)


def place_parts(whole: WholePhoto, base: int | None) -> PlacedPart:
    """The parts of one photo on its page."""
    photos = whole.photos
    chosen = max(photos, key=lambda index: photos[index].weight) if base is None else base
    return replace(_place(chosen, photos, whole.H_page_flat, whole.pairs), notices=whole.notices)


def _place(
    base: int,
    photos: Mapping[int, FlatPhoto],
    H_world_flat: Mapping[int, Homography],
    pairs: tuple[PairRegistration, ...],
) -> PlacedPart:
    """The photos in the frontal frame of the page, without displacements."""
    frontal = agree_on_frontal_frame(photos, H_world_flat)
    placements = {index: Placement(frontal.H_mosaic_world @ H_world_flat[index]) for index in photos}
    return PlacedPart(base, photos, placements, pairs, frontal.width, frontal.height)


def _lay_on_sheet(
    joint: JointSheet, photos: Mapping[int, FlatPhoto], pairs: Sequence[PairRegistration]
) -> tuple[dict[int, FlatPhoto], dict[int, Homography], tuple[PairRegistration, ...]]:
    """The photos in their views of one sheet, the places of these on it, and the matches in them."""
    laid: dict[int, FlatPhoto] = {}
    H_world_flat: dict[int, Homography] = {}
    for index, photo in photos.items():
        laid[index] = view_again(photo, joint.views[index])
        frame = laid[index].frame
        assert isinstance(frame, CurvedFrame)
        H_world_flat[index] = joint.H_world_page[index] @ frame.H_page_flat
    return laid, H_world_flat, match_again(pairs, photos, laid, H_world_flat)
