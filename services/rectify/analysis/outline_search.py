"""The search for the sheet's outline, beside that for the directions of its text where a processor is spare."""

import numpy as np

from services.arrays import Points
from services.imaging.reduction import Halves
from services.rectify.analysis.found_text import FoundText
from services.rectify.analysis.page_analysis import PageAnalysis
from services.sheet.outline.detection import OutlineParameters, find_outline
from services.sheet.outline.results import SheetOutline
from services.side_by_side import SideStep


class OutlineSearch:
    """Seeks the outline of the sheet in `photo`, once at most for the same text."""

    def __init__(self, photo: Halves, parameters: OutlineParameters | None = None) -> None:
        self._photo = photo
        self._parameters = parameters
        self._begun: tuple[FoundText, SideStep[SheetOutline | None]] | None = None

    def begin(self, seen: FoundText) -> None:
        """Begin with the text that was `seen`, all of which may lie on the sheet: mostly it does."""
        self.end()
        self._begun = seen, SideStep(lambda: self._seek(seen.characters, seen.text_height_px))

    def find(self, seen: FoundText | PageAnalysis | None) -> SheetOutline | None:
        """The outline of the sheet on which the text is that was `seen`; None where no sheet's edge is seen."""
        if seen is None:
            self.end()
            return self._seek(None, None)
        characters, height_px = seen.characters, seen.text_height_px
        if self._begun is not None:
            before, step = self._begun
            if before.text_height_px == height_px and np.array_equal(before.characters, characters):
                return step.result()
            self.end()
        return self._seek(characters, height_px)

    def end(self) -> None:
        """Wait for a search that has begun, and forget it."""
        if self._begun is not None:
            self._begun[1].end()
            self._begun = None

    def _seek(self, characters: Points | None, height_px: float | None) -> SheetOutline | None:
        return find_outline(self._photo, characters, height_px, self._parameters)
