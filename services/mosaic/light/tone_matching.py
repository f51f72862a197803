"""Equal light within and between photos: matched gains and localized histogram normalization (4.4)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Mask, Points
from services.contract.rectify import Illumination
from services.geometry.homographies import from_resized, to_resized
from services.imaging.channels import only_where, strongest_channel
from services.imaging.levels import (
    Levels,
    level_coefficients,
    measure_levels,
    neutral_gains,
)
from services.imaging.node_grid import node_grid, take_values
from services.imaging.pictures import find_pictures, levels_beside_pictures
from services.imaging.reduction import PRINT_PX
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.light.canvas import (
    CELL_PX,
    Canvas,
    CanvasView,
    FloatImage,
    draw_on_canvas,
    draw_reduced,
    frame_canvas,
    without_rim,
)
from services.mosaic.light.canvas_sums import CanvasSums, compare_cells
from services.mosaic.light.hidden_parts import (
    HiddenCells,
    HiddenPart,
    find_hidden_cells,
    hidden_part,
    show_only,
)
from services.mosaic.light.light_field import (
    bright_parts,
    fit_light,
    node_field,
    spread,
    to_cells,
)
from services.mosaic.light.tones import ToneMap
from services.mosaic.placing.placement import Placement

PAPER_QUANTILE = 0.95
"""Share of the bright levels that are at most paper's: glare is brighter."""


# Parameters of light matching and of levels.
VIEW_LONG_SIDE_PX = 600
"""Long side of a photo's view on the canvas. At this size text still has paper between its lines."""
WINDOWS_CELLS = (1.5, 6.0, 24.0)
"""Sizes of the Gaussian windows in which a photo's light is adapted to the mean. The first covers two text lines;
the others are used in dark parts of pictures."""
BRIGHTEST_PAPER = 250.0
"""Largest paper level after matching, unless the brightest photo has a larger one."""
MAP_LONG_SIDE = 400
"""Long side of a tone map with levels. The levels are measured at this size, and follow a shadow's edge."""
GRAY_PAPER = 230.0
"""Level of paper when each photo's own levels are measured: below white, to avoid clipping."""
WELL_WITHIN = 1 / 30
"""Share of the page's long side: twice the width of each ring in which the edge of a picture is measured."""
LARGEST_CORRECTION = 0.25
"""Largest relative deviation of a photo's own paper level from that of all photos; beyond it, it is not paper."""
LIGHTEST_INK = 0.55
"""Largest ink level, as a share of the paper level, that is made dark. It doubles the contrast. In a more blurred
photo the strokes would merge."""


@dataclass(frozen=True, slots=True, eq=False)
class MatchedTones:
    """For each photo its tones, and the part of it that something hides and another photo shows.

    `glare` is the part of the page that is white in all photos of it; None without photos.
    """

    maps: tuple[ToneMap, ...] = ()
    hidden: tuple[HiddenPart, ...] = ()
    glare: HiddenPart | None = None


def match_tones(
    photos: Sequence[FlatPhoto], placements: Sequence[Placement], illumination: Illumination
) -> MatchedTones:
    """One tone map for each photo, such that the light of all photos agrees.

    Without print on paper only gains are matched. The result does not depend on the order of the photos.

    Parameters
    ----------
    photos, placements
        The flat views and their places on the mosaic.
    illumination
        "keep": overlapping photos get equal colours, and the mean over all photos stays, unless paper would be clipped.
        "normalize": in addition, paper becomes white, also in hue unless it is clearly coloured, and the ink of all
        photos becomes equally dark. The levels are those of the whole page, so a photo with little paper gets them
        from its neighbours. Pictures get the light of the paper around them. Looks of a scanner are made of that.
    """
    if not photos:
        return MatchedTones()
    canvas, boxes = frame_canvas(photos, placements, VIEW_LONG_SIDE_PX)
    views = [
        draw_on_canvas(photo, placement, canvas, box)
        for photo, placement, box in zip(photos, placements, boxes, strict=True)
    ]
    lights = match_light(views, canvas)
    if illumination != "keep":
        lights = _with_neutral_paper(lights)
    grids = [
        _FlatGrid.over(photo, placement, canvas, MAP_LONG_SIDE)
        for photo, placement in zip(photos, placements, strict=True)
    ]
    gains = [
        grid.sample(light, view.left, view.top, CELL_PX)
        for grid, light, view in zip(grids, lights.fields, views, strict=True)
    ]
    levels = None
    if illumination != "keep":
        levels = _page_levels(lights)
    if levels is None:
        identity = np.array([1, 0, 0], np.float32)
        changes = [np.broadcast_to(identity, gain.shape) for gain in gains]
    else:
        changes = _normalizations(photos, grids, gains, levels, canvas)
    tones = tuple(
        ToneMap(np.dstack([gain, change]), *photo.size)
        for photo, gain, change in zip(photos, gains, changes, strict=True)
    )
    hidden = tuple(
        hidden_part(cells, to_cells(view.feather) > 0, (view.left, view.top), canvas)
        for cells, view in zip(lights.hidden.of_views, views, strict=True)
    )
    return MatchedTones(
        tones, hidden, hidden_part(lights.hidden.clipped, lights.hidden.shown, (0, 0), canvas)
    )


