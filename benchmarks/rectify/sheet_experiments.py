"""The experiments on whole sheets, creased or not, and on photos that show less than one or two of them."""

from dataclasses import replace

import numpy as np

from benchmarks.rectify.experiments import Experiment
from simulation.creased import Crossed, Crumpled
from simulation.cropping import Cut
from simulation.folded import Folded, folded_in_thirds
from simulation.picture_pages import PICTURE_PAGES
from simulation.relaxed import FOLDED_PAPER, Relaxed
from simulation.scenes import BOOK, PLANE, WAVE
from simulation.sheets import SHEET_ASPECT, SHEET_VIEWS, Staging
from simulation.spreads import SPREAD_VIEWS, opened_book
from simulation.surfaces import Cylinder

LAMPS = (
    Staging(lamp_deg=200.0, lamp_height_deg=40.0),
    Staging(lamp_deg=300.0, lamp_height_deg=50.0),
    Staging(lamp_deg=250.0, lamp_height_deg=35.0, ambient=0.5),
    Staging(lamp_deg=110.0, lamp_height_deg=45.0),
    Staging(lamp_deg=20.0, lamp_height_deg=40.0, ambient=0.7),
    Staging(lamp_deg=275.0, lamp_height_deg=30.0, ambient=0.75),
    Staging(lamp_deg=165.0, lamp_height_deg=50.0, margin=0.09),
)
"""Oblique, from all sides: panels shade differently. Seven, which no other count here divides."""

FOLDED = tuple(
    folded_in_thirds(SHEET_ASPECT, first, second, radius=radius, sags=sags, upright=upright, skew_deg=skew)
    for first, second, radius, sags, upright, skew in (
        (25, -20, 0.03, (0.0, 0.0, 0.0), False, 0.0),
        (30, 25, 0.03, (0.1, -0.05, 0.1), False, 0.5),
        (-18, 12, 0.02, (0.0, 0.08, 0.0), False, 1.5),
        (15, -35, 0.0, (0.0, 0.0, 0.0), False, 0.0),
        (-20, -15, 0.04, (-0.15, 0.1, -0.1), False, -0.5),
        (12, 8, 0.03, (0.05, 0.05, 0.05), False, 0.0),
        (20, -25, 0.03, (0.0, 0.0, 0.0), True, 0.0),
        (38, -38, 0.015, (0.0, 0.0, 0.0), False, -1.0),
        (-30, 30, 0.03, (-0.1, 0.0, 0.1), False, 0.0),
        (10, 14, 0.05, (0.0, -0.1, 0.0), True, 0.5),
        (-25, 18, 0.02, (0.12, 0.0, -0.12), False, 0.0),
        (-12, -28, 0.0, (0.0, 0.0, 0.0), True, -0.5),
        (40, 20, 0.03, (0.0, 0.0, 0.0), False, 0.0),
        (-8, 10, 0.03, (-0.1, -0.1, -0.1), False, 1.0),
    )
)
"""Degrees, degrees, half page widths, its inverse: letters, and leaflets with upright creases."""

CROSSED = tuple(
    Relaxed(Crossed(SHEET_ASPECT, first, second, alike, centre, skew), FOLDED_PAPER)
    for first, second, alike, centre, skew in (
        (20, 20, False, (0.0, 0.0), 0.0),
        (25, 15, True, (0.03, -0.02), 0.5),
        (-20, 15, False, (-0.02, 0.0), -1.0),
        (12, -18, False, (0.0, 0.05), 1.5),
        (-15, -12, True, (0.0, 0.0), 0.0),
        (30, 12, False, (0.05, 0.0), -0.5),
        (15, 28, False, (0.0, -0.04), 0.0),
        (-28, -20, False, (0.0, 0.0), 1.0),
        (10, 10, True, (-0.04, 0.03), 0.0),
        (18, -25, False, (0.0, 0.0), -2.0),
        (-10, 22, False, (0.02, 0.02), 0.0),
        (22, -14, False, (0.0, 0.0), 0.0),
    )
)
"""Degrees: most as they were folded, three opened between the folds."""

_STEEPNESS_DEG = (12, 16, 10, 14, 18, 8, 14, 12, 16, 10, 20, 14)
_FACETS = (4.0, 3.0, 5.0, 2.5, 4.0, 3.0, 5.0, 2.0, 4.5, 3.5, 3.0, 4.0)
CRUMPLED = tuple(
    Relaxed(Crumpled(SHEET_ASPECT, 40 + number, angle, facets))
    for number, (angle, facets) in enumerate(zip(_STEEPNESS_DEG, _FACETS, strict=True))
)
"""Of the wanted steepness paper takes a good half."""

