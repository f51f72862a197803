"""The result of a page whose shape is known: what is said of it beside its picture."""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from services.arrays import RgbImage
from services.geometry.camera import field_of_view
from services.geometry.page_frame import Frame, mesh_of
from services.notices import Notice
from services.rectify.results import CameraEstimate, Evidence, Orientation, PrintSample, RectifyResult
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.stage_clock import StageClock
from services.rectify.view.sheet_corners import corners_by_view


def describe_page(
    page: ShapedPage,
    image: RgbImage,
    frame: Frame,
    orientation: Orientation,
    notices: Sequence[Notice],
    clock: StageClock,
    printed: PrintSample | None,
    judged: tuple[float | None, float | None] = (None, None),
) -> RectifyResult:
    """The result whose view is `image`, seen through `frame` after it was turned by `orientation`.

    `judged` is the share of the print that it keeps and the error of the mesh to expect, in percent.
    """
    mesh = np.asarray(mesh_of(frame), np.float64)
    return RectifyResult(
        image,
        page.shape.kind,
        describe_evidence(page, judged),
        describe_camera(page),
        page.shape.surface(page.view),
        orientation,
        mesh,
        tuple(notices),
        clock.timings_ms,
        corners_by_view(page.outline, mesh, mirrored=orientation.mirrored)
        if page.corners is None
        else np.roll(page.corners, orientation.rotation_deg // 90, axis=0),
        printed,
        page.shape.sheet_aspect,
    )


def describe_evidence(page: ShapedPage, judged: tuple[float | None, float | None] = (None, None)) -> Evidence:
    """Convergence of both flows, the share of text, what decided the shape, and how its view was `judged`."""
    confidence = None if page.outline is None else page.outline.confidence
    sides = 0 if page.outline is None else sum(side.seen > 0 for side in page.outline.sides)
    source, points, analysis = page.shape.sources, page.vanishing_points, page.analysis
    if points is None or analysis is None:
        return Evidence(None, None, 0.0, source, confidence, sides, *judged)
    return Evidence(
        points.horizontal.convergence,
        None if analysis.minor is None else points.vertical.convergence,
        analysis.text.area_fraction,
        source,
        confidence,
        sides,
        *judged,
    )


def describe_camera(page: ShapedPage) -> CameraEstimate:
    """Focal length in photo pixels, and its source."""
    shape, view = page.shape, page.view
    focal_px = shape.focal * view.unit_px
    moved: Literal["centre", "estimated"] = "centre" if view.principal_point_px is None else "estimated"
    angle = field_of_view(focal_px, view.width, view.height)
    deviation = shape.log_focal_deviation if np.isfinite(shape.log_focal_deviation) else None
    return CameraEstimate(focal_px, angle, shape.focal_source, view.centre, moved, deviation)
