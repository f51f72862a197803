"""Descriptions of photos and pairs, and notices, that a mosaic's result contains in addition to the page."""

from collections.abc import Mapping, Sequence

import numpy as np

from services.arrays import Homography, Vector
from services.contract.answers.mosaic import Pair, SheetCamera, SheetSurface
from services.errors import DocumentError
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.light.hidden_parts import HiddenPart
from services.mosaic.page_cropping import PageCrop
from services.mosaic.patch_mesh import mesh_of_patch, scale_of_patch
from services.mosaic.photo_graph import connect_photos, overlap_fraction
from services.mosaic.placed_photo import PlacedPhoto
from services.mosaic.placing.adjustment import residual_px
from services.mosaic.placing.joint_sheet import JointSheet
from services.mosaic.placing.placed_part import PlacedPart
from services.mosaic.registration.pair_registration import PairRegistration
from services.mosaic.results import Patch
from services.notices import Notice

LEAST_GLARE = 0.005
"""Share of the page that glare hides in all photos, from which a person is told: about a line of text."""
DESCRIBED_COLUMNS = 25
"""Most columns of nodes of a sheet in the answer, as of creased sheets in that of /rectify."""


def describe_patches(
    count: int,
    placed: Sequence[PlacedPhoto],
    sharpness: Sequence[float],
    covered: Sequence[float],
    H_final_mosaic: Homography,
    joint: JointSheet | None = None,
) -> tuple[Patch, ...]:
    """One patch for each of `count` photos. Meshes are in the pixels of the final page, after crop and rotation.

    Parameters
    ----------
    count
        Number of uploaded photos.
    placed
        The placed photos.
    sharpness
        Sharpness of the placed photos' print, relative to the sharpest, as in `ComposedPage`.
    covered
        Shares of the placed photos that are hidden, as in `describe_covers`.
    H_final_mosaic
        Mosaic pixels -> final page.
    joint
        The sheet that all of them show, if they were laid on one.
    """
    patches = [Patch(False)] * count
    for photo, sharp, share in zip(placed, sharpness, covered, strict=True):
        final = photo.placement.within(H_final_mosaic)
        patches[photo.flat.index] = Patch(
            True,
            np.asarray(mesh_of_patch(photo.flat, final), np.float64),
            scale_of_patch(photo.flat, final),
            sharp,
            share,
            None if joint is None else describe_camera(joint, photo.flat),
        )
    return tuple(patches)


def describe_covers(
    placed: Sequence[PlacedPhoto], glare: HiddenPart | None, crop: PageCrop
) -> tuple[tuple[float, ...], list[Notice]]:
    """Shares of what the photos show within `crop` that are hidden, and a notice where all photos are."""
    page = (crop.left, crop.top, crop.right, crop.bottom)
    covered = tuple(0.0 if photo.hidden is None else photo.hidden.fraction(*page) for photo in placed)
    left = 0.0 if glare is None else glare.fraction(*page)
    if left < LEAST_GLARE:
        return covered, []
    detail = (
        f"Glare hides {100 * left:.1f} % of the page in all photos of that place: take one more, from another side or "
        "without the lamp."
    )
    return covered, [Notice("glare", detail)]


def describe_camera(joint: JointSheet, photo: FlatPhoto) -> SheetCamera:
    """The camera of a photo before the joint sheet, lengths in its widths."""
    assert photo.page is not None
    camera, view = joint.cameras[photo.index], photo.page.view
    first, second, third = (_space(row) for row in camera.rotation)
    return SheetCamera(
        focal_length_px=round(camera.focal * view.unit_px, 2),
        principal_point=view.centre,
        rotation=(first, second, third),
        translation=_space(camera.translation / joint.mesh.size[0]),
    )


def describe_sheet(joint: JointSheet) -> SheetSurface:
    """The sheet that all photos show."""
    mesh = joint.mesh.resampled(min(joint.mesh.columns, DESCRIBED_COLUMNS))
    return SheetSurface(
        kind=joint.kind,
        reference=joint.reference,
        fitted=joint.fitted,
        residual_text_heights=round(joint.residual, 4),
        rows=mesh.rows,
        columns=mesh.columns,
        nodes=[[_space(node / mesh.size[0]) for node in row] for row in mesh.nodes],
    )


def _space(vector: Vector) -> tuple[float, float, float]:
    x, y, z = np.round(vector, 6).tolist()
    return x, y, z


def describe_pairs(flats: Mapping[int, FlatPhoto], part: PlacedPart) -> tuple[Pair, ...]:
    """The pairs that connect the photos of the page."""
    return tuple(
        Pair(
            a=pair.a,
            b=pair.b,
            matches=pair.matches,
            votes=pair.votes,
            runner_up_votes=pair.runner_up_votes,
            overlap_fraction=round(overlap_fraction(flats[pair.a], flats[pair.b], pair.H_a_b), 4),
            residual_px=round(residual_px(pair, part.placements[pair.a], part.placements[pair.b]), 4),
        )
        for pair in part.pairs
    )


def notices_of(placed: Sequence[PlacedPhoto]) -> list[Notice]:
    """Notices of the rectification of each placed photo; each names its photo."""
    return [
        Notice(notice.code, f"images[{photo.flat.index}]: {notice.detail}")
        for photo in placed
        for notice in photo.flat.notices
    ]


def duplicate_notices(repeats: Mapping[int, int]) -> list[Notice]:
    """For each photo that repeats another one, by their indices, a notice."""
    return [
        Notice("duplicate-photo", f"images[{index}] repeats images[{other}], and adds nothing to the page.")
        for index, other in sorted(repeats.items())
    ]


def unplaced_notices(
    unplaced: Sequence[int], textless: Mapping[int, DocumentError], pairs: Sequence[PairRegistration]
) -> list[Notice]:
    """For each photo that is not on the page, a notice with the reason."""
    beside = [pair for pair in pairs if pair.a in unplaced and pair.b in unplaced]
    parts = connect_photos(unplaced, [(pair.a, pair.b) for pair in beside])
    notices = []
    for index in unplaced:
        others = [other for part in parts if index in part for other in part if other != index]
        if index in textless:
            reason = textless[index].detail
        elif others:
            names = ", ".join(f"images[{other}]" for other in others)
            reason = f"it overlaps {names}, but nothing that connects with the rest of the page."
        else:
            reason = (
                "it overlaps none of the photos of the page, or too little. Photograph what lies between too."
            )
        notices.append(Notice("unplaced", f"images[{index}] is not on the page: {reason}"))
    return notices
