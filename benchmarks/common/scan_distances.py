"""How far a flat view lies from a scan of the page: the figures of the field (DocUNet, DewarpNet, PaperEdge).

The published protocol is MATLAB code with SIFT flow (evalUnwarp.m, alignLD.m). Here the steps and constants are
the same, but the flow is OpenCV's DIS after an alignment by SIFT features: figures compare with each other,
not with published ones.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage, RgbImage
from services.imaging.illumination import flatten_illumination

AREA_PX = 598400
"""Both images are resized to the scan's shape at this area."""

SCALE_WEIGHTS = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)
"""Of the five scales of MS-SSIM (Wang et al., 2003); the published code adds them up."""

_SSIM_SIGMA = 1.5
_SSIM_CONSTANTS = ((0.01 * 255) ** 2, (0.03 * 255) ** 2)
_SHARE_OF_EDGES = 0.5
"""Pixels above this share of the strongest gradient are aligned (alignLD.m)."""
_LEAST_MATCHES = 12
_MATCH_RATIO = 0.8
_FARTHEST = 0.15
"""Of the width: a view that is off by more is no view of the page; repeated words match farther away."""
_INLIER_PX = 40.0
_MOST_STRETCH = 0.4
"""Of the affine map, by which one view of a page may differ from another."""
_REACH_PX = 40.0
"""Over which the displacements of matched features are averaged: several text lines."""
_INK = 0.15
_FILL_PX = 12.0
"""Over which the flow is continued from ink into blank paper, pixels of the half size."""

Flow = NDArray[np.float32]
"""(H, W, 2) displacements (x, y): a pixel of the scan -> the same point in the view."""


@dataclass(frozen=True, slots=True)
class ScanDistances:
    """One view against the scan.

    Attributes
    ----------
    ms_ssim : float
        Sum of SSIM over five scales by `SCALE_WEIGHTS`, at most 1; light and colour of the paper count.
    local_distortion_px : float
        LD: mean length of the flow, pixels at half size. Margins count.
    aligned_distortion_px : float
        AD (Ma et al., 2022): mean length after the best scale and shift along each axis, weighted by the
        scan's gradient. Margins cost nothing.
    aspect_error_percent : float
        Of the view's width over height, against the scan's.
    """

    ms_ssim: float
    local_distortion_px: float
    aligned_distortion_px: float
    aspect_error_percent: float


def compare_with_scan(view: RgbImage, scan: RgbImage) -> ScanDistances:
    """Distances of a view from the scan of its page, which may differ in size."""
    aspect = view.shape[1] * scan.shape[0] / (view.shape[0] * scan.shape[1])
    scale = float(np.sqrt(AREA_PX / (scan.shape[0] * scan.shape[1])))
    size = (round(scan.shape[1] * scale), round(scan.shape[0] * scale))
    reference, image = _resized(_gray(scan), size), _resized(_gray(view), size)
    flow = estimate_flow(reference, image)
    edges = edge_strength(_half(reference))
    return ScanDistances(
        ms_ssim(image, reference),
        float(np.linalg.norm(flow, axis=2).mean()),
        aligned_distortion(flow, edges),
        100 * abs(aspect - 1),
    )


def ms_ssim(first: GrayImage, second: GrayImage) -> float:
    """SSIM of two images (H, W) on five scales, summed by `SCALE_WEIGHTS`."""
    total = 0.0
    for weight in SCALE_WEIGHTS:
        total += weight * _ssim(first.astype(np.float64), second.astype(np.float64))
        first, second = (np.asarray(cv2.pyrDown(image), np.uint8) for image in (first, second))
    return total


def _ssim(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    def mean(image: NDArray[np.float64]) -> NDArray[np.float64]:
        blurred = cv2.GaussianBlur(image, (11, 11), _SSIM_SIGMA, borderType=cv2.BORDER_REPLICATE)
        return np.asarray(blurred, np.float64)

    light, structure = _SSIM_CONSTANTS
    mean_1, mean_2 = mean(first), mean(second)
    variances = mean(first**2) - mean_1**2 + mean(second**2) - mean_2**2
    covariance = mean(first * second) - mean_1 * mean_2
    value = (2 * mean_1 * mean_2 + light) * (2 * covariance + structure)
    return float((value / ((mean_1**2 + mean_2**2 + light) * (variances + structure))).mean())


def estimate_flow(scan: GrayImage, view: GrayImage) -> Flow:
    """Where each pixel of the scan lies in the view, both (H, W), at half their size and in its pixels.

    Both are flat-fielded. Matched features give an affine map and a smooth displacement, DIS the rest; blank
    paper takes the flow of the ink nearby.
    """
    flat_scan, flat_view = flatten_illumination(scan), flatten_illumination(view)
    first, second = _half(flat_scan), _half(flat_view)
    size = (first.shape[1], first.shape[0])
    coarse = _feature_flow(flat_scan, flat_view) / 2
    start = np.asarray(cv2.resize(coarse, size, interpolation=cv2.INTER_AREA), np.float32)
    warped = _displaced(second, start)
    zero = np.zeros((*first.shape, 2), np.float32)
    rest = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM).calc(first, warped, zero)
    flow = np.asarray(rest + _displaced(start, rest), np.float32)
    weights = edge_strength(first) + np.float32(1e-4)
    ink = cv2.GaussianBlur((weights > _INK).astype(np.float32), (0, 0), 1.5)[..., None]
    own = np.minimum(2 * ink, 1)
    return np.asarray(own * flow + (1 - own) * _mean_nearby(flow, weights, _FILL_PX), np.float32)


