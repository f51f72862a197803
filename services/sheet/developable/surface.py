"""A sheet bent along its rulings, seen by a pin-hole camera: exactly isometric, with few parameters.

On the flat sheet, (a, b) are coordinates whose a-axis runs across the rulings. The ruling through (s, 0) consists
of the points (a, b) = (s + t w(s), t), with the slope w(s) = w_1 s + w_2 s^2: parallel rulings (w = 0) make a
cylinder, w = w_1 s a cone (all rulings meet in b = -1/w_1), anything else a general developable. Rolling the sheet
along the a-axis turns its frame F(s) = (A, B, N) about the ruling at the rate k(s),

    F' = F [k (w, 1, 0)]_x,    P' = F (1, 0, 0),    X(s, t) = P(s) + t R(s),    R(s) = F (w, 1, 0),

so that dX = A (1 + t w') ds + R dt: the metric is that of the flat sheet for all k and w. The text's axes (u, v)
are turned against (a, b) by the skew. All lengths are in centred unit coordinates (half the photo's diagonal); the
sheet's origin is seen at the `anchor`, at the depth where the page's unit is the photo's.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import BSpline

from services.arrays import Floats, Points, Vector
from services.kernels.library import SheetPoints, SheetTables, address, find_kernels

NODES = 160
"""Nodes along the a-axis; the error of the trapezoidal rule is then below 1e-5 of the page for all bends of paper."""

LEAST_SIGHT = 0.02
"""Cosine between normal and line of sight from which on the sheet counts as turned away."""
MIN_GROWTH = 0.1
"""Rulings nearer to each other than this share of their distance on the a-axis count as crossing."""


@dataclass(frozen=True, slots=True, eq=False)
class BendBasis:
    """Cubic B-splines of the bend k over a in [low, high]; the sheet is straight beyond.

    `nodes` (n,) are the a at which the surface is tabulated, `values` (n, K) the splines there, and `midpoints`
    (n - 1, K) half-way between. `spacing` is the distance of neighbouring splines in units of that for which priors
    of bends are given.
    """

    nodes: Vector
    values: Floats
    midpoints: Floats
    low: float
    high: float
    spacing: float = 1.0


def bend_basis(
    low: float, high: float, count: int, reach: float, spacing: float = 1.0, tabulated: int = NODES
) -> BendBasis:
    """`count` >= 4 splines on [low, high], tabulated to `reach` times that length beyond either end.

    `tabulated` is the number of nodes.
    """
    length = high - low
    inner = np.linspace(low, high, count - 2)
    knots = np.concatenate([np.full(3, low), inner, np.full(3, high)])
    nodes = np.linspace(low - reach * length, high + reach * length, tabulated)

    def at(a: Vector) -> Floats:
        inside = (a >= low) & (a <= high)
        values = np.zeros((len(a), count))
        values[inside] = BSpline.design_matrix(np.clip(a[inside], low, high), knots, 3).toarray()
        return values

    return BendBasis(nodes, at(nodes), at(0.5 * (nodes[1:] + nodes[:-1])), low, high, spacing)


def rotations(vectors: Floats) -> Floats:
    """Rotation matrices (N, 3, 3) of axis-angle vectors (N, 3), by Rodrigues' formula."""
    angle = np.maximum(np.linalg.norm(vectors, axis=1), 1e-12)[:, None, None]
    x, y, z = vectors.T
    K = np.zeros((len(vectors), 3, 3))
    K[:, 0, 1], K[:, 0, 2], K[:, 1, 2] = -z, y, -x
    K[:, 1, 0], K[:, 2, 0], K[:, 2, 1] = z, -y, x
    return np.asarray(np.eye(3) + np.sin(angle) / angle * K + (1 - np.cos(angle)) / angle**2 * (K @ K))


def running_products(factors: Floats) -> Floats:
    """Products (N, 3, 3) of the first 1, 2, ... N of `factors` (N, 3, 3), by doubling."""
    products, step = factors.copy(), 1
    while step < len(products):
        products[step:] = products[:-step] @ products[step:]
        step *= 2
    return products


