"""Brightness and gradients of cells relative to the paper around them; light and exposure have no effect on these."""

import ctypes
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage, Mask
from services.imaging.channels import only_where
from services.kernels.library import CellLevels, RelatedMaps, address, find_kernels
from services.mosaic.composition.patch_drawing import FloatMap

LEAST_WEIGHT = 1e-3
"""Least share of a window that shows paper; with less its level is not known."""
DARKEST_PAPER = 1.0
"""Least gray level of paper, which is divided by."""


@dataclass(frozen=True, slots=True, eq=False)
class RelatedCells:
    """Of cells (rows, columns), 0 where they are not shown.

    Attributes
    ----------
    darkness : 1 - level over that of the paper.
    slope : RMS gradient of both axes, relative to the paper.
    energy : (rows, columns, 2) mean squared gradient relative to the paper, across and down.
    bare : whether a cell is shown and about as bright as its paper.
    """

    darkness: FloatMap
    slope: FloatMap
    energy: FloatMap
    bare: Mask


def relate_cells(
    gray: GrayImage, energy: FloatMap, shown: Mask, light: FloatMap, weight: FloatMap, bare_level: float
) -> RelatedCells:
    """Cells relative to their paper; they are bare from `bare_level` of its level on.

    `gray` and `energy` are those of `CellMeasures`; the paper's level is `light` / `weight`, both (rows, columns).
    """
    kernels = find_kernels()
    if kernels is None:
        return relate_cells_plain(gray, energy, shown, light, weight, bare_level)
    _check_cells(shown, (light, weight, gray), energy)
    values = [np.ascontiguousarray(each, np.float32) for each in (light, weight, energy)]
    levels = [np.ascontiguousarray(each) for each in (gray, shown)]
    found = RelatedCells(
        np.empty(shown.shape, np.float32),
        np.empty(shown.shape, np.float32),
        np.empty((*shown.shape, 2), np.float32),
        np.empty(shown.shape, bool),
    )
    cells = CellLevels(shown.size, *map(address, levels), *map(address, values))
    into = RelatedMaps(*map(address, (found.darkness, found.slope, found.energy, found.bare)))
    kernels.relate_cells(ctypes.byref(cells), LEAST_WEIGHT, DARKEST_PAPER, bare_level, ctypes.byref(into))
    return found


def relate_cells_plain(
    gray: GrayImage, energy: FloatMap, shown: Mask, light: FloatMap, weight: FloatMap, bare_level: float
) -> RelatedCells:
    """`relate_cells` by NumPy and OpenCV: the same."""
    smooth = np.maximum(light / np.maximum(weight, LEAST_WEIGHT), DARKEST_PAPER).astype(np.float32)
    relative = gray / smooth
    relative_energy = cv2.divide(energy, cv2.merge([np.square(smooth)] * 2))
    kept = only_where(shown, np.asarray(relative_energy, np.float32))
    return RelatedCells(
        np.where(shown, 1 - relative, 0).astype(np.float32),
        np.sqrt(kept[..., 0] + kept[..., 1]),
        kept,
        shown & (relative > bare_level),
    )


def raise_strength(
    values: FloatMap, largest: FloatMap, least: float, share: float, strength: GrayImage
) -> None:
    """Raise `strength`, in place, to 255 times `values` relative to the `largest` near, all (rows, columns).

    Values below `share` of the largest, or below `least`, raise nothing; the largest is `least` at least.
    """
    kernels = find_kernels()
    if kernels is None:
        raise_strength_plain(values, largest, least, share, strength)
        return
    numbers = [np.ascontiguousarray(each, np.float32) for each in (values, largest)]
    if any(each.shape != strength.shape for each in numbers) or not strength.flags.c_contiguous:
        raise ValueError("values and their strength are of the same cells")
    kernels.raise_strength(*map(address, numbers), strength.size, least, share, address(strength))


def raise_strength_plain(
    values: FloatMap, largest: FloatMap, least: float, share: float, strength: GrayImage
) -> None:
    """`raise_strength` by NumPy: the same."""
    relative = np.clip(values / np.maximum(largest, np.float32(least)), 0, 1)
    own = np.where((values > least) & (relative > share), 255 * relative, 0).astype(np.uint8)
    cv2.max(strength, own, dst=strength)


def remove_noise(energy: FloatMap, noise: NDArray[np.float32]) -> None:
    """Take `noise` (2,) from `energy` (rows, columns, 2), in place; it stays at least 0."""
    kernels = find_kernels()
    if kernels is None or not energy.flags.c_contiguous:
        np.maximum(energy - noise, 0, out=energy)
        return
    usual = np.ascontiguousarray(noise, np.float32)
    kernels.remove_noise(address(energy), energy.size // 2, address(usual))


def masked_medians(values: FloatMap, mask: Mask) -> NDArray[np.float32]:
    """Medians (2,) of `values` (rows, columns, 2), none negative, where `mask` (rows, columns) is true; 0 of none."""
    kernels = find_kernels()
    if kernels is None:
        return masked_medians_plain(values, mask)
    _check_cells(mask, (), values)
    numbers, where = np.ascontiguousarray(values, np.float32), np.ascontiguousarray(mask)
    medians = np.zeros(2, np.float32)
    if not kernels.masked_medians(address(numbers), address(where), mask.size, address(medians)):
        raise MemoryError
    return medians


def masked_medians_plain(values: FloatMap, mask: Mask) -> NDArray[np.float32]:
    """`masked_medians` by NumPy: the same."""
    if not mask.any():
        return np.zeros(2, np.float32)
    return np.array([np.median(plane[mask]) for plane in cv2.split(values)], np.float32)


def masked_means(values: FloatMap, mask: Mask) -> NDArray[np.float32]:
    """Means (2,) of `values` (rows, columns, 2) where `mask` (rows, columns) is true; 0 of none."""
    kernels = find_kernels()
    if kernels is None:
        return masked_means_plain(values, mask)
    _check_cells(mask, (), values)
    numbers, where = np.ascontiguousarray(values, np.float32), np.ascontiguousarray(mask)
    sums = np.zeros(2, np.float32)
    used = kernels.masked_sums(address(numbers), address(where), mask.size, address(sums))
    return (sums / np.float64(max(used, 1))).astype(np.float32)


def masked_means_plain(values: FloatMap, mask: Mask) -> NDArray[np.float32]:
    """`masked_means` by NumPy: the same."""
    return np.asarray(values[mask].mean(axis=0) if mask.any() else np.zeros(2), np.float32)


def _check_cells(mask: Mask, images: tuple[FloatMap | GrayImage, ...], values: FloatMap) -> None:
    if values.shape != (*mask.shape, 2) or any(image.shape != mask.shape for image in images):
        raise ValueError("all are of the same cells")
    if mask.dtype != bool or any(image.dtype not in (np.uint8, np.float32) for image in images):
        raise ValueError("masks are of truth values, levels of bytes or single precision")
