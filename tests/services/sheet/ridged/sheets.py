"""Sheets of paper in closed form, seen by an analytic camera, and what a photo shows of them."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from services.arrays import Floats, Points, Vector
from services.sheet.developable.observations import NO_LINES, LineObservations, Run
from services.sheet.ridged.mesh import SheetMesh
from services.sheet.ridged.observations import SheetObservations, SideObservations
from services.texture_flow.field import FlowSamples

PIXEL = 1 / 1700
"""Of a photo of 12 megapixels, in centred units, reduced as it is for lines."""
WIDTH, HEIGHT = 1.3, 1.8
FOCAL = 2.2
TEXT = (0.52, 0.75)
"""Half the width and height of the text."""
SPACING = 0.036
TEXT_HEIGHT = 0.02


@dataclass(frozen=True, slots=True)
class Sheet:
    """A sheet that is bent along one family of level or upright rulings.

    `turns_rad` are slopes of the panels between creases at thirds of the height, or `radius` that of a cylinder with
    upright axis. The camera looks at it from `angles_deg`.
    """

    turns_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)
    radius: float | None = None
    angles_deg: tuple[float, float, float] = (22.0, -15.0, 4.0)

    def place(self, page: Points) -> Floats:
        """Points (N, 3) in the camera's frame of page points (N, 2), whose origin is the sheet's middle."""
        u, v = page[:, 0], page[:, 1]
        if self.radius is not None:
            r = self.radius
            X = np.stack([r * np.sin(u / r), v, r * np.cos(u / r) - r], axis=1)
        else:
            ends = np.array([-HEIGHT / 2, -HEIGHT / 6, HEIGHT / 6, HEIGHT / 2])
            y, z = np.full(len(v), -HEIGHT / 2), np.zeros(len(v))
            for k, slope in enumerate(self.turns_rad):
                # The outer panels go on beyond the sheet.
                low = -np.inf if k == 0 else ends[k]
                high = np.inf if k == 2 else ends[k + 1]
                length = np.clip(v, low, high) - ends[k]
                y, z = y + length * np.cos(slope), z + length * np.sin(slope)
            X = np.stack([u, y, z - 0.1], axis=1)
        rotation = Rotation.from_euler("xyz", self.angles_deg, degrees=True).as_matrix()
        return np.asarray(X @ rotation.T + np.array([0.02, 0.01, FOCAL]))

    def see(self, page: Points) -> Points:
        """Photo points (N, 2), centred, of page points (N, 2)."""
        X = self.place(page)
        return np.asarray(FOCAL * X[:, :2] / X[:, 2:])

    def mesh(self, columns: int = 25) -> SheetMesh:
        """The sheet as a mesh whose nodes lie on it."""
        rows = round((columns - 1) * HEIGHT / WIDTH) + 1
        step = WIDTH / (columns - 1)
        u, v = np.linspace(-WIDTH / 2, WIDTH / 2, columns), np.linspace(-HEIGHT / 2, HEIGHT / 2, rows)
        page = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
        aspect = HEIGHT / (rows - 1) / step
        return SheetMesh(
            self.place(page).reshape(rows, columns, 3), FOCAL, step, aspect, (-WIDTH / 2, -HEIGHT / 2)
        )

    def corners(self) -> Points:
        """Photo points (4, 2) of the corners, clockwise from the top left one."""
        return self.see(
            0.5 * np.array([[-WIDTH, -HEIGHT], [WIDTH, -HEIGHT], [WIDTH, HEIGHT], [-WIDTH, HEIGHT]])
        )


FLAT = Sheet()
FOLDED = Sheet(turns_rad=(0.25, -0.25, 0.25))
CURVED = Sheet(radius=0.9)


def observe(
    sheet: Sheet,
    rng: np.random.Generator,
    noise: float = 0.5 * PIXEL,
    *,
    text: bool = True,
    line_points: int = 22,
    side_points: int = 60,
    focal_deviation: float = 0.05,
    directions: bool = False,
) -> SheetObservations:
    """What a photo of `sheet` shows: lines in paragraphs of eight, strokes, and four sides.

    `directions`: those of the lines too.
    """

    def off(points: Points) -> Points:
        return np.asarray(points + rng.normal(0, noise, points.shape)) if noise > 0 else points

    lines, strokes, flow = NO_LINES, None, None
    if text:
        places = np.arange(-TEXT[1], TEXT[1], SPACING)
        places = places[np.arange(len(places)) % 9 != 8]
        u = np.linspace(-TEXT[0], TEXT[0], line_points)
        points = sheet.see(np.stack([np.tile(u, len(places)), np.repeat(places, line_points)], axis=1))
        starts = sheet.see(np.stack([np.full(len(places), -TEXT[0]), places], axis=1))
        numbers = np.arange(len(places))
        runs = [Run(numbers[k : k + 8], np.arange(float(len(numbers[k : k + 8])))) for k in numbers[::8]]
        deviations = np.full(len(points), max(noise, 0.1 * PIXEL))
        lines = LineObservations(
            off(points),
            np.repeat(numbers, line_points),
            deviations,
            [run for run in runs if len(run.lines) > 1],
            [np.arange(len([run for run in runs if len(run.lines) > 1]))],
            [off(starts)],
            TEXT_HEIGHT,
        )
        at = rng.uniform(-1, 1, (300, 2)) * TEXT
        half = np.array([0.0, 0.01])
        way = sheet.see(at + half) - sheet.see(at - half)
        # Type leans by what `RidgedParameters.slant_rad` expects: none here.
        angles = np.arctan2(way[:, 1], way[:, 0]) + rng.normal(0, np.deg2rad(1.0) if noise > 0 else 0.0, 300)
        strokes = FlowSamples(sheet.see(at), angles, np.ones(300))
        if directions:
            way = sheet.see(at + half[::-1]) - sheet.see(at - half[::-1])
            flow = FlowSamples(sheet.see(at), np.arctan2(way[:, 1], way[:, 0]), np.ones(300))
    share = np.linspace(-0.98, 0.98, side_points) / 2
    whole = np.full(side_points, 0.5)
    ends = (
        (share * WIDTH, -whole * HEIGHT),
        (whole * WIDTH, share * HEIGHT),
        (share * WIDTH, whole * HEIGHT),
        (-whole * WIDTH, share * HEIGHT),
    )
    sides = tuple(
        SideObservations(off(sheet.see(np.stack(end, axis=1))), np.full(side_points, max(noise, 0.1 * PIXEL)))
        for end in ends
    )
    return SheetObservations(lines, strokes, sides, float(np.log(FOCAL)), focal_deviation, flow)


def errors(sheet: Sheet, mesh: SheetMesh) -> Vector:
    """Distances (N,) of the mesh's page points from the true ones after the best similarity, in page widths."""
    page = 0.5 * np.stack(
        np.meshgrid(np.linspace(-WIDTH, WIDTH, 40), np.linspace(-HEIGHT, HEIGHT, 50)), axis=-1
    ).reshape(-1, 2)
    found = mesh.to_page(sheet.see(page))
    assert np.isfinite(found).all()
    a, b = ((p - p.mean(axis=0)) @ np.array([1, 1j]) for p in (found, page))
    scale = np.vdot(a, b) / np.vdot(a, a)
    return np.asarray(np.abs(scale * a - b) / WIDTH)
