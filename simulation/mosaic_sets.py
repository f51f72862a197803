"""Several overlapping photos of one page, each from another place, under another light, by a hand that moves.

The page's print is divided into a grid of cells, and every photo shows one cell and as much around it as makes
neighbours overlap by the wanted share on average. What surrounds the page is one desk, the same in all photos.
"""

from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

from simulation.camera import Camera, Pose
from simulation.degradation import Degradation, Exposure, RgbImage, degrade, desk_texture, expose
from simulation.flat_page import Page, Points
from simulation.photo import SimulatedPhoto, simulate_photo
from simulation.surfaces import Cylinder, Plane, Shape
from simulation.truth import Truth

GRIDS = {2: (2, 1), 4: (2, 2), 8: (4, 2)}
"""Rows and columns of cells by number of photos."""
PHOTO_SIZES = {2: (2400, 1800), 4: (1500, 2000), 8: (1600, 1200)}
"""Largest width and height of a photo, px: pages of 300 dpi are seen at 220 to 440 dpi."""
OVERLAPS = (0.1, 0.2, 0.4)

GENTLE_CURVE = Cylinder((0.0, 0.03, -0.10, 0.0, 0.02))
"""A sheet that was folded or rolled once: bent by some 20 degrees from side to side."""

LARGEST_TILT_RAD = float(np.radians(35.0))
LARGEST_ROLL_RAD = float(np.radians(15.0))
SMALLEST_SIZE = 1 / 1.5
"""Photos are up to this much smaller than the largest, so that scales differ by 1.5."""

_SMALLEST_TILT_RAD = float(np.radians(5.0))
_SMALLEST_SHARE = 0.04
"""Photos that share less of their ink than this do not hold a set together: bare paper and pieces of a few letters
cannot be registered. (The weakest links of the data's sets share 0.08.)"""
_LARGEST_EXCESS = 0.3
"""No two neighbours share more than this above the wanted mean, so that the mean is of like pairs."""
_UNSEEN = 0.002
"""Share of the print that no photo need show."""
_TRIES_A_LEVEL = 10
_LEVELS = 16
_CALMER = 0.9
"""After ten draws that leave a gap, or no common area, tilts and rolls are drawn this much smaller."""
_INK_POINTS = 6000
_GRID_POINTS = 90
"""Points across the page at which shares of area are counted."""
_DESK_PX = 1024
_DESK_PX_PER_UNIT = 300.0


@dataclass(frozen=True, slots=True, eq=False)
class MosaicSet:
    """Photos of one page, in no order, with the truth of each.

    `overlaps` holds the share of the page's area that photos a < b both show, over that of the one that shows
    less; `mean_overlap` is the mean of neighbours in the grid, `cells` (row, column) are the photos' places there.
    """

    page: Page
    photos: tuple[SimulatedPhoto, ...]
    overlaps: dict[tuple[int, int], float]
    cells: tuple[tuple[int, int], ...]

    @property
    def images(self) -> tuple[RgbImage, ...]:
        """The photos alone."""
        return tuple(photo.image for photo in self.photos)

    @property
    def mean_overlap(self) -> float:
        """Mean share of neighbours."""
        return float(np.mean([self.overlaps[pair] for pair in neighbours(self.cells)]))


@dataclass(frozen=True, slots=True)
class _Aim:
    """How a cell is photographed, but for the distance. Angles are radians."""

    tilt_rad: float
    azimuth_rad: float
    roll_rad: float
    camera: Camera


def photograph_set(
    page: Page,
    count: int,
    overlap: float,
    rng: np.random.Generator,
    *,
    shape: Shape | None = None,
    turned: int = 0,
) -> MosaicSet:
    """`count` (2, 4 or 8) photos of `page`, neighbours overlapping by `overlap` (share of area) on average.

    `shape` is the sheet's, flat by default; `turned` photos are taken from the other side of the table, upside down.

    Raises
    ------
    ValueError
        When there is no grid for `count`, the overlap is not within 0.02-0.7, or no poses were found.
    """
    if count not in GRIDS or not 0.02 <= overlap <= 0.7 or not 0 <= turned <= count:
        raise ValueError("2, 4 or 8 photos overlap by 2 to 70 %, and no more are turned than there are")
    shape = shape or Plane()
    cells = [(row, column) for row in range(GRIDS[count][0]) for column in range(GRIDS[count][1])]
    cells = [cells[i] for i in rng.permutation(count)]
    upside_down = np.isin(np.arange(count), rng.choice(count, turned, replace=False))
    truths = _draw_truths(page, shape, cells, overlap, upside_down, rng)
    desk = desk_texture(_DESK_PX, _DESK_PX, rng)
    photos = tuple(_take(truth, desk, rng) for truth in truths)
    shown = [_shown(truth, _page_grid(page)) for truth in truths]
    return MosaicSet(page, photos, _shares(shown), tuple(cells))


