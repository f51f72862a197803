"""Places that a photo of a page and a flat scan of it share, to a fraction of a pixel."""

import cv2
import numpy as np

from services.arrays import Floats, GrayImage, Mask, Points, RgbImage

_WIDTH_PX = 1240
"""Of the sheet's short side in both pictures while they are matched: 150 dpi of A4."""
_FEATURES = 6000
_RATIO = 0.8
_INLIER_PX = 12.0
_PATCH_PX, _SEARCH_PX, _STEP_PX = 24, 14, 16
_LEAST_CONTRAST = 18.0
_LEAST_SCORE, _LEAST_LEAD = 0.6, 0.08
"""A patch is found where its correlation is at least the first, and that of any other place is lower by the second."""
_PAPER = 230.0
_FEWEST = 50


def match_scan(photo: RgbImage, scan: RgbImage) -> tuple[Points, Points]:
    """Points (N, 2) of the photo, and of the scan, that show the same print; none where the two do not match.

    Features give a homography; then patches of the scan are found in the photo seen through it. Strays from a smooth
    (cubic) field are left out.
    """
    seen, seen_factor = _even(photo)
    flat, flat_factor = _even(scan)
    H = _homography(seen, flat)
    if H is None:
        return np.zeros((0, 2)), np.zeros((0, 2))
    through = cv2.warpPerspective(seen, H, flat.shape[::-1], borderValue=_PAPER)
    at, found = _find_patches(flat, through)
    kept = _smooth(at, found, flat.shape[1])
    back = cv2.perspectiveTransform(found[kept][None], np.linalg.inv(H))[0]
    return np.asarray(back / seen_factor, np.float64), np.asarray(at[kept] / flat_factor, np.float64)


def _even(picture: RgbImage) -> tuple[GrayImage, float]:
    """The picture in gray, evenly lit, at the size for matching; and the factor of its size."""
    gray = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    factor = _WIDTH_PX / min(gray.shape)
    small = cv2.resize(
        gray, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
    )
    light = cv2.medianBlur(cv2.morphologyEx(small, cv2.MORPH_CLOSE, np.ones((25, 25), np.uint8)), 31)
    even = np.clip(small / np.maximum(light.astype(np.float32), 1.0) * _PAPER, 0, 255)
    return even.astype(np.uint8), factor


def _homography(seen: GrayImage, flat: GrayImage) -> Floats | None:
    """Map (3, 3) of pixels of `seen` to those of `flat` by matched features."""
    sift = cv2.SIFT_create(_FEATURES)  # type: ignore[attr-defined]
    (here, seen_features), (there, flat_features) = (
        sift.detectAndCompute(image, None) for image in (seen, flat)
    )
    pairs = cv2.BFMatcher().knnMatch(seen_features, flat_features, k=2)
    good = [first for first, second in pairs if first.distance < _RATIO * second.distance]
    if len(good) < _FEWEST:
        return None
    source = np.array([here[match.queryIdx].pt for match in good], np.float32)
    target = np.array([there[match.trainIdx].pt for match in good], np.float32)
    H, _ = cv2.findHomography(source, target, cv2.USAC_MAGSAC, _INLIER_PX, maxIters=20000)
    return None if H is None else np.asarray(H, np.float64)


def _find_patches(flat: GrayImage, through: GrayImage) -> tuple[Points, Points]:
    """Centres (N, 2) of patches of `flat`, and where they are in `through`, which is nearly the same picture."""
    places: list[tuple[float, float]] = []
    found: list[tuple[float, float]] = []
    rim = _PATCH_PX + _SEARCH_PX
    for y in range(rim, flat.shape[0] - rim, _STEP_PX):
        for x in range(rim, flat.shape[1] - rim, _STEP_PX):
            patch = flat[y - _PATCH_PX : y + _PATCH_PX, x - _PATCH_PX : x + _PATCH_PX]
            if patch.std() < _LEAST_CONTRAST:
                continue
            scores = cv2.matchTemplate(
                through[y - rim : y + rim, x - rim : x + rim], patch, cv2.TM_CCOEFF_NORMED
            )
            best = _clear_peak(scores)
            if best is not None:
                places.append((x, y))
                found.append((x - _SEARCH_PX + best[0], y - _SEARCH_PX + best[1]))
    return np.array(places, np.float64).reshape(-1, 2), np.array(found, np.float64).reshape(-1, 2)


def _clear_peak(scores: Floats) -> tuple[float, float] | None:
    """Place (x, y) of the peak of `scores`, to a fraction of a pixel; None if it is low, at the border or not alone."""
    _, score, _, (x, y) = cv2.minMaxLoc(scores)
    if score < _LEAST_SCORE or not (0 < x < scores.shape[1] - 1 and 0 < y < scores.shape[0] - 1):
        return None
    others = scores.copy()
    cv2.circle(others, (x, y), 4, -1.0, -1)
    if others.max() > score - _LEAST_LEAD:
        return None

    def vertex(before: float, after: float) -> float:
        curve = before - 2 * score + after
        return 0.0 if curve == 0 else 0.5 * (before - after) / curve

    return x + vertex(scores[y, x - 1], scores[y, x + 1]), y + vertex(scores[y - 1, x], scores[y + 1, x])


def _smooth(at: Points, found: Points, width: int) -> Mask:
    """Which displacements (N,) from `at` to `found` (N, 2) follow a cubic field."""
    x, y = ((at - at.mean(axis=0)) / width).T
    terms = np.stack([x**i * y**j for i in range(4) for j in range(4 - i)], axis=1)
    moved, kept = found - at, np.ones(len(at), bool)
    for _ in range(8):
        field = np.linalg.lstsq(terms[kept], moved[kept], rcond=None)[0]
        off = np.linalg.norm(moved - terms @ field, axis=1)
        kept = off < max(4.5 * float(np.median(off[kept])), 0.6)
    return np.asarray(kept)
