"""Views whose corners are given points of the photo, and what lies around a view."""

from dataclasses import dataclass, replace

import numpy as np

from services.arrays import Floats, Homography, Points
from services.geometry.homographies import transform_points, translation
from services.geometry.page_frame import Frame, turn_frame

STEP_PX = 1.0
"""By which the slope of a view is measured at its border."""


def corners_of_view(width: int, height: int) -> Points:
    """Pixels (4, 2) at the corners of a view, clockwise from its top left."""
    right, bottom = width - 1.0, height - 1.0
    return np.array([[0.0, 0.0], [right, 0.0], [right, bottom], [0.0, bottom]])


def end_at_corners(frame: Frame, corners: Points, size: tuple[int, int] | None = None) -> Frame:
    """The view of the same page whose corners show the photo points `corners` (4, 2), clockwise from its top left.

    Without a `size` (width, height) its sides are as long as the sheet's in `frame`, in the mean of two opposite ones.
    """
    seen = frame.to_flat(corners)
    top, right, bottom, left = np.linalg.norm(np.roll(seen, -1, axis=0) - seen, axis=1)
    width, height = size or (max(round((top + bottom) / 2) + 1, 2), max(round((left + right) / 2) + 1, 2))
    return frame.through(_four_points(corners_of_view(width, height), seen), width, height)


def hold_corners(frame: Frame, corners: Points) -> Frame:
    """`frame`, turned so that the first of the photo points `corners` (4, 2) is at the top left; they are a rectangle.

    It is the nearest one to where they were seen: of the same middle, its sides their mean lengths.
    """
    seen = frame.to_flat(corners)
    ahead = np.roll(seen, -1, axis=0) - seen
    quarters = round(float(np.arctan2(*(ahead[0] - ahead[2])[::-1])) / (np.pi / 2)) % 4
    top, right, bottom, left = np.linalg.norm(ahead, axis=1)
    half = np.array([(top + bottom) / 4, (left + right) / 4])
    rectangle = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * half
    for _ in range(quarters):
        rectangle = np.column_stack([-rectangle[:, 1], rectangle[:, 0]])
    H_old_new = _four_points(seen.mean(axis=0) + rectangle, seen)
    held = frame.through(H_old_new, frame.width, frame.height)
    return turn_frame(held, -90 * quarters % 360, mirrored=False)


def _four_points(here: Points, there: Points) -> Homography:
    """The homography that maps four points (4, 2) to four others; in double precision, which OpenCV's is not."""
    scale = max(float(np.abs(here).max()), 1.0)
    rows = []
    for (x, y), (u, v) in zip(here / scale, there / scale, strict=True):
        rows.append([x, y, 1, 0, 0, 0, -u * x, -u * y])
        rows.append([0, 0, 0, x, y, 1, -v * x, -v * y])
    h = np.linalg.solve(np.array(rows), (there / scale).ravel())
    H = np.append(h, 1.0).reshape(3, 3)
    return np.asarray(np.diag([scale, scale, 1.0]) @ H @ np.diag([1 / scale, 1 / scale, 1.0]), np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class WidenedFrame:
    """The view `inner` of a bent page with `margin` pixels around it, in which the page goes on straight.

    `H_inner_flat` leads from pixels of this view to those of `inner`.
    """

    inner: Frame
    H_inner_flat: Homography
    width: int
    height: int

    @property
    def H_photo_flat(self) -> None:
        """See `Frame`."""

    def to_photo(self, pixels: Points) -> Points:
        """See `Frame`."""
        at = transform_points(self.H_inner_flat, pixels)
        end = np.array([self.inner.width - 1.0, self.inner.height - 1.0])
        near = np.clip(at, 0.0, end)
        beyond = at - near
        seen = self.inner.to_photo(near)
        out = np.flatnonzero((beyond != 0).any(axis=1))
        if len(out):
            seen = np.array(seen)
            seen[out] += self._slope(near[out], end, beyond[out])
        return seen

    def _slope(self, near: Points, end: Points, beyond: Points) -> Floats:
        """By how much the photo point moves on `beyond` the border points `near` (N, 2)."""
        moved = np.zeros_like(near)
        for axis in (0, 1):
            inward = np.where(near[:, axis] > 0.5 * end[axis], -STEP_PX, STEP_PX)
            step = np.zeros_like(near)
            step[:, axis] = inward
            slope = (self.inner.to_photo(near + step) - self.inner.to_photo(near)) / inward[:, None]
            moved += slope * beyond[:, axis, None]
        return moved

    def to_flat(self, photo: Points) -> Points:
        """See `Frame`; where the page goes on straight it is not known."""
        return transform_points(np.linalg.inv(self.H_inner_flat), self.inner.to_flat(photo))

    def through(self, H_old_new: Homography, width: int, height: int) -> "WidenedFrame":
        """See `Frame`."""
        return replace(self, H_inner_flat=self.H_inner_flat @ H_old_new, width=width, height=height)


def with_margin(frame: Frame, percent: float) -> Frame:
    """The view with `percent` of its width around it."""
    if percent <= 0:
        return frame
    margin = round(percent / 100 * frame.width)
    H_old_new = translation(-float(margin), -float(margin))
    width, height = frame.width + 2 * margin, frame.height + 2 * margin
    if frame.H_photo_flat is not None:
        return frame.through(H_old_new, width, height)
    return WidenedFrame(frame, H_old_new, width, height)
