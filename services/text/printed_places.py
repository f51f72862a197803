"""Words that a page of a PDF prints, carried from its picture into a view of it."""

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats
from services.contract.rectify import Origin, Rotation, TypesetPage
from services.geometry.homographies import transform_points
from services.geometry.page_frame import turning
from services.ocr.engine import CERTAIN, Word
from services.ocr.printed_words import NOT_KNOWN, PrintedWords

_BENT_PX = 1.0
"""Largest distance, in pixels of the view, between it and a view of the page that is turned, enlarged and cut."""


def printed_on_page(origin: Origin, size: tuple[int, int], turn: Rotation = 0) -> PrintedWords:
    """The words that are printed on a picture of `size` (width, height), turned clockwise by `turn` degrees."""
    H, width, height = turning(*size, turn, False)
    right, foot = width - 1.0, height - 1.0
    corners = np.array([[0, 0], [right, 0], [0, foot], [right, foot]])
    return printed_in_view(
        origin, size, np.asarray(transform_points(H, corners).reshape(2, 2, 2), np.float64), (width, height)
    )


def printed_in_view(
    origin: Origin, photo_size: tuple[int, int], mesh: NDArray[np.float64], size: tuple[int, int]
) -> PrintedWords:
    """The words that are printed in a view of `size` (width, height), of a picture of `photo_size`.

    `mesh` (rows, columns, 2) has the photo point of output pixel (c (width-1)/(columns-1), r (height-1)/(rows-1)).
    Words whose middle lies outside of the view are left out. They are not known where the view is bent or aslant, as
    between corners that a person sets.
    """
    if not isinstance(origin, TypesetPage) or not origin.words:
        return NOT_KNOWN
    A = _fit_affine(mesh, size)
    if A is None:
        return NOT_KNOWN
    # A box ends at the edges of its pixels; coordinates are those of pixel centres.
    boxes = np.array([word.box for word in origin.words]) * np.tile(photo_size, 2) - 0.5
    corners = boxes[:, [0, 1, 2, 1, 2, 3, 0, 3]].reshape(-1, 4, 2) @ A[:2] + A[2] + 0.5
    low, high = corners.min(axis=1), corners.max(axis=1)
    middle = (low + high) / 2
    inside = ((middle >= 0) & (middle <= size)).all(axis=1)
    low, high = np.clip(low, 0, size), np.clip(high, 0, size)
    words = tuple(
        Word(word.text, (float(x0), float(y0), float(x1), float(y1)), CERTAIN, word.line)
        for word, (x0, y0), (x1, y1), is_inside in zip(origin.words, low, high, inside, strict=True)
        if is_inside and x1 > x0 and y1 > y0
    )
    return PrintedWords(words, is_all=not origin.has_pictures)


def _fit_affine(mesh: NDArray[np.float64], size: tuple[int, int]) -> Floats | None:
    """A (3, 2) with (x, y, 1) A = a pixel of the view for the photo points of `mesh`; None if there is none."""
    rows, columns = mesh.shape[:2]
    across, down = np.meshgrid(np.linspace(0, size[0] - 1, columns), np.linspace(0, size[1] - 1, rows))
    places, photo = np.stack([across.ravel(), down.ravel()], axis=1), mesh.reshape(-1, 2)
    known = np.isfinite(photo).all(axis=1)
    equations = np.column_stack([photo[known], np.ones(known.sum())])
    A, _, rank, _ = np.linalg.lstsq(equations, places[known], rcond=None)
    if rank < 3 or np.abs(equations @ A - places[known]).max() > _BENT_PX:
        return None
    return np.asarray(A)
