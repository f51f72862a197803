"""A photo whose page shows no shape, passed through as it is."""

import numpy as np

from services.arrays import RgbImage
from services.errors import NoText
from services.notices import Notice
from services.rectify.results import CameraEstimate, Evidence, Orientation, RectifyResult
from services.sheet.surfaces import PlaneSurface

MESH_ROWS, MESH_COLUMNS = 65, 49


def keep_photo(photo: RgbImage, refusal: NoText) -> RectifyResult:
    """The photo (H, W, 3) as its own flat view, with a warning that says why."""
    height, width = photo.shape[:2]
    x, y = np.meshgrid(np.linspace(0, width - 1, MESH_COLUMNS), np.linspace(0, height - 1, MESH_ROWS))
    return RectifyResult(
        photo,
        "planar",
        Evidence(None, None, 0.0, ()),
        CameraEstimate(None, None, "assumed"),
        PlaneSurface(None),
        Orientation(0, False, None),
        np.stack([x, y], axis=-1),
        (Notice("kept-as-it-is", f"the photo was passed through: {refusal.detail}"),),
    )
