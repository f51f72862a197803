"""Screenshots that continue one another: photos whose overlaps have the same pixels, some whole pixels apart.

They are joined as they are. To place them by fractions of a pixel, to even out their light and to crop them would only
blur, tint and cut what is exact.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from services.arrays import RgbImage
from services.geometry.homographies import translation
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.light.tones import ToneMap
from services.mosaic.placed_photo import PlacedPhoto
from services.mosaic.placing.placed_part import PlacedPart
from services.mosaic.placing.placement import Placement
from services.mosaic.registration.pair_registration import PairRegistration
from services.sheet.plane.framing import FlatFrame

Shift = tuple[int, int]
"""Columns and rows."""
REACH_PX = 1.0
"""Distance of the shifts that matched blocks show from their median, in the median, up to which they are one shift."""
SAME_SHARE = 0.6
"""Least share of the pixels at contours that are equal in both photos: a bar that stays in its place, a clock and a
mouse pointer differ. Of pages that were scanned twice 0.14 are equal at a noise of half a level, of screenshots as
JPEG of quality 95 0.34, of a page and itself one pixel below up to 0.41."""
MOST_GROWTH = 1.2
"""A page that is larger than the placed one by this has more pixels than a mosaic may have."""
TIE = np.float32(1e-3)
"""Weight of the distances from all borders, where those from the nearest one are equal."""
UNCHANGED = np.array([[[1, 1, 1, 1, 0, 0]]], np.float32)
"""Coefficients of tones."""


@dataclass(frozen=True, slots=True, eq=False)
class JoinedPhotos:
    """The page (H, W, 3), white where no photo shows it, and the photos with their places on it."""

    image: RgbImage
    placed: tuple[PlacedPhoto, ...]


def join_whole_pixels(flats: Mapping[int, FlatPhoto], part: PlacedPart) -> JoinedPhotos | None:
    """The page of the photos of `part`, if they differ by shifts of whole pixels; else None.

    Bars at the borders of screenshots stay in their place while the page moves, so each pixel is taken from the photo
    in which it is farthest from the border.
    """
    if not all(isinstance(flats[index].frame, FlatFrame) for index in part.placements):
        return None
    shifts = _spread_shifts(part.base, _shifts_of_pairs(flats, part.pairs))
    if set(shifts) != set(part.placements):
        return None
    order = sorted(shifts)
    starts = np.array([shifts[index] for index in order])
    ends = starts + [flats[index].photo.shape[1::-1] for index in order]
    low = starts.min(axis=0)
    width, height = (int(v) for v in ends.max(axis=0) - low)
    if width * height > MOST_GROWTH * part.width * part.height:
        return None
    places = [(int(x), int(y)) for x, y in starts - low]
    photos = [flats[index] for index in order]
    image = _paint([flat.photo for flat in photos], places, (width, height))
    return JoinedPhotos(image, tuple(_place(flat, *at) for flat, at in zip(photos, places, strict=True)))


def _paint(photos: Sequence[RgbImage], places: Sequence[Shift], size: tuple[int, int]) -> RgbImage:
    """Page of `size` (width, height), each pixel from the photo in which it is farthest from the border."""
    page = np.full((size[1], size[0], 3), 255, np.uint8)
    farthest = np.full(page.shape[:2], -1.0, np.float32)
    for photo, (x, y) in zip(photos, places, strict=True):
        height, width = photo.shape[:2]
        at = slice(y, y + height), slice(x, x + width)
        across = np.minimum(np.arange(width), np.arange(width)[::-1]).astype(np.float32)
        down = np.minimum(np.arange(height), np.arange(height)[::-1]).astype(np.float32)[:, None]
        inset = np.minimum(across, down) + TIE * (across + down)
        chosen = inset > farthest[at]
        page[at][chosen], farthest[at][chosen] = photo[chosen], inset[chosen]
    return page


def _place(flat: FlatPhoto, x: int, y: int) -> PlacedPhoto:
    """The photo with its first pixel at (x, y) of the page."""
    assert isinstance(flat.frame, FlatFrame)
    placement = Placement(translation(x, y) @ flat.frame.H_photo_flat)
    return PlacedPhoto(flat, placement, ToneMap(UNCHANGED, flat.frame.width, flat.frame.height))


def _shifts_of_pairs(
    flats: Mapping[int, FlatPhoto], pairs: Sequence[PairRegistration]
) -> dict[tuple[int, int], Shift]:
    """Place of photo b in the pixels of photo a, for each pair (a, b) with the same pixels in its overlap."""
    found = {}
    for pair in pairs:
        a, b = flats[pair.a], flats[pair.b]
        apart = a.to_photo(pair.points_a) - b.to_photo(pair.points_b)
        usual = np.median(apart, axis=0)
        if float(np.median(np.abs(apart - usual))) > REACH_PX:
            continue
        shift = round(float(usual[0])), round(float(usual[1]))
        if same_share(a.photo, b.photo, shift) >= SAME_SHARE:
            found[pair.a, pair.b] = shift
    return found


def _spread_shifts(base: int, pairs: Mapping[tuple[int, int], Shift]) -> dict[int, Shift]:
    """Place of each photo that the `pairs` connect with the base, in its pixels; none where two ways disagree."""
    places = {base: (0, 0)}
    waiting = [base]
    while waiting:
        here = waiting.pop()
        for (a, b), (x, y) in pairs.items():
            if here not in (a, b):
                continue
            there, sign = (b, 1) if here == a else (a, -1)
            place = places[here][0] + sign * x, places[here][1] + sign * y
            if there not in places:
                places[there] = place
                waiting.append(there)
            elif places[there] != place:
                return {}
    return places


def same_share(a: RgbImage, b: RgbImage, shift: Shift) -> float:
    """Share (0-1) of the pixels at contours of `a` that `b`, whose first pixel lies at `shift` in `a`, has too."""
    x, y = shift
    left, top = max(x, 0), max(y, 0)
    right, bottom = min(a.shape[1], x + b.shape[1]), min(a.shape[0], y + b.shape[0])
    if right - left < 2 or bottom <= top:
        return 0.0
    own, other = a[top:bottom, left:right], b[top - y : bottom - y, left - x : right - x]
    contour = (own[:, 1:] != own[:, :-1]).any(axis=2)
    same = (own[:, 1:] == other[:, 1:]).all(axis=2)
    return float(same[contour].mean()) if contour.any() else 0.0
