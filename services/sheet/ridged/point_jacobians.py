"""How the places of photo points on a mesh move with its nodes, and with the focal length.

With a point x seen at grid coordinates g, f X(g) / Z(g) = x: if the nodes move by dX_k, then g moves by
dg = -G^-1 sum_k w_k P dX_k, with P = (f I | -x) / Z and G = P (X_c X_r); if f changes, by -G^-1 x d(log f).
"""

import numpy as np
from numpy.typing import NDArray

from services.arrays import Points
from services.kernels.library import address, find_kernels
from services.sheet.ridged.blocks import SparseRows
from services.sheet.ridged.mesh import SheetMesh, invert_2x2


def point_jacobians(
    mesh: SheetMesh, photo: Points, grid: Points, known: NDArray[np.bool_], focal_at: int
) -> tuple[SparseRows, SparseRows]:
    """Derivatives (N, unknowns) of the columns and of the rows `grid` (N, 2) at which `photo` points (N, 2) are found.

    The unknowns begin with the nodes' coordinates; number `focal_at` is the logarithm of the focal length. Points that
    are not `known` (N,) have no derivatives.
    """
    kernels = find_kernels()
    if kernels is None:
        return point_jacobians_plain(mesh, photo, grid, known, focal_at)
    photo, grid = (np.ascontiguousarray(points, np.float64) for points in (photo, grid))
    known = np.ascontiguousarray(known, np.bool_)
    # Four nodes of three coordinates, and the focal length.
    columns, entries = np.empty((len(photo), 13), np.intp), np.empty((2, len(photo), 13))
    (seen, _held), points = mesh.for_kernels(), (address(photo), address(grid), address(known), len(photo))
    kernels.derive_points(seen, *points, focal_at, address(columns), address(entries))
    return SparseRows(columns, entries[0]), SparseRows(columns, entries[1])


def point_jacobians_plain(
    mesh: SheetMesh, photo: Points, grid: Points, known: NDArray[np.bool_], focal_at: int
) -> tuple[SparseRows, SparseRows]:
    """`point_jacobians` without a kernel."""
    placed, count = mesh.place(grid), len(photo)
    inverse = invert_2x2(mesh.derivatives(placed))
    inverse[~known] = 0.0
    P = np.zeros((count, 2, 3))
    P[:, 0, 0] = P[:, 1, 1] = mesh.focal
    P[:, :, 2] = -photo
    P /= placed.X[:, 2, None, None]
    by_point = -inverse @ P
    by_focal = -np.einsum("nij,nj->ni", inverse, photo)
    by_node = (3 * placed.nodes[:, :, None] + np.arange(3)).reshape(count, 12)
    columns = np.concatenate([by_node, np.full((count, 1), focal_at)], axis=1)
    found = []
    for axis in (0, 1):
        entries = (placed.weights[:, :, None] * by_point[:, None, axis]).reshape(count, 12)
        found.append(SparseRows(columns, np.concatenate([entries, by_focal[:, axis : axis + 1]], axis=1)))
    return found[0], found[1]