@dataclass(frozen=True, slots=True, eq=False)
class MatchedLight:
    """Gains (h, w, 3) of every view at its cells, and the page after their application.

    `page` (H, W, 3) float32 is the mean of all views, without their `hidden` cells, and `bright` (H, W) its
    `bright_parts`, 0 where no view exists. `shown` (H, W) is true where any view exists, `inner` (H, W) where a view
    exists far enough inside its borders.
    """

    fields: tuple[FloatImage, ...]
    hidden: HiddenCells
    page: FloatImage
    bright: FloatImage
    shown: Mask
    inner: Mask


def match_light(views: Sequence[CanvasView], canvas: Canvas) -> MatchedLight:
    """Gains that equalize all views: first smooth fields, then the ratio to the mean where views overlap.

    The mean weights each view by the distance to its border. Therefore it changes gradually into a view's own light
    where the others end. Light that smooth fields cannot model, such as a shadow's edge, fades out towards the border
    of the overlap.
    """
    fields = [
        np.exp(node_field(nodes, *view.shown.shape))
        for nodes, view in zip(fit_light(views), views, strict=True)
    ]
    hidden = find_hidden_cells(views, fields)
    clear = [show_only(view, cells) for view, cells in zip(views, hidden.of_views, strict=True)]
    inner = np.zeros((canvas.height, canvas.width), bool)
    well_within = WELL_WITHIN * max(canvas.height, canvas.width)
    for view in views:
        inner[view.box] |= view.feather > well_within
    sums = CanvasSums.nothing(canvas)
    for view, gain in zip(clear, fields, strict=True):
        sums.add(view, gain)
    strongest, page, shown = sums.end(), sums.page, sums.weight > 0
    bright = bright_parts(strongest) * shown
    followed = []
    for view, gain in zip(clear, fields, strict=True):
        means, share = compare_cells(page, bright, view, gain)
        there, here = np.dsplit(spread(means, share, WINDOWS_CELLS), 2)
        followed.append(to_cells(gain) * (there + 1) / (here + 1))
    overall = _overall_gain(clear, page, bright, BRIGHTEST_PAPER)
    if overall < 1.0:
        page *= np.float32(overall)
        bright = bright_parts(strongest_channel(page)) * shown
    return MatchedLight(tuple(gain * overall for gain in followed), hidden, page, bright, shown, inner)


def _with_neutral_paper(lights: MatchedLight) -> MatchedLight:
    """`lights` with neutral paper if its tint may come from the light; clearly coloured paper keeps its colour."""
    bright = lights.bright[::CELL_PX, ::CELL_PX] > 0
    if not bright.any():
        return lights
    gains = neutral_gains(np.median(lights.page[::CELL_PX, ::CELL_PX][bright], axis=0))
    page = lights.page * np.tile(gains, lights.page.shape[1]).reshape(-1, 3)
    return replace(
        lights,
        fields=tuple(field * gains for field in lights.fields),
        page=page,
        bright=bright_parts(strongest_channel(page)) * lights.shown,
    )


def _overall_gain(
    views: Sequence[CanvasView], page: FloatImage, bright: FloatImage, brightest_paper: float
) -> float:
    """Gain, at most 1, that keeps the common paper level below white."""
    reached = _paper_level(page, bright)
    limit = max(
        [brightest_paper] + [_paper_level(view.image, bright[view.box] * view.shown) for view in views]
    )
    return min(1.0, limit / max(reached, 1.0))


def _paper_level(image: FloatImage, bright: FloatImage) -> float:
    """Level of well-lit paper."""
    levels = strongest_channel(np.ascontiguousarray(image[::CELL_PX, ::CELL_PX]))[
        bright[::CELL_PX, ::CELL_PX] > 0
    ]
    return float(np.quantile(levels, PAPER_QUANTILE)) if levels.size else 0.0


def _page_levels(lights: MatchedLight) -> Levels | None:
    """Levels of the matched page, measured again with pictures replaced by paper; pictures count as not measured."""
    image = _page_image(lights)
    levels = measure_levels(image)
    if levels is None:
        return None
    return levels_beside_pictures(image, levels, find_pictures(levels, lights.inner))