def neighbours(cells: tuple[tuple[int, int], ...]) -> list[tuple[int, int]]:
    """Indices a < b of cells (row, column) side by side."""
    places = np.array(cells)
    return [(a, b) for a, b in combinations(range(len(cells)), 2) if np.abs(places[a] - places[b]).sum() == 1]


def printed_box(page: Page) -> tuple[float, float, float, float]:
    """Box (x0, y0, x1, y1) of all ink, page pixels; the whole page where there is none."""
    ink = _ink(page)
    rows, columns = np.flatnonzero(ink.any(axis=1)), np.flatnonzero(ink.any(axis=0))
    if not len(rows):
        return 0.0, 0.0, page.width - 1.0, page.height - 1.0
    return float(columns[0]), float(rows[0]), float(columns[-1]), float(rows[-1])


def _ink(page: Page) -> NDArray[np.bool_]:
    gray = page.image if page.image.ndim == 2 else page.image.min(axis=2)
    return np.asarray(gray < page.paper - 48)


def _ink_points(page: Page) -> Points:
    """Some thousand page pixels (N, 2) that are ink, spread evenly over all of it."""
    places = np.flatnonzero(_ink(page))
    chosen = places[np.linspace(0, len(places) - 1, min(_INK_POINTS, len(places))).astype(np.intp)]
    return np.stack([chosen % page.width, chosen // page.width], axis=1).astype(np.float64)


def _draw_truths(
    page: Page,
    shape: Shape,
    cells: list[tuple[int, int]],
    overlap: float,
    upside_down: NDArray[np.bool_],
    rng: np.random.Generator,
) -> list[Truth]:
    """Poses are drawn until all of the print is seen and the photos hang together."""
    grid = _page_grid(page)
    box = printed_box(page)
    printed = np.all((grid >= box[:2]) & (grid <= box[2:]), axis=1)
    ink = _ink_points(page)
    pairs = neighbours(tuple(cells))
    for level in range(_LEVELS):
        for _ in range(_TRIES_A_LEVEL):
            aims = [_draw_aim(len(cells), _CALMER**level, bool(turn), rng) for turn in upside_down]
            outlines = [_cell_outline(box, cell, len(cells)) for cell in cells]
            truths, shown = _at_overlap(page, shape, outlines, aims, pairs, overlap, grid)
            seen = np.any(shown, axis=0)[printed].mean()
            shares = _shares(shown)
            beside = np.array([shares[pair] for pair in pairs])
            reached = (
                abs(beside.mean() - overlap) < 0.1 * overlap and beside.max() < overlap + _LARGEST_EXCESS
            )
            if reached and seen >= 1 - _UNSEEN:
                shared_ink = _shares([_shown(truth, ink) for truth in truths])
                if _hangs_together(len(cells), shared_ink):
                    return truths
    raise ValueError("no poses were found that show all of the page at this overlap")


def _draw_aim(count: int, calm: float, upside_down: bool, rng: np.random.Generator) -> _Aim:
    size = rng.uniform(SMALLEST_SIZE, 1.0)
    width, height = (2 * round(side * size / 2) for side in PHOTO_SIZES[count])
    # Phones' main cameras: 24 to 30 mm on 43 mm of film.
    focal = rng.uniform(0.56, 0.7) * float(np.hypot(width, height))
    tilt = rng.uniform(_SMALLEST_TILT_RAD, LARGEST_TILT_RAD) * calm
    roll = rng.uniform(-LARGEST_ROLL_RAD, LARGEST_ROLL_RAD) * calm + (np.pi if upside_down else 0.0)
    return _Aim(tilt, rng.uniform(0, 2 * np.pi), roll, Camera(focal, width, height))


def _at_overlap(
    page: Page,
    shape: Shape,
    outlines: list[Points],
    aims: list[_Aim],
    pairs: list[tuple[int, int]],
    overlap: float,
    grid: Points,
) -> tuple[list[Truth], list[NDArray[np.bool_]]]:
    """Photos that all show cells grown alike, such that the mean share of neighbours is `overlap` (bisection)."""
    low, high = 0.5, 2.2
    for _ in range(9):
        growth = (low + high) / 2
        truths = [_aimed(page, shape, cell, aim, growth) for cell, aim in zip(outlines, aims, strict=True)]
        shown = [_shown(truth, grid) for truth in truths]
        shares = _shares(shown)
        if np.mean([shares[pair] for pair in pairs]) < overlap:
            low = growth
        else:
            high = growth
    return truths, shown


def _aimed(page: Page, shape: Shape, cell: Points, aim: _Aim, growth: float) -> Truth:
    """The camera moved until the cell (outline, page pixels), `growth` times as large, just fits into the photo."""
    centre = cell.mean(axis=0)
    sheet = page.sheet_from_page(centre + growth * (cell - centre), 0.0)
    turn = Pose(aim.tilt_rad, aim.azimuth_rad, aim.roll_rad).rotation()
    points = shape.place(sheet)
    middle = points.mean(axis=0)
    leaning = (points - middle) @ turn.T
    size = np.array([aim.camera.width, aim.camera.height], np.float64)
    at = np.array([0.0, 0.0, 4.0])
    for _ in range(25):
        seen = aim.camera.focal_length_px * (leaning + at)[:, :2] / np.maximum((leaning + at)[:, 2:], 0.05)
        low, high = seen.min(axis=0), seen.max(axis=0)
        at[:2] -= (low + high) / 2 * at[2] / aim.camera.focal_length_px
        at[2] *= float(np.max((high - low) / size)) ** 0.7
    x, y, z = at - turn @ middle
    return Truth(page, shape, 0.0, Pose(aim.tilt_rad, aim.azimuth_rad, aim.roll_rad, (x, y, z)), aim.camera)


def _cell_outline(box: tuple[float, float, float, float], cell: tuple[int, int], count: int) -> Points:
    """Corners and middles of sides (8, 2) of a cell of the printed box, page pixels."""
    x0, y0, x1, y1 = box
    rows, columns = GRIDS[count]
    size = np.array([(x1 - x0) / columns, (y1 - y0) / rows])
    middle = np.array([x0, y0]) + size * (np.array([cell[1], cell[0]]) + 0.5)
    around = [(-1, -1), (0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0)]
    return np.asarray(middle + np.array(around) * size / 2, np.float64)


def _page_grid(page: Page) -> Points:
    x = (np.arange(_GRID_POINTS) + 0.5) * page.width / _GRID_POINTS - 0.5
    rows = max(round(_GRID_POINTS * page.height / page.width), 2)
    y = (np.arange(rows) + 0.5) * page.height / rows - 0.5
    return np.asarray(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2), np.float64)


def _shown(truth: Truth, page_points: Points) -> NDArray[np.bool_]:
    """Which page points (N,) lie within the photo."""
    seen = truth.page_to_photo(page_points)
    with np.errstate(invalid="ignore"):
        inside = (seen >= -0.5) & (seen <= [truth.camera.width - 0.5, truth.camera.height - 0.5])
    return np.asarray(inside.all(axis=1))


def _shares(shown: list[NDArray[np.bool_]]) -> dict[tuple[int, int], float]:
    """Share of each pair's common points in those of the one that shows fewer."""
    return {
        (a, b): float((shown[a] & shown[b]).sum() / max(min(shown[a].sum(), shown[b].sum()), 1))
        for a, b in combinations(range(len(shown)), 2)
    }


def _hangs_together(count: int, shares: dict[tuple[int, int], float]) -> bool:
    """Whether the photos are connected by shares that are large enough."""
    reached = {0}
    for _ in range(count):
        for (a, b), share in shares.items():
            if share >= _SMALLEST_SHARE and (a in reached or b in reached):
                reached |= {a, b}
    return len(reached) == count


def _take(truth: Truth, desk: RgbImage, rng: np.random.Generator) -> SimulatedPhoto:
    camera = truth.camera
    sheet = np.clip(np.nan_to_num(truth.sheet_lattice().upsampled(0, camera.height)), -50, 50)
    # The desk goes on as its own mirror image.
    last = np.float32(_DESK_PX - 1)
    place = last - np.abs(np.mod(sheet * np.float32(_DESK_PX_PER_UNIT), 2 * last) - last)
    x, y = (np.ascontiguousarray(place[..., k]) for k in (0, 1))
    beside = np.asarray(cv2.remap(desk, x, y, cv2.INTER_LINEAR), np.uint8)
    clean = simulate_photo(
        truth.page, truth.shape, truth.skew_rad, truth.pose, camera, background=beside, close_up=True
    )
    red, green, blue = rng.uniform(0.9, 1.08, 3)
    slant = rng.uniform(-0.18, 0.18, 2)
    light = Exposure(
        (float(slant[0]), float(slant[1])),
        float(rng.uniform(0.65, 1.0)),
        (float(red), float(green), float(blue)),
        float(rng.uniform(0.85, 1.2)),
    )
    dirt = Degradation(
        vignetting=float(rng.uniform(0.05, 0.3)),
        blur_sigma_px=float(rng.uniform(0.4, 1.5)),
        motion_px=float(rng.uniform(2.0, 4.0)) if rng.random() < 0.15 else 0.0,
        noise_sigma=float(rng.uniform(1.5, 4.0)),
        jpeg_quality=int(rng.integers(84, 94)),
    )
    return SimulatedPhoto(degrade(expose(clean.image, light), dirt, rng), truth)