def roll_frames(turns: Floats) -> Floats:
    """Frames (N + 1, 3, 3) of what turns by the axis-angle vectors `turns` (N, 3), one after the other."""
    kernels = find_kernels()
    if kernels is None:
        return roll_frames_plain(turns)
    turns = np.ascontiguousarray(turns, np.float64)
    frames = np.empty((len(turns) + 1, 3, 3))
    kernels.roll_frames(address(turns), len(frames), address(frames))
    return frames


def roll_frames_plain(turns: Floats) -> Floats:
    """`roll_frames` without a kernel."""
    return np.concatenate([np.eye(3)[None], running_products(rotations(turns))])


@dataclass(frozen=True, slots=True, eq=False)
class DevelopableSurface:
    """A developable page as a `PageMap`.

    `rotation` (3, 3) has columns A, B, N in the camera frame at the sheet's origin; `skew_rad` is the angle from the
    a-axis to the text's direction; `slopes` (w_1, w_2) and `bends` (K,) as in the module's text; `reach` bounds
    how far b goes beyond the range in which rulings do not cross.
    """

    rotation: Floats
    focal: float
    anchor: tuple[float, float]
    skew_rad: float
    slopes: tuple[float, float]
    bends: Vector
    basis: BendBasis
    P: Floats = field(init=False, repr=False)
    """Points (n, 3) of the a-axis at the nodes."""
    A: Floats = field(init=False)
    """Directions (n, 3) of the a-axis."""
    N: Floats = field(init=False)
    """Unit normals (n, 3) along the rulings, away from the viewer."""
    front: tuple[int, int] = field(init=False)
    """First and last of the nodes round s = 0 that face the camera; beyond, the sheet is hidden."""
    R: Floats = field(init=False)
    """Ruling vectors (n, 3), one unit of b long in b."""

    def __post_init__(self) -> None:
        s = self.basis.nodes
        step = float(s[1] - s[0])
        middle = 0.5 * (s[1:] + s[:-1])
        k = self.basis.midpoints @ self.bends
        turn = step * np.stack([k * self.slope(middle), k, np.zeros_like(k)], axis=1)
        frames = roll_frames(turn)
        origin = int(np.argmin(np.abs(s)))
        # The frame at s = 0 is the given one: from the nearest node, by the remaining distance.
        k0 = float(self.basis.values[origin] @ self.bends)
        rest = -s[origin] * k0 * np.array([[self.slope(s[origin : origin + 1])[0], 1.0, 0.0]])
        start = frames[origin] @ rotations(rest)[0]
        frames = self.rotation @ start.T @ frames
        A = np.ascontiguousarray(frames[:, :, 0])
        P = np.zeros((len(s), 3))
        P[1:] = np.cumsum(0.5 * step * (A[1:] + A[:-1]), axis=0)
        at_origin = P[origin] - s[origin] * A[origin]
        P += np.array([*self.anchor, self.focal]) - at_origin
        w = self.slope(s)[:, None]
        N = frames[:, :, 2]
        facing = np.einsum("ij,ij->i", N, P) > LEAST_SIGHT * np.linalg.norm(P, axis=1)
        hidden = np.flatnonzero(~facing)
        first = int(hidden[hidden < origin].max(initial=-1)) + 1
        last = int(hidden[hidden > origin].min(initial=len(s))) - 1
        first, last = min(first, origin - 1, len(s) - 2), max(last, origin + 1, 1)
        object.__setattr__(self, "front", (max(first, 0), min(last, len(s) - 1)))
        object.__setattr__(self, "P", P)
        object.__setattr__(self, "A", A)
        object.__setattr__(self, "N", N)
        object.__setattr__(self, "R", w * A + frames[:, :, 1])

    def for_kernels(self) -> SheetTables:
        """The surface as kernels take it, which must not outlive it."""
        nodes = self.basis.nodes
        return SheetTables(
            *(address(table) for table in (nodes, self.P, self.A, self.R)),
            len(nodes),
            *self.front,
            float(nodes[1] - nodes[0]),
            self.focal,
            self.slopes,
            np.cos(self.skew_rad),
            np.sin(self.skew_rad),
            self.anchor,
        )

    def slope(self, s: Vector) -> Vector:
        """Slope w(s) of the rulings on the sheet."""
        return np.asarray(self.slopes[0] * s + self.slopes[1] * s * s)

    def slope_rate(self, s: Vector) -> Vector:
        """w'(s)."""
        return np.asarray(self.slopes[0] + 2 * self.slopes[1] * s)

    def to_sheet(self, page: Points) -> Points:
        """(s, t) of page points (u, v), each (N, 2).

        The ruling through (a, b) is the root of s + b w(s) = a whose growth ds/da is positive:
        s = 2 a / (g + sqrt(g^2 + 4 a b w2)) with g = 1 + b w1 and w(s) = w1 s + w2 s^2. Where the square root has no
        real value no ruling passes; the point is then given to the ruling at which the others cross.
        """
        c, d = np.cos(self.skew_rad), np.sin(self.skew_rad)
        a, b = c * page[:, 0] - d * page[:, 1], d * page[:, 0] + c * page[:, 1]
        at_origin = 1 + b * self.slopes[0]
        growth = np.sqrt(np.maximum(at_origin**2 + 4 * a * b * self.slopes[1], 0.0))
        s = 2 * a / _away_from_zero(at_origin + growth)
        return np.stack([s, b], axis=1)

    def from_sheet(self, sheet: Points) -> Points:
        """(u, v) of sheet points (s, t), each (N, 2)."""
        c, d = np.cos(self.skew_rad), np.sin(self.skew_rad)
        a, b = sheet[:, 0] + sheet[:, 1] * self.slope(sheet[:, 0]), sheet[:, 1]
        return np.stack([c * a + d * b, c * b - d * a], axis=1)

    def to_photo(self, page: Points) -> Points:
        """See `PageMap`. The sheet ends where its rulings cross, where it turns away, and behind the camera."""
        kernels = find_kernels()
        if kernels is None:
            return self.to_photo_plain(page)
        page = np.ascontiguousarray(page, np.float64)
        seen = np.empty_like(page)
        kernels.see_points(self.for_kernels(), address(page), len(page), MIN_GROWTH, address(seen))
        return seen

    def to_photo_plain(self, page: Points) -> Points:
        """`to_photo` without a kernel."""
        sheet = self.to_sheet(page)
        s, t = sheet.T
        P, R, A = self._along(s)
        X = P + t * R
        with np.errstate(divide="ignore", invalid="ignore"):
            seen = np.stack(list(self.focal * X[:2] / X[2]), axis=1)
        growth = 1 + t * self.slope_rate(s)
        seen[(X[2] <= 1e-6) | (growth < MIN_GROWTH) | (dot(cross(A, R), X) <= 0)] = np.nan
        return np.asarray(seen)

    def to_page(self, centred: Points) -> Points:
        """See `PageMap`."""
        return self.unroll(centred).page

    def jacobians(self, centred: Points) -> Floats:
        """See `PageMap`."""
        return self.unroll(centred).jacobians

    def unroll(self, centred: Points) -> "Unrolled":
        """The page at photo points (N, 2).

        The ruling through a photo point is the root in s of det(d, P(s), R(s)) = 0, d being the line of sight: the
        moment P x R is the projected ruling. The root is bracketed among the nodes for all points at once, then
        found by Newton's method on the Hermite cubic between two nodes.
        """
        kernels = find_kernels()
        if kernels is None:
            return self.unroll_plain(centred)
        count = len(centred)
        sheet, page = np.empty((2, count, 2))
        X, A, R = np.empty((3, 3, count)).swapaxes(1, 2)
        in_photo = np.ascontiguousarray(centred, np.float64)
        at = Unrolled(in_photo, sheet, page, np.empty((count, 2, 2)), X, A, R)
        if not kernels.unroll_points(self.for_kernels(), at.for_kernels()[0]):
            raise MemoryError
        return at

    def unroll_plain(self, centred: Points) -> "Unrolled":
        """`unroll` without a kernel."""
        x, y = np.ascontiguousarray(centred.T)
        d = np.stack([x, y, np.full(len(centred), self.focal)])
        nodes = self.basis.nodes
        step = float(nodes[1] - nodes[0])
        front = slice(self.front[0], self.front[1] + 1)
        P, A, R = (table[front].T for table in (self.P, self.A, self.R))
        moment = cross(P, R)
        rate = cross(A, R) + cross(P, self.slope_rate(nodes[front]) * A)
        # Single precision is enough to find the interval: where the sign is unsure the root is at the node.
        side = moment.T.astype(np.float32) @ d.astype(np.float32)
        way = np.sign(d.sum(axis=1) @ rate).mean()
        before = side < 0 if way > 0 else side > 0
        # Rows of points are added up ten times as fast as points of rows, in bytes where they hold the numbers.
        of_nodes = np.uint8 if len(before) < 256 else np.uint16
        count = np.add.reduce(before.view(np.uint8), axis=0, dtype=of_nodes).astype(np.intp)
        left = np.minimum(np.maximum(count - (way != 0), 0), len(nodes[front]) - 2)
        # Values and slopes of the moments at both nodes of the interval.
        table = np.concatenate([moment, step * rate])
        here, there = table.take(left, axis=1), table.take(left + 1, axis=1)
        y0, m0 = dot(d, here[:3]), dot(d, here[3:])
        y1, m1 = dot(d, there[:3]), dot(d, there[3:])
        part = y0 / _away_from_zero(y0 - y1)
        c2, c3 = 3 * (y1 - y0) - 2 * m0 - m1, 2 * (y0 - y1) + m0 + m1
        for _ in range(3):
            value = y0 + part * (m0 + part * (c2 + part * c3))
            part = part - value / _away_from_zero(m0 + part * (2 * c2 + 3 * part * c3))
        # Beyond the table the last interval is continued; the surface is straight there.
        s = nodes[front][left] + step * np.minimum(np.maximum(part, -50.0), 50.0)
        P, R, A = self._along(s)
        dR, dP = cross(d, R), cross(d, P)
        t = -dot(dR, dP) / np.maximum(dot(dR, dR), 1e-300)
        X = P + t * R
        grow = 1 + t * self.slope_rate(s)
        # d photo / d (s, t) = (f I | -x) (X_s X_t) / Z.
        scale, place = self.focal / X[2], d[:2] / X[2]
        along, down = scale * R[:2], place * R[2]
        along, down = grow * (scale * A[:2] - place * A[2]), along - down
        det = _away_from_zero(along[0] * down[1] - along[1] * down[0])
        # d (a, b) = ((1 + t w', w), (0, 1)) d (s, t), then the turn by the skew.
        w = self.slope(s)
        c, e = np.cos(self.skew_rad), np.sin(self.skew_rad)
        u_s, u_t = c * grow / det, (c * w + e) / det
        v_s, v_t = -e * grow / det, (c - e * w) / det
        J = np.stack(
            [
                u_s * down[1] - u_t * along[1],
                u_t * along[0] - u_s * down[0],
                v_s * down[1] - v_t * along[1],
                v_t * along[0] - v_s * down[0],
            ],
            axis=1,
        ).reshape(-1, 2, 2)
        sheet = np.stack([s, t], axis=1)
        return Unrolled(centred, sheet, self.from_sheet(sheet), J, X.T, A.T, R.T)

    def normals(self, centred: Points) -> Floats:
        """Unit normals (N, 3) at photo points (N, 2), camera frame, away from the viewer."""
        return self.normals_at(self.to_sheet(self.to_page(centred))[:, 0])

    def normals_at(self, s: Vector) -> Floats:
        """Unit normals (N, 3) along the rulings at `s` (N,)."""
        N = np.stack([np.interp(s, self.basis.nodes, self.N[:, k]) for k in range(3)], axis=1)
        return np.asarray(N / np.linalg.norm(N, axis=1, keepdims=True))

    def line_at(self, s: Vector) -> tuple[Floats, Floats]:
        """P and R (N, 3 each) of the rulings at s, by Hermite's cubics: their derivatives are A and w' A."""
        P, R, _ = self._along(s)
        return P.T, R.T

    def place(self, page: Points) -> Floats:
        """Points (N, 3) in space of page points (N, 2), camera frame."""
        s, t = self.to_sheet(page).T
        P, R = self.line_at(s)
        return np.asarray(P + t[:, None] * R)

    def _along(self, s: Vector) -> tuple[Floats, Floats, Floats]:
        """P, R and A (3, N each) at s: the rulings, and the direction of the a-axis, linear between the nodes.

        Components come first, so that what has one value for each s is broadcast along memory.
        """
        nodes = self.basis.nodes
        step = float(nodes[1] - nodes[0])
        with np.errstate(invalid="ignore"):  # NaN is in any interval, and stays NaN
            left = np.minimum(np.maximum(((s - nodes[0]) / step).astype(int), 0), len(nodes) - 2)
        x = (s - nodes[left]) / step
        A = self.A.T
        table = np.concatenate([self.P.T, self.R.T, A, self.slope_rate(nodes) * A])
        here, there = table.take(left, axis=1), table.take(left + 1, axis=1)
        h1 = x * x * (3 - 2 * x)
        h2, h3 = step * x * (1 - x) ** 2, step * x * x * (x - 1)
        # The slopes of P and R are A and w' A.
        found = here[:6] + h1 * (there[:6] - here[:6]) + h2 * here[6:] + h3 * there[6:]
        # Beyond the table the surface is straight.
        for out, end, far in ((x < 0, here, x), (x > 1, there, x - 1)):
            if out.any():
                found[:, out] = end[:6, out] + step * far[out] * end[6:, out]
        inner = np.minimum(np.maximum(x, 0.0), 1.0)
        return found[:3], found[3:], (1 - inner) * here[6:9] + inner * there[6:9]


