"""The sides of the sheet as evidence for every shape: which run along the text, how straight a flat view shows them."""

import numpy as np

from services.arrays import Mask, Points, Vector
from services.geometry.page_map import PageMap
from services.geometry.photo_frame import PhotoFrame
from services.sheet.developable.observations import NO_EDGES, SideObservations
from services.sheet.outline.results import LEAST_POINTS, SheetOutline

LEAST_PLACED = 0.9
"""Share of the points that a map must place."""
KEPT = 0.95
"""Share of the points, nearest to their lines, that are measured: the others may be notches."""


def read_edges(outline: SheetOutline | None, view: PhotoFrame, direction_rad: float) -> SideObservations:
    """The sides that are seen, in the centred coordinates of `view`.

    `direction_rad` is that of the text lines in the photo, up to a half turn.
    """
    if outline is None:
        return NO_EDGES
    seen = [k for k in range(4) if len(outline.sides[k].points) >= LEAST_POINTS]
    if not seen:
        return NO_EDGES
    text, along = np.array([np.cos(direction_rad), np.sin(direction_rad)]), [0.0, 0.0]
    for k in seen:
        chord = outline.sides[k].points[-1] - outline.sides[k].points[0]
        along[k % 2] += abs(float(chord @ text)) / float(np.linalg.norm(chord))
    first = 0 if along[0] >= along[1] else 1
    sides = [outline.sides[k] for k in seen]
    return SideObservations(
        view.to_centred(np.concatenate([side.points for side in sides])),
        np.repeat([(k + first) % 4 for k in seen], [len(side.points) for side in sides]),
        np.concatenate([side.deviations for side in sides]) / view.unit_px,
    )


def measure_sides(page_map: PageMap, edges: SideObservations) -> float:
    """RMS distance of the sides from four lines at right angles on the flat page, as a share of the sheet's size.

    NaN where no side is seen, or `page_map` does not place them.
    """
    page = page_map.to_page(edges.points)
    known = np.asarray(np.isfinite(page).all(axis=1))
    if not len(page) or known.mean() < LEAST_PLACED:
        return float("nan")
    index, page = edges.index[known], page[known]
    along, across = lay_along(page, edges.upright[known])
    number = np.maximum(np.bincount(index, minlength=4), 1)
    along, across = (a - (np.bincount(index, a, 4) / number)[index] for a in (along, across))
    # Print may be askew on its sheet: one turn of all sides is free.
    turn = float(along @ across / (along @ along))
    rest = np.sort(np.abs(across - turn * along))[: max(int(KEPT * len(across)), 1)]
    return float(np.sqrt(np.mean(rest**2)) / np.sqrt(np.prod(np.ptp(page, axis=0))))


def lay_along(page: Points, upright: Mask) -> tuple[Vector, Vector]:
    """Coordinates (N,) along and across its side of each page point (N, 2); which are `upright` (N,) is known."""
    u, v = page.T
    return np.where(upright, v, u), np.where(upright, -u, v)
