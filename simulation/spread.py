"""An opened book: two bent pages that meet in a gutter, before one camera."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from simulation.camera import Camera, Pose
from simulation.degradation import Degradation, RgbImage, degrade, desk_texture
from simulation.flat_page import Page, Points
from simulation.photo import Light, simulate_photo
from simulation.scenes import View, fitting_pose
from simulation.surfaces import Cylinder, Points3, Shape
from simulation.truth import Truth


@dataclass(frozen=True, slots=True)
class Moved:
    """`shape` at another place: moved by `offset`, in half page widths of the surface frame."""

    shape: Shape
    offset: tuple[float, float, float]

    def place(self, sheet: Points) -> Points3:
        """See `Shape`."""
        return np.asarray(self.shape.place(sheet) + self.offset)

    def tangents(self, sheet: Points) -> tuple[Points3, Points3]:
        """See `Shape`."""
        return self.shape.tangents(sheet)

    def rulings(self, sheet: Points) -> Points3:
        """See `Shape`."""
        return self.shape.rulings(sheet)

    def meet(self, origin: Points3, directions: Points3) -> Points:
        """See `Shape`."""
        return self.shape.meet(np.asarray(origin - self.offset), directions)


def page_beside_gutter(rise: float, fall: float, *, right: bool) -> Cylinder:
    """A book's page: it leaves the gutter at slope `rise` towards the viewer, and ends at slope `fall` away from him.

    The slope changes as the third power of the distance from the page's outer edge: fast at the gutter.
    """
    a, b = rise / 8, fall / 2
    mirror = 1.0 if right else -1.0
    return Cylinder((0.0, mirror * (b - a), 1.5 * a + b / 2, -mirror * a, a / 4))


@dataclass(frozen=True, slots=True)
class Binding:
    """Light in the gutter: the share `shade` of it is missing, less and less over `reach` half page widths."""

    shade: float = 0.6
    reach: float = 0.08


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedSpread:
    """A photo (H, W, 3) RGB uint8 of two pages, and what is known of each."""

    image: NDArray[np.uint8]
    left: Truth
    right: Truth


def photograph_spread(
    pages: tuple[Page, Page],
    view: View,
    shapes: tuple[Shape, Shape],
    *,
    binding: Binding | None = None,
    lights: tuple[Light, ...] = (Light(),),
    dirt: Degradation | None = None,
    rng: np.random.Generator,
    size: tuple[int, int],
    margin: float = 0.02,
) -> SimulatedSpread:
    """Both pages, left and right, on a desk; `margin` of the photo is left beside them (negative: they are cut off).

    Raises
    ------
    ValueError
        When the pages differ in shape, or one hides part of itself in this view.
    """
    if pages[0].half_height_units != pages[1].half_height_units:
        raise ValueError("the pages of a book have one shape")
    camera = view.camera(*size)
    joined = _join(shapes)
    pose = fitting_pose(view, lambda pose: _outlines(pages, joined, pose, camera), camera, margin)
    image = desk_texture(camera.width, camera.height, rng)
    binding = binding or Binding()
    truths = []
    for page, shape, gutter in zip(pages, joined, (1.0, -1.0), strict=True):
        photo = simulate_photo(page, shape, 0.0, pose, camera, lights=lights, background=image)
        image = _shade(photo.image, photo.truth, gutter, binding)
        truths.append(photo.truth)
    if dirt is not None:
        image = degrade(image, dirt, rng)
    return SimulatedSpread(image, truths[0], truths[1])


def _join(shapes: tuple[Shape, Shape]) -> tuple[Moved, Moved]:
    """Both shapes moved so that the left one's right edge and the right one's left edge are the origin."""
    ends = [shape.place(np.array([[s, 0.0]]))[0] for shape, s in zip(shapes, (1.0, -1.0), strict=True)]
    left, right = (
        Moved(shape, (-float(end[0]), -float(end[1]), -float(end[2])))
        for shape, end in zip(shapes, ends, strict=True)
    )
    return left, right


def _outlines(pages: tuple[Page, Page], shapes: tuple[Moved, Moved], pose: Pose, camera: Camera) -> Points:
    outlines = [
        Truth(page, shape, 0.0, pose, camera).outline() for page, shape in zip(pages, shapes, strict=True)
    ]
    return np.concatenate(outlines)


def _shade(image: RgbImage, truth: Truth, gutter: float, binding: Binding) -> RgbImage:
    """`image` darker on the page, towards its edge at sheet coordinate s = `gutter`."""
    sheet = truth.sheet_lattice().upsampled(0, truth.camera.height)
    edge = np.array([1.0, truth.page.half_height_units], np.float32)
    with np.errstate(invalid="ignore"):
        on_page = (np.abs(sheet) <= edge).all(axis=2)
        away = np.abs(gutter - sheet[..., 0])
    light = np.where(on_page, 1.0 - binding.shade * np.exp(-np.nan_to_num(away) / binding.reach), 1.0)
    return np.asarray(cv2.multiply(image, cv2.merge([light] * 3), dtype=cv2.CV_8U), np.uint8)
