"""Mesh of mosaic points over a photo."""

import numpy as np

from services.arrays import Floats, Homography, Points, Vector
from services.geometry.homographies import denominators, transform_points
from services.geometry.page_frame import fill_unknown, turn_against_photo, turn_as_in_photo
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.placing.placement import Placement

COLUMNS, ROWS = 49, 65
"""Nodes across and down a photo."""
MOST_BETWEEN_PX = 2.0
"""Gently bent pages have at most 0.7, photos with the steep edge of a wave 3 to 1800."""
LOOKED_AT = 4
"""Every fourth row and column is looked at for that: an edge of a sheet crosses many."""
_STEP_PX = 8.0
"""To each side of a photo's middle, where the turn of the page against it is measured."""
LARGEST_REACH = 3.0
"""Largest distance of a photo's point from the view, in sizes of the view. Points farther out are near the horizon."""


def mesh_of_patch(photo: FlatPhoto, placement: Placement) -> Floats:
    """Mesh (rows, columns, 2) of mosaic points over the photo, corner to corner.

    65 x 49 nodes, or 129 x 97 where the sheet turns so far away that mosaic points between those would be more than
    `MOST_BETWEEN_PX` off. A node where the photo does not show the page gets the point of the nearest node that does.
    """
    height, width = photo.photo.shape[:2]
    x, y = np.linspace(0, width - 1, 2 * COLUMNS - 1), np.linspace(0, height - 1, 2 * ROWS - 1)
    mesh, shown = _nodes(photo, placement, x[::2], y[::2])
    across = _nodes(photo, placement, x[1::2], y[:: 2 * LOOKED_AT])[1]
    down = _nodes(photo, placement, x[:: 2 * LOOKED_AT], y[1::2])[1]
    off = max(
        _off_between(shown[::LOOKED_AT], across),
        _off_between(shown[:, ::LOOKED_AT].swapaxes(0, 1), down.swapaxes(0, 1)),
    )
    return fill_unknown(_nodes(photo, placement, x, y)[0] if off > MOST_BETWEEN_PX else mesh)


def _nodes(photo: FlatPhoto, placement: Placement, x: Vector, y: Vector) -> tuple[Floats, Floats]:
    """Mosaic points (rows, columns, 2) of photo pixels in columns `x` and rows `y`; the same, NaN beyond the view."""
    flat = flat_points(photo, np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
    mosaic = placement.to_mosaic(flat)
    with np.errstate(invalid="ignore"):
        shown = ((flat >= 0) & (flat <= np.array(photo.size) - 1)).all(axis=1, keepdims=True)
    shape = len(y), len(x), 2
    return mosaic.reshape(shape), np.where(shown, mosaic, np.nan).reshape(shape)


def _off_between(nodes: Floats, middles: Floats) -> float:
    """How far `middles` (n, m - 1, 2) are at most from half-way between the `nodes` (n, m, 2) beside them."""
    off = np.linalg.norm(middles - 0.5 * (nodes[:, :-1] + nodes[:, 1:]), axis=2)
    return float(np.nanmax(off, initial=0.0))


def turn_as_in_patch(photo: FlatPhoto, placement: Placement, H_page_mosaic: Homography) -> int:
    """The turn after which the page lies as in a photo, by its middle."""
    height, width = photo.photo.shape[:2]
    x, y = (side / 2 + np.array([-_STEP_PX, 0.0, _STEP_PX]) for side in (width, height))
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    page = transform_points(H_page_mosaic, placement.to_mosaic(flat_points(photo, grid)))
    return turn_as_in_photo(-turn_against_photo(fill_unknown(page.reshape(3, 3, 2))))


def flat_points(photo: FlatPhoto, points: Points) -> Points:
    """Flat pixels (N, 2) of photo pixels (N, 2); NaN beyond the page's horizon or outside of the page model."""
    frame = photo.frame
    if frame.H_photo_flat is not None:
        H_flat_photo = np.linalg.inv(frame.H_photo_flat)
        flat = transform_points(H_flat_photo, points)
        # The view's own points lie on the visible side of the horizon.
        middle = frame.to_photo(np.array([[(frame.width - 1) / 2, (frame.height - 1) / 2]]))
        beyond = np.asarray(denominators(H_flat_photo, points) * denominators(H_flat_photo, middle) <= 0)
    else:
        flat = frame.to_flat(points)
        beyond = np.asarray(~np.isfinite(flat).all(axis=1))
    size = np.array(photo.size, np.float64)
    with np.errstate(invalid="ignore"):
        beyond |= (np.abs(flat - size / 2) > LARGEST_REACH * size).any(axis=1)
    return np.asarray(np.where(beyond[:, None], np.nan, flat))


def scale_of_patch(photo: FlatPhoto, placement: Placement) -> float:
    """Mosaic pixels per photo pixel at the centre of the shown part."""
    rows, columns = np.nonzero(photo.shown[::8, ::8])
    middle = 8.0 * np.array([[columns.mean(), rows.mean()]]) if len(rows) else np.array([photo.size]) / 2.0
    square = middle + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])

    def area(points: Points) -> float:
        return float(abs(np.linalg.det(points[1:] - points[0])))

    return float(np.sqrt(area(placement.to_mosaic(square)) / max(area(photo.to_photo(square)), 1e-12)))
