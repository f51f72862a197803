"""True size of a page: the proportions of its sheet, and the paper format that they allow.

The aspect of a flat view is metric, its scale is not. So a format follows from the aspect only where the sheet's four
corners were seen and just one format has this aspect within the uncertainty. Formats of the A series share their
aspect; A4 is assumed among them, and the answer says so.
"""

import math
import re
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from services.arrays import Points
from services.geometry.sheet_aspect import SheetAspect

_LEAST_DEVIATION = 0.004
"""On simulated photos with the outline in view."""
_ASSUMED_CAMERA = 0.02
"""Added where nothing shows the focal length of a bent sheet: the foreshortening of a tilted one depends on it."""
_AGREEMENT = 2.5
"""A format fits within this many deviations."""
_MOST_DEVIATION = 0.025
"""Letter and A4 differ by 0.089: beyond this the aspect decides nothing."""
_CROPPED_DEVIATION = 0.08
"""Of pages that a phone's app has cropped, from A4: 17 pages from six phones."""
_FILE_DEVIATION = 0.001
_SCAN_ERROR_MM = 2.0
"""Sides of scans of a format differ from it by less."""
_CERTAIN_FORMAT = 0.95
"""Probability from which on a format is named that a sheet has been given because the photo does not show its
aspect: of 3600 simulated sheets, two fifths of them of no format, 604 were named so, 8 of these wrongly."""


MM_PER_INCH = 25.4
FORMATS: dict[str, tuple[float, float]] = {
    "a3": (297.0, 420.0),
    "a4": (210.0, 297.0),
    "a5": (148.0, 210.0),
    "letter": (215.9, 279.4),
    "legal": (215.9, 355.6),
}
"""Width and height in millimetres, upright."""
CANDIDATES = ("a4", "letter", "legal")
"""Formats of different aspect; A3 and A5 are taken only if the request names them."""
LEAST_TOLD = 0.001
"""A view that was stretched by less is as it was."""
_SIZE = re.compile(r"(\d{1,4}(?:\.\d)?)x(\d{1,4}(?:\.\d)?)(?:mm)?")


@dataclass(frozen=True, slots=True)
class SheetSize:
    """Size of the sheet in millimetres and resolution of the flat view; None for what is not known.

    `source` is "outline" (by the aspect of the sheet), "given", or "file" (by its resolution). `reason` is a sentence
    for people. `aspect` is width over height of the sheet in the view, `aspect_deviation` the standard deviation of its
    logarithm. `stretch` is the factor by which the view's width over its height was changed to fit a given size.
    """

    width_mm: float | None
    height_mm: float | None
    dpi: float | None
    paper: str | None
    source: Literal["outline", "given", "file"] | None
    reason: str
    aspect: float | None = None
    aspect_deviation: float | None = None
    stretch: float | None = None


def parse_size(paper: str) -> tuple[float, float] | None:
    """Width and height in millimetres of a format's name or of `210x297`; None for `auto` and `none`.

    Raises
    ------
    ValueError
        When it is neither.
    """
    if paper in ("auto", "none"):
        return None
    if paper in FORMATS:
        return FORMATS[paper]
    found = _SIZE.fullmatch(paper)
    if found is None or not all(10 <= float(side) <= 5000 for side in found.groups()):
        raise ValueError(
            f"expected auto, none, {', '.join(FORMATS)}, or width x height in millimetres as 210x297 (10 to 5000)"
        )
    return float(found[1]), float(found[2])


def oriented_size(paper: str, aspect: float) -> tuple[float, float] | None:
    """Width and height in millimetres of a size that is given, for a sheet whose width over height is about `aspect`.

    A format's name says nothing of the sheet's direction. None for `auto` and `none`.
    """
    size = parse_size(paper)
    return size if size is None or "x" in paper or (size[0] > size[1]) == (aspect > 1) else (size[1], size[0])


def measure_size(
    paper: str,
    corners: Points | None,
    mesh: NDArray[np.float64],
    width: int,
    height: int,
    *,
    camera_assumed: bool,
    seen: SheetAspect | None = None,
    stretch: float | None = None,
) -> SheetSize:
    """The size of the sheet in a flat view of `width` x `height` pixels.

    Parameters
    ----------
    paper
        `auto`, `none`, a format, or `210x297`.
    corners
        (4, 2) photo pixels, clockwise from the top left of the view; a row is NaN where a corner was not seen.
    mesh
        (rows, columns, 2) photo points of the view.
    camera_assumed
        Whether nothing showed the focal length.
    seen
        How well the aspect is known, if that was computed.
    stretch
        Factor by which the view's width over its height was changed to have the proportions of `paper`; None: it was
        not fitted to them.
    """

    sides = None
    if corners is not None and np.isfinite(corners).all():
        sides = _sides(places_in_view(corners, mesh, width, height))
    size = oriented_size(paper, width / height)
    if size is not None:
        shown = float(width) if sides is None else sides[0]
        reason = "The request names the size."
        if stretch is not None and abs(stretch - 1) >= LEAST_TOLD:
            way = "wider" if stretch > 1 else "higher"
            percent = 100 * (max(stretch, 1 / stretch) - 1)
            reason += f" The view was made {way} by {percent:.1f} % to have its proportions."
        dpi = shown / size[0] * MM_PER_INCH
        return SheetSize(
            *size, dpi, paper, "given", reason, stretch=None if stretch is None else round(stretch, 4)
        )
    if paper == "none":
        return SheetSize(None, None, None, None, None, "The request wants no size.")
    if sides is None:
        return SheetSize(
            None,
            None,
            None,
            None,
            None,
            "The sheet's four corners are not in view, so its proportions are unknown.",
        )
    sheet_width, sheet_height, difference = sides
    aspect = sheet_width / sheet_height
    deviation = math.hypot(_LEAST_DEVIATION, difference)
    if seen is not None:
        # Where the sides are bent a little, their lines meet elsewhere than at the corners. The view may be turned.
        bent = min(abs(math.log(aspect / seen.aspect)), abs(math.log(aspect * seen.aspect)))
        deviation = math.hypot(deviation, seen.log_deviation, bent)
    elif camera_assumed:
        deviation += _ASSUMED_CAMERA
    if seen is not None and seen.likely is not None and seen.probability < _CERTAIN_FORMAT:
        reason = (
            f"The photo shows the sheet's aspect to {100 * deviation:.1f} % only; {seen.likely} is the likeliest "
            f"format, with a probability of {seen.probability:.2f}."
        )
        return SheetSize(None, None, None, None, None, reason, round(aspect, 4), round(deviation, 4))
    return _choose(sheet_width, aspect, deviation)


