"""The drawing of the answer's view, which may begin while the view is judged and read: mostly it is right as it is."""

from types import TracebackType
from typing import Self

import numpy as np

from services.arrays import Points, RgbImage
from services.contract.rectify import RectifyParameters
from services.geometry.page_frame import Frame, turn_frame
from services.rectify.results import Orientation
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.view.drawing import FlatDrawing, draw_flat_view
from services.rectify.view.held_corners import end_at_corners, with_margin
from services.rectify.view.judged_view import JudgedView
from services.rectify.view.paper_fit import fit_to_paper
from services.side_by_side import SideStep


class ViewDrawing:
    """Draws the view of a photo that `parameters` ask for. Leaving the `with` block ends what was begun in vain."""

    def __init__(self, photo: RgbImage, parameters: RectifyParameters) -> None:
        self._photo = photo
        self._parameters = parameters
        self._begun: tuple[Frame, FlatDrawing, SideStep[None]] | None = None

    @property
    def expected(self) -> Orientation:
        """What is drawn before the page is read: the turn that was asked for, else none."""
        return Orientation(self._parameters.page_turn or 0, False, None)

    def begin(self, page: ShapedPage, frame: Frame, paper: Points | None) -> None:
        """Begin to draw the view of `page` through `frame`, if a processor is spare."""
        self.end()
        drawing = FlatDrawing(self._photo, self._end_frame(page, frame, self.expected)[0], self._white(paper))
        step = SideStep(drawing.draw)
        if step.is_beside:
            self._begun = frame, drawing, step
        else:
            step.end()

    def finish(self, view: JudgedView, orientation: Orientation) -> tuple[RgbImage, Frame, float | None]:
        """The `view` turned to its `orientation`, its frame, and the factor by which it was stretched, if it was."""
        frame, stretch = self._end_frame(view.page, view.frame, orientation)
        expected = self.expected
        turn = (orientation.rotation_deg, orientation.mirrored)
        if self._begun is not None and turn == (expected.rotation_deg, expected.mirrored):
            drawn, drawing, step = self._begun
            if drawn is view.frame:
                drawing.draw()
                step.result()
                return drawing.finish(), frame, stretch
        self.end()
        return draw_flat_view(self._photo, frame, self._white(view.paper)), frame, stretch

    def end(self) -> None:
        """Stop a drawing that has begun, and forget it."""
        if self._begun is not None:
            _, drawing, step = self._begun
            drawing.stop()
            step.end()
            self._begun = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.end()

    def _end_frame(
        self, page: ShapedPage, frame: Frame, orientation: Orientation
    ) -> tuple[Frame, float | None]:
        """The frame turned, stretched to the wanted paper and with its margin; and the stretch."""
        p, stretch = self._parameters, None
        frame = turn_frame(frame, orientation.rotation_deg, orientation.mirrored)
        if p.crop == "sheet":
            frame, stretch = fit_to_paper(frame, page, p.paper)
            if stretch is not None and page.corners is not None:
                turned = np.roll(page.corners, orientation.rotation_deg // 90, axis=0)
                frame = end_at_corners(frame, turned, (frame.width, frame.height))
        return (with_margin(frame, p.margin) if p.margin > 0 else frame), stretch

    def _white(self, paper: Points | None) -> Points | None:
        """The polygon outside of which it is white; none with a margin: then what lies around the cut is wanted."""
        return paper if self._parameters.margin <= 0 else None
