"""What is known of a simulated photo, at any of its points."""

import itertools
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from simulation.camera import Camera, Pose
from simulation.flat_page import Page, PageWord, Points
from simulation.surfaces import Plane, Points3, Shape

_LATTICE_STEP_PX = 8
_LATTICE_PAD = 2
_MARGIN_UNITS = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """The generative process of one photo, forwards and backwards, exact at points.

    Photo and page points are (N, 2) pixels, origin at the centre of the top-left pixel. Angles are radians
    in the image frame (x right, y down), modulo pi. 3D directions are in the camera frame (x right, y down,
    z forward). Photo points beside the page see the surface continued beyond the sheet; where even that is
    missed, answers are NaN.
    """

    page: Page
    shape: Shape
    skew_rad: float
    pose: Pose
    camera: Camera

    @property
    def focal_length_px(self) -> float:
        """Of the pin-hole, in photo pixels."""
        return self.camera.focal_length_px

    @property
    def half_field_of_view_rad(self) -> float:
        """Angle between the optical axis and the ray to an image corner (3.4.1)."""
        return self.camera.half_field_of_view_rad

    @property
    def is_planar(self) -> bool:
        """Whether the page is flat."""
        return isinstance(self.shape, Plane)

    def page_to_photo(self, points: Points) -> Points:
        """Forward map of page pixels; NaN behind the camera."""
        return self.sheet_to_photo(self.page.sheet_from_page(points, self.skew_rad))

    def photo_to_page(self, points: Points) -> Points:
        """Backward map of photo pixels."""
        return self.page.page_from_sheet(self.photo_to_sheet(points), self.skew_rad)

    def sheet_to_photo(self, sheet: Points) -> Points:
        """Sheet points (half page widths from the centre, before un-skewing) -> photo pixels."""
        return self.camera.project(self.pose.to_camera(self.shape.place(sheet)))

    def photo_to_sheet(self, points: Points) -> Points:
        """Photo pixels -> sheet points."""
        rays = self.camera.rays(points) @ self.pose.rotation()
        return self.shape.meet(self.pose.eye(), rays)

    def on_page(self, points: Points) -> NDArray[np.bool_]:
        """Which photo points (N,) show the sheet (its frame is not skewed: see Appendix A, step 1)."""
        return self._on_sheet(self.photo_to_sheet(points))

    def normals(self, points: Points) -> Points3:
        """Unit normal N = U x V, (N, 3): away from the viewer, (0, 0, 1) for a frontal page."""
        across, down = self._tangents(self.photo_to_sheet(points))
        return np.cross(across, down)

    def normals_on_sheet(self, sheet: Points) -> Points3:
        """As `normals`, at sheet points."""
        return np.cross(*self._tangents(sheet))

    def major_flow_3d(self, points: Points) -> Points3:
        """Unit direction of the text lines, T = U cos(skew) + V sin(skew)."""
        across, down = self._tangents(self.photo_to_sheet(points))
        flow: Points3 = across * np.cos(self.skew_rad) + down * np.sin(self.skew_rad)
        return flow

    def minor_flow_3d(self, points: Points) -> Points3:
        """Unit direction of the vertical strokes, B = -U sin(skew) + V cos(skew)."""
        across, down = self._tangents(self.photo_to_sheet(points))
        flow: Points3 = -across * np.sin(self.skew_rad) + down * np.cos(self.skew_rad)
        return flow

    def rulings_3d(self, points: Points) -> Points3:
        """Unit direction of the ruling through each point."""
        return self.shape.rulings(self.photo_to_sheet(points)) @ self.pose.rotation().T

    def major_flow(self, points: Points) -> NDArray[np.float64]:
        """Direction (N,) of the text lines in the photo, in [-pi/2, pi/2)."""
        return self._angles(points, self.major_flow_3d(points), -np.pi / 2)

    def minor_flow(self, points: Points) -> NDArray[np.float64]:
        """Direction (N,) of the vertical strokes in the photo, in [0, pi)."""
        return self._angles(points, self.minor_flow_3d(points), 0.0)

    def rulings(self, points: Points) -> NDArray[np.float64]:
        """Direction (N,) of the rulings in the photo, in [0, pi)."""
        return self._angles(points, self.rulings_3d(points), 0.0)

    def ruling_vanishing_points(self, points: Points) -> Points3:
        """Homogeneous vanishing point (N, 3), photo pixels, of the ruling through each point."""
        return self._vanishing_points(self.rulings_3d(points))

    def flow_vanishing_points(self) -> Points3:
        """Homogeneous vanishing points (2, 3) of text lines and strokes of a planar page.

        Raises
        ------
        ValueError
            When the page is not flat: its lines then have none in common.
        """
        self._refuse_curved()
        centre = self.sheet_to_photo(np.zeros((1, 2)))
        both = np.concatenate([self.major_flow_3d(centre), self.minor_flow_3d(centre)])
        return self._vanishing_points(both)

    def H_photo_page(self) -> NDArray[np.float64]:
        """Homography (3, 3) of a planar page, page pixels -> photo pixels.

        Raises
        ------
        ValueError
            When the page is not flat.
        """
        self._refuse_curved()
        corners = np.array(
            [[0.0, 0.0], [self.page.width, 0.0], [self.page.width, self.page.height], [0.0, self.page.height]]
        )
        seen = self.page_to_photo(corners)
        rows: list[list[float]] = []
        for (x, y), (p, q) in zip(corners, seen, strict=True):
            rows.append([x, y, 1, 0, 0, 0, -p * x, -p * y])
            rows.append([0, 0, 0, x, y, 1, -q * x, -q * y])
        entries = np.linalg.solve(np.array(rows), seen.ravel())
        return np.append(entries, 1.0).reshape(3, 3)

    def outline(self, points_per_side: int = 50) -> Points:
        """The sheet's border as seen in the photo, (4 points_per_side, 2), clockwise from the top left."""
        x, y = 1.0, self.page.half_height_units
        corners = np.array([[-x, -y], [x, -y], [x, y], [-x, y], [-x, -y]])
        steps = np.arange(points_per_side)[:, None] / points_per_side
        sides = [a + steps * (b - a) for a, b in itertools.pairwise(corners)]
        return self.sheet_to_photo(np.concatenate(sides))

    def backward_map(self) -> NDArray[np.float32]:
        """(H, W, 2) page pixel seen by every photo pixel; NaN beside the page. From
        `sheet_lattice`: good to 0.01 px in photos of some megapixels, to half a pixel at a crease."""
        sheet = self.sheet_lattice().upsampled(0, self.camera.height).astype(np.float64)
        flat = sheet.reshape(-1, 2)
        page = self.page.page_from_sheet(flat, self.skew_rad)
        page[~self._on_sheet(flat)] = np.nan
        return page.astype(np.float32).reshape(sheet.shape)

    def page_mask(self) -> NDArray[np.bool_]:
        """(H, W) True where the photo shows the sheet."""
        sheet = self.sheet_lattice().upsampled(0, self.camera.height)
        return self._on_sheet(sheet.reshape(-1, 2)).reshape(sheet.shape[:2])

    def text_mask(self) -> NDArray[np.bool_]:
        """(H, W) True inside the boxes of the words that can be seen whole."""
        mask = np.zeros((self.camera.height, self.camera.width), np.uint8)
        for word in (word for line in self.visible_lines() for word in line):
            outline = self.page_to_photo(_box_outline(word.box))
            cv2.fillPoly(mask, [np.round(outline).astype(np.int32)], 1)
        return mask.astype(bool)

    def visible_lines(self) -> tuple[tuple[PageWord, ...], ...]:
        """The words, line by line, that are whole on the sheet after cropping and whole in the photo."""
        kept = []
        for line in self.page.lines:
            words = tuple(word for word in line if self._is_whole(word))
            if words:
                kept.append(words)
        return tuple(kept)

    def text_points(self, rng: np.random.Generator, count: int = 400) -> Points:
        """Sample points (M, 2), M <= count, of the photo inside the visible words."""
        words = [word.box for line in self.visible_lines() for word in line]
        if not words:
            return np.zeros((0, 2))
        boxes = np.array(words)
        areas = (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
        chosen = boxes[rng.choice(len(boxes), size=count, p=areas / areas.sum())]
        share = rng.random((count, 2))
        return self.page_to_photo(chosen[:, :2] + share * (chosen[:, 2:] - chosen[:, :2]))

    def sheet_lattice(self) -> "Lattice":
        """Sheet coordinates at every 8th photo pixel, exact."""
        points, rows, columns = _lattice_points(self.camera)
        return Lattice(self.photo_to_sheet(points).reshape(rows, columns, 2), self.camera.width)

    def check_visible(self) -> None:
        """Refuse a page that turns its back anywhere.

        Raises
        ------
        ValueError
            When part of the sheet hides itself or lies behind the camera: the photo would not be one-to-one.
        """
        s = np.linspace(-1 - _MARGIN_UNITS, 1 + _MARGIN_UNITS, 81)
        t = self.page.half_height_units * np.linspace(-1, 1, 41)
        sheet = np.stack(np.meshgrid(s, t), axis=-1).reshape(-1, 2)
        at = self.pose.to_camera(self.shape.place(sheet))
        facing = np.einsum("ij,ij->i", self.normals_on_sheet(sheet), at)
        if np.any(at[:, 2] <= 0) or np.any(facing <= 0):
            raise ValueError("part of the page hides itself or lies behind the camera")

    def _is_whole(self, word: PageWord) -> bool:
        corners = _box_outline(word.box)
        if not np.all(self._on_sheet(self.page.sheet_from_page(corners, self.skew_rad))):
            return False
        seen = self.page_to_photo(corners)
        limit = np.array([self.camera.width - 0.5, self.camera.height - 0.5])
        return bool(np.all((seen > -0.5) & (seen < limit)))

    def _on_sheet(self, sheet: NDArray[np.floating]) -> NDArray[np.bool_]:
        edge = np.array([1.0, self.page.half_height_units])
        return np.asarray(np.all(np.abs(sheet) <= edge, axis=1))

    def _tangents(self, sheet: Points) -> tuple[Points3, Points3]:
        missed = np.isnan(sheet[:, :1])
        across, down = self.shape.tangents(np.where(missed, 0.0, sheet))
        turn = self.pose.rotation().T
        return np.where(missed, np.nan, across @ turn), np.where(missed, np.nan, down @ turn)

    def _angles(self, points: Points, directions: Points3, lowest: float) -> NDArray[np.float64]:
        seen = self.camera.project_directions(points, directions)
        angles = (np.arctan2(seen[:, 1], seen[:, 0]) - lowest) % np.pi
        # The remainder of a tiny negative angle rounds to pi itself.
        return np.asarray(np.where(angles >= np.pi, 0.0, angles) + lowest)

    def _vanishing_points(self, directions: Points3) -> Points3:
        f, (cx, cy) = self.camera.focal_length_px, self.camera.principal_point
        calibration = np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])
        points: Points3 = directions @ calibration.T
        return points

    def _refuse_curved(self) -> None:
        if not self.is_planar:
            raise ValueError("only a planar page has one homography and one pair of vanishing points")


