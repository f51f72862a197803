"""Options of a rectification that can only be checked against the pages and the photo."""

from dataclasses import replace

import cv2
import numpy as np

from services.arrays import Points
from services.contract.rectify import RectifyParameters
from services.errors import InvalidOption
from services.geometry.hulls import corner_turns

SHORTEST_SIDE = 0.02
"""Of the photo's diagonal: the side of a given sheet; a shorter one shows no print."""
LEAST_TURN = float(np.sin(np.deg2rad(3.0)))
"""Sine of the turn at a corner of a sheet; three corners in a line are those of no view of one."""


def parameters_of_page(parameters: RectifyParameters, index: int, count: int) -> RectifyParameters:
    """The options of one of `count` pages.

    Raises
    ------
    InvalidOption
        When `corners` or `rotate` have not one entry for each page.
    """
    for name, entries, unknown in (
        ("corners", parameters.corners, "null"),
        ("rotate", parameters.rotate, "auto"),
    ):
        one_for_all = not entries or (name == "rotate" and len(entries) == 1)
        if len(entries) != count and not one_for_all:
            pages = "1 page" if count == 1 else f"{count} pages"
            raise InvalidOption(
                f"{name}: {len(entries)} entries were sent for {pages}; send one for each page, {unknown} where it is "
                "to be found.",
                name,
            )
    return replace(
        parameters,
        corners=parameters.corners and (parameters.corners[index],),
        rotate=parameters.rotate if len(parameters.rotate) == 1 else (parameters.rotate[index],),
        on_no_text=parameters.on_no_text or ("refuse" if count == 1 else "keep"),
    )


def check_parameters(width: int, height: int, parameters: RectifyParameters) -> None:
    """Check the focal length, the region and the corners against the size of the photo.

    Raises
    ------
    InvalidOption
        When the focal length is not plausible, the region lies outside of the photo or has no area, or the corners are
        those of no sheet that a photo can show.
    """
    diagonal = float(np.hypot(width, height))
    if parameters.focal_length_px is not None and not 0.15 < parameters.focal_length_px / diagonal < 15.0:
        raise InvalidOption(
            f"focal_length_px: {parameters.focal_length_px:g} is not believable for a photo of {width} x {height} "
            f"pixels; expected {0.15 * diagonal:.0f} to {15 * diagonal:.0f}.",
            "focal_length_px",
        )
    if parameters.region is not None:
        corners = np.array(parameters.region)
        beside = (corners.max(axis=0) < 0).any() or (corners.min(axis=0) > [width - 1, height - 1]).any()
        if beside:
            raise InvalidOption("region: the polygon lies outside of the photo.", "region")
        if cv2.contourArea(corners.astype(np.float32)) <= 0:
            raise InvalidOption("region: the polygon has no area; send points round the text.", "region")
    if parameters.page_corners is not None:
        _check_corners(np.array(parameters.page_corners), width, height)


def _check_corners(corners: Points, width: int, height: int) -> None:
    """Check that `corners` (4, 2) are on the photo, in their order, and neither cross nor coincide."""
    reason = ""
    turns, lengths = corner_turns(corners), np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    sines = turns / np.maximum(np.roll(lengths, 1) * lengths, 1e-9)
    outside = (corners < -0.5).any() or (corners > [width - 0.5, height - 0.5]).any()
    if outside:
        reason = f"a point lies outside of the photo of {width} x {height} pixels"
    elif lengths.min() < SHORTEST_SIDE * np.hypot(width, height):
        reason = "two points are so close that there is no side between them"
    elif (sines <= -LEAST_TURN).all():
        reason = "they run counter-clockwise"
    elif not (sines > 0).all() and np.abs(turns).min() > 0 and (turns > 0).sum() == 2:
        reason = "sides cross each other"
    elif not (sines > LEAST_TURN).all():
        reason = "they are not those of a sheet: its outline turns right at all four of them"
    if reason:
        raise InvalidOption(
            f"corners: {reason}; send four points of the photo, clockwise from the page's top left.",
            "corners",
        )