WHITE = tuple(
    Staging("white", lamp_deg=lamp, lamp_height_deg=height, shadow=shadow, margin=margin)
    for lamp, height, shadow, margin in (
        (200.0, 60.0, 0.12, 0.08),
        (300.0, 70.0, 0.0, 0.15),
        (120.0, 55.0, 0.08, 0.2),
        (20.0, 75.0, 0.0, 0.05),
        (250.0, 60.0, 0.05, 0.12),
    )
)
"""On a table as white as the sheet: a faint shadow at one side of it, or nothing."""
GENTLE = (
    Cylinder((0.0, 0.0, 0.08)), Cylinder((0.0, 0.06, -0.12, 0.0, 0.04)), Cylinder((0.0, 0.1, 0.0, -0.12)),
    Cylinder((0.0, 0.0, -0.1)), Folded((), np.pi / 2, 0.0, (0.08,)), Folded((), 1.2, 0.0, (-0.1,)),
)  # fmt: skip
"""Sheets that do not lie quite flat."""
STEEP_GUTTERS = tuple(
    Cylinder((0.0, slope, square, -slope / 3 + cube, -square / 2))
    for slope, square, cube in (
        (0.55, 0.0, 0.0), (-0.6, 0.05, 0.0), (0.7, -0.1, 0.05), (-0.75, 0.0, 0.05), (0.5, 0.15, -0.05),
        (-0.5, -0.15, 0.0), (0.65, 0.1, 0.0), (-0.7, 0.1, 0.0), (0.6, -0.15, 0.05), (-0.55, 0.0, -0.1),
    )
)  # fmt: skip
"""Pages steepest in their middle, where the gutter between two columns is, by 27 to 37 degrees."""
BOOKS = tuple(
    book
    for gutter, left, right, radius, sag in (
        (60, 30, 30, 0.45, 0.1), (80, 45, 35, 0.35, 0.15), (50, 20, 35, 0.4, 0.05),
        (90, 45, 45, 0.3, 0.2), (40, 25, 20, 0.45, 0.1), (70, 28, 44, 0.3, 0.15),
    )
    for book in (opened_book(gutter, left, right, radius=radius, sag=sag),) * 2
)  # fmt: skip
"""Each twice: for its left and its right page."""
QUARTERS = (Cut("right", 0.25), Cut("bottom", 0.2), Cut("left", 0.25), Cut("right", 0.25), Cut("bottom", 0.2))

_FLAT = (0.0,)
SHEET_EXPERIMENTS = (
    Experiment("folded", FOLDED, SHEET_VIEWS, _FLAT, once=True, stagings=LAMPS),
    Experiment("crossed", CROSSED, SHEET_VIEWS, _FLAT, once=True, stagings=LAMPS),
    Experiment("crumpled", CRUMPLED, SHEET_VIEWS, _FLAT, once=True, stagings=LAMPS),
    Experiment(
        "outline_hidden",
        (*FOLDED[:5], *CROSSED[:5], *CRUMPLED[:5]),
        SHEET_VIEWS[:4],
        _FLAT,
        once=True,
        stagings=tuple(replace(lamp, close=True) for lamp in LAMPS),
    ),
    Experiment("ground", (*(PLANE,) * 6, *GENTLE), SHEET_VIEWS, _FLAT, once=True, stagings=WHITE),
    Experiment("two_columns", STEEP_GUTTERS, SHEET_VIEWS, _FLAT, once=True, pages=("revtex", "own-5")),
    Experiment("cropped", (PLANE, BOOK, PLANE, WAVE) * 4, once=True, cuts=QUARTERS),
    Experiment(
        "textless",
        (*(PLANE,) * 6, *GENTLE[:3], *FOLDED[:3]),
        SHEET_VIEWS[:5],
        _FLAT,
        once=True,
        stagings=LAMPS,
        pages=PICTURE_PAGES,
    ),
    Experiment("spread", BOOKS, SPREAD_VIEWS, _FLAT, once=True, stagings=LAMPS, is_spread=True),
)
"""Of 10 to 16 photos each; `two_columns` and `cropped` fill the photo as the dissertation's do."""
