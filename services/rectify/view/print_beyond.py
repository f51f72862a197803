"""Light print beyond the paper's end, on a band of the page that differs from its paper as a desk does."""

import cv2
import numpy as np

from services.arrays import Floats, RgbImage
from services.geometry.page_frame import resize_frame
from services.imaging.channels import luminance
from services.imaging.illumination import divide_by_light, reduced_light
from services.imaging.long_edges import LONG_SIDE_PX
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.view.drawing import draw_flat_view
from services.rectify.view.paper_end import PaperEnd
from services.sheet.tracing.level_rows import find_level_rows, shows_print
from services.texture_flow.text_identification import detect_ink

NO_BOXES: Floats = np.zeros((0, 4, 2))


def light_print_beyond(photo: RgbImage, page: ShapedPage, end: PaperEnd) -> Floats:
    """Boxes (N, 4, 2), corners in photo pixels, of light print in level rows beyond the `end` of the paper.

    None where what is light there forms no such rows: grain of a desk does not. Of a page of light print it is dark
    print, since such a page is seen as a negative. Beyond a believed outline, and on a page that fills its photo,
    nothing is sought.
    """
    analysis = page.analysis
    sides = end.reach if page.outline is None else page.outline.polygon
    if analysis is None or analysis.facing_page or page.ground is not None or end.believed or sides is None:
        return NO_BOXES
    whole = page.frame(None, "photo")
    factor = min(1.0, LONG_SIDE_PX / max(whole.width, whole.height))
    frame = resize_frame(whole, factor)
    gray = luminance(draw_flat_view(photo, frame))
    seen = gray if analysis.positive is not None else np.asarray(255 - gray, np.uint8)
    beyond = np.ones(gray.shape, np.uint8)
    corners = frame.to_flat(sides)
    corners = corners[np.isfinite(corners).all(axis=1)]
    if len(corners) < 3:
        return NO_BOXES
    cv2.fillPoly(beyond, [np.round(corners).astype(np.int32)], 0)
    ink = detect_ink(divide_by_light(seen, reduced_light(seen)), beyond > 0)
    if not shows_print(ink):
        return NO_BOXES
    found, rows = find_level_rows(ink)
    own = np.concatenate(rows)
    left, top, right, bottom = (side[own] for side in (found.left, found.top, found.right, found.bottom))
    boxes = np.stack([left, top, right, top, right, bottom, left, bottom], axis=1).reshape(-1, 2) - 0.5
    return frame.to_photo(boxes).reshape(-1, 4, 2)
