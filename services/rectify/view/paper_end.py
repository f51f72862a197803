"""Where the paper of a page ends in its photo: asked by the frame, by the cut, by what is drawn white, by mosaics.

Three things show it, in this order. The ground of a photo that is the page reaches to the photo's frame. An outline was
followed along the sheet's edge, side by side. And paper is as bright as that under the text, which tells roughly where
it ends if no edge could be followed, and no text lies beyond.
"""

from dataclasses import dataclass, replace
from typing import TypeGuard

import cv2
import numpy as np

from services.arrays import Floats, Points
from services.contract.rectify import Crop
from services.rectify.analysis.page_analysis import PageAnalysis
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.view.outside_text import has_text_outside
from services.rectify.view.print_kept import hides_print
from services.sheet.outline.results import BELIEVED_CONFIDENCE, SheetOutline

LEAST_HELD = 0.97
"""Share of the characters that the paper holds, or it is not that of this page."""
LEAST_FILLED = 0.96
"""Of its convex hull, a sheet seen whole covers at least this much: torn sheets and opened books do not."""


@dataclass(frozen=True, slots=True, eq=False)
class PaperEnd:
    """What is known of the paper's end; polygons (M, 2) are photo pixels.

    The frame goes to `reach`; None: to where the shape's own frame goes. Beyond `white` it is certain that there is no
    paper, and the view is white there; None: that is nowhere certain. With `whole` the
    sheet's end is known all round, so that lines inside of it are print. What looks like text beyond the sides of a
    `believed` outline is specks of a desk, and is cut off. All ground that is seen to be paper lies in `around`, which
    is rough; a picture may divide the sheet, and that alone is no end.
    """

    reach: Points | None = None
    white: Points | None = None
    whole: bool = False
    believed: bool = False
    around: Points | None = None


def find_paper_end(page: ShapedPage, crop: Crop, boxes: Floats) -> PaperEnd:
    """Where the paper of `page` ends in a view cut to `crop`; `boxes` (N, 4, 2), photo pixels, are its print.

    What lies between given corners is the person's page, to the last pixel: nothing ends there.
    """
    if page.corners is not None:
        return PaperEnd()
    analysis, outline = page.analysis, page.outline
    if crop != "sheet":
        # Without text the sheet is all that a view can show.
        return PaperEnd(outline.polygon if analysis is None and outline is not None else None)
    if page.ground is not None:
        found = PaperEnd(white=page.ground.outline, whole=True, around=page.ground.outline)
    elif is_believed(outline, page.characters):
        polygon = outline.polygon
        found = PaperEnd(polygon, polygon, whole=True, believed=True, around=polygon)
    elif analysis is None:
        found = PaperEnd(None if outline is None else outline.polygon)
    else:
        found = _end_by_colours(page, analysis)
    # The sheet's end stays known where a few letters stick out of it.
    if found.white is not None and hides_print(found.white, boxes):
        found = replace(found, white=None)
    return found


def is_believed(outline: SheetOutline | None, characters: Points) -> TypeGuard[SheetOutline]:
    """Whether the paper ends at the `outline`: it is sure, and holds the `characters` (N, 2), if there are any."""
    if outline is None or outline.confidence < BELIEVED_CONFIDENCE:
        return False
    on_sheet = outline.holds(characters)
    return not len(on_sheet) or float(on_sheet.mean()) >= LEAST_HELD


def _end_by_colours(page: ShapedPage, analysis: PageAnalysis) -> PaperEnd:
    """The end of what is as bright as the ground of the page's text, where no text lies beyond."""
    reach = analysis.paper.outline(analysis.characters)
    if reach is None or has_text_outside(analysis, reach):
        parts = analysis.paper.hull(analysis.characters)
        return PaperEnd(around=None if parts is None or has_text_outside(analysis, parts) else parts)
    reach = _within_gutter(reach, analysis)
    if page.shape.ends_at_sides:
        return PaperEnd(around=reach)
    white = filled_hull(reach)
    is_flat_sheet = page.shape.kind == "planar" and not analysis.facing_page
    return PaperEnd(reach, white, is_flat_sheet and white is not None, around=reach)


def filled_hull(outline: Points) -> Points | None:
    """Convex hull (N, 2) of a sheet's `outline` (M, 2) if the sheet fills it: then it is surely one whole sheet."""
    points = outline.astype(np.float32)
    hull = cv2.convexHull(points)
    filled = cv2.contourArea(points) / max(cv2.contourArea(hull), 1e-9)
    return np.asarray(hull[:, 0, :], np.float64) if filled >= LEAST_FILLED else None


def _within_gutter(outline: Points, analysis: PageAnalysis) -> Points:
    """`outline` (N, 2) in the photo with what lies beyond the gutter, if there is one, drawn back to it."""
    if analysis.gutter is None:
        return outline
    middle = analysis.gutter.mean(axis=0)
    along = np.linalg.svd(analysis.gutter - middle)[2][0]
    across = np.array([-along[1], along[0]])
    side = np.sign(np.median((analysis.characters - middle) @ across))
    beyond = np.minimum(side * ((outline - middle) @ across), 0.0)
    return np.asarray(outline - side * beyond[:, None] * across)
