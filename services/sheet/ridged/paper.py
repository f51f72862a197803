"""Residuals of a mesh that is made of paper: it does not stretch, and it bends little but at few ridges."""

import numpy as np
from numpy.typing import NDArray

from services.arrays import Vector
from services.sheet.ridged.blocks import ResidualBlock, SparseRows
from services.sheet.ridged.mesh import SheetMesh
from services.sheet.ridged.parameters import STRETCH, RidgedParameters, Stage


class PaperResiduals:
    """Residuals at vectors of unknowns: first the nodes of `mesh`, at `aspect_at` the log aspect."""

    def __init__(self, mesh: SheetMesh, parameters: RidgedParameters, stage: Stage, aspect_at: int) -> None:
        self.mesh, self.p, self.stage = mesh, parameters, stage
        self.nodes, self.aspect_at = 3 * mesh.rows * mesh.columns, aspect_at
        self._edges, self._hinges = _edges(mesh), _hinges(mesh)
        self._hinge_jacobians = {
            name: _difference_jacobian(nodes, signs) for name, (nodes, signs) in self._hinges.items()
        }

    def stretch(self, x: Vector) -> ResidualBlock:
        """Edges and diagonals of the cells keep their lengths."""
        X = x[: self.nodes].reshape(-1, 3)
        aspect = float(np.exp(x[self.aspect_at]))
        a, b, across, down = self._edges
        way = X[b] - X[a]
        length = np.maximum(np.linalg.norm(way, axis=1), 1e-12)
        flat = np.hypot(across, aspect * down)
        unit = self.mesh.step * STRETCH * self.stage.slack
        values = (length - self.mesh.step * flat) / unit
        toward = way / (length * unit)[:, None]
        by_aspect = -self.mesh.step * (aspect * down) ** 2 / (flat * unit)
        columns = np.concatenate(
            [
                3 * a[:, None] + np.arange(3),
                3 * b[:, None] + np.arange(3),
                np.full((len(a), 1), self.aspect_at),
            ],
            axis=1,
        )
        data = np.concatenate([-toward, toward, by_aspect[:, None]], axis=1)
        return ResidualBlock(values, SparseRows(columns, data), 0)

    def bends(self, x: Vector) -> list[ResidualBlock]:
        """Second differences of the nodes, as angles: across, down, and the twist of a cell."""
        X = x[: self.nodes].reshape(-1, 3)
        aspect = self.mesh.aspect
        found = []
        for name, (nodes, signs) in self._hinges.items():
            size = {"across": 1.0, "down": aspect, "twist": np.sqrt(aspect)}[name] * self.mesh.step
            scale = (self.mesh.columns - 1) / (size * self.p.bend_rad)
            values = scale * np.einsum("nki,k->ni", X[nodes], signs).ravel()
            found.append(ResidualBlock(values, self._hinge_jacobians[name].scaled(scale), 3))
        return found


def _numbers(mesh: SheetMesh) -> NDArray[np.intp]:
    return np.arange(mesh.rows * mesh.columns).reshape(mesh.rows, mesh.columns)


def _edges(mesh: SheetMesh) -> tuple[NDArray[np.intp], NDArray[np.intp], Vector, Vector]:
    """Both ends of every edge and diagonal, and how many columns and rows it spans."""
    n = _numbers(mesh)
    kinds = [
        (n[:, :-1], n[:, 1:], 1.0, 0.0),
        (n[:-1], n[1:], 0.0, 1.0),
        (n[:-1, :-1], n[1:, 1:], 1.0, 1.0),
        (n[:-1, 1:], n[1:, :-1], 1.0, 1.0),
    ]
    return (
        np.concatenate([begin.ravel() for begin, _, _, _ in kinds]),
        np.concatenate([end.ravel() for _, end, _, _ in kinds]),
        np.concatenate([np.full(begin.size, across) for begin, _, across, _ in kinds]),
        np.concatenate([np.full(begin.size, down) for begin, _, _, down in kinds]),
    )


def _hinges(mesh: SheetMesh) -> dict[str, tuple[NDArray[np.intp], Vector]]:
    """Nodes (n, k) of every second difference, and the signs (k,) they are taken with."""
    n = _numbers(mesh)

    def nodes(*parts: NDArray[np.intp]) -> NDArray[np.intp]:
        return np.stack([part.ravel() for part in parts], axis=1)

    second = np.array([1.0, -2.0, 1.0])
    return {
        "across": (nodes(n[:, :-2], n[:, 1:-1], n[:, 2:]), second),
        "down": (nodes(n[:-2], n[1:-1], n[2:]), second),
        "twist": (nodes(n[:-1, :-1], n[:-1, 1:], n[1:, :-1], n[1:, 1:]), np.array([1.0, -1.0, -1.0, 1.0])),
    }


def _difference_jacobian(nodes: NDArray[np.intp], signs: Vector) -> SparseRows:
    """Derivatives of signed sums of nodes (n, k), point by point: 3 n rows."""
    columns = (3 * nodes[:, None, :] + np.arange(3)[:, None]).reshape(-1, len(signs))
    return SparseRows(columns, np.broadcast_to(signs, columns.shape))
