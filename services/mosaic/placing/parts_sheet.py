"""One bent sheet that photos of its parts show, and the camera of each.

Registration finds points of the page to a few hundredths of a pixel; what is wrong with a mosaic of a bent page is the
shape that each photo shows by itself, of which an overlap sees little. So the sheet's shape and all cameras are fitted
once more together, to the print of all photos and to the points that they share.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from services.arrays import Mask, Points, Vector
from services.geometry.focal_prior import FOCAL, MEASURED, FocalPrior
from services.geometry.homographies import scaling, transform_points
from services.mosaic.flat_photo import FlatPhoto, SeenPage
from services.mosaic.placing.joint_sheet import (
    COLUMNS,
    LEFT_BY_MATCHING,
    MOST_LEFT,
    THIN,
    JointSheet,
    measure_apart,
)
from services.mosaic.placing.placement import Placement
from services.mosaic.placing.resection import resect_camera
from services.mosaic.placing.residual_warp import HELD_OUT_CELL, HELD_OUT_CELLS
from services.mosaic.registration.pair_registration import PairRegistration
from services.order_statistics import median
from services.sheet.curved_page import REACH, CurvedPage, implausibility, page_hull
from services.sheet.developable.fitting import FittedSurface, rescale_deviations, shown_deviations
from services.sheet.developable.observations import NO_EDGES, PageObservations
from services.sheet.developable.print_residuals import FittingParameters
from services.sheet.developable.surface import BendBasis, DevelopableSurface, bend_basis
from services.sheet.framing import CurvedFrame, frame_curved_page
from services.sheet.ridged.mesh import LEAST_ROWS, SheetMesh
from services.sheet.ridged.views import OtherCamera
from services.sheet.shared_fit import SeenPart, SharedPoints, fit_shared_sheet
from services.sheet.shared_sheet import SharedSheet, camera_of, hold_camera, unit_of
from services.sheet.tracing.line_tracing import NO_WORSE, STRAIGHT, measure_straightness
from services.sheet.tracing.page_lines import trace_lines

MARGIN = 0.12
"""The bend continues beyond the text by this share of the sheet's width."""
MOST_BENDS = 60
"""Splines across a sheet that photos show in parts, as far apart as one photo has them, or farther."""
ALONG = 25
"""Places along a photo at which its own surface tells the bend."""
SMOOTH = (0.02, 0.3)
"""Weights of first and second differences of neighbouring bends, where no photo tells them."""
LESS_STRAIGHT = 1.2
"""Factor on the straightness of lines that is left by a sheet whose sides are straight, too: of two sets of waves it is
1.09 and 1.14."""
MATCH_PX = 0.1
"""Deviation of a coordinate of a correspondence, pixels of the photos."""
MOST_BASES = 4
"""Photos whose own surfaces are tried as the start: those with most text."""


@dataclass(frozen=True, slots=True, eq=False)
class _Parts:
    """The photos, what they show, and their placements, in one order."""

    photos: tuple[FlatPhoto, ...]
    pages: tuple[SeenPage, ...]
    placements: tuple[Placement, ...]

    def to_page(self, k: int, base: int, points: Points) -> Points:
        """Points (N, 2) of photo `k` on the flat page of photo `base`, as the photos are placed."""
        on_mosaic = self.placements[k].to_mosaic(self.photos[k].frame.to_flat(points))
        H = _frame(self.photos[base]).H_page_flat @ np.linalg.inv(self.placements[base].H_mosaic_flat)
        return transform_points(H, on_mosaic)


