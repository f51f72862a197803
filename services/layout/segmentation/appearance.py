"""How the ink of zones looks: print is even and stands on baselines, handwriting, stamps and dirt do not."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from services.layout.page import Box, InkAppearance, Zone
from services.layout.segmentation.components import Boxes, near_pairs
from services.layout.segmentation.frame import PrintedPage

WITHIN = 0.5
"""A component belongs to a zone that holds this share of its box."""
_LEVEL, _NEAR = 0.12, 4.0
"""Feet that differ by less are level, if the components are no farther apart; in units of the page's glyph height."""
_TALL = 0.35
"""Lower components, in units, are dots and dirt, and stand on no baseline."""


@dataclass(frozen=True, slots=True, eq=False)
class InkMarks:
    """N components of a page: `edges` (4, N), x0, y0, x1, y1 in its pixels, the `least` area (N,) of each that a zone
    holds to have it, and what appearance is the sum of, `terms` (N, 10)."""

    edges: Boxes
    least: NDArray[np.float64]
    terms: NDArray[np.float64]


def mark_ink(printed: PrintedPage) -> InkMarks:
    """The components of a page, with their sizes in units of its glyph height and strokes in its usual stroke."""
    components, unit = printed.components, printed.unit
    scale = np.array(printed.frame.scale)
    area, height = components.area, components.height / unit
    log_height, root = np.log2(height), np.sqrt(area)
    tall = height > _TALL
    terms = [
        area * np.prod(scale),
        area,
        area * height,
        area * components.stroke / _usual_stroke(printed),
        # The moments of thin rules and specks give any slant.
        area * np.clip(components.slant, -1.0, 1.0),
        root,
        root * log_height,
        root * log_height**2,
        tall,
        tall & _is_level(printed, tall),
    ]
    edges = np.ascontiguousarray((components.boxes * np.tile(scale, 2)).T)
    least = WITHIN * (edges[2] - edges[0]) * (edges[3] - edges[1])
    return InkMarks(edges, least, np.column_stack(terms).astype(np.float64))


def measure_appearance(marks: InkMarks, box: Box) -> InkAppearance | None:
    """InkAppearance of the ink in a box; None where there is none."""
    x0, y0, x1, y1 = marks.edges
    down = np.minimum(y1, box[3]) - np.maximum(y0, box[1])
    near = np.flatnonzero(down > 0)
    across = np.minimum(x1[near], box[2]) - np.maximum(x0[near], box[0])
    inside = near[np.maximum(across, 0.0) * down[near] > marks.least[near]]
    if len(inside) == 0:
        return None
    ink, area, sizes, strokes, slants, weight, logs, squares, tall, level = marks.terms[inside].sum(axis=0)
    return InkAppearance(
        density=float(ink / max((box[2] - box[0]) * (box[3] - box[1]), 1.0)),
        size=float(sizes / area),
        size_spread=float(np.sqrt(max(squares / weight - (logs / weight) ** 2, 0.0))),
        stroke=float(strokes / area),
        slant=float(slants / area),
        regularity=float(level / max(tall, 1.0)),
    )


def with_appearance(marks: InkMarks | None, zones: Sequence[Zone]) -> list[Zone]:
    """The zones with the appearance of their ink; as they are without marks."""
    if marks is None:
        return list(zones)
    return [replace(zone, appearance=measure_appearance(marks, zone.box)) for zone in zones]


def _usual_stroke(printed: PrintedPage) -> float:
    """Median width of the strokes of glyphs by their ink, in pixels of the working copy."""
    glyphs = np.flatnonzero(printed.kinds.glyphs)
    if len(glyphs) == 0:
        glyphs = np.arange(len(printed.components))
    order = glyphs[np.argsort(printed.components.stroke[glyphs])]
    total = np.cumsum(printed.components.area[order])
    return float(printed.components.stroke[order][np.searchsorted(total, total[-1] / 2)])


def _is_level(printed: PrintedPage, tall: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which components (N,) stand on one baseline with a tall neighbour."""
    level = np.zeros(len(tall), dtype=bool)
    members = np.flatnonzero(tall)
    boxes = printed.levelled.boxes[members]
    foot = boxes[:, 3] - printed.levelled.hang[members]
    centre = (boxes[:, 0] + boxes[:, 2]) / 2
    reach = _LEVEL * printed.unit / 2
    i, j = near_pairs(foot - reach, foot + reach)
    near = np.abs(centre[i] - centre[j]) < _NEAR * printed.unit
    level[members[i[near]]] = level[members[j[near]]] = True
    return level
