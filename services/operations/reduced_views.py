"""Flat pages and mosaics in a smaller size (`max_width`, `max_height`), with meshes that fit it."""

from dataclasses import replace

import cv2
import numpy as np

from services.arrays import Points, RgbImage, Vector
from services.contract.images import Encoding
from services.geometry.homographies import to_resized
from services.mosaic.results import MosaicResult, Patch
from services.rectify.results import RectifyResult


def reduced_size(width: int, height: int, max_width: int | None, max_height: int | None) -> tuple[int, int]:
    """Width and height of a picture that keeps both limits and nearly its proportions; it is never enlarged."""
    factor = min(1.0, (max_width or width) / width, (max_height or height) / height)
    return max(1, round(width * factor)), max(1, round(height * factor))


def reduce_picture(picture: RgbImage, width: int, height: int) -> RgbImage:
    """`picture` (H, W, 3) at a smaller size; each pixel is the mean of those that it covers."""
    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


def reduce_view(result: RectifyResult, encoding: Encoding) -> RectifyResult:
    """The flat view within the size limits of `encoding`; the mesh then has the nodes of the smaller picture."""
    old_height, old_width = result.image.shape[:2]
    width, height = reduced_size(old_width, old_height, encoding.max_width, encoding.max_height)
    if (width, height) == (old_width, old_height):
        return result
    rows, columns = result.mesh.shape[:2]
    mesh = _interpolate(result.mesh, _places(rows, old_height, height))
    mesh = _interpolate(mesh.swapaxes(0, 1), _places(columns, old_width, width)).swapaxes(0, 1)
    picture = reduce_picture(result.image, width, height)
    return replace(result, image=picture, mesh=np.asarray(mesh, np.float64))


def _places(nodes: int, old_px: int, new_px: int) -> Vector:
    """Places (nodes,) of the new nodes among the old ones; the outer nodes are centres of the outer pixels."""
    new = np.linspace(0, new_px - 1, nodes)
    old = (new + 0.5) * old_px / new_px - 0.5
    return np.asarray(np.clip(old * (nodes - 1) / max(old_px - 1, 1), 0, nodes - 1))


def _interpolate(mesh: Points, places: Vector) -> Points:
    """Points (N, columns, 2) at fractional rows `places` (N,) of `mesh` (rows, columns, 2)."""
    first = np.minimum(places.astype(int), mesh.shape[0] - 2)
    share = (places - first)[:, None, None]
    return np.asarray((1 - share) * mesh[first] + share * mesh[first + 1])


def reduce_mosaic(result: MosaicResult, encoding: Encoding) -> MosaicResult:
    """The mosaic within the size limits of `encoding`; meshes, scales and residuals are in its new pixels."""
    old_height, old_width = result.image.shape[:2]
    width, height = reduced_size(old_width, old_height, encoding.max_width, encoding.max_height)
    if (width, height) == (old_width, old_height):
        return result
    factors = np.array([width / old_width, height / old_height])
    scale = float(factors.mean())
    return replace(
        result,
        image=reduce_picture(result.image, width, height),
        patches=tuple(_reduce_patch(patch, factors, scale) for patch in result.patches),
        pairs=tuple(
            pair.model_copy(update={"residual_px": round(pair.residual_px * scale, 4)})
            for pair in result.pairs
        ),
    )


def _reduce_patch(patch: Patch, factors: Points, scale: float) -> Patch:
    if patch.mesh is None:
        return patch
    mesh = np.asarray(to_resized(patch.mesh, factors), np.float64)
    return replace(patch, mesh=mesh, scale=None if patch.scale is None else patch.scale * scale)
