"""The experiments on whole sheets that lie on a desk: folded, crossed, crumpled."""

from benchmarks.experiments import Experiment
from simulation.creased import Crossed, Crumpled
from simulation.folded import folded_in_thirds
from simulation.relaxed import FOLDED_PAPER, Relaxed
from simulation.sheets import SHEET_ASPECT, SHEET_VIEWS, Staging

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

SHEET_EXPERIMENTS = (
    Experiment("folded", FOLDED, SHEET_VIEWS, (0.0,), LAMPS),
    Experiment("crossed", CROSSED, SHEET_VIEWS, (0.0,), LAMPS),
    Experiment("crumpled", CRUMPLED, SHEET_VIEWS, (0.0,), LAMPS),
)
"""Of whole sheets: 12 to 14 photos each."""
