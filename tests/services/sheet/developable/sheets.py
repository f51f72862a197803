"""Bent sheets to test with: random ones, the simulator's in the model's own terms, and what is seen of them."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from services.arrays import Floats, Points, Vector
from services.geometry.page_map import PageMap
from services.sheet.developable.fitting import SurfaceStart
from services.sheet.developable.observations import (
    NO_EDGES,
    NO_LINES,
    LineObservations,
    PageObservations,
    Run,
    SideObservations,
)
from services.sheet.developable.residuals import surface_of
from services.sheet.developable.surface import BendBasis, DevelopableSurface, bend_basis
from services.texture_flow.field import FlowSamples
from simulation.cone import Cone
from simulation.surfaces import Cylinder
from simulation.truth import Truth

BASIS = bend_basis(-1.0, 1.0, 8, 0.3)
SLANT_RAD = 0.004
"""How far the type leans in what is seen of a sheet."""


def box(u: float, v: float, columns: int = 9, rows: int = 11) -> Points:
    """Page points on a grid over [-u, u] x [-v, v]."""
    grid = np.meshgrid(np.linspace(-u, u, columns), np.linspace(-v, v, rows))
    return np.stack([g.ravel() for g in grid], axis=1)


PAGE = box(0.45, 0.55)


@dataclass(frozen=True, slots=True)
class Bent:
    """A sheet in plain numbers: turn (axis-angle, of the text's axes) and the parameters of the surface."""

    turn: tuple[float, float, float] = (0.2, -0.3, 0.1)
    focal: float = 1.3
    anchor: tuple[float, float] = (0.05, -0.08)
    skew: float = 0.1
    slopes: tuple[float, float] = (0.15, 0.05)
    bends: tuple[float, ...] = (0.4, 0.8, 1.2, 0.6, -0.4, -1.0, -0.6, 0.2)

    @property
    def parameters(self) -> Vector:
        """As `surface_of` takes them: turn, log focal length, skew, slopes, slant, bends."""
        return np.array(
            [*self.turn, np.log(self.focal), self.skew, *self.slopes, SLANT_RAD, *self.bends], np.float64
        )

    def surface(self, basis: BendBasis = BASIS) -> DevelopableSurface:
        """The sheet."""
        return surface_of(self.parameters, np.eye(3), self.anchor, basis)

    def start(self, change: Vector | None = None, basis: BendBasis = BASIS) -> SurfaceStart:
        """Where a fit begins: this sheet, `change` (8 + K,) away from it."""
        x = self.parameters + (0.0 if change is None else change)
        return SurfaceStart(Rotation.from_rotvec(x[:3]).as_matrix(), self.anchor, basis, x[3:])


FLAT = Bent(slopes=(0.0, 0.0), bends=(0.0,) * 8)


def _triple(size: float) -> st.SearchStrategy[tuple[float, float, float]]:
    one = st.floats(-size, size)
    return st.tuples(one, one, one)


BENT = st.builds(
    Bent,
    turn=_triple(0.35),
    focal=st.floats(0.9, 3.0),
    anchor=st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2)),
    skew=st.floats(-1.7, 1.7),
    slopes=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.3, 0.3)),
    bends=st.tuples(*[st.floats(-1.0, 1.0)] * 8),
)
"""Sheets of which all of `PAGE` faces the camera."""


def sheet_of(truth: Truth, count: int = 40) -> DevelopableSurface:
    """The simulated page as a surface of the model, half a page's width being `scale_of(truth)` units long."""
    unit = half_diagonal(truth)
    centre = truth.pose.to_camera(truth.shape.place(np.zeros((1, 2))))[0]
    focal = truth.focal_length_px / unit
    scale = focal / centre[2]
    U, V = (d[0] @ truth.pose.rotation().T for d in truth.shape.tangents(np.zeros((1, 2))))
    # How the a-axis and the rulings lie on the sheet, and how fast the frame turns about them, in half widths.
    if isinstance(truth.shape, Cone):
        away = float(np.hypot(*truth.shape.apex))
        down = -np.array(truth.shape.apex) / away
        across = np.array([down[1], -down[0]])
        slope = 1 / away
        basis = bend_basis(-2.0 * scale, 2.0 * scale, count, 0.4)
        cosine = away / np.hypot(basis.nodes / scale, away)
        k = -truth.shape.bulge * cosine**3 / (away * np.tan(truth.shape.half_angle_rad))
    else:
        assert isinstance(truth.shape, Cylinder)
        down, across, slope = np.array([0.0, 1.0]), np.array([1.0, 0.0]), 0.0
        Z = np.polynomial.Polynomial(truth.shape.directrix)
        x = np.linspace(-1.1, 1.1, 2001)
        speed = np.hypot(1, Z.deriv()(x))
        arc = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(x))])
        arc -= np.interp(0.0, x, arc)
        basis = bend_basis(-1.08 * scale, 1.08 * scale, count, 0.4)
        k = np.interp(basis.nodes / scale, arc, -Z.deriv(2)(x) / speed**3)
    inside = (np.abs(basis.values).sum(axis=1) > 0)[:, None]
    bends = np.linalg.lstsq(basis.values * inside, k * inside[:, 0] / scale, rcond=None)[0]
    A, B = (axis[0] * U + axis[1] * V for axis in (across, down))
    rotation = np.stack([A, B, np.cross(A, B)], axis=1)
    skew = truth.skew_rad - float(np.arctan2(across[1], across[0]))
    anchor = focal * centre[:2] / centre[2]
    return DevelopableSurface(
        rotation, focal, (float(anchor[0]), float(anchor[1])), skew, (slope / scale, 0.0), bends, basis
    )


