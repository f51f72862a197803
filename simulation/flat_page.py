"""A flat page: its pixels and the truth of its words."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
"""(N, 2) float64, (x, y) pixels, origin at the centre of the top-left pixel."""


@dataclass(frozen=True, slots=True)
class PageWord:
    """A printed word and its box (x0, y0, x1, y1) in page pixels."""

    text: str
    box: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Page:
    """A flat page: `image` (H, W) or (H, W, 3) uint8, dark on light; `lines` in reading order.

    `paper` is the gray value of what a skewed page uncovers inside its frame.
    """

    image: NDArray[np.uint8]
    lines: tuple[tuple[PageWord, ...], ...] = ()
    dpi: float = 300.0
    paper: int = 255
    name: str = "page"

    def __post_init__(self) -> None:
        if self.image.dtype != np.uint8 or self.image.ndim not in (2, 3) or min(self.image.shape[:2]) < 2:
            raise ValueError("a page needs an (H, W) or (H, W, 3) uint8 image")

    @property
    def width(self) -> int:
        """Pixels across."""
        return int(self.image.shape[1])

    @property
    def height(self) -> int:
        """Pixels down."""
        return int(self.image.shape[0])

    @property
    def half_width_px(self) -> float:
        """The unit of length of the surface frame: half of the page's width, pixel edges included."""
        return self.width / 2.0

    @property
    def half_height_units(self) -> float:
        """Half of the page's height in half widths."""
        return self.height / self.width

    def sheet_from_page(self, points: Points, skew_rad: float) -> Points:
        """Page pixels -> sheet: turned by the skew round the centre, in half widths (Appendix A, step 1).

        Positive skew turns the print clockwise as displayed (x right, y down), so that the text's
        direction on the sheet is (cos skew, sin skew).
        """
        centred = (points - self._centre()) / self.half_width_px
        return centred @ _turn(skew_rad).T

    def page_from_sheet(self, sheet: Points, skew_rad: float) -> Points:
        """Inverse of `sheet_from_page`."""
        return (sheet @ _turn(skew_rad)) * self.half_width_px + self._centre()

    def _centre(self) -> Points:
        return np.array([(self.width - 1) / 2.0, (self.height - 1) / 2.0])


def _turn(angle_rad: float) -> NDArray[np.float64]:
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[c, -s], [s, c]])
