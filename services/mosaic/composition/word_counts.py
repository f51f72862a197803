"""Votes of cells on the photos that words are taken from."""

import ctypes
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from services.arrays import Mask
from services.kernels.library import WordBox, address, find_kernels
from services.mosaic.composition.patch_drawing import Rectangle
from services.mosaic.composition.sharpness import PatchMaps

Words = NDArray[np.int32]
"""(rows, columns) of the page: the word of which each cell is a part, 0 for none."""


def count_votes(
    maps: Sequence[PatchMaps], words: Words, count: int, cells: NDArray[np.int16]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Per word (count) and photo (len(maps)): number of `cells` that chose the photo, and that it shows whole.

    `cells` (rows, columns) are indices of photos, -1 for none.
    """
    kernels = find_kernels()
    if kernels is None:
        return count_votes_plain(maps, words, count, cells)
    parts, choices = np.ascontiguousarray(words, np.int32), np.ascontiguousarray(cells, np.int16)
    if parts.shape != choices.shape or not _are_numbered(parts, count):
        raise ValueError("words are numbered, and their cells are those that chose")
    if choices.max(initial=-1) >= len(maps):
        raise ValueError("cells choose one of the photos")
    votes, shown = np.zeros((2, count, len(maps)), np.int64)
    rows, columns = words.shape
    page = Rectangle(0, 0, columns, rows)
    whole = WordBox(address(parts), address(choices), columns, columns, rows, columns)
    kernels.count_votes(ctypes.byref(whole), len(maps), address(votes))
    for number, patch in enumerate(maps):
        at = patch.box.within(page)
        covered = np.ascontiguousarray(patch.covered)
        if parts[at].shape != covered.shape:
            raise ValueError("photos lie within the page")
        box = WordBox(address(parts[at]), address(choices[at]), columns, columns, *covered.shape)
        kernels.count_shown(ctypes.byref(box), address(covered), len(maps), address(shown[:, number:]))
    return votes, shown


def count_votes_plain(
    maps: Sequence[PatchMaps], words: Words, count: int, cells: NDArray[np.int16]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """`count_votes` by NumPy: the same."""
    photos = len(maps)
    page = Rectangle(0, 0, words.shape[1], words.shape[0])
    voters = (words > 0) & (cells >= 0)
    ballot = words[voters].astype(np.int64) * photos + cells[voters]
    votes = np.bincount(ballot, minlength=count * photos).reshape(count, photos)
    shown = np.zeros((count, photos), np.int64)
    for number, patch in enumerate(maps):
        at = patch.box.within(page)
        seen = (patch.covered == 255) & (words[at] > 0)
        shown[:, number] = np.bincount(words[at][seen], minlength=count)
    return votes, shown


def take_words(
    words: Words, photos: NDArray[np.int16], labels: NDArray[np.int16], whole: Mask, todo: Mask
) -> None:
    """Give cells of words with one of the `photos` (count,), -1 for none, its index as label, in place.

    They become `whole`, and are no longer `todo`; all are (rows, columns).
    """
    kernels = find_kernels()
    packed = all(each.flags.c_contiguous for each in (labels, whole, todo))
    if kernels is None or not packed:
        take_words_plain(words, photos, labels, whole, todo)
        return
    if any(each.shape != words.shape for each in (labels, whole, todo)) or labels.dtype != np.int16:
        raise ValueError("labels are those of the words' cells")
    parts, chosen = np.ascontiguousarray(words, np.int32), np.ascontiguousarray(photos, np.int16)
    if not _are_numbered(parts, len(chosen)):
        raise ValueError("each word has a photo, or none")
    kernels.take_words(
        address(parts), words.size, address(chosen), address(labels), address(whole), address(todo)
    )


def take_words_plain(
    words: Words, photos: NDArray[np.int16], labels: NDArray[np.int16], whole: Mask, todo: Mask
) -> None:
    """`take_words` by NumPy: the same."""
    photo = photos[words]
    chosen = photo >= 0
    labels[chosen] = photo[chosen]
    whole |= chosen
    todo &= ~chosen


def _are_numbered(words: Words, count: int) -> bool:
    """Whether all are from 0 to below `count`: negative numbers are large ones without a sign."""
    return int(words.view(np.uint32).max(initial=0)) < count