def edge_strength(image: GrayImage) -> NDArray[np.float32]:
    """Gradient of an image (H, W) by Sobel, as a share of the strongest."""
    gray = image.astype(np.float32)
    strength = np.hypot(cv2.Sobel(gray, cv2.CV_32F, 1, 0), cv2.Sobel(gray, cv2.CV_32F, 0, 1))
    return np.asarray(strength / max(float(strength.max()), 1e-6), np.float32)


def aligned_distortion(flow: Flow, edges: NDArray[np.float32]) -> float:
    """AD of a flow (H, W, 2): what the best scale and shift of each axis leave, weighted by `edges` (H, W)."""
    height, width = edges.shape
    places = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(np.float64)
    strong = edges > _SHARE_OF_EDGES
    rest = np.empty_like(places)
    for axis in (0, 1):
        here, there = places[..., axis], places[..., axis] + flow[..., axis]
        if np.ptp(there[strong]) > 1 if strong.any() else False:
            scale, shift = np.polyfit(there[strong], here[strong], 1)
        else:
            scale, shift = 1.0, 0.0
        rest[..., axis] = scale * there + shift - here
    return float((edges * np.linalg.norm(rest, axis=2)).mean())


def _feature_flow(scan: GrayImage, view: GrayImage) -> Flow:
    """Smooth flow (H, W, 2) through matched SIFT features; zero where too few agree."""
    height, width = scan.shape
    flow = np.zeros((height, width, 2), np.float32)
    here, there = _matches(scan, view)
    near = np.linalg.norm(there - here, axis=1) < _FARTHEST * width
    here, there = here[near], there[near]
    if len(here) < _LEAST_MATCHES:
        return flow
    affine, inliers = cv2.estimateAffine2D(
        here, there, method=cv2.USAC_MAGSAC, ransacReprojThreshold=_INLIER_PX
    )
    if affine is None or inliers.sum() < _LEAST_MATCHES:
        return flow
    if np.abs(affine[:, :2] - np.eye(2)).max() > _MOST_STRETCH:
        return flow
    good = inliers[:, 0] > 0
    here, there = here[good], there[good]
    grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(np.float32)
    flow = cv2.transform(grid, affine) - grid
    rests = there - cv2.transform(here[None], affine)[0]
    columns, rows = np.clip(here.round().astype(int), 0, (width - 1, height - 1)).T
    smooth = np.zeros_like(flow)
    # What the features say beyond the affine map, averaged nearby; a weak zero holds where there are none.
    for reach in (2 * _REACH_PX, _REACH_PX):
        kept = np.linalg.norm(rests - smooth[rows, columns], axis=1) < reach / 2
        counts, sums = np.zeros((height, width), np.float32), np.zeros((height, width, 2), np.float32)
        np.add.at(counts, (rows[kept], columns[kept]), 1)
        np.add.at(sums, (rows[kept], columns[kept]), rests[kept])
        counts, sums = (np.asarray(cv2.GaussianBlur(field, (0, 0), reach)) for field in (counts, sums))
        alone = 0.5 / (2 * np.pi * reach**2)
        smooth = sums / (counts + alone)[..., None]
    return np.asarray(flow + smooth, np.float32)


def _matches(scan: GrayImage, view: GrayImage) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Places (N, 2) in the scan and in the view of features that are each other's best."""
    finder = cv2.SIFT.create(4000)
    points_1, found_1 = finder.detectAndCompute(scan, None)
    points_2, found_2 = finder.detectAndCompute(view, None)
    none = np.empty((0, 2), np.float32)
    if found_1 is None or found_2 is None or min(len(found_1), len(found_2)) < 2:
        return none, none
    pairs = cv2.BFMatcher(cv2.NORM_L2).knnMatch(found_1, found_2, k=2)
    kept = [best for best, other in pairs if best.distance < _MATCH_RATIO * other.distance]
    if not kept:
        return none, none
    here = np.array([points_1[match.queryIdx].pt for match in kept], np.float32)
    there = np.array([points_2[match.trainIdx].pt for match in kept], np.float32)
    return here, there


def _mean_nearby(flow: Flow, weights: NDArray[np.float32], sigma: float) -> Flow:
    """The flow's weighted mean about each pixel."""
    total = cv2.GaussianBlur(weights, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
    mean = cv2.GaussianBlur(flow * weights[..., None], (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(mean / np.maximum(total, 1e-12)[..., None], np.float32)


def _displaced(image: NDArray[np.generic], flow: Flow) -> NDArray[np.generic]:
    """`image` looked up at each pixel's place plus its flow."""
    height, width = flow.shape[:2]
    grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(np.float32)
    return np.asarray(cv2.remap(image, grid + flow, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def _gray(image: RgbImage) -> GrayImage:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8)


def _resized(image: GrayImage, size: tuple[int, int]) -> GrayImage:
    """To (width, height): averaged where it shrinks, cubic where it grows."""
    method = cv2.INTER_AREA if size[0] < image.shape[1] else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(image, size, interpolation=method), np.uint8)


def _half(image: GrayImage) -> GrayImage:
    blurred = cv2.GaussianBlur(image, (7, 7), 1.0, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(cv2.resize(blurred, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_CUBIC), np.uint8)