def find_sheet_of_parts(
    photos: Mapping[int, FlatPhoto],
    pairs: Sequence[PairRegistration],
    placements: Mapping[int, Placement],
) -> JointSheet | None:
    """The smooth bent sheet that all `photos` show parts of, if it explains more than their own surfaces do.

    None where no photo shows a bent sheet, where a photo shows no page, where a camera is not believable, and where
    correspondences that were held out, or the lines of text, speak for the views that were flattened one by one, with
    these `placements`.
    """
    order = list(photos)
    pages = [photo.page for photo in photos.values() if photo.page is not None]
    bent = [k for k, page in enumerate(pages) if _smooth(page) is not None]
    if len(pages) < len(photos) or not bent:
        return None
    parts = _Parts(tuple(photos.values()), tuple(pages), tuple(placements[index] for index in order))
    bent.sort(key=lambda k: -len(pages[k].evidence.text.characters))
    starts = [start for start in (_start_at(k, parts) for k in bent[:MOST_BASES]) if start is not None]
    if not starts:
        return None
    start = min(starts, key=lambda start: start[1])[0]
    shared, held_out = _share(parts, order, pairs, start)
    # Homographies of single views are fitted to all correspondences, those that are held out here too.
    most = min(MOST_LEFT, max(LEFT_BY_MATCHING, measure_apart(photos, pairs, placements)))
    whole = [
        _observe(k, page, start.surface(camera))
        for k, (page, camera) in enumerate(zip(pages, start.cameras, strict=True))
    ]
    tried = [whole]
    if any(len(part.observed.edges.points) for part in whole):
        tried.append([replace(part, observed=replace(part.observed, edges=NO_EDGES)) for part in whole])
    for seen in tried:
        sheet = fit_shared_sheet(start, seen, shared).sheet
        left, surfaces = _left(sheet, parts, held_out), map(sheet.surface, sheet.cameras)
        if left <= most and all(map(_is_plausible, pages, sheet.cameras, surfaces, seen)):
            return _describe(sheet, parts, order, left)
    return None


def _is_plausible(page: SeenPage, camera: OtherCamera, surface: DevelopableSurface, part: SeenPart) -> bool:
    """Whether `surface`, the sheet before a photo's `camera`, may be what the photo shows, its lines straight."""
    if not _is_believable(camera.focal, page.focal_prior):
        return False
    if implausibility(surface, page.evidence.characters) is not None:
        return False
    lines = part.observed.lines
    own = measure_straightness(page.shape.page_map, lines)
    worse = LESS_STRAIGHT if len(part.observed.edges.points) else NO_WORSE
    return measure_straightness(surface, lines) <= max(STRAIGHT, worse * own)


def _is_believable(focal: float, prior: FocalPrior) -> bool:
    """Whether a camera may have this focal length.

    Where photos show a sheet in parts, a longer lens before a sheet that leans more away from it leaves all points and
    lines nearly as they are, and a stretched page.
    """
    most = FOCAL.exif_contradiction if prior.source in MEASURED else FOCAL.believable
    return abs(float(np.log(focal)) - prior.log_focal) <= most * prior.deviation


def _frame(photo: FlatPhoto) -> CurvedFrame:
    assert isinstance(photo.frame, CurvedFrame)
    return photo.frame


def _smooth(page: SeenPage) -> CurvedPage | None:
    """The shape of a page, if it is a smooth bent sheet."""
    return page.shape if isinstance(page.shape, CurvedPage) else None


def _own_fit(page: SeenPage) -> FittedSurface:
    shape = _smooth(page)
    assert shape is not None
    return shape.fitted


