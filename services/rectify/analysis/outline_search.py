"""The search for the sheet's outline, beside that for the directions of its text where a processor is spare."""

from dataclasses import replace
from functools import partial

import numpy as np

from services.geometry.focal_prior import FocalPrior
from services.geometry.photo_frame import PhotoFrame
from services.imaging.reduction import Halves
from services.rectify.analysis.found_text import FoundText
from services.rectify.analysis.page_analysis import PageAnalysis
from services.sheet.outline.detection import OutlineParameters, find_outline
from services.sheet.outline.reduced_photo import LEAST_SIDE_PX, ReducedPhoto, reduce_photo
from services.sheet.outline.results import SheetOutline
from services.sheet.plane.outline_plane import SheetSides, read_sides
from services.side_by_side import SideStep

_Seen = tuple[SheetOutline | None, SheetSides | None]


class OutlineSearch:
    """Seeks the outline of the sheet in `photo`, whose frame is `view`, and reads its sides."""

    def __init__(
        self,
        photo: Halves,
        view: PhotoFrame,
        prior: FocalPrior,
        parameters: OutlineParameters | None = None,
    ) -> None:
        self._photo = photo
        self._view = view
        self._prior = prior
        self._parameters = parameters
        self._begun: tuple[FoundText, SideStep[_Seen]] | None = None
        self._read: _Seen | None = None
        self._reducing: SideStep[ReducedPhoto] | None = None

    def prepare(self) -> None:
        """Begin to reduce the photo, if a processor is spare: that needs no text."""
        if min(self._photo.image.shape[:2]) >= LEAST_SIDE_PX:
            self._reducing = SideStep(partial(reduce_photo, self._photo))

    def begin(self, seen: FoundText) -> None:
        """Begin, once a processor is spare, with all text that was `seen`: mostly all of it lies on the sheet."""
        self._end_search()
        self._begun = seen, SideStep(lambda: self._seek_and_read(seen))

    def find(self, seen: FoundText | PageAnalysis | None) -> SheetOutline | None:
        """The outline of the sheet on which the text is that was `seen`; None where no sheet's edge is seen."""
        if seen is None:
            self._end_search()
            return self._seek(None)
        if self._begun is not None:
            before, step = self._begun
            is_same = before.text_height_px == seen.text_height_px and before.window == seen.window
            if is_same and np.array_equal(before.characters, seen.characters):
                self._read = step.result()
                self._end_reducing()
                return self._read[0]
            self._end_search()
        outline = self._seek(seen)
        self._end_reducing()
        return outline

    def find_in_view(self, seen: FoundText | PageAnalysis) -> SheetOutline | None:
        """The outline where what was `seen` is no text: a sheet that goes on beyond the photo is shown by print."""
        self._parameters = replace(self._parameters or OutlineParameters(), follows=False)
        return self._seek(seen)

    def read(self, outline: SheetOutline | None) -> SheetSides | None:
        """The sides of `outline`, as `read_sides` of the whole photo reads them."""
        if self._read is not None and self._read[0] is outline:
            return self._read[1]
        return read_sides(outline, self._view, self._prior)

    def end(self) -> None:
        """Wait for what has begun, and forget it."""
        self._end_search()
        self._end_reducing()

    def _end_reducing(self) -> None:
        if self._reducing is not None:
            self._reducing.end()  # its CPU time counts here
            self._reducing = None

    def _end_search(self) -> None:
        if self._begun is not None:
            self._begun[1].end()
            self._begun = None

    def _seek(self, seen: FoundText | PageAnalysis | None) -> SheetOutline | None:
        if seen is None or seen.window is None:
            characters = None if seen is None else seen.characters
            reduced = None if self._reducing is None else self._reducing.result()
            return find_outline(self._photo, characters, self._parameters, reduced)
        characters = seen.characters
        x0, y0, x1, y1 = (max(round(v), 0) for v in seen.window)
        part = self._photo.image[y0:y1, x0:x1]
        outline = find_outline(part, characters - (x0, y0), self._parameters)
        return None if outline is None else outline.moved(x0, y0)

    def _seek_and_read(self, seen: FoundText) -> _Seen:
        outline = self._seek(seen)
        return outline, read_sides(outline, self._view, self._prior)
