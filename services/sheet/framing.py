"""Frames of the views of unrolled pages: the part that is shown, and its resolution."""

from dataclasses import dataclass

import numpy as np

from services.arrays import Floats, Homography, Points
from services.geometry.homographies import scaling, transform_points, translation
from services.geometry.page_frame import DETAIL_PERCENTILE, PAPER_MARGIN, TEXT_MARGIN, within_bounds
from services.geometry.page_map import PageMap
from services.geometry.photo_frame import PhotoFrame
from services.sheet.ridged.mesh import SheetMesh
from services.texture_flow.text_identification import FEWEST_CHARACTERS

# How far the view extends beyond the text, where the surface is extrapolated.
REACH = 0.3
"""Extent beyond the text in widths of the text, if the edge of the paper is not seen."""
SHEET_REACH = 0.6
"""Extent if the edge is seen."""
MAX_STRETCH = 4.0
"""Enlargement in the margins over that of the text, up or down; parts that are stretched more are left out."""
MOST_UNKNOWN = 0.1
"""Share of a border inside of the sheet's edge that the map may not know: the sheet's corners, beyond the text."""
STEPS = 12
"""Steps in which the view shrinks to the text if the margins are not plausible."""


@dataclass(frozen=True, slots=True, eq=False)
class CurvedFrame:
    """View of a curved page: output pixel -> page point (affine), page point -> photo by the page's map."""

    page_map: PageMap
    view: PhotoFrame
    H_page_flat: Homography
    width: int
    height: int

    @property
    def H_photo_flat(self) -> None:
        """See `Frame`."""

    def to_photo(self, pixels: Points) -> Points:
        """See `Frame`."""
        seen = self.page_map.to_photo(transform_points(self.H_page_flat, pixels))
        return self.view.to_photo(seen)

    def to_flat(self, photo: Points) -> Points:
        """See `Frame`."""
        page = self.page_map.to_page(self.view.to_centred(photo))
        return transform_points(np.linalg.inv(self.H_page_flat), page)

    def through(self, H_old_new: Homography, width: int, height: int) -> "CurvedFrame":
        """See `Frame`."""
        return CurvedFrame(self.page_map, self.view, self.H_page_flat @ H_old_new, width, height)


def frame_curved_page(
    page_map: PageMap,
    view: PhotoFrame,
    text_points: Points,
    text_height_px: float,
    paper: Points | None,
    *,
    only_text: bool = False,
) -> CurvedFrame:
    """View of the whole sheet, or, without an outline, of the part of the photo that is near the text.

    `text_points` (N, 2) are centres of characters in photo pixels; `paper` is the sheet's outline if it was found.
    A view of `only_text` has its margins alone.
    """
    characters = view.to_centred(text_points)
    text = page_map.to_page(characters)
    # Photo pixels per page unit at the text.
    with np.errstate(invalid="ignore"):
        scale = view.unit_px / np.sqrt(np.abs(np.linalg.det(page_map.jacobians(characters))))
    good = np.isfinite(text).all(axis=1) & np.isfinite(scale)
    text, scale = text[good], scale[good]
    resolution, usual = float(np.percentile(scale, DETAIL_PERCENTILE)), float(np.median(scale))
    margin = TEXT_MARGIN * text_height_px / usual
    core = np.stack([text.min(axis=0) - margin, text.max(axis=0) + margin])
    beyond = (0.0 if only_text else REACH if paper is None else SHEET_REACH) * float(
        (core[1] - core[0]).max()
    )
    outer = np.stack([core[0] - beyond, core[1] + beyond])
    seen = _visible(page_map, view, outer)
    if paper is not None:
        sheet = page_map.to_page(view.to_centred(paper))
        inside = ((sheet >= outer[0]) & (sheet <= outer[1])).all(axis=1)
        if inside.any():
            rim = PAPER_MARGIN * float((core[1] - core[0]).max())
            seen[0] = np.maximum(seen[0], sheet[inside].min(axis=0) - rim)
            seen[1] = np.minimum(seen[1], sheet[inside].max(axis=0) + rim)
    box = np.stack([np.minimum(core[0], seen[0]), np.maximum(core[1], seen[1])])
    most_unknown = 0.0 if paper is None else MOST_UNKNOWN
    box = _believable(page_map, view, core, box, usual, most_unknown)
    extent = box[1] - box[0]
    resolution = within_bounds(resolution, (extent[0], extent[1]), view.width * view.height)
    width, height = (max(round(v * resolution), 1) for v in extent)
    low = (float(box[0, 0]), float(box[0, 1]))
    H_page_flat = translation(*low) @ scaling(1 / resolution) @ translation(0.5, 0.5)
    return CurvedFrame(page_map, view, H_page_flat, width, height)


