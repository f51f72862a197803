"""Photos that are parts of one photo, whose page is found in all of them together.

Each part by itself shows less of the page, and its principal point is not in its middle: of two crops of a bent page
each got a shape of its own, and letters were doubled where they meet. So the page is that of the part that shows all of
the others, or it is found in the photo that they are pasted into. It is drawn from the parts themselves.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from services.arrays import Homography, Points
from services.contract.rectify import RectifyParameters
from services.errors import NoText, NotOverlapping
from services.geometry.focal_prior import typical_focal_prior
from services.geometry.homographies import transform_points, translation
from services.geometry.page_frame import Frame
from services.mosaic.flat_photo import GRID, FlatPhoto, SeenPage
from services.mosaic.flattening import flattest_view, see_page, view_photo, view_unchanged
from services.mosaic.photo_graph import choose_part, connect_photos
from services.mosaic.placing.joint_sheet import MOST_LEFT
from services.mosaic.placing.part_frame import PartFrame
from services.mosaic.placing.pasting import paste_photos
from services.mosaic.placing.second_matches import match_again
from services.mosaic.placing.similarities import fit_similarities
from services.mosaic.registration.pair_registration import PairRegistration
from services.mosaic.registration.photo_pairs import QUICK_LOOKS, register_photos
from services.notices import Notice
from services.rectify.page_search import find_page
from services.rectify.stage_clock import StageClock
from services.rectify.view.judged_view import CLEARLY_FLATTER
from services.sheet.plane.flat_photo import PhotoAsPage

BESIDE = 0.01
"""Distance, over its diagonal, by which others may reach beyond a photo that shows all of them."""


@dataclass(frozen=True, slots=True, eq=False)
class WholePhoto:
    """The photos by index, in views of the page that they show together, their places on it, and notices of it.

    `pairs` are those of these views.
    """

    photos: Mapping[int, FlatPhoto]
    H_page_flat: Mapping[int, Homography]
    pairs: tuple[PairRegistration, ...]
    notices: tuple[Notice, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """The page as a photo shows it that all others are parts of, as in `FlatPhoto`; their common pixels -> its own."""

    H_photo_common: Homography
    frame: Frame
    page: SeenPage
    sheet: Points | None
    error_percent: float | None
    notices: tuple[Notice, ...]


def find_whole_photo(
    photos: Mapping[int, FlatPhoto], pairs: Sequence[PairRegistration], base: int | None, clock: StageClock
) -> WholePhoto | None:
    """The photos of the page as parts of one; None where they are not, and where that shows no page.

    Photos that each are the page itself, as scans are, stay as they are, and those of which none shows a page. Flat
    views of parts may be too unlike to be registered: photos that the `pairs` do not connect are compared as they are.
    """
    found = _join(photos, photos, pairs, base, clock)
    if len(connect_photos(photos, [(pair.a, pair.b) for pair in pairs])) == 1:
        return found
    with clock.stage("registration"):
        views = {index: view_unchanged(photo) for index, photo in photos.items()}
        again = register_photos(list(views.values()), QUICK_LOOKS)
    if _largest(photos, again) <= _largest(photos, pairs):
        return found
    return _join(photos, views, again, base, clock) or found


def _largest(photos: Mapping[int, FlatPhoto], pairs: Sequence[PairRegistration]) -> int:
    """Number of the photos that the `pairs` connect, of the largest part."""
    return max(map(len, connect_photos(photos, [(pair.a, pair.b) for pair in pairs])))


def _join(
    photos: Mapping[int, FlatPhoto],
    views: Mapping[int, FlatPhoto],
    pairs: Sequence[PairRegistration],
    base: int | None,
    clock: StageClock,
) -> WholePhoto | None:
    """The `photos` that belong to the page by the `pairs` of their `views`."""
    try:
        part, _ = choose_part(connect_photos(views, [(pair.a, pair.b) for pair in pairs]), views, base)
    except NotOverlapping:
        return None
    members = {index: photos[index] for index in part}
    shapes = [photo.page.shape for photo in members.values() if photo.page is not None]
    if all(isinstance(shape, PhotoAsPage) for shape in shapes):
        return None
    within = tuple(pair for pair in pairs if pair.a in part)
    H_common_photo = fit_similarities({index: views[index] for index in part}, within)
    if H_common_photo is None:
        return None
    seen = _shown_by_one(members, H_common_photo) or _shown_together(members, H_common_photo, clock)
    if seen is None or (views is photos and _agree_better(members, within, seen.error_percent)):
        return None
    laid: dict[int, FlatPhoto] = {}
    H_page_flat: dict[int, Homography] = {}
    with clock.stage("framing"):
        for index, photo in members.items():
            frame = _part_of(seen, photo, seen.H_photo_common @ H_common_photo[index])
            if frame is None:
                return None
            laid[index], H_page_flat[index] = _lay(photo, frame, seen)
    return WholePhoto(laid, H_page_flat, match_again(within, views, laid, H_page_flat), seen.notices)


def _agree_better(
    photos: Mapping[int, FlatPhoto], pairs: Sequence[PairRegistration], error_percent: float | None
) -> bool:
    """Whether the flat views agree, each is flat, and the worst clearly has a smaller error than `error_percent`."""
    errors = [photo.error_percent for photo in photos.values() if photo.error_percent is not None]
    if error_percent is None or len(errors) < len(photos) or max(errors) >= CLEARLY_FLATTER * error_percent:
        return False
    if any(notice.code == "not-flat" for photo in photos.values() for notice in photo.notices):
        return False
    for pair in pairs:
        apart = np.linalg.norm(transform_points(pair.H_a_b, pair.points_b) - pair.points_a, axis=1)
        if float(np.median(apart)) > MOST_LEFT * photos[pair.a].text_height_px:
            return False
    return True


def _shown_by_one(photos: Mapping[int, FlatPhoto], H_common_photo: Mapping[int, Homography]) -> _Seen | None:
    """The page of the photo that shows all that the others show, of several of the one with the least error."""
    corners = np.concatenate(
        [transform_points(H_common_photo[index], _grid(photo, 2)) for index, photo in photos.items()]
    )
    found = []
    for index, photo in photos.items():
        own = transform_points(np.linalg.inv(H_common_photo[index]), corners)
        size = np.array(photo.photo.shape[1::-1], np.float64)
        beside = np.maximum(-own, own - (size - 1)).max()
        if photo.page is not None and beside <= BESIDE * np.linalg.norm(size):
            H = np.linalg.inv(H_common_photo[index])
            found.append(_Seen(H, photo.frame, photo.page, photo.sheet, photo.error_percent, photo.notices))
    return min(found, key=lambda seen: seen.error_percent or np.inf, default=None)


def _shown_together(
    photos: Mapping[int, FlatPhoto], H_common_photo: Mapping[int, Homography], clock: StageClock
) -> _Seen | None:
    """The page of the photo that all are pasted into; None where it shows none by its text.

    The photos' Exif tells the focal length of what they are parts of only if they are no crops, so it is not asked.
    """
    with clock.stage("pasting"):
        images = {index: photo.photo for index, photo in photos.items()}
        picture, H_picture_common = paste_photos(images, H_common_photo)
    try:
        page = find_page(picture, RectifyParameters(), None, clock, needs_text=True)
    except NoText:
        return None
    with clock.stage("framing"):
        view = flattest_view(page)
        seen = see_page(view.page, typical_focal_prior())
    return _Seen(H_picture_common, view.frame, seen, view.end.around, view.error_percent, view.notices)


def _part_of(seen: _Seen, photo: FlatPhoto, H_seen_photo: Homography) -> PartFrame | None:
    """The part of the page's view that `photo` shows; None where it shows nothing of it."""
    whole = seen.frame
    frame = PartFrame(whole, np.linalg.inv(H_seen_photo), np.eye(3), whole.width, whole.height)
    last = np.array([whole.width - 1, whole.height - 1])
    flat = frame.to_flat(_grid(photo, GRID)).reshape(GRID, GRID, 2)
    with np.errstate(invalid="ignore"):
        shown = ((flat >= 0) & (flat <= last)).all(axis=-1)
    # The neighbours of what lies within reach beyond the border.
    for axis in (0, 1):
        ahead, back = np.roll(shown, 1, axis), np.roll(shown, -1, axis)
        shown = shown | ahead | back
    shown &= np.isfinite(flat).all(axis=-1)
    if not shown.any():
        return None
    low = np.clip(np.floor(flat[shown].min(axis=0)), 0, last).astype(int)
    high = np.clip(np.ceil(flat[shown].max(axis=0)), 0, last).astype(int)
    width, height = (high - low + 1).tolist()
    return frame.through(translation(float(low[0]), float(low[1])), width, height)


def _lay(photo: FlatPhoto, frame: PartFrame, seen: _Seen) -> tuple[FlatPhoto, Homography]:
    """The photo in its part of the page, and the place of that."""
    scale = float(np.sqrt(np.abs(np.linalg.det(frame.H_part_photo[:2, :2]))))
    laid = view_photo(
        photo.index, photo.photo, frame, seen.page.text_height_px * scale, photo.weight, is_drawn=False
    )
    assert isinstance(laid.frame, PartFrame)
    sheet = None if seen.sheet is None else transform_points(frame.H_part_photo, seen.sheet)
    return (
        replace(laid, sheet=sheet, error_percent=seen.error_percent, page=seen.page),
        laid.frame.H_page_flat,
    )


def _grid(photo: FlatPhoto, count: int) -> Points:
    """Photo pixels (count * count, 2) from corner to corner, row by row."""
    height, width = photo.photo.shape[:2]
    x, y = np.linspace(0, width - 1, count), np.linspace(0, height - 1, count)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
