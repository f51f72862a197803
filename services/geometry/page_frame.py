"""Views of a flat page: what a frame offers, how far it reaches, and how it is turned and resized."""

from typing import Protocol, Self, TypeVar

import numpy as np
from scipy.ndimage import distance_transform_edt

from services.arrays import Floats, Homography, Points
from services.geometry.homographies import resizing

# Sizes relative to the photo, the text, or the text height.
TEXT_MARGIN = 2.5
"""Text heights that are kept round the text in any case."""
PAPER_MARGIN = 0.01
"""Of the paper's size, so that its edge is not shaved."""
DETAIL_PERCENTILE = 85.0
"""This share of the text keeps all its pixels; what was nearer to the camera is reduced a little."""
MAX_GROWTH = 1.6
"""Output pixels over photo pixels."""
SMALL_PRINT_PX = 18.0
"""Text height up to which print is drawn with more pixels than it has in the photo: on ten photos of 1 megapixel
it was read 1 to 12 points better."""
MAX_ENLARGEMENT = 2.0
SMALL_VIEW_PX = 4e6
"""Pixels of a view that are always allowed."""
LONGEST_SIDE_PX = 20000.0
"""Longest side of a view; OpenCV remaps no more than 32767 pixels."""


class Frame(Protocol):
    """A view of the flat page: the output's size, and where in the photo each of its pixels is."""

    @property
    def width(self) -> int:
        """Output columns."""

    @property
    def height(self) -> int:
        """Output rows."""

    def to_photo(self, pixels: Points) -> Points:
        """Photo pixels (N, 2) of output pixels (N, 2)."""

    @property
    def H_photo_flat(self) -> Homography | None:
        """From output pixels to photo pixels, where this is a homography: on a flat page."""

    def to_flat(self, photo: Points) -> Points:
        """Output pixels (N, 2) of photo pixels (N, 2)."""

    def through(self, H_old_new: Homography, width: int, height: int) -> Self:
        """The same page in other pixels: the view whose pixel p shows what pixel `H_old_new` p showed."""


AnyFrame = TypeVar("AnyFrame", bound=Frame)


def within_bounds(resolution: float, extent: tuple[float, float], photo_pixels: int) -> float:
    """`resolution`, in pixels a unit of the page, or less if a view of this `extent` (width, height) is too large."""
    width, height = extent
    return min(
        resolution,
        float(np.sqrt(MAX_GROWTH * photo_pixels / (width * height))),
        LONGEST_SIDE_PX / max(extent),
    )


def turning(width: int, height: int, rotation_deg: int, mirrored: bool) -> tuple[Homography, int, int]:
    """H_old_new of a view flipped left to right if `mirrored`, then turned clockwise, and its new width and height."""
    turn = np.eye(3)
    if mirrored:
        turn = turn @ np.array([[-1.0, 0.0, width - 1], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    for _ in range(rotation_deg // 90 % 4):
        # Output (x, y) of a clockwise quarter turn shows (y, height - 1 - x) of the view before.
        turn = turn @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, height - 1], [0.0, 0.0, 1.0]])
        width, height = height, width
    return turn, width, height


def turn_frame(frame: AnyFrame, rotation_deg: int, mirrored: bool) -> AnyFrame:
    """The view flipped left to right if `mirrored`, then turned clockwise by a multiple of 90 degrees."""
    return frame.through(*turning(frame.width, frame.height, rotation_deg, mirrored))


def resize_frame(frame: AnyFrame, factor: float) -> AnyFrame:
    """The same view with `factor` times the pixels on a side."""
    width, height = max(round(frame.width * factor), 1), max(round(frame.height * factor), 1)
    return frame.through(np.linalg.inv(resizing(factor)), width, height)


def restore_detail(frame: AnyFrame, photo_pixels: int, characters: Points, text_height_px: float) -> AnyFrame:
    """Raise the resolution of `frame` to that of the photo, and above it where print is small.

    A view that was larger before it was cut may have been reduced. Small print loses detail by every resampling, less
    so if it is drawn with more pixels than the photo has, which are `photo_pixels`. `characters` (N, 2) are their
    centres in the photo. `frame` itself is returned if its resolution is right.
    """
    at = frame.to_flat(characters)
    at = at[np.isfinite(at).all(axis=1)]
    if not len(at):
        return frame
    steps = [frame.to_photo(at + d) for d in np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])]
    a, b = steps[1] - steps[0], steps[2] - steps[0]
    with np.errstate(invalid="ignore"):
        lost = np.sqrt(np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
    growth = float(np.nanpercentile(lost, DETAIL_PERCENTILE))
    enlargement = float(np.clip(SMALL_PRINT_PX / max(text_height_px, 1.0), 1.0, MAX_ENLARGEMENT))
    growth *= enlargement
    pixels = max(MAX_GROWTH * photo_pixels, SMALL_VIEW_PX if enlargement > 1 else 0.0)
    room = np.sqrt(pixels / (frame.width * frame.height))
    growth = min(growth, float(room), LONGEST_SIDE_PX / max(frame.width, frame.height))
    return resize_frame(frame, growth) if growth > 1.0 else frame


def mesh_of(frame: Frame, columns: int = 49, rows: int = 65) -> Floats:
    """Mesh (rows, columns, 2) of photo points over the output, corner to corner.

    A node beyond what the page's model knows takes the photo point of the nearest node within.
    """
    x, y = np.linspace(0, frame.width - 1, columns), np.linspace(0, frame.height - 1, rows)
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    mesh = frame.to_photo(grid.reshape(-1, 2)).reshape(rows, columns, 2)
    return fill_unknown(mesh)


def turn_against_photo(mesh: Floats) -> float:
    """Clockwise turn of a view against the photo, degrees from 0 to 360: the mean over its `mesh` (rows, columns, 2).

    A mirrored view is compared with the mirrored photo.
    """
    along = (mesh[:, -1] - mesh[:, 0]).mean(axis=0) / (mesh.shape[1] - 1)
    down = (mesh[-1] - mesh[0]).mean(axis=0) / (mesh.shape[0] - 1)
    if along[0] * down[1] - along[1] * down[0] < 0:
        along, down = along * [-1, 1], down * [-1, 1]
    # The rotation that is nearest to both axes of the view in the photo; of a view one pixel wide, to the other one.
    along, down = (axis / max(float(np.linalg.norm(axis)), 1e-12) for axis in (along, down))
    turned = np.arctan2(along[1] - down[0], along[0] + down[1])
    return float(np.degrees(-turned) % 360)


def turn_as_in_photo(turned_deg: float) -> int:
    """The turn in right angles after which a view that is turned by `turned_deg` against its photo lies as it does."""
    return -90 * round(turned_deg / 90) % 360


def fill_unknown(mesh: Floats) -> Floats:
    """`mesh` (rows, columns, 2) with the nearest known node's point where a node is not finite."""
    unknown = ~np.isfinite(mesh).all(axis=-1)
    if unknown.any() and not unknown.all():
        nearest = distance_transform_edt(unknown, return_distances=False, return_indices=True)
        mesh = mesh[nearest[0], nearest[1]]
    return np.asarray(np.nan_to_num(mesh))
