"""What a request asks of a photo in pixels of a reduced copy, and what was found there in pixels of the photo."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats
from services.contract.rectify import RectifyParameters
from services.geometry.homographies import to_resized
from services.rectify.results import PrintSample, RectifyResult


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
        printed = PrintSample(moved(printed.characters), printed.heights_px * factor)
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