def size_of_photo(width: int, height: int, dpi: float | None) -> SheetSize:
    """The size of a photo that is the page itself, whose view has `width` x `height` pixels.

    `dpi` is the resolution of the view by the file, if it says one: it gives the size. Else the photo may be squeezed.
    """

    aspect = round(width / height, 4)
    if dpi is None:
        reason = "The photo is the page. Cropping may have changed its proportions; send paper to fit the view to it."
        return SheetSize(None, None, None, None, None, reason, aspect, _CROPPED_DEVIATION)
    size = width / dpi * MM_PER_INCH, height / dpi * MM_PER_INCH
    names = [
        name
        for name, sides in FORMATS.items()
        if max(abs(a - b) for a, b in zip(sorted(size), sorted(sides), strict=True)) < _SCAN_ERROR_MM
    ]
    reason = f"The file's resolution is {dpi:.0f} dpi."
    name = names[0] if names else None
    return SheetSize(round(size[0], 1), round(size[1], 1), dpi, name, "file", reason, aspect, _FILE_DEVIATION)


def _choose(sheet_width: float, aspect: float, deviation: float) -> SheetSize:
    evidence = round(aspect, 4), round(deviation, 4)
    if deviation > _MOST_DEVIATION:
        reason = (
            f"The sheet's aspect is known to {100 * deviation:.1f} % only, too little to tell formats apart."
        )
        return SheetSize(None, None, None, None, None, reason, *evidence)
    upright = min(aspect, 1.0 / aspect)
    fitting = [
        name
        for name in CANDIDATES
        if abs(math.log(upright * FORMATS[name][1] / FORMATS[name][0])) <= _AGREEMENT * deviation
    ]
    if len(fitting) != 1:
        what = "fits no known format" if not fitting else f"fits {' and '.join(fitting)}"
        reason = f"The sheet's aspect, {aspect:.3f} within {100 * deviation:.1f} %, {what}."
        return SheetSize(None, None, None, None, None, reason, *evidence)
    name = fitting[0]
    width_mm, height_mm = FORMATS[name] if aspect <= 1 else FORMATS[name][::-1]
    reason = f"The sheet's aspect, {aspect:.3f} within {100 * deviation:.1f} %, is that of {name} alone."
    if name == "a4":
        reason = reason.replace("a4 alone", "the A series; A4 is assumed (send paper=a3 or a5 for others)")
    return SheetSize(
        width_mm, height_mm, sheet_width / width_mm * MM_PER_INCH, name, "outline", reason, *evidence
    )


def _sides(corners: Points) -> tuple[float, float, float]:
    """Width and height of a quadrilateral (4, 2), and how much opposite sides differ, as a share."""
    lengths = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    across, down = (lengths[0] + lengths[2]) / 2, (lengths[1] + lengths[3]) / 2
    unequal = np.hypot((lengths[0] - lengths[2]) / across, (lengths[1] - lengths[3]) / down)
    return float(across), float(down), float(unequal) / 2


def places_in_view(points: Points, mesh: NDArray[np.float64], width: int, height: int) -> Points:
    """Pixels (N, 2) of the view that show photo `points` (N, 2), by the linear map of the nearest cell of the mesh."""
    rows, columns = mesh.shape[:2]
    origin = mesh[:-1, :-1]
    across, down = mesh[:-1, 1:] - origin, mesh[1:, :-1] - origin
    middles = (mesh[:-1, :-1] + mesh[1:, 1:]) / 2
    known = np.isfinite(middles).all(axis=-1) & np.isfinite(across + down).all(axis=-1)
    if not known.any():
        return np.full(points.shape, np.nan)
    cells = np.argwhere(known)
    _, nearest = cKDTree(middles[known]).query(points)
    found = np.empty(points.shape)
    step = np.array([(width - 1) / (columns - 1), (height - 1) / (rows - 1)])
    for index, (row, column) in enumerate(cells[nearest]):
        jacobian = np.stack([across[row, column], down[row, column]], axis=1)
        offset = np.linalg.lstsq(jacobian, points[index] - origin[row, column], rcond=None)[0]
        found[index] = (np.array([column, row]) + offset) * step
    return found
