"""Sheets with parallel creases, as a letter for an envelope has: exactly isometric, soft or sharp."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simulation.flat_page import Points
from simulation.surfaces import Points3

_FAR = 50.0
"""Half page widths that the outer panels are continued by."""
_NEWTON_STEPS = 6


@dataclass(frozen=True, slots=True)
class Crease:
    """A straight crease.

    place: where it crosses the line through the sheet's centre in the direction of `Folded.across_rad`, half
        page widths.
    turn_rad: by how much the sheet turns there; positive: beyond it the sheet rises towards the viewer.
    radius: of curvature, half page widths; 0 is a sharp crease.
    """

    place: float
    turn_rad: float
    radius: float = 0.0


@dataclass(frozen=True, slots=True)
class Folded:
    """A sheet with parallel creases: a general cylinder whose directrix is made of lines and arcs.

    `across_rad` is the direction on the sheet, from its s axis towards its t axis, in which the creases
    follow one another (pi/2: they run from left to right); they come in this order. `slope_rad` is how the
    sheet rises at its centre. `sags` (1/half page width), if any, is one more than there are creases: the
    curvature of the panels between them, positive as a crease's turn. The outer panels bend up to `reach`
    from the centre, and are straight beyond.

    Raises
    ------
    ValueError
        When creases overlap or are not in order, or the number of sags does not fit.
    """

    creases: tuple[Crease, ...]
    across_rad: float = np.pi / 2
    slope_rad: float = 0.0
    sags: tuple[float, ...] = ()
    reach: float = 2.0

    def __post_init__(self) -> None:
        if self.sags and len(self.sags) != len(self.creases) + 1:
            raise ValueError("there is one panel more than there are creases")
        starts = self._directrix().starts
        if np.any(np.diff(starts) < 0):
            raise ValueError("creases come in order, and their arcs do not overlap")

    def place(self, sheet: Points) -> Points3:
        """See `Shape`."""
        along, beside = self._frame()
        x, z, _ = self._directrix().at(sheet @ along)
        return np.column_stack([x[:, None] * along + (sheet @ beside)[:, None] * beside, z])

    def tangents(self, sheet: Points) -> tuple[Points3, Points3]:
        """See `Shape`."""
        along, beside = self._frame()
        _, _, heading = self._directrix().at(sheet @ along)
        forward = np.column_stack([np.cos(heading)[:, None] * along, -np.sin(heading)])
        ruling = np.array([*beside, 0.0])
        c, s = along
        return c * forward - s * ruling, s * forward + c * ruling

    def rulings(self, sheet: Points) -> Points3:
        """See `Shape`; to the right where they are level."""
        _, beside = self._frame()
        down = -beside if (beside[1], beside[0]) < (0.0, 0.0) else beside
        return np.tile(np.array([*down, 0.0]), (len(sheet), 1))

    def meet(self, origin: Points3, directions: Points3) -> Points:
        """See `Shape`. The ruling drops out of the search: it is one root in the plane across the creases."""
        along, beside = self._frame()
        curve = self._directrix()
        start, step = origin[:2] @ along, directions[:, :2] @ along
        rise = directions[:, 2]
        arc = curve.seen_at(float(start), float(origin[2]), step, rise)
        x, z, heading = curve.at(arc)
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = ((x - start) * step + (z - origin[2]) * rise) / (step**2 + rise**2)
        across = origin[:2] @ beside + reach * (directions[:, :2] @ beside)
        front = rise * np.cos(heading) + step * np.sin(heading) > 0
        met: Points = arc[:, None] * along + across[:, None] * beside
        met[~((reach > 0) & front)] = np.nan
        return met

    def _frame(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Unit vectors (2,) on the sheet, across and along the creases."""
        c, s = np.cos(self.across_rad), np.sin(self.across_rad)
        return np.array([c, s]), np.array([-s, c])

    def _directrix(self) -> "_Arcs":
        sags = self.sags or (0.0,) * (len(self.creases) + 1)
        starts, curvatures, turns = [-self.reach], [sags[0]], [0.0]
        for crease, sag in zip(self.creases, sags[1:], strict=True):
            half = abs(crease.turn_rad) * crease.radius / 2
            if half > 0:
                starts.append(crease.place - half)
                curvatures.append(float(np.sign(crease.turn_rad)) / crease.radius)
                turns.append(0.0)
            starts.append(crease.place + half)
            curvatures.append(sag)
            turns.append(0.0 if half > 0 else crease.turn_rad)
        starts.append(self.reach)
        return _Arcs(np.array(starts), np.array([*curvatures, 0.0]), np.array([*turns, 0.0]), self.slope_rad)


