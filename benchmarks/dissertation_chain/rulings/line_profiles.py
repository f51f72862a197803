"""Curve-based projection profiles along rulings, and the text lines in them (dissertation 3.3.4).

The base line of a profile is a projected ruling; the projection paths follow the major flow at every point, so that
a curved text line falls on one place of the profile.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import uniform_filter1d

from benchmarks.dissertation_chain.rulings.convergence import Directions
from services.arrays import Floats, Points, Vector


@dataclass(frozen=True, slots=True)
class ProfileParameters:
    """Lengths are multiples of the text height."""

    half_path: float = 9.0
    """Paths reach so far to both sides of the ruling."""
    path_step: float = 0.5
    integration_step: float = 1.5
    base_step: float = 1.5
    """Distance of the paths that are integrated; those between are interpolated."""
    sampling: float = 0.12
    shortest_wave: float = 1.3
    longest_wave: float = 8.0
    """Line spacings that are looked for."""
    smoothing: float = 0.08
    """Deviation of the smoothing kernel over the wave length: a kernel as wide as the wave would level it."""
    least_contrast: float = 0.25
    """A line's swing from its white space, over the profile's usual one."""


@dataclass(frozen=True, slots=True, eq=False)
class InkImage:
    """Binarised ink (H, W), and the way to its pixels: pixel = centred unit point * `scale` + `centre`."""

    ink: Floats
    scale: float
    centre: tuple[float, float]

    def at(self, points: Points) -> Floats:
        """Ink (R, C), 0-1, at unit coordinates `points` (R, C, 2), bilinear; nothing outside."""
        where = (points * self.scale + np.array(self.centre)).astype(np.float32)
        source = np.asarray(self.ink, np.float32)
        return np.asarray(
            cv2.remap(source, where[..., 0], where[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
        )


@dataclass(frozen=True, slots=True, eq=False)
class LineProfiles:
    """Profiles (N, S) of N rulings at `places` (S,) along each (units from its reference point); `step` between.

    `wave_lengths` (N,) are the principal ones, in units; 0 where a profile shows none.
    """

    profiles: Floats
    places: Vector
    step: float
    wave_lengths: Vector


@dataclass(frozen=True, slots=True, eq=False)
class LineEdges:
    """Places (T,) of the tops of text lines on one ruling, and of their bottoms, in order."""

    tops: Vector
    bottoms: Vector


def measure_line_profiles(
    ink: InkImage,
    major_at: Directions,
    points: Points,
    angles: Vector,
    reach: tuple[float, float],
    text_height: float,
) -> LineProfiles:
    """Profiles along the rulings through `points` (N, 2) at `angles` (N,), from reach[0] to reach[1] along each.

    Centred unit coordinates throughout, but for the pixels of `ink`.
    """
    p = ProfileParameters()
    step = p.sampling * text_height
    count = int(np.clip((reach[1] - reach[0]) / step, 8, 4000)) + 1
    places, step = np.linspace(reach[0], reach[1], count, retstep=True)
    bases = np.linspace(
        reach[0], reach[1], max(int((reach[1] - reach[0]) / (p.base_step * text_height)), 2) + 1
    )
    along = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    start = points[:, None] + bases[:, None] * along[:, None]
    steps = max(int(np.ceil(p.half_path / p.integration_step)), 1)
    paths = follow_flow(major_at, start.reshape(-1, 2), p.half_path * text_height / steps, steps)
    paths = paths.reshape(len(points), len(bases), 2 * steps + 1, 2)
    samples = max(int(2 * p.half_path / p.path_step), 2) + 1
    profiles = np.empty((len(points), count))
    for profile, path in zip(profiles, paths.astype(np.float32), strict=True):
        # Between the integrated paths and their nodes, places are linear: OpenCV enlarges them quickly.
        profile[:] = ink.at(_enlarge(path, count, samples)).mean(axis=1)
    return LineProfiles(
        profiles, places, float(step), principal_wave_lengths(profiles, float(step), text_height, p)
    )


def follow_flow(flow: Directions, start: Points, step: float, steps: int) -> Points:
    """Paths (P, 2 steps + 1, 2) along `flow` from `start` (P, 2) to both sides, by the midpoint rule."""
    first = flow(start)
    sides = []
    for sign in (-1.0, 1.0):
        at: Points = start
        heading: Points = sign * np.stack([np.cos(first), np.sin(first)], axis=-1)
        nodes = []
        for _ in range(steps):
            middle = _head(flow, at + 0.5 * step * heading, heading)
            at = at + step * middle
            heading = _head(flow, at, middle)
            nodes.append(at)
        sides.append(np.stack(nodes, axis=1))
    return np.concatenate([sides[0][:, ::-1], start[:, None], sides[1]], axis=1)


def _head(flow: Directions, points: Points, before: Points) -> Points:
    """Unit vectors (P, 2) of the flow that go on as `before` did; where nothing is known, `before` itself."""
    angle = flow(points)
    unit = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    sign = np.where(np.einsum("px,px->p", unit, before) < 0, -1.0, 1.0)[:, None]
    return np.asarray(np.where(np.isfinite(unit), sign * unit, before))


def _enlarge(path: Floats, rows: int, columns: int) -> Floats:
    """Places (rows, columns, 2) on the grid `path` (R, C, 2), its corners on the corners."""
    r = np.linspace(0, path.shape[0] - 1, rows, dtype=np.float32)
    c = np.linspace(0, path.shape[1] - 1, columns, dtype=np.float32)
    x, y = np.meshgrid(c, r)
    return np.asarray(cv2.remap(path, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def principal_wave_lengths(
    profiles: Floats, step: float, text_height: float, parameters: ProfileParameters | None = None
) -> Vector:
    """Wave length (N,) of the strongest frequency of each profile (N, S); one that few share gives way to the usual.

    The spectrum is taken of the windowed profile, and read between its bins by a parabola.
    """
    p = parameters or ProfileParameters()
    length = profiles.shape[1]
    centred = (profiles - profiles.mean(axis=1, keepdims=True)) * np.hanning(length)
    size = 4 * length
    spectrum = np.abs(np.fft.rfft(centred, size, axis=1))
    frequency = np.fft.rfftfreq(size, step)
    wanted = (frequency >= 1 / (p.longest_wave * text_height)) & (
        frequency <= 1 / (p.shortest_wave * text_height)
    )
    if not wanted.any():
        return np.zeros(len(profiles))
    band = np.where(wanted, spectrum, 0.0)
    # All rulings cross the same lines: their common spectrum finds the wave, each one's own its length there.
    strength = np.maximum(band.max(axis=1, keepdims=True), 1e-12)
    common = frequency[np.argmax((band / strength).sum(axis=0))]
    near = wanted & (frequency > common / 1.5) & (frequency < common * 1.5)
    own = frequency[np.argmax(np.where(near, spectrum, 0.0), axis=1)]
    return np.where(band.max(axis=1) > 1e-9, 1 / np.maximum(own, frequency[wanted][0]), 0.0)


def find_line_edges(profiles: LineProfiles) -> list[LineEdges]:
    """Tops (rising edges) and bottoms (falling ones) of the text lines on every ruling, between samples.

    The profile is smoothed and compared with its own mean over one wave length (the adaptive threshold).
    """
    p = ProfileParameters()
    found = []
    for profile, wave in zip(profiles.profiles, profiles.wave_lengths, strict=True):
        if wave <= 0:
            found.append(LineEdges(np.zeros(0), np.zeros(0)))
            continue
        sigma = max(p.smoothing * wave / profiles.step, 0.5)
        smooth = cv2.GaussianBlur(profile[None], (0, 0), sigma, sigmaY=0.1, borderType=cv2.BORDER_REPLICATE)[
            0
        ]
        above = smooth - uniform_filter1d(smooth, max(round(wave / profiles.step), 3), mode="nearest")
        found.append(_crossings(above, profiles.places, p.least_contrast))
    return found


def _crossings(above: Vector, places: Vector, least_contrast: float) -> LineEdges:
    """Edges where `above` (S,) changes sign, but for ripples."""
    sign = above > 0
    at = np.flatnonzero(sign[1:] != sign[:-1])
    if not sign[at + 1].any():
        return LineEdges(np.zeros(0), np.zeros(0))
    share = above[at] / (above[at] - above[at + 1])
    edge = places[at] + share * (places[1] - places[0])
    rising = sign[at + 1]
    # The largest swing between two edges tells whether a line is there, or a ripple of white space.
    swing = np.maximum.reduceat(np.abs(above), np.append(at + 1, len(above) - 1)[: len(at)])
    strong = swing > least_contrast * float(np.median(swing[rising]))
    before = np.append(False, strong[:-1])
    return LineEdges(edge[rising & strong], edge[~rising & before])
