"""A page bent to a circular cylinder, seen by a known camera: evidence and truth in closed form."""

from dataclasses import dataclass, replace

import numpy as np

from benchmarks.dissertation_chain.strips.evidence import StripEvidence
from services.arrays import Floats, Points, Vector


@dataclass(frozen=True, slots=True)
class BentPage:
    """Page point (s, t), both -1 to 1: s runs round the cylinder of `radius`, t along its rulings.

    Lines of text go at `skew_rad` to s. An infinite radius is a plane.
    """

    radius: float = 1.2
    focal: float = 1.3
    tilt_rad: float = 0.5
    azimuth_rad: float = 1.0
    roll_rad: float = 0.1
    skew_rad: float = 0.0
    distance: float = 4.0

    def rotation(self) -> Floats:
        """Page axes in the camera frame."""
        a, t, r = self.azimuth_rad, self.tilt_rad, self.roll_rad
        axis = np.array([-np.sin(a), np.cos(a), 0.0])
        K = np.cross(np.eye(3), axis).T
        leaning = np.eye(3) + np.sin(t) * K + (1 - np.cos(t)) * K @ K
        rolling = np.array([[np.cos(r), -np.sin(r), 0.0], [np.sin(r), np.cos(r), 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(rolling @ leaning)

    def place(self, page: Points) -> Floats:
        """Points (N, 3) in the camera frame."""
        s, t = page[:, 0], page[:, 1]
        if np.isinf(self.radius):
            flat = np.stack([s, t, np.zeros_like(s)], axis=1)
        else:
            turn = s / self.radius
            flat = np.stack([self.radius * np.sin(turn), t, self.radius * (1 - np.cos(turn))], axis=1)
        return np.asarray(flat @ self.rotation().T + [0.0, 0.0, self.distance])

    def tangents(self, s: Vector) -> tuple[Floats, Floats]:
        """Unit vectors (N, 3) across the rulings and along them."""
        turn = s / self.radius
        across = np.stack([np.cos(turn), np.zeros_like(s), np.sin(turn)], axis=1)
        along = np.broadcast_to([0.0, 1.0, 0.0], across.shape)
        return np.asarray(across @ self.rotation().T), np.asarray(along @ self.rotation().T)

    def normals(self, s: Vector) -> Floats:
        """Away from the viewer, (N, 3)."""
        return np.cross(*self.tangents(s))

    def text_flows(self, s: Vector) -> tuple[Floats, Floats]:
        """Directions (N, 3) of lines and strokes in space."""
        across, along = self.tangents(s)
        c, d = np.cos(self.skew_rad), np.sin(self.skew_rad)
        return c * across + d * along, c * along - d * across

    def see(self, page: Points) -> Points:
        """Photo points (N, 2), centred unit coordinates."""
        at = self.place(page)
        return np.asarray(self.focal * at[:, :2] / at[:, 2:])

    def see_direction(self, page: Points, direction: Floats) -> Floats:
        """Unit directions (N, 2) in the photo of directions (N, 3) at page points."""
        seen = direction[:, :2] - self.see(page) * direction[:, 2:] / self.focal
        return np.asarray(seen / np.linalg.norm(seen, axis=1, keepdims=True))

    def text_frame(self, page: Points) -> Points:
        """Page points turned so that the first coordinate runs along the lines."""
        c, d = np.cos(self.skew_rad), np.sin(self.skew_rad)
        return np.asarray(page @ np.array([[c, -d], [d, c]]))

    def strip_middles(self, count: int) -> Vector:
        """s at the middle of each strip."""
        edges = np.linspace(-1, 1, count + 1)
        return np.asarray((edges[1:] + edges[:-1]) / 2)

    def characters(self) -> Points:
        """Photo points (N, 2) of a lattice of characters."""
        grid = np.stack(np.meshgrid(np.linspace(-0.98, 0.98, 40), np.linspace(-0.98, 0.98, 40)), axis=-1)
        return self.see(grid.reshape(-1, 2))

    def evidence(self, count: int = 12, per_strip: int = 8) -> StripEvidence:
        """What is seen of `count` strips, without error."""
        edges, middles = np.linspace(-1, 1, count + 1), self.strip_middles(count)
        references = np.stack([edges, np.zeros_like(edges)], axis=1)
        ruling = self.tangents(edges)[1]
        vanishing = ruling / [1.0, 1.0, self.focal]
        s = np.repeat(middles, per_strip)
        page = np.stack([s, np.tile(np.linspace(-0.9, 0.9, per_strip), count)], axis=1)
        T, B = self.text_flows(s)
        shape = (count, per_strip, 2)
        return StripEvidence(
            reference_points=self.see(references),
            rulings=self.see_direction(references, ruling),
            vanishing_points=vanishing / np.linalg.norm(vanishing, axis=1, keepdims=True),
            vanishing_deviations=np.full(count + 1, 0.02),
            points=self.see(page).reshape(shape),
            major=self.see_direction(page, T).reshape(shape),
            minor=self.see_direction(page, B).reshape(shape),
            major_weights=np.ones(shape[:2]),
            minor_weights=np.ones(shape[:2]),
        )


def disturbed(evidence: StripEvidence, rng: np.random.Generator, deviation_rad: float) -> StripEvidence:
    """All directions turned at random."""
    turned = {
        name: _turned(
            getattr(evidence, name), rng.normal(0, deviation_rad, getattr(evidence, name).shape[:-1])
        )
        for name in ("rulings", "major", "minor")
    }
    return replace(evidence, **turned)


def _turned(directions: Floats, angles: Floats) -> Floats:
    c, s = np.cos(angles), np.sin(angles)
    x, y = directions[..., 0], directions[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def angles_between_deg(a: Floats, b: Floats) -> Vector:
    """Angles (N,) between unit vectors (N, 3)."""
    return np.asarray(np.degrees(np.arccos(np.clip(np.einsum("na,na->n", a, b), -1, 1))))


def similarity_residual(found: Points, truth: Points) -> float:
    """RMS distance after the best similarity (no mirror image), in the unit of `truth`."""
    a = (found - found.mean(axis=0)) @ [1, 1j]
    b = (truth - truth.mean(axis=0)) @ [1, 1j]
    return float(np.sqrt(np.mean(np.abs(b - np.vdot(a, b) / np.vdot(a, a) * a) ** 2)))
