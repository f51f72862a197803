"""What a request asks of a photo in pixels of a copy (reduced, or with square pixels), and what was found there in
pixels of the photo."""

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats
from services.contract.rectify import Corners, RectifyParameters
from services.geometry.homographies import to_resized
from services.rectify.results import RectifyResult


def reduce_parameters(parameters: RectifyParameters, reduction: int) -> RectifyParameters:
    """`parameters` in pixels of a photo reduced by `reduction`."""
    focal, region = parameters.focal_length_px, parameters.region
    return replace(
        parameters,
        focal_length_px=None if focal is None else focal / reduction,
        region=None
        if region is None
        else tuple(((x + 0.5) / reduction - 0.5, (y + 0.5) / reduction - 0.5) for x, y in region),
    )


def enlarge(result: RectifyResult, factor: float) -> RectifyResult:
    """`result` of a reduced photo in pixels of the photo that is `factor` times as large."""

    def moved(points: Floats) -> NDArray[np.float64]:
        return np.asarray(to_resized(points, factor), np.float64)

    height, width = result.image.shape[:2]
    size = max(round(height * factor), 1), max(round(width * factor), 1)
    camera = result.camera
    point = camera.principal_point
    printed = result.print
    if printed is not None:
        printed = replace(
            printed, characters=moved(printed.characters), heights_px=printed.heights_px * factor
        )
    return replace(
        result,
        image=np.broadcast_to(result.image[:1, :1], (*size, 3)),
        camera=replace(
            camera,
            focal_length_px=None if camera.focal_length_px is None else camera.focal_length_px * factor,
            principal_point=None
            if point is None
            else (float(moved(np.array(point[0]))), float(moved(np.array(point[1])))),
        ),
        surface=result.surface.resized(factor),
        mesh=moved(result.mesh),
        corners=None if result.corners is None else moved(result.corners),
        print=printed,
    )


def in_square_pixels(parameters: RectifyParameters, stretch: tuple[float, float]) -> RectifyParameters:
    """`parameters`, in pixels of the file, for its copy with `stretch` pixels for each of them along x and y."""
    if stretch == (1.0, 1.0):
        return parameters

    def moved(points: Sequence[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
        return tuple((float(x), float(y)) for x, y in to_resized(np.array(points), np.array(stretch)))

    region, corners = parameters.region, parameters.page_corners
    return replace(
        parameters,
        region=None if region is None else moved(region),
        corners=() if corners is None else (cast(Corners, moved(corners)),),
    )


def in_pixels_of_file(result: RectifyResult, stretch: tuple[float, float]) -> RectifyResult:
    """`result` of a copy with square pixels, in pixels of the file, which has 1 / `stretch` of them along x and y.

    Camera and surface stay those of the copy: cameras have square pixels.
    """
    if stretch == (1.0, 1.0):
        return result
    factor = 1 / np.array(stretch)
    corners = result.corners
    return replace(
        result,
        mesh=np.asarray(to_resized(result.mesh, factor), np.float64),
        corners=None if corners is None else np.asarray(to_resized(corners, factor), np.float64),
    )
