"""Rulings continued to where the text ends."""

import numpy as np

from benchmarks.dissertation_chain.rulings.results import ProjectedRulings, RulingVanishingPoints
from services.arrays import Points, Vector

_MOST = 10
"""Rulings added on each side, at most."""
_SHARE = 1 / 3
"""Of the rulings, from either end: what those added continue."""
_FEW = 0.0007
"""Share of the characters that may stay outside."""


def cover_text(
    rulings: ProjectedRulings, vanishing_points: RulingVanishingPoints, characters: Points
) -> tuple[ProjectedRulings, RulingVanishingPoints]:
    """The same with as many rulings more, evenly on, as leave hardly a character (N, 2) beyond the last.

    Reference points lie on one line across the text (Appendix B). Where text is skewed to the rulings, or these run
    together, its corners lie beyond the first or last of them, and a flat continuation would cost half a percent of
    the page there. The vanishing points of those added are unknown.
    """
    if len(rulings) < 3 or not len(characters):
        return rulings, vanishing_points
    for end in (0, -1):
        rulings, vanishing_points = _continue(rulings, vanishing_points, characters, end)
    return rulings, vanishing_points


def _continue(
    rulings: ProjectedRulings, vanishing_points: RulingVanishingPoints, characters: Points, end: int
) -> tuple[ProjectedRulings, RulingVanishingPoints]:
    inner = 1 if end == 0 else -2
    step = rulings.points[end] - rulings.points[inner]
    turn = _turn(rulings.angles, end)
    points, angles = [], []
    for k in range(_MOST):
        at, angle = rulings.points[end] + k * step, rulings.angles[end] + k * turn
        if _share_beyond(characters, at, angle, step) <= _FEW:
            break
        points.append(at + step)
        angles.append(angle + turn)
    if not points:
        return rulings, vanishing_points
    count = len(points)
    order = slice(None, None, -1) if end == 0 else slice(None)

    def joined(known: np.ndarray, added: np.ndarray) -> np.ndarray:
        return np.concatenate([added[order], known] if end == 0 else [known, added[order]])

    return (
        ProjectedRulings(
            joined(rulings.points, np.array(points)),
            joined(rulings.angles, np.array(angles)) % np.pi,
            joined(rulings.qualities, np.full(count, rulings.qualities[end])),
            joined(rulings.curved, np.zeros(count, bool)),
        ),
        RulingVanishingPoints(
            joined(vanishing_points.directions, np.repeat(vanishing_points.directions[[end]], count, axis=0)),
            joined(vanishing_points.deviations, np.full(count, np.inf)),
        ),
    )


def _turn(angles: Vector, end: int) -> float:
    """Mean turn from one ruling to the next towards an end, over the share of rulings next to it."""
    turns = (np.diff(angles) + np.pi / 2) % np.pi - np.pi / 2
    count = max(round(_SHARE * len(turns)), 1)
    return -float(np.mean(turns[:count])) if end == 0 else float(np.mean(turns[-count:]))


def _share_beyond(characters: Points, at: Points, angle: float, outwards: Points) -> float:
    across = np.array([-np.sin(angle), np.cos(angle)])
    across = across if across @ outwards >= 0 else -across
    return float(np.mean((characters - at) @ across > 0))