@dataclass(frozen=True, slots=True, eq=False)
class Unrolled:
    """The page at photo points `centred` (N, 2).

    `sheet` (N, 2) holds (s, t), `page` (N, 2) (u, v), `jacobians` (N, 2, 2) d page / d photo; `X`, `A`, `R` (N, 3)
    are the point in space, the direction of the a-axis, and the ruling there.
    """

    centred: Points
    sheet: Points
    page: Points
    jacobians: Floats
    X: Floats
    A: Floats
    R: Floats

    def for_kernels(self) -> tuple[SheetPoints, list[Floats]]:
        """The points as kernels take them, and the arrays that hold them."""
        found = self.centred, self.sheet, self.page, self.jacobians, self.X.T, self.A.T, self.R.T
        arrays: list[Floats] = [np.ascontiguousarray(each, np.float64) for each in found]
        return SheetPoints(len(self.centred), *map(address, arrays)), arrays


def cross(a: Floats, b: Floats) -> Floats:
    """Cross product (..., 3, N) of vectors whose components come first; numpy's own copies far more."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.subtract(a[..., j, :] * b[..., k, :], a[..., k, :] * b[..., j, :], out=out[..., i, :])
    return out


def dot(a: Floats, b: Floats) -> Floats:
    """Inner product (N,) of vectors (3, N) whose components come first."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _away_from_zero(value: Vector, least: float = 1e-9) -> Vector:
    return np.where(np.abs(value) < least, np.where(value < 0, -least, least), value)
