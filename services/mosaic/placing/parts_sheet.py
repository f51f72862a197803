"""One bent sheet that photos of its parts show, and the camera of each.

Registration places points of the page to a few hundredths of a pixel; what is wrong with a mosaic of a bent page is
the shape that each photo shows by itself, of which an overlap sees little. So the sheet's shape and all cameras are
fitted once more together: to the print of all photos, and to the points that they share.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from services.arrays import Floats, Points, Vector
from services.geometry.homographies import transform_points
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.placing.placement import Placement
from services.mosaic.placing.resection import resect_camera
from services.mosaic.registration.pair_registration import PairRegistration
from services.sheet.curved_page import REACH, CurvedPage, page_hull
from services.sheet.developable.fitting import rescale_deviations
from services.sheet.developable.observations import SLANT_MEAN_RAD, PageObservations
from services.sheet.developable.print_residuals import FittingParameters
from services.sheet.developable.shared_sheet import (
    FittedSheet,
    SeenPart,
    SharedPoints,
    SharedSheet,
    fit_shared_sheet,
    hold_camera,
    unit_of,
)
from services.sheet.developable.surface import BendBasis, DevelopableSurface, bend_basis
from services.sheet.framing import CurvedFrame
from services.sheet.ridged.views import OtherCamera
from services.sheet.tracing.page_lines import trace_lines

THIN = 200
"""Characters of a photo that its camera is found by."""
MARGIN = 0.12
MOST_BENDS = 30
MATCH_PX = 0.1
ALONG = 25
LIKE_RULINGS_RAD = np.deg2rad(25.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Base:
    """The photo whose own surface is the start, and the maps into its page."""

    index: int
    surface: DevelopableSurface
    H_page_mosaic: Floats


def start_sheet(
    base: int, photos: Mapping[int, FlatPhoto], placements: Mapping[int, Placement]
) -> SharedSheet | None:
    """The sheet of photo `base`, continued by what the others show of its bends, and their cameras on it."""
    flat = photos[base]
    shape = flat.page.shape
    surface = shape.fitted.surface
    H_page_mosaic = flat.frame.H_page_flat @ np.linalg.inv(placements[base].H_mosaic_flat)
    pages = {}
    seen = {}
    for index, photo in photos.items():
        characters = photo.page.evidence.text.characters
        characters = characters[:: max(len(characters) // THIN, 1)]
        page = _page_of(photo, placements[index], H_page_mosaic, characters)
        known = np.isfinite(page).all(axis=1)
        pages[index], seen[index] = page[known], photo.page.view.to_centred(characters[known])
    s = surface.to_sheet(np.concatenate(list(pages.values())))[:, 0]
    low, high = np.percentile(s, [0.2, 99.8])
    own = surface.basis
    margin = MARGIN * (high - low)
    spacing = (own.high - own.low) / (own.values.shape[1] - 3)
    low, high = low - margin, high + margin
    count = int(np.clip(round((high - low) / spacing) + 3, 12, MOST_BENDS))
    basis = bend_basis(low, high, count, REACH)
    at, bend, weight = [], [], []
    for index, photo in photos.items():
        if not isinstance(photo.page.shape, CurvedPage):
            continue
        found = _bends_of(photo, surface, placements[index], H_page_mosaic)
        if found is not None:
            at.append(found[0])
            bend.append(found[1])
    bends = _fit_bends(basis, np.concatenate(at), np.concatenate(bend))
    c, d = np.cos(surface.skew_rad), np.sin(surface.skew_rad)
    skew = np.array([[c, d, 0.0], [-d, c, 0.0], [0.0, 0.0, 1.0]])
    camera = OtherCamera(surface.rotation @ skew.T, np.array([*surface.anchor, surface.focal]), surface.focal)
    sheet = SharedSheet(surface.skew_rad, surface.slopes, shape.fitted.slant_rad, bends, basis, ())
    whole = sheet.surface(camera)
    cameras = []
    for index, photo in photos.items():
        sc = whole.to_sheet(pages[index])
        P, R = whole.line_at(sc[:, 0])
        X = (P + sc[:, 1:] * R - camera.translation) @ camera.rotation
        found = resect_camera(X, seen[index], photo.page.focal_prior)
        if found is None:
            return None
        middle = np.median(pages[index], axis=0)
        cameras.append(hold_camera(sheet, found, (float(middle[0]), float(middle[1]))))
    return replace(sheet, held=tuple(cameras))


def _page_of(photo: FlatPhoto, placement: Placement, H_page_mosaic: Floats, points: Points) -> Points:
    return transform_points(H_page_mosaic, placement.to_mosaic(photo.frame.to_flat(points)))


def _bends_of(
    photo: FlatPhoto, sheet: DevelopableSurface, placement: Placement, H_page_mosaic: Floats
) -> tuple[Vector, Vector] | None:
    """Places on the sheet's a-axis, and the bends there, that the photo's own surface has; None if it is ruled otherwise."""
    own = photo.page.shape.fitted.surface
    st = own.to_sheet(own.to_page(photo.page.evidence.characters))
    low, high = np.nanpercentile(st[:, 0], [1, 99])
    t = float(np.nanmedian(st[:, 1]))
    s = np.linspace(low, high, ALONG)
    k = np.interp(s, own.basis.nodes, own.basis.values @ own.bends)
    H = H_page_mosaic @ placement.H_mosaic_flat @ np.linalg.inv(photo.frame.H_page_flat)
    lines = [transform_points(H, own.from_sheet(np.column_stack([s, np.full(ALONG, t + d)]))) for d in (0.0, 0.05)]
    here, there = (sheet.to_sheet(line) for line in lines)
    way = there - here
    lean = np.median(np.arctan2(way[:, 0], np.abs(way[:, 1])))
    rate = np.gradient(here[:, 0], s)
    if abs(lean) > LIKE_RULINGS_RAD or not np.isfinite(rate).all():
        return None
    return here[:, 0], k / np.maximum(np.abs(rate), 0.05)


def _fit_bends(basis: BendBasis, at: Vector, bend: Vector) -> Vector:
    values = np.stack([np.interp(at, basis.nodes, column, left=0, right=0) for column in basis.values.T], axis=1)
    count = values.shape[1]
    smooth = 0.3 * np.diff(np.eye(count), 2, axis=0)
    held = 0.02 * np.diff(np.eye(count), axis=0)
    A = np.concatenate([values, smooth, held])
    return np.linalg.lstsq(A, np.concatenate([bend, np.zeros(len(smooth) + len(held))]), rcond=None)[0]


def observe_part(photo: FlatPhoto, surface: DevelopableSurface, *, again: bool) -> SeenPart:
    e, shape, prior = photo.page.evidence, photo.page.shape, photo.page.focal_prior
    p = FittingParameters(cauchy_flows=True)
    from services.sheet.developable.observations import NO_EDGES

    edges = NO_EDGES
    if isinstance(shape, CurvedPage):
        p = rescale_deviations(p, shape.fitted)
        edges = shape.edges
    lines = shape.lines if isinstance(shape, CurvedPage) and not again else trace_lines(e.text, e.view, surface)
    observed = PageObservations(
        e.major, e.minor, lines, page_hull(e.characters), prior.log_focal, prior.deviation, edges
    )
    return SeenPart(observed, p)


def share_points(
    photos: Mapping[int, FlatPhoto], pairs: Sequence[PairRegistration], sheet: SharedSheet, held_out=None
) -> list[SharedPoints]:
    order = list(photos)
    found = []
    for number, pair in enumerate(pairs):
        a, b = order.index(pair.a), order.index(pair.b)
        ends = [
            photos[i].page.view.to_centred(photos[i].to_photo(points))
            for i, points in ((pair.a, pair.points_a), (pair.b, pair.points_b))
        ]
        if held_out is not None:
            ends = [end[~held_out[number]] for end in ends]
        size = []
        for k, i, end in ((a, pair.a, ends[0]), (b, pair.b, ends[1])):
            camera = sheet.cameras[k]
            J = sheet.surface(camera).jacobians(end) * unit_of(camera)
            size.append(np.median(np.sqrt(np.abs(np.linalg.det(J)))) / photos[i].page.view.unit_px)
        found.append(SharedPoints(a, b, *ends, MATCH_PX * float(np.hypot(*size)) / np.sqrt(2)))
    return found