class _Arcs:
    """A plane curve of lines and arcs, by its length: x, z (falling towards the viewer) and its heading."""

    def __init__(
        self,
        starts: NDArray[np.float64],
        curvatures: NDArray[np.float64],
        turns: NDArray[np.float64],
        slope_rad: float,
    ) -> None:
        # Before the first start the curve is straight: one more piece, from far away.
        self.starts = np.concatenate([[starts[0] - _FAR], starts])
        self._curvatures = np.concatenate([[0.0], curvatures])
        lengths = np.diff(self.starts)
        bends = self._curvatures[:-1] * lengths + turns
        self._headings = np.concatenate([[0.0], np.cumsum(bends)])
        self._x, self._z = np.zeros(len(self.starts)), np.zeros(len(self.starts))
        self._settle(slope_rad)

    def _settle(self, slope_rad: float) -> None:
        """Turn and shift so that the curve passes the origin with the given heading."""
        self._chain()
        _, _, heading = self.at(np.zeros(1))
        self._headings += slope_rad - heading[0]
        self._chain()
        x, z, _ = self.at(np.zeros(1))
        self._x -= x[0]
        self._z -= z[0]

    def _chain(self) -> None:
        for piece in range(len(self.starts) - 1):
            length = self.starts[piece + 1] - self.starts[piece]
            step_x, step_z, _ = self._along(np.array([piece]), np.array([length]))
            self._x[piece + 1], self._z[piece + 1] = step_x[0], step_z[0]

    def _along(
        self, piece: NDArray[np.intp], length: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        half = self._curvatures[piece] * length / 2
        chord = length * np.sinc(half / np.pi)
        middle = self._headings[piece] + half
        return (
            self._x[piece] + chord * np.cos(middle),
            self._z[piece] - chord * np.sin(middle),
            middle + half,
        )

    def at(
        self, arc: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """x, z and heading at signed arc lengths (N,) from the sheet's centre."""
        piece = np.clip(np.searchsorted(self.starts, arc, side="right") - 1, 0, len(self.starts) - 1)
        return self._along(piece, arc - self.starts[piece])

    def seen_at(
        self, origin_x: float, origin_z: float, dx: NDArray[np.float64], dz: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Arc lengths (N,) where rays meet the curve; NaN beside it."""
        ends = np.append(self.starts, self.starts[-1] + _FAR)
        x, z, _ = self.at(ends)
        bearings = np.unwrap(np.arctan2(x - origin_x, z - origin_z))
        # A sheet that does not hide itself has rising bearings; `maximum` keeps the rest searchable.
        rising = np.maximum.accumulate(bearings)
        sought = np.arctan2(dx, dz)
        piece = np.clip(np.searchsorted(rising, sought, side="right") - 1, 0, len(self.starts) - 1)
        low, span = rising[piece], rising[piece + 1] - rising[piece]
        room = ends[piece + 1] - ends[piece]
        share = np.divide(sought - low, span, out=np.full_like(sought, 0.5), where=span > 0)
        length = np.clip(share, 0.0, 1.0) * room
        for _ in range(_NEWTON_STEPS):
            x_at, z_at, heading = self._along(piece, length)
            miss = (x_at - origin_x) * dz - (z_at - origin_z) * dx
            rate = np.cos(heading) * dz + np.sin(heading) * dx
            step = np.divide(miss, rate, out=np.zeros_like(miss), where=np.abs(rate) > 1e-9)
            length = np.clip(length - step, 0.0, room)
        seen = (sought >= rising[0]) & (sought <= rising[-1])
        return np.where(seen, self.starts[piece] + length, np.nan)


def folded_in_thirds(
    half_height: float,
    first_deg: float,
    second_deg: float,
    *,
    radius: float = 0.03,
    sags: tuple[float, float, float] = (0.0, 0.0, 0.0),
    upright: bool = False,
    skew_deg: float = 0.0,
) -> Folded:
    """A letter folded twice for its envelope, then opened: its creases turn by two angles, degrees.

    `half_height` is in half page widths. `upright` creases run down the page, as a leaflet has them. `skew_deg`
    is how far the folding missed the sheet's axes. The sheet lies as level as it can.
    """
    half = 1.0 if upright else half_height
    across = (0.0 if upright else np.pi / 2) + float(np.radians(skew_deg))
    turns = np.radians([first_deg, second_deg])
    creases = tuple(
        Crease(place, float(turn), radius) for place, turn in zip((-half / 3, half / 3), turns, strict=True)
    )
    level = Folded(creases, across, 0.0, sags, half)
    # The chord from edge to edge, along the sheet's middle, is level.
    ends = level.place(np.outer([-half, half], [np.cos(across), np.sin(across)]))
    rise = ends[1] - ends[0]
    slope = float(np.arctan2(rise[2], np.hypot(rise[0], rise[1])))
    return Folded(creases, across, slope, sags, half)
