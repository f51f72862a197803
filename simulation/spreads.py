"""An opened book: two pages on one surface, each with the truth of its own."""

from dataclasses import dataclass, replace

import numpy as np

from simulation.degradation import Degradation
from simulation.flat_page import Page, PageWord, Points
from simulation.folded import Crease, Folded
from simulation.photo import SimulatedPhoto
from simulation.scenes import View
from simulation.sheets import Staging, take_photo
from simulation.surfaces import Points3, Shape
from simulation.truth import Truth

SPREAD_SIZE = (3400, 2500)
"""Width and height of the photos, px."""
SPREAD_VIEWS = (
    View("1", 2300.0, 8.0, 80.0, -2.0),
    View("2", 2700.0, 15.0, 270.0, 3.0),
    View("3", 2100.0, 12.0, 120.0, 1.0),
    View("4", 2500.0, 20.0, 75.0, -4.0),
    View("5", 2400.0, 10.0, 200.0, 5.0),
)
"""Over the foot of the book, mostly."""


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a sheet as a sheet of its own: its `centre` on the whole, and its unit of length in the whole's."""

    whole: Shape
    centre: tuple[float, float]
    scale: float

    def place(self, sheet: Points) -> Points3:
        """See `Shape`; in the part's units, about the whole's centre."""
        return self.whole.place(self._on_whole(sheet)) / self.scale

    def tangents(self, sheet: Points) -> tuple[Points3, Points3]:
        """See `Shape`."""
        return self.whole.tangents(self._on_whole(sheet))

    def rulings(self, sheet: Points) -> Points3:
        """See `Shape`."""
        return self.whole.rulings(self._on_whole(sheet))

    def meet(self, origin: Points3, directions: Points3) -> Points:
        """See `Shape`."""
        met = self.whole.meet(origin * self.scale, directions)
        part: Points = (met - np.array(self.centre)) / self.scale
        return part

    def _on_whole(self, sheet: Points) -> Points:
        whole: Points = np.array(self.centre) + self.scale * sheet
        return whole


def bind(left: Page, right: Page) -> Page:
    """Two pages of one size side by side, the words of the left one first.

    Raises
    ------
    ValueError
        When their sizes differ.
    """
    if left.image.shape != right.image.shape:
        raise ValueError("the two pages of a book are of one size")
    moved = tuple(
        tuple(PageWord(word.text, _shifted(word.box, left.width)) for word in line) for line in right.lines
    )
    image = np.concatenate([left.image, right.image], axis=1)
    return Page(image, left.lines + moved, left.dpi, left.paper, f"{left.name}+{right.name}")


def page_truths(spread: Truth, left: Page, right: Page) -> tuple[Truth, Truth]:
    """Of the photo of `bind(left, right)`, not skewed: each page's own, in the same camera."""
    half = 0.5
    away = np.array(spread.pose.translation) / half
    pose = replace(spread.pose, translation=(float(away[0]), float(away[1]), float(away[2])))
    first, second = (
        Truth(page, Part(spread.shape, (side * half, 0.0), half), 0.0, pose, spread.camera)
        for page, side in ((left, -1), (right, 1))
    )
    return first, second


def photograph_spread(
    left: Page,
    right: Page,
    view: View,
    book: Shape,
    staging: Staging,
    *,
    dirt: Degradation | None = None,
    rng: np.random.Generator,
    only: int | None = None,
    size: tuple[int, int] = SPREAD_SIZE,
) -> tuple[SimulatedPhoto, SimulatedPhoto]:
    """A photo (size: width, height) of an opened book, once with the truth of its left and once of its right page.

    With `only` (0: left, 1: right) that page alone is there, in the same place and camera.

    Raises
    ------
    ValueError
        When the pages differ in size, or the book hides part of itself in this view.
    """
    spread = bind(left, right)
    camera = view.camera(*size)
    truth = Truth(spread, book, 0.0, view.pose(spread, book, camera, staging.margin), camera)
    truths = page_truths(truth, left, right)
    image = take_photo(truth if only is None else truths[only], staging, dirt, rng).image
    return SimulatedPhoto(image, truths[0]), SimulatedPhoto(image, truths[1])


def opened_book(
    gutter_deg: float, left_deg: float, right_deg: float, *, radius: float = 0.4, sag: float = 0.1
) -> Folded:
    """Two pages that rise steeply out of their gutter and level out; unit of length: one page's width.

    `gutter_deg` is the angle by which the paper turns in the gutter, `left_deg` and `right_deg` what each page
    bends back on its `radius`; `sag` is how far each falls towards its outer edge.
    """
    creases = (
        Crease(-0.3, -float(np.radians(left_deg)), radius),
        Crease(0.0, float(np.radians(gutter_deg)), 0.0),
        Crease(0.3, -float(np.radians(right_deg)), radius),
    )
    slope = float(np.radians(right_deg * gutter_deg / (left_deg + right_deg)))
    return Folded(creases, 0.0, slope, (-sag, 0.0, 0.0, -sag), 1.0)


def _shifted(box: tuple[float, float, float, float], shift: float) -> tuple[float, float, float, float]:
    return box[0] + shift, box[1], box[2] + shift, box[3]