def half_diagonal(truth: Truth) -> float:
    """The unit of centred coordinates in photo pixels."""
    return float(np.hypot(truth.camera.width, truth.camera.height)) / 2


def residual_percent(page_map: PageMap, truth: Truth, photo: NDArray[np.float64]) -> float:
    """RMS error of the page at photo pixels (N, 2), after the best similarity, in percent of the page's width."""
    z = page_map.to_page((photo - truth.camera.principal_point) / half_diagonal(truth)) @ [1, 1j]
    w = truth.photo_to_page(photo) @ [1, 1j]
    z, w = z - z.mean(), w - w.mean()
    rest = w - np.vdot(z, w) / np.vdot(z, z) * z
    return float(100 * np.sqrt(np.mean(np.abs(rest) ** 2)) / truth.page.width)


def seen_flow(surface: DevelopableSurface, page: Points, lean: float, probe: float = 0.002) -> FlowSamples:
    """What is seen at page points of the direction that leans by `lean` from u.

    The angle is that of the way to a photo point `probe` away, as the residuals take it.
    """
    seen = surface.to_photo(page)
    toward = np.array([np.cos(lean), np.sin(lean)])
    J = np.linalg.inv(surface.jacobians(seen))
    angle = np.arctan2(*(J @ toward).T[::-1])
    for _ in range(4):
        # The direction's curve is bent in the photo: turn until the end of the way lies on it.
        end = surface.to_page(seen + probe * np.stack([np.cos(angle), np.sin(angle)], axis=1)) - page
        angle -= np.arctan2(end[:, 1], end[:, 0]) - lean
    return FlowSamples(seen, angle, np.ones(len(page)))


def seen_lines(surface: DevelopableSurface, noise: float, rng: np.random.Generator) -> LineObservations:
    """Twelve justified lines in two paragraphs of one spacing, 10 points each, with noise in centred units."""
    v = np.concatenate([-0.5 + 0.08 * np.arange(7), 0.14 + 0.08 * np.arange(5)])
    u = np.linspace(-0.42, 0.42, 10)
    page = np.stack([np.tile(u, 12), np.repeat(v, 10)], axis=1)
    seen = surface.to_photo(page) + rng.normal(0, noise, (120, 2))
    margins: list[Points] = [
        surface.to_photo(np.stack([np.full(12, side), v], axis=1)) + rng.normal(0, noise, (12, 2))
        for side in (-0.43, 0.43)
    ]
    runs = [Run(np.arange(7), np.arange(7.0)), Run(np.arange(7, 12), np.arange(5.0))]
    return LineObservations(
        seen,
        np.repeat(np.arange(12), 10),
        np.full(120, max(noise, 5e-4)),
        runs,
        [np.array([0, 1])],
        margins,
        0.02,
    )


def observe(
    surface: DevelopableSurface,
    *,
    flow_noise_rad: float = 0.0,
    line_noise: float = 0.0,
    lines: bool = True,
    seed: int = 0,
    focal: float | None = None,
    focal_deviation: float = 0.25,
    edges: bool = False,
) -> PageObservations:
    """What is seen of a sheet; with `edges` its sides too."""
    rng = np.random.default_rng(seed)
    major, minor = (seen_flow(surface, PAGE, lean) for lean in (0.0, np.pi / 2 - SLANT_RAD))
    major, minor = (
        replace(flow, angles=flow.angles + rng.normal(0, flow_noise_rad, len(flow)))
        for flow in (major, minor)
    )
    corners = surface.to_photo(np.array([[-0.45, -0.55], [0.45, -0.55], [0.45, 0.55], [-0.45, 0.55]]))
    return PageObservations(
        major,
        minor,
        seen_lines(surface, line_noise, rng) if lines else NO_LINES,
        corners,
        float(np.log(focal or surface.focal)),
        focal_deviation,
        seen_edges(surface, line_noise, rng) if edges else NO_EDGES,
    )


def seen_edges(surface: DevelopableSurface, noise: float, rng: np.random.Generator) -> SideObservations:
    """Twelve points of each side of a sheet on which the print is askew by a degree."""
    c, s = np.cos(np.radians(1.0)), np.sin(np.radians(1.0))
    corners = np.array([[-0.47, -0.57], [0.47, -0.57], [0.47, 0.57], [-0.47, 0.57]]) @ np.array(
        [[c, s], [-s, c]]
    )
    steps = np.linspace(0.02, 0.98, 12)[:, None]
    sides = [corners[k] + steps * (corners[(k + 1) % 4] - corners[k]) for k in range(4)]
    points = surface.to_photo(np.concatenate(sides))
    return SideObservations(
        points + rng.normal(0, noise, points.shape), np.repeat(np.arange(4), 12), np.full(48, 1e-3)
    )


def page_error(found: DevelopableSurface, true: DevelopableSurface, page: Points = PAGE) -> float:
    """RMS error of the found page after the best similarity, in units of the page."""
    z, w = found.to_page(true.to_photo(page)) @ [1, 1j], page @ [1, 1j]
    z, w = z - z.mean(), w - w.mean()
    return float(np.sqrt(np.mean(np.abs(w - np.vdot(z, w) / np.vdot(z, z) * z) ** 2)))


def differences(f: Callable[[Vector], Floats], x: Vector, step: float = 1e-5) -> Floats:
    """Central differences (..., M) of a function of x (M,)."""
    columns = []
    for k in range(len(x)):
        d = np.zeros(len(x))
        d[k] = step
        columns.append((f(x + d) - f(x - d)) / (2 * step))
    return np.stack(columns, axis=-1)
