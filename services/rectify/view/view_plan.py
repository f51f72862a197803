"""How the views of a page are drawn, without its shape and evidence: kept with a photo for later answers."""

import io
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import get_args

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

from services.arrays import Floats, Homography, Points
from services.contract.rectify import Crop
from services.geometry.homographies import transform_points
from services.geometry.page_frame import Frame
from services.imaging.node_grid import GRID_STEP_PX
from services.rectify.view.drawing import photo_nodes, places_in_view
from services.rectify.view.paper_end import filled_hull
from services.sheet.plane.framing import FlatFrame


@dataclass(frozen=True, slots=True, eq=False)
class NodeGrid:
    """Photo pixels `nodes` (rows, columns, 2) of a view's grid, as it is drawn."""

    nodes: NDArray[np.float32]

    def at(self, pixels: Points) -> Floats:
        """Photo pixels (N, 2) of pixels of the view, bilinear between the nodes; NaN beyond them."""
        column, row = ((pixels + 0.5) / GRID_STEP_PX + 0.5).T
        with np.errstate(invalid="ignore"):
            found = [map_coordinates(self.nodes[..., k], (row, column), order=1, cval=np.nan) for k in (0, 1)]
        return np.stack(found, axis=1).astype(np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class PlannedFrame:
    """A `Frame` by the grid of a view that was planned; `H_grid_flat` leads from its pixels to those of the grid."""

    grid: NodeGrid
    H_grid_flat: Homography
    width: int
    height: int

    @property
    def H_photo_flat(self) -> None:
        """See `Frame`."""

    def to_photo(self, pixels: Points) -> Points:
        """See `Frame`."""
        return self.grid.at(transform_points(self.H_grid_flat, pixels))

    def to_flat(self, photo: Points) -> Points:
        """See `Frame`: from the nearest node on, by the slope of the grid there."""
        nodes = self.grid.nodes.astype(np.float64)
        rows, columns = nodes.shape[:2]
        known = np.flatnonzero(np.isfinite(nodes).all(axis=2))
        _, nearest = cKDTree(nodes.reshape(-1, 2)[known]).query(photo)
        row, column = np.divmod(known[nearest], columns)
        row, column = np.clip(row, 1, rows - 2), np.clip(column, 1, columns - 2)
        across = 0.5 * (nodes[row, column + 1] - nodes[row, column - 1])
        down = 0.5 * (nodes[row + 1, column] - nodes[row - 1, column])
        off = photo - nodes[row, column]
        det = across[:, 0] * down[:, 1] - across[:, 1] * down[:, 0]
        x = (off[:, 0] * down[:, 1] - off[:, 1] * down[:, 0]) / det
        y = (across[:, 0] * off[:, 1] - across[:, 1] * off[:, 0]) / det
        at = np.column_stack([column - 0.5 + x, row - 0.5 + y]) * GRID_STEP_PX - 0.5
        return transform_points(np.linalg.inv(self.H_grid_flat), at)

    def through(self, H_old_new: Homography, width: int, height: int) -> "PlannedFrame":
        """See `Frame`."""
        return replace(self, H_grid_flat=self.H_grid_flat @ H_old_new, width=width, height=height)


@dataclass(frozen=True, slots=True, eq=False)
class PlannedView:
    """One view before it is turned: its frame, where it is drawn white, and where its text is.

    `paper` (M, 2) is a polygon of photo pixels as of `draw_flat_view`, None where nothing is drawn white.
    `characters` (N, 2) are pixels of the view; None where no text was seen.
    """

    frame: Frame
    paper: Points | None
    characters: Points | None


def plan_view(frame: Frame, paper: Points | None, characters: Points | None) -> PlannedView:
    """The plan of the view through `frame`; `characters` (N, 2) are photo pixels."""
    places = None if characters is None else places_in_view(frame, characters)
    if frame.H_photo_flat is not None:
        return PlannedView(FlatFrame(frame.H_photo_flat, frame.width, frame.height), paper, places)
    grid = NodeGrid(photo_nodes(frame).astype(np.float32))
    return PlannedView(PlannedFrame(grid, np.eye(3), frame.width, frame.height), paper, places)


@dataclass(frozen=True, eq=False)
class ViewPlan:
    """The views of one page by what they show (`crop`)."""

    views: Mapping[Crop, PlannedView]

    @cached_property
    def packed(self) -> bytes:
        """The plan as a file of arrays."""
        arrays: dict[str, NDArray[np.generic]] = {}
        for crop, view in self.views.items():
            frame = view.frame
            arrays[f"{crop}.size"] = np.array([frame.width, frame.height])
            if isinstance(frame, PlannedFrame):
                arrays[f"{crop}.nodes"] = frame.grid.nodes
            else:
                assert frame.H_photo_flat is not None
                arrays[f"{crop}.H"] = np.asarray(frame.H_photo_flat, np.float64)
            for name in ("paper", "characters"):
                points = getattr(view, name)
                if points is not None:
                    arrays[f"{crop}.{name}"] = points.astype(np.float32)
        buffer = io.BytesIO()
        np.savez(buffer, **arrays)  # type: ignore[arg-type]
        return buffer.getvalue()


def unpack_plan(packed: bytes) -> ViewPlan:
    """The plan that `packed` holds; it is data that this service has written."""
    views: dict[Crop, PlannedView] = {}
    with np.load(io.BytesIO(packed), allow_pickle=False) as arrays:
        for crop in get_args(Crop):
            if f"{crop}.size" not in arrays:
                continue
            width, height = (int(v) for v in arrays[f"{crop}.size"])
            frame: Frame
            if f"{crop}.nodes" in arrays:
                frame = PlannedFrame(NodeGrid(arrays[f"{crop}.nodes"]), np.eye(3), width, height)
            else:
                frame = FlatFrame(arrays[f"{crop}.H"], width, height)
            paper, border, characters = (
                arrays[name].astype(np.float64) if (name := f"{crop}.{part}") in arrays else None
                for part in ("paper", "border", "characters")
            )
            if paper is None and border is not None:  # earlier releases kept two polygons
                paper = filled_hull(border)
            views[crop] = PlannedView(frame, paper, characters)
    return ViewPlan(views)