@dataclass(frozen=True, slots=True, eq=False)
class Lattice:
    """Values (rows, columns, K) at photo pixels ((i - 2) + 0.5) 8 - 0.5, two nodes beyond each border."""

    values: NDArray[np.float64]
    width: int

    def upsampled(self, top: int, bottom: int) -> NDArray[np.float32]:
        """Photo rows top..bottom (exclusive) by cubic interpolation, (h, w, K).

        Not `cv2.resize`: its cubic kernel (a = -0.75) does not even reproduce a linear map.
        """
        rows, columns, depth = self.values.shape
        down = _catmull_rom(np.arange(top, bottom), rows)
        across = _catmull_rom(np.arange(self.width), columns)
        first, last = int(down.indices.min()), int(down.indices.max()) + 1
        part = self.values[first:last].transpose(1, 0, 2).reshape(columns, -1)
        wide = (across @ part).reshape(self.width, last - first, depth).transpose(1, 0, 2)
        dense = down[:, first:last] @ wide.reshape(last - first, -1)
        return np.asarray(dense.reshape(bottom - top, self.width, depth), np.float32)


def _catmull_rom(pixels: NDArray[np.int_], nodes: int) -> csr_array:
    """Weights (pixels, nodes), 4 a row, of the lattice nodes round each photo row or column."""
    place = (pixels + 0.5) / _LATTICE_STEP_PX - 0.5 + _LATTICE_PAD
    left = np.floor(place).astype(np.int64)
    t = place - left
    weights = 0.5 * np.stack(
        [
            -t + 2 * t**2 - t**3,
            2 - 5 * t**2 + 3 * t**3,
            t + 4 * t**2 - 3 * t**3,
            -(t**2) + t**3,
        ],
        axis=1,
    )
    columns = left[:, None] + np.arange(-1, 3)
    starts = np.arange(0, 4 * len(pixels) + 1, 4)
    return csr_array((weights.ravel(), columns.ravel(), starts), shape=(len(pixels), nodes))


def _lattice_points(camera: Camera) -> tuple[Points, int, int]:
    columns = -(-camera.width // _LATTICE_STEP_PX) + 2 * _LATTICE_PAD
    rows = -(-camera.height // _LATTICE_STEP_PX) + 2 * _LATTICE_PAD
    x = (np.arange(columns) - _LATTICE_PAD + 0.5) * _LATTICE_STEP_PX - 0.5
    y = (np.arange(rows) - _LATTICE_PAD + 0.5) * _LATTICE_STEP_PX - 0.5
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2), rows, columns


def _box_outline(box: tuple[float, float, float, float]) -> Points:
    x0, y0, x1, y1 = box
    middle = (x0 + x1) / 2
    return np.array([[x0, y0], [middle, y0], [x1, y0], [x1, y1], [middle, y1], [x0, y1]])
