"""The shapes that a page may have, each fitted when it is first asked for, and the questions that all are asked."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from services.geometry.focal_prior import FocalPrior
from services.geometry.page_map import PageMap
from services.rectify.shape_choice.textless import planar_page
from services.sheet.curved_page import CurvedPage, estimate_curved_page, fit_flows, flow_deviation
from services.sheet.developable.fitting import FittedSurface
from services.sheet.developable.observations import NO_EDGES, LineObservations, SideObservations
from services.sheet.evidence import PageEvidence
from services.sheet.outline.results import BELIEVED_CONFIDENCE, CERTAIN_CONFIDENCE, SheetOutline
from services.sheet.plane.outline_plane import SheetSides
from services.sheet.plane.planar_page import PlanarPage
from services.sheet.plane.pose import ASLANT_RAD, EDGES_BELIEVED, choose_pose
from services.sheet.ridged_page import RidgedPage, estimate_ridged_page, mean_bend, sides_bend
from services.sheet.shape import NoShape, PageShape
from services.sheet.sheet_edges import measure_sides, read_edges
from services.sheet.tracing.line_tracing import FEW_LINES, measure_straightness
from services.sheet.tracing.page_lines import trace_lines, with_rules
from services.sheet.tracing.profile_tracing import trace_by_profiles

STRAIGHT_SIDE = 0.003
"""RMS bend of a sheet's side, as a share of its size, up to which it counts as straight."""


@dataclass(eq=False)
class Hypotheses:
    """A page's plane, smooth and creased sheet: a page that is clearly one of them needs no fit of the others."""

    evidence: PageEvidence
    prior: FocalPrior
    seems: Literal["planar", "curved"]
    outline: SheetOutline | None
    sheet: SheetSides | None
    refusal: str = ""
    """Why there is no smooth sheet."""
    _profiles: dict[PageShape, LineObservations] = field(default_factory=dict)

    @cached_property
    def direction_rad(self) -> float:
        """That of the text lines in the photo, up to a half turn."""
        flow = self.evidence.major
        double = 2 * flow.angles
        return 0.5 * float(np.arctan2(flow.weights @ np.sin(double), flow.weights @ np.cos(double)))

    @cached_property
    def edges(self) -> SideObservations:
        """The sides of the sheet, as far as they are seen."""
        return read_edges(self.outline, self.evidence.view, self.direction_rad)

    @property
    def bent_sides(self) -> bool:
        """Whether a side of the sheet is seen to bend."""
        return self.outline is not None and sides_bend(self.outline) > STRAIGHT_SIDE

    @property
    def bend_of_sides(self) -> float:
        """RMS distance of the sheet's sides from straight lines in the photo, as a share of its size; 0 without any."""
        return 0.0 if self.outline is None else mean_bend(self.outline)

    @property
    def believed_outline(self) -> bool:
        """Whether the outline is rather the sheet's than that of a stack of pages."""
        return self.outline is not None and self.outline.confidence >= BELIEVED_CONFIDENCE

    @property
    def certain_outline(self) -> bool:
        """Whether the outline is surely the sheet's, not that of a stack of pages or of a picture."""
        return self.outline is not None and self.outline.confidence >= CERTAIN_CONFIDENCE

    @property
    def rigid(self) -> bool:
        """Whether straight sides of a certain outline show a plane: that of a flat sheet, or of a board."""
        shown = self.sheet is not None and self.sheet.plane is not None
        return shown and self.certain_outline and not self.bent_sides

    @cached_property
    def plane(self) -> PlanarPage:
        """The plane that fits best. Against the sides of a rigid sheet text needs many lines."""
        found = choose_pose(self.evidence, self.prior, sheet=self.sheet)
        against = "outline" not in found.sources or abs(found.skew_rad) > ASLANT_RAD
        if not self.rigid or not against or found.line_count >= FEW_LINES:
            return found
        assert self.sheet is not None
        assert self.sheet.plane is not None
        by_sides = planar_page(self.sheet.plane, self.prior, "outline")
        e = self.evidence
        return replace(
            by_sides,
            notices=(EDGES_BELIEVED, *by_sides.notices),
            line_count=found.line_count,
            deviation=flow_deviation(by_sides.page_map, e.major, e.minor),
        )

    @property
    def plane_by_sides(self) -> bool:
        """Whether the plane is that of the sides, with or without text."""
        return self.plane.sides_believed or (self.rigid and "outline" in self.plane.sources)

    @cached_property
    def plane_lines(self) -> LineObservations:
        """The text lines, traced in the plane's view."""
        found, e = self.plane.lines, self.evidence
        if found is None:
            return self.trace(self.plane.page_map)
        return with_rules(found, e.text, e.view, self.plane.page_map)

    @cached_property
    def plane_straightness(self) -> float:
        """That of these lines, in text heights; NaN where it is not known."""
        return measure_straightness(self.plane.page_map, self.plane_lines)

    @cached_property
    def smooth(self) -> CurvedPage | None:
        """The smooth sheet that lines and sides show together; None if none is plausible, and `refusal` says why."""
        return self._fit_smooth(self.edges)

    @cached_property
    def smooth_by_text(self) -> CurvedPage | None:
        """The smooth sheet that text alone shows."""
        return self._fit_smooth(NO_EDGES) if len(self.edges.points) else self.smooth

    @cached_property
    def flat_fit(self) -> FittedSurface:
        """What the flows alone show: the start of every smooth sheet."""
        return fit_flows(self.evidence, self.prior)

    def _fit_smooth(self, edges: SideObservations) -> CurvedPage | None:
        found = estimate_curved_page(self.evidence, self.prior, edges, self.flat_fit)
        if isinstance(found, NoShape):
            self.refusal = found.reason
            return None
        return found

    @cached_property
    def creased(self) -> RidgedPage | None:
        """The creased sheet within the outline, if there is one."""
        found = self.fit_creased()
        return None if isinstance(found, NoShape) else found

    def fit_creased(self) -> RidgedPage | NoShape:
        """The creased sheet within the outline, refined by the page's text, or why there is none."""
        if self.outline is None:
            return NoShape("no sheet is seen")
        e = self.evidence
        return estimate_ridged_page(
            self.outline, e.view, self.prior, self.direction_rad, self.trace_by_profiles, e.strokes, e.major
        )

    def trace(self, page_map: PageMap) -> LineObservations:
        """The lines that are seen in the view of `page_map`."""
        return trace_lines(self.evidence.text, self.evidence.view, page_map)

    def trace_by_profiles(self, page_map: PageMap) -> LineObservations:
        """The same by profiles of darkness, as the creased sheet's are: these find lines across creases."""
        return trace_by_profiles(self.evidence.text, self.evidence.view, page_map)

    def profiles_in(self, shape: PageShape) -> LineObservations:
        """These lines in the view of a fitted `shape`, traced once."""
        if shape not in self._profiles:
            self._profiles[shape] = self.trace_by_profiles(shape.page_map)
        return self._profiles[shape]

    def sides_of(self, page_map: PageMap) -> float:
        """How far the sheet's sides are from straight ones at right angles; NaN where none is seen."""
        return measure_sides(page_map, self.edges)