def _page_image(lights: MatchedLight) -> NDArray[np.uint8]:
    """The matched page, 8 bits; paper like that nearby where no photo shows the page."""
    known = only_where(lights.bright > 0, lights.page)
    around = spread(to_cells(known), to_cells(lights.bright), WINDOWS_CELLS)
    height, width = lights.shown.shape
    filled = cv2.resize(around, (width, height), interpolation=cv2.INTER_LINEAR)
    page = np.asarray(cv2.copyTo(lights.page, lights.shown.view(np.uint8), filled), np.float32)
    page += np.float32(0.5)
    return np.clip(page, 0, 255, out=page).astype(np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class _FlatGrid:
    """Cells of a photo's tone map, as points on the canvas."""

    points: Points
    rows: int
    columns: int

    @classmethod
    def over(cls, photo: FlatPhoto, placement: Placement, canvas: Canvas, long_side: int) -> "_FlatGrid":
        width, height = photo.size
        factor = min(1.0, long_side / max(width, height))
        columns, rows = max(1, round(width * factor)), max(1, round(height * factor))
        x = (np.arange(columns) + 0.5) * width / columns - 0.5
        y = (np.arange(rows) + 0.5) * height / rows - 0.5
        flat = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        return cls(canvas.from_mosaic(placement.to_mosaic(flat)), rows, columns)

    def sample(self, values: FloatImage, left: float, top: float, step: float) -> FloatImage:
        """Samples (rows, columns, C) of `values`, each of which covers `step` canvas pixels, from (left, top) on."""
        places = from_resized(self.points - (left, top), step)
        places = places.reshape(self.rows, self.columns, 2).astype(np.float32)
        return np.asarray(take_values(values, places, cv2.INTER_LINEAR, cv2.BORDER_REPLICATE), np.float32)


def _normalizations(
    photos: Sequence[FlatPhoto],
    grids: Sequence[_FlatGrid],
    gains: Sequence[FloatImage],
    levels: Levels,
    canvas: Canvas,
) -> list[FloatImage]:
    """Coefficients (rows, columns, 3) of `level_coefficients` for every photo, applied after its gains."""
    step = canvas.width / levels.paper.shape[1]
    papers, inks, shares = [], [], []
    for photo, grid, gain in zip(photos, grids, gains, strict=True):
        paper = grid.sample(levels.paper, 0, 0, step)
        measured = grid.sample(levels.measured, 0, 0, step)
        own = measure_levels(_gray_paper_view(photo, gain / paper[..., None], measured))
        ink = None
        if own is not None:
            size = (grid.columns, grid.rows)
            rest = np.log(cv2.resize(own.paper, size) / GRAY_PAPER)
            trusted = cv2.resize(own.measured, size) * measured
            limit = np.log1p(LARGEST_CORRECTION)
            # Fade out at the limit: a larger difference is not paper, or not the same paper.
            trusted = trusted * np.clip(2 - 2 * np.abs(rest) / limit, 0, 1)
            paper = paper * np.exp(rest * trusted).astype(np.float32)
            ink = cv2.resize(own.ink, size) if own.ink.any() else None
        papers.append(paper)
        inks.append(ink)
        shares.append(measured)
    known = [float(np.median(ink)) for ink in inks if ink is not None]
    typical = np.float32(np.median(known) if known else 0.0)
    return [
        level_coefficients(paper, np.minimum(typical if ink is None else ink, LIGHTEST_INK) * measured)
        for paper, ink, measured in zip(papers, inks, shares, strict=True)
    ]


def _gray_paper_view(photo: FlatPhoto, gain: FloatImage, measured: FloatImage) -> NDArray[np.uint8]:
    """Reduced flat view with paper brought to `gray_paper` by `gain` (rows, columns, 3).

    Where the page's paper was not `measured` (rows, columns), as on a desk or a picture, the view is bare paper.
    """
    width, height = photo.size
    factor = min(1.0, PRINT_PX / max(width, height))
    size = (max(1, round(width * factor)), max(1, round(height * factor)))
    nodes, _ = node_grid(0, 0, *size)
    flat = to_resized(nodes, np.array([width / size[0], height / size[1]]))
    image, within = draw_reduced(photo, flat, *size)
    on_page = cv2.resize(photo.shown.view(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    enlarged = cv2.resize(gain * np.float32(GRAY_PAPER), size, interpolation=cv2.INTER_LINEAR)
    view = cv2.multiply(image, enlarged, dtype=cv2.CV_8U)
    is_paper = cv2.resize(measured, size, interpolation=cv2.INTER_LINEAR) > 0.5
    shown = without_rim(within, np.asarray(on_page, np.uint8)) & is_paper
    return np.asarray(cv2.copyTo(view, shown.view(np.uint8), np.full_like(view, GRAY_PAPER)), np.uint8)