def _start_at(base: int, parts: _Parts) -> tuple[SharedSheet, float] | None:
    """The sheet of photo `base`, continued by what the others show of its bends, with their cameras on it.

    Beside it the mean of the distances, centred units, that the cameras leave. None if one cannot be found.
    """
    own = _own_fit(parts.pages[base])
    surface = own.surface
    shown = []
    for k, page in enumerate(parts.pages):
        characters = page.evidence.text.characters
        characters = characters[:: max(len(characters) // THIN, 1)]
        on_page = parts.to_page(k, base, characters)
        known = np.isfinite(on_page).all(axis=1)
        shown.append((on_page[known], page.view.to_centred(characters[known])))
    across = surface.to_sheet(np.concatenate([on_page for on_page, _ in shown]))[:, 0]
    low, high = (float(v) for v in np.percentile(across, [0.2, 99.8]))
    margin = MARGIN * (high - low)
    fewest = len(surface.bends)
    spacing = (surface.basis.high - surface.basis.low) / (fewest - 3)
    count = int(np.clip(round((high - low + 2 * margin) / spacing) + 3, fewest, MOST_BENDS))
    tabulated = round(len(surface.basis.nodes) * (count - 3) / (fewest - 3))
    basis = bend_basis(low - margin, high + margin, count, REACH, surface.basis.spacing, tabulated)
    told = [_bends_of(k, base, parts) for k in range(len(parts.pages))]
    bends = _join_bends(basis, [each for each in told if each is not None])
    sheet = SharedSheet(surface.skew_rad, surface.slopes, own.slant_rad, bends, basis, ())
    camera = camera_of(surface)
    whole, cameras, left = sheet.surface(camera), [], []
    for (on_page, seen), page in zip(shown, parts.pages, strict=True):
        X = (whole.place(on_page) - camera.translation) @ camera.rotation
        found = resect_camera(X, seen, page.focal_prior)
        if found is None:
            return None
        left.append(float(np.median(np.linalg.norm(found.project(X) - seen, axis=1))))
        middle = np.median(on_page, axis=0)
        cameras.append(hold_camera(sheet, found, (float(middle[0]), float(middle[1]))))
    return replace(sheet, held=tuple(cameras)), float(np.mean(left))


def _bends_of(k: int, base: int, parts: _Parts) -> tuple[Vector, Vector] | None:
    """Places across the sheet of photo `base`, and its bends there as photo `k` tells them.

    None if photo `k` shows no bend.
    """
    page = parts.pages[k]
    shape = _smooth(page)
    if shape is None:
        return None
    own, sheet = shape.fitted.surface, _own_fit(parts.pages[base]).surface
    at = own.to_sheet(own.to_page(page.evidence.characters))
    low, high = np.nanpercentile(at[:, 0], [1, 99])
    s, t = np.linspace(low, high, ALONG), float(np.nanmedian(at[:, 1]))
    bend = np.interp(s, own.basis.nodes, own.basis.values @ own.bends)
    seen = own.to_photo(own.from_sheet(np.column_stack([s, np.full(ALONG, t)])))
    across = sheet.to_sheet(parts.to_page(k, base, page.view.to_photo(seen)))[:, 0]
    rate = np.abs(np.gradient(across, s))
    known = np.isfinite(rate) & (rate > 0)
    if not known.any():
        return None
    return across[known], bend[known] / rate[known]


def _join_bends(basis: BendBasis, told: Sequence[tuple[Vector, Vector]]) -> Vector:
    """Bends (K,) of the sheet by least squares; where no photo tells them they go on smoothly."""
    at, bend = (np.concatenate(each) for each in zip(*told, strict=True))
    values = np.stack([np.interp(at, basis.nodes, spline) for spline in basis.values.T], axis=1)
    count = values.shape[1]
    held = [weight * np.diff(np.eye(count), order, axis=0) for order, weight in enumerate(SMOOTH, start=1)]
    A = np.concatenate([values, *held])
    return np.asarray(np.linalg.lstsq(A, np.append(bend, np.zeros(len(A) - len(bend))), rcond=None)[0])


def _observe(k: int, page: SeenPage, surface: DevelopableSurface) -> SeenPart:
    """The print of photo `k`, and sides; lines are those of its own surface, or are traced on the sheet."""
    e, shape, prior = page.evidence, _smooth(page), page.focal_prior
    p = FittingParameters(cauchy_flows=True)
    if shape is not None:
        p, lines = shown_deviations(rescale_deviations(p, shape.fitted), shape.fitted), shape.lines
        edges = shape.edges
    else:
        lines, edges = trace_lines(e.text, e.view, surface), NO_EDGES
    hull = page_hull(e.characters)
    # Photos for which one focal length was measured, by Exif or earlier photos, are of one camera.
    camera = prior if prior.source in MEASURED else k
    return SeenPart(
        PageObservations(e.major, e.minor, lines, hull, prior.log_focal, prior.deviation, edges), p, camera
    )


def _share(
    parts: _Parts, order: Sequence[int], pairs: Sequence[PairRegistration], sheet: SharedSheet
) -> tuple[list[SharedPoints], list[SharedPoints]]:
    """What pairs of photos share: what the sheet is fitted to, and what is held out."""
    fitted, held_out, cameras = [], [], sheet.cameras
    for pair in pairs:
        a, b = order.index(pair.a), order.index(pair.b)
        i, j = np.floor(pair.points_a / (HELD_OUT_CELL * parts.photos[a].text_height_px)).astype(int).T
        out: Mask = (i + 2 * j) % HELD_OUT_CELLS == 0
        ends, px = [], []
        for k, points in ((a, pair.points_a), (b, pair.points_b)):
            view = parts.pages[k].view
            ends.append(view.to_centred(parts.photos[k].to_photo(points)))
            J = sheet.surface(cameras[k]).jacobians(ends[-1]) * unit_of(cameras[k])
            px.append(median(np.sqrt(np.abs(np.linalg.det(J)))) / view.unit_px)
        both = SharedPoints(a, b, ends[0], ends[1], MATCH_PX * float(np.sqrt(np.mean(np.square(px)))))
        fitted.append(replace(both, points_a=ends[0][~out], points_b=ends[1][~out]))
        held_out.append(replace(both, points_a=ends[0][out], points_b=ends[1][out]))
    return fitted, held_out


def _left(sheet: SharedSheet, parts: _Parts, held_out: Sequence[SharedPoints]) -> float:
    """Median distance on the sheet of the correspondences of a pair, in text heights; of all pairs the mean by points.

    Not of the worst pair: a pair may have eight points, in a corner where no print tells the sheet.
    """
    found, cameras = [], sheet.cameras
    for pair in held_out:
        ends = []
        for k, points in ((pair.a, pair.points_a), (pair.b, pair.points_b)):
            ends.append(sheet.surface(cameras[k]).to_page(points) * unit_of(cameras[k]))
        page = parts.pages[pair.b]
        J = sheet.surface(cameras[pair.b]).jacobians(pair.points_b) * unit_of(cameras[pair.b])
        height = np.sqrt(np.abs(np.linalg.det(J))) * page.text_height_px / page.view.unit_px
        found.append(np.linalg.norm(ends[0] - ends[1], axis=1) / height)
    judged = [distances for distances in found if len(distances)]
    if not judged:
        return float("inf")
    return float(np.average([median(each) for each in judged], weights=[len(each) for each in judged]))


def _describe(sheet: SharedSheet, parts: _Parts, order: Sequence[int], left: float) -> JointSheet:
    """The sheet with the views of its photos, in the camera frame of the first one."""
    views, H_world_page, cameras, boxes = {}, {}, {}, []
    first = sheet.cameras[0]
    for index, photo, page, camera in zip(order, parts.photos, parts.pages, sheet.cameras, strict=True):
        characters = page.evidence.text.characters
        frame = frame_curved_page(
            sheet.surface(camera), page.view, characters, page.text_height_px, photo.sheet
        )
        views[index], H_world_page[index] = frame, scaling(unit_of(camera))
        rotation = camera.rotation @ first.rotation.T
        cameras[index] = OtherCamera(
            rotation, camera.translation - rotation @ first.translation, camera.focal
        )
        corners = np.array([[0.0, 0.0], [frame.width - 1.0, frame.height - 1.0]])
        boxes.append(transform_points(H_world_page[index] @ frame.H_page_flat, corners))
    low, high = np.min(boxes, axis=(0, 1)), np.max(boxes, axis=(0, 1))
    extent = high - low
    rows = max(round(COLUMNS * float(extent[1] / extent[0])), LEAST_ROWS - 1)
    u, v = np.linspace(low[0], high[0], COLUMNS + 1), np.linspace(low[1], high[1], rows + 1)
    page_points = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    surface = sheet.surface(first)
    nodes = unit_of(first) * surface.place(page_points / unit_of(first))
    step = float(extent[0]) / COLUMNS
    mesh = SheetMesh(
        nodes.reshape(rows + 1, COLUMNS + 1, 3),
        first.focal,
        step,
        float(extent[1]) / rows / step,
        (float(low[0]), float(low[1])),
    )
    return JointSheet(order[0], "smooth", mesh, cameras, views, H_world_page, True, left)
