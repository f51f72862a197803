"""What is remembered of a camera: the focal length that its pages have shown."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

CAMERA_PATTERN = r"^([A-Za-z0-9][A-Za-z0-9 ._-]{0,99})?$"
"""Names of cameras: a client's token, or what EXIF says. An empty field of a form counts as absent."""
FEWEST_PHOTOS = 3
"""Photos from which on a camera's focal length decides."""
MOST_PHOTOS = 24
"""Of a camera, of which the focal length is kept; the newest."""
CLEAR_DEVIATION = 0.1
"""A page shows the focal length well if its logarithm has a smaller standard deviation."""
LEAST_DEVIATION = 0.01
"""Focusing on near pages changes the focal length by 1 to 2 %."""
_SPREAD = 0.01
"""Standard deviation from photo to photo, in addition to that of each page."""
_ROUNDS = 12


@dataclass(frozen=True, slots=True)
class CameraMemory:
    """The focal length of a camera, from `photos` photos.

    `log_focal` is the logarithm of the focal length over half the photo's diagonal, `deviation` its standard deviation.
    """

    name: str
    log_focal: float
    deviation: float
    photos: int


def find_camera(cameras: Sequence[CameraMemory], name: str | None) -> CameraMemory | None:
    """What is remembered of the camera of this name; None if nothing is."""
    return next((memory for memory in cameras if memory.name == name), None)


def remember(name: str, seen: Sequence[tuple[float, float]]) -> CameraMemory:
    """Robust mean of what the pages of a camera have shown: pairs (log focal length, its standard deviation).

    Cauchy weights, from the weighted median on: a zoomed or cropped photo among them does not count.
    """
    variances = [deviation**2 + _SPREAD**2 for _, deviation in seen]
    mean = _weighted_median([value for value, _ in seen], [1 / v for v in variances])
    weights = [1 / v for v in variances]
    for _ in range(_ROUNDS):
        weights = [
            1 / (v * (1 + (value - mean) ** 2 / (4 * v)))
            for (value, _), v in zip(seen, variances, strict=True)
        ]
        mean = sum(w * value for w, (value, _) in zip(weights, seen, strict=True)) / sum(weights)
    spread = sum(w * (value - mean) ** 2 for w, (value, _) in zip(weights, seen, strict=True)) / sum(weights)
    count = sum(weights) ** 2 / sum(w * w for w in weights)
    deviation = math.sqrt(max(1 / sum(weights), spread / count))
    return CameraMemory(name, mean, max(deviation, LEAST_DEVIATION), len(seen))


def _weighted_median(values: Sequence[float], weights: Sequence[float]) -> float:
    half, passed = sum(weights) / 2, 0.0
    for value, weight in sorted(zip(values, weights, strict=True)):
        passed += weight
        if passed >= half:
            return value
    return values[-1]
