"""One sheet in space that all photos of a bent page show, and the camera of each.

Each photo alone shows the page's shape with an error of its own. A wrong shape cannot be seen by the other cameras
where their photos show it: a camera has seven unknowns, and hundreds of correspondences. So each photo's sheet is
judged by those of the others. The best one is held, or, where it leaves more than matching does, fitted once more to
the print of its photo and the correspondences with all others. What is fitted is judged by correspondences that
were held out.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from services.arrays import Floats, Homography, Mask, Points
from services.geometry.homographies import jacobians, scaling, transform_points
from services.geometry.page_map import PageMap
from services.mosaic.flat_photo import FlatPhoto, SeenPage
from services.mosaic.placing.placement import Placement
from services.mosaic.placing.resection import resect_camera
from services.mosaic.placing.residual_warp import HELD_OUT_CELL, HELD_OUT_CELLS
from services.mosaic.registration.pair_registration import PairRegistration
from services.sheet.curved_page import MIN_VISIBLE
from services.sheet.developable.observations import LineObservations
from services.sheet.framing import CurvedFrame
from services.sheet.line_residual import MorphedPage
from services.sheet.ridged.fitting import fit_mesh
from services.sheet.ridged.mesh import LEAST_ROWS, SheetMesh
from services.sheet.ridged.observations import SheetObservations
from services.sheet.ridged.parameters import RidgedParameters, Stage
from services.sheet.ridged.views import OtherCamera, OtherView
from services.sheet.ridged_page import IMPROVEMENT, RidgedPage, without_waves
from services.sheet.tracing.line_tracing import NO_WORSE, STRAIGHT, measure_straightness
from services.sheet.tracing.profile_tracing import trace_by_profiles

THIN = 200
"""Characters of a photo that are looked up on the sheet."""
COLUMNS = 60
"""Cells across the mesh of a smooth sheet: chords of a sheet bent to a radius of half its width then lie within
0.01 % of its width."""
LEFT_BY_MATCHING = 0.01
"""Median distance of correspondences, text heights, up to which a sheet is held as it is: on 12 sets of smooth sheets
the best one leaves 0.0014 to 0.007, on creased ones 0.012 to 0.4."""
MOST_LEFT = 0.05
"""The same, beyond which no sheet explains all photos: fitted sheets leave at most 0.03 on 28 simulated sets, and
sheets that were bent otherwise between two real photos 0.12 to 1.3."""
MATCH_PX = 0.2
"""Deviation of a correspondence, pixels of the photo. Those on planes have 0.03; cells of a creased sheet leave more.
With half or twice as much, meshes of three creased sets are not better."""
FIT = RidgedParameters(schedule=(Stage(12, 10.0, 3.0, 3.0), Stage(24, 1.0, 1.0, 1.0)), evaluations=60)
"""Fit to all photos. Depth and focal length that grow alike hardly change one photo, so convergence along them is
slow: with 20 evaluations one of eight sets stopped at a focal length 20 % too short."""


@dataclass(frozen=True, slots=True, eq=False)
class JointSheet:
    """A sheet that several photos show.

    Attributes
    ----------
    reference : the photo in whose camera frame the sheet is.
    kind : whether its surface is smooth.
    mesh : the sheet in space.
    cameras : of all photos by index, that of the reference too.
    views : the frames of their views of the sheet.
    H_world_page : page points of these frames' maps -> one page of all photos.
    fitted : whether the sheet was fitted to all photos; else it is that of the reference.
    residual : median distance of correspondences that were held out, in text heights, of the worst photo.
    """

    reference: int
    kind: Literal["smooth", "creased"]
    mesh: SheetMesh
    cameras: Mapping[int, OtherCamera]
    views: Mapping[int, CurvedFrame]
    H_world_page: Mapping[int, Homography]
    fitted: bool
    residual: float


@dataclass(frozen=True, slots=True, eq=False)
class _Shared:
    """Points (N, 2) that the reference photo shares with another one, centred in either, and which are held out.

    `text_height` is that of the other photo, centred units.
    """

    own: Points
    other: Points
    held_out: Mask
    text_height: float


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    """The sheet of one photo, what this shares with each other one, and the cameras of these.

    `page_map` is that of the mesh, or with a small field for waves; `observed` is what a creased mesh was fitted to.
    """

    reference: int
    mesh: SheetMesh
    page_map: PageMap
    H_page_flat: Homography
    observed: SheetObservations | None
    shared: Mapping[int, _Shared]
    cameras: Mapping[int, OtherCamera]

    def residual(self, *, held_out: bool) -> float:
        """Median distance of correspondences, all or those held out, in text heights, of the worst photo."""
        medians = []
        for index, shared in self.shared.items():
            chosen = shared.held_out if held_out else np.ones(len(shared.own), bool)
            X = _in_space(self.mesh, shared.own[chosen])
            off = np.linalg.norm(self.cameras[index].project(X) - shared.other[chosen], axis=1)
            medians.append(
                float(np.nanmedian(off)) / shared.text_height if np.isfinite(off).any() else np.inf
            )
        return max(medians)


def find_joint_sheet(
    photos: Mapping[int, FlatPhoto],
    pairs: Sequence[PairRegistration],
    placements: Mapping[int, Placement],
) -> JointSheet | None:
    """The bent sheet that all `photos` show, if one photo shows all of it, and it explains more than flat views do.

    None where they do not, where no photo shares points with all others and shows all of their text, where the page
    is flat, where the sheet was bent otherwise from photo to photo, and where the views that were flattened one by one,
    with these `placements`, agree better than one sheet with all of them.
    """
    pages = {index: photo.page for index, photo in photos.items() if photo.page is not None}
    if len(pages) < len(photos):
        return None
    seen = [_judge_sheet(index, photos, pages, pairs) for index in pages]
    candidates = [candidate for candidate in seen if candidate is not None]
    if not candidates:
        return None
    best = min(candidates, key=lambda candidate: candidate.residual(held_out=False))
    page = pages[best.reference]
    left, fitted = best.residual(held_out=True), None
    if left > LEFT_BY_MATCHING:
        fitted = _fit_to_all(best, pages)
    if fitted is None and page.shape.kind == "planar":
        return None
    found = fitted or best
    left = found.residual(held_out=True)
    if left > min(MOST_LEFT, measure_apart(photos, pairs, placements)):
        return None
    flat = photos[best.reference]
    height = round(flat.frame.height * found.mesh.size[1] / best.mesh.size[1])
    here = OtherCamera(np.eye(3), np.zeros(3), found.mesh.focal)
    cameras = {best.reference: here, **found.cameras}
    views = {}
    for index, camera in cameras.items():
        own = camera.see(found.mesh)
        page_map = replace(found.page_map, surface=own) if isinstance(found.page_map, MorphedPage) else own
        views[index] = CurvedFrame(page_map, pages[index].view, best.H_page_flat, flat.frame.width, height)
    return JointSheet(
        best.reference,
        "creased" if fitted or page.shape.ends_at_sides else "smooth",
        found.mesh,
        cameras,
        views,
        dict.fromkeys(views, np.eye(3)),
        fitted is not None,
        left,
    )


def _judge_sheet(
    reference: int,
    photos: Mapping[int, FlatPhoto],
    pages: Mapping[int, SeenPage],
    pairs: Sequence[PairRegistration],
) -> _Candidate | None:
    """The sheet of photo `reference` with the cameras of all others; None where some do not show it, or more."""
    shared = _gather(reference, photos, pages, pairs)
    if len(shared) < len(photos) - 1:
        return None
    sheet = _sheet_of(photos[reference], pages[reference], shared)
    if not np.isfinite(sheet.mesh.nodes).all():
        return None
    cameras = {}
    for index, points in shared.items():
        camera = resect_camera(_in_space(sheet.mesh, points.own), points.other, pages[index].focal_prior)
        if camera is None or not _shows_all(sheet.mesh, camera, pages[index], pages[reference]):
            return None
        cameras[index] = camera
    return replace(sheet, cameras=cameras)


def _sheet_of(photo: FlatPhoto, page: SeenPage, shared: Mapping[int, _Shared]) -> _Candidate:
    """The sheet of one photo over its flat view, without cameras."""
    frame, shape = photo.frame, page.shape
    if isinstance(shape, RidgedPage) and isinstance(frame, CurvedFrame):
        return _Candidate(
            photo.index, shape.mesh, shape.page_map, frame.H_page_flat, shape.observed, shared, {}
        )
    rows = max(round(COLUMNS * (frame.height - 1) / (frame.width - 1)), LEAST_ROWS - 1)
    x, y = np.linspace(0, frame.width - 1, COLUMNS + 1), np.linspace(0, frame.height - 1, rows + 1)
    flat = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    nodes = shape.in_space(page.view.to_centred(photo.to_photo(flat)))
    nodes = nodes.reshape(rows + 1, COLUMNS + 1, 3)
    step = float(np.linalg.norm(np.diff(nodes, axis=1), axis=2).mean())
    mesh = SheetMesh(nodes, shape.focal, step, float(y[1] / x[1]), (0.0, 0.0))
    return _Candidate(photo.index, mesh, mesh, scaling(step / float(x[1])), None, shared, {})


def _gather(
    reference: int,
    photos: Mapping[int, FlatPhoto],
    pages: Mapping[int, SeenPage],
    pairs: Sequence[PairRegistration],
) -> dict[int, _Shared]:
    """What photo `reference` shares with each other one that it overlaps."""
    found = {}
    cell = HELD_OUT_CELL * photos[reference].text_height_px
    for pair in pairs:
        if reference not in (pair.a, pair.b):
            continue
        index = pair.b if pair.a == reference else pair.a
        own, other = (pair.points_a, pair.points_b) if pair.a == reference else (pair.points_b, pair.points_a)
        i, j = np.floor(own / cell).astype(int).T
        view = pages[index].view
        found[index] = _Shared(
            pages[reference].view.to_centred(photos[reference].to_photo(own)),
            view.to_centred(photos[index].to_photo(other)),
            (i + 2 * j) % HELD_OUT_CELLS == 0,
            pages[index].text_height_px / view.unit_px,
        )
    return found


def _in_space(mesh: SheetMesh, centred: Points) -> Floats:
    """Points (N, 3) of the mesh that its camera sees at photo points (N, 2); NaN where it ends."""
    grid = mesh.locate(centred)
    known = np.isfinite(grid).all(axis=1, keepdims=True)
    return np.where(known, mesh.place(np.nan_to_num(grid)).X, np.nan)


def _shows_all(mesh: SheetMesh, camera: OtherCamera, other: SeenPage, reference: SeenPage) -> bool:
    """Whether the sheet places the text of the photo `other`, which `camera` took, within the `reference` photo."""
    characters = other.evidence.text.characters
    characters = characters[:: max(len(characters) // THIN, 1)]
    page = camera.see(mesh).to_page(other.view.to_centred(characters))
    photo = reference.view.to_photo(mesh.to_photo(page))
    size = np.array([reference.view.width, reference.view.height])
    with np.errstate(invalid="ignore"):
        inside = ((photo >= 0) & (photo <= size - 1)).all(axis=1)
    return len(characters) > 0 and float(np.mean(inside)) >= MIN_VISIBLE


def _fit_to_all(start: _Candidate, pages: Mapping[int, SeenPage]) -> _Candidate | None:
    """The sheet fitted to the print of its photo and to all others; None if it does not explain more."""
    page = pages[start.reference]
    evidence, prior = page.evidence, page.focal_prior

    def trace(page_map: PageMap) -> LineObservations:
        return trace_by_profiles(evidence.text, page.view, page_map)

    observed = start.observed
    if observed is None:
        lines = trace(start.mesh)
        observed = SheetObservations(lines, evidence.strokes, (None,) * 4, prior.log_focal, prior.deviation)
    views = tuple(_view(start, index, pages[index]) for index in start.shared)
    fitted = fit_mesh(start.mesh, replace(observed, views=views), FIT)
    cameras = {index: view.camera for index, view in zip(start.shared, fitted.views, strict=True)}
    found = replace(start, mesh=fitted.mesh, page_map=fitted.mesh, cameras=cameras)
    if not found.residual(held_out=True) <= IMPROVEMENT * start.residual(held_out=True):
        return None
    lines = trace(found.mesh)
    straightness = measure_straightness(found.mesh, lines)
    if straightness > max(STRAIGHT, NO_WORSE * measure_straightness(start.mesh, lines)):
        return None
    return replace(found, page_map=without_waves(found.mesh, lines, trace)[0])


def _view(start: _Candidate, index: int, page: SeenPage) -> OtherView:
    """What the fit is shown of another photo: correspondences on the sheet that are not held out."""
    shared, camera, prior = start.shared[index], start.cameras[index], page.focal_prior
    fitted = np.isfinite(_in_space(start.mesh, shared.own)).all(axis=1) & ~shared.held_out
    return OtherView(
        shared.own[fitted],
        shared.other[fitted],
        MATCH_PX / page.view.unit_px,
        camera,
        prior.log_focal,
        prior.deviation,
    )


def measure_apart(
    photos: Mapping[int, FlatPhoto], pairs: Sequence[PairRegistration], placements: Mapping[int, Placement]
) -> float:
    """Median distance of the matches of views laid on each other by homographies, text heights, of the worst pair."""
    medians = []
    for pair in pairs:
        ends = [
            transform_points(placements[index].H_mosaic_flat, points)
            for index, points in ((pair.a, pair.points_a), (pair.b, pair.points_b))
        ]
        J = jacobians(placements[pair.b].H_mosaic_flat, pair.points_b)
        height = photos[pair.b].text_height_px * np.sqrt(np.abs(np.linalg.det(J)))
        medians.append(float(np.median(np.linalg.norm(ends[0] - ends[1], axis=1) / height)))
    return max(medians)