def frame_mesh(mesh: SheetMesh, page_map: PageMap, view: PhotoFrame, text_points: Points) -> CurvedFrame:
    """View of a whole sheet by `page_map`, cut at the sides of its `mesh`, at the resolution of the text in the photo.

    `text_points` (N, 2) are centres of characters in photo pixels; with few, the resolution is that of the
    whole sheet.
    """
    points = view.to_centred(text_points)
    if len(points) < FEWEST_CHARACTERS:
        points = mesh.project(mesh.nodes.reshape(-1, 3))
    with np.errstate(invalid="ignore"):
        scale = view.unit_px / np.sqrt(np.abs(np.linalg.det(mesh.jacobians(points))))
    resolution = float(np.nanpercentile(scale, DETAIL_PERCENTILE))
    width, height = mesh.size
    resolution = within_bounds(resolution, (width, height), view.width * view.height)
    size = max(round(width * resolution), 1), max(round(height * resolution), 1)
    H_page_flat = translation(*mesh.origin) @ scaling(1 / resolution) @ translation(0.5, 0.5)
    return CurvedFrame(page_map, view, H_page_flat, *size)


def _visible(page_map: PageMap, view: PhotoFrame, outer: Floats) -> Floats:
    """Bounds (2, 2) of the page's part within `outer` that the photo shows."""
    grid = _grid(outer, 60)
    seen = page_map.to_photo(grid)
    limit = np.array([view.width, view.height]) / (2 * view.unit_px)
    with np.errstate(invalid="ignore"):
        inside = (np.abs(seen) <= limit).all(axis=1)
    if not inside.any():
        return outer.copy()
    step = (outer[1] - outer[0]) / 59
    shown = grid[inside]
    return np.stack([shown.min(axis=0) - step, shown.max(axis=0) + step])


def _grid(box: Floats, count: int) -> Points:
    x, y = np.linspace(box[0, 0], box[1, 0], count), np.linspace(box[0, 1], box[1, 1], count)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _believable(
    page_map: PageMap,
    view: PhotoFrame,
    core: Floats,
    box: Floats,
    usual: float,
    most_unknown: float,
) -> Floats:
    """The greatest box between `core` and `box` at whose border the map neither folds nor stretches too much.

    Each side shrinks independently to where the map from page to photo keeps its orientation and its scale within
    `MAX_STRETCH` of the text's. It need not know a share of `most_unknown` of the border.
    """
    box = box.copy()
    for side in (0, 1):
        for axis in (0, 1):
            for step in range(STEPS + 1):
                share = 1 - step / STEPS
                at = core[side, axis] + share * (box[side, axis] - core[side, axis])
                along = np.linspace(core[0, 1 - axis], core[1, 1 - axis], 40)
                rim = np.empty((40, 2))
                rim[:, axis], rim[:, 1 - axis] = at, along
                d = 1e-3 * float((core[1] - core[0]).max())
                seen = [page_map.to_photo(rim + offset) for offset in ([0.0, 0.0], [d, 0.0], [0.0, d])]
                du, dv = (seen[1] - seen[0]) / d, (seen[2] - seen[0]) / d
                det = du[:, 0] * dv[:, 1] - du[:, 1] * dv[:, 0]
                scale = view.unit_px * np.sqrt(np.maximum(det, 0.0)) / usual
                known = np.isfinite(det)
                plausible = (scale > 1 / MAX_STRETCH) & (scale < MAX_STRETCH)
                if plausible[known].all() and known.mean() >= 1 - most_unknown:
                    break
            box[side, axis] = at
    return box
