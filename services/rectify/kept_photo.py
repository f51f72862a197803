"""A photo whose page shows no shape, passed through as it is."""

from typing import get_args

import numpy as np

from services.arrays import RgbImage
from services.contract.rectify import Crop
from services.errors import NoText
from services.geometry.page_frame import mesh_of, turn_frame
from services.notices import Notice
from services.rectify.results import CameraEstimate, Evidence, Orientation, RectifyResult
from services.rectify.view.turned_image import apply_orientation
from services.rectify.view.view_plan import PlannedView, ViewPlan
from services.sheet.plane.framing import FlatFrame
from services.sheet.surfaces import PlaneSurface


def keep_photo(photo: RgbImage, refusal: NoText, rotation_deg: int = 0) -> RectifyResult:
    """The photo (H, W, 3), turned clockwise, as its own flat view, with a warning that says why."""
    height, width = photo.shape[:2]
    as_it_is = FlatFrame(np.eye(3), width, height)
    frame = turn_frame(as_it_is, rotation_deg, mirrored=False)
    view, orientation = PlannedView(as_it_is, None, None), Orientation(rotation_deg, False, None)
    return RectifyResult(
        apply_orientation(photo, orientation),
        "planar",
        Evidence(None, None, 0.0, ()),
        CameraEstimate(None, None, "assumed"),
        PlaneSurface(None),
        orientation,
        np.asarray(mesh_of(frame), np.float64),
        (Notice("kept-as-it-is", f"the photo was passed through: {refusal.detail}"),),
        plan=ViewPlan(dict.fromkeys(get_args(Crop), view)),
    )
