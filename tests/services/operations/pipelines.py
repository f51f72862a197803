"""What stands for the pipelines: remembers how it was called, and answers at once."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from services.contract.answers.mosaic import Pair
from services.contract.rectify import Origin
from services.mosaic.results import MosaicResult, Patch
from services.notices import Notice
from services.rectify.results import CameraEstimate, Evidence, Orientation, RectifyResult
from services.rectify.spread import RectifiedPages
from services.sheet.surfaces import MeshSurface, PlaneSurface, StripsSurface


def reject_constant(name: str) -> None:
    """For `json.loads`: NaN and infinity are no JSON."""
    raise AssertionError(f"{name} is not JSON")


def turned_mesh(photo: np.ndarray, scale: float = 1.0) -> np.ndarray:
    """The mesh of the photo turned by 90 degrees; its steps in the photo are `scale` times those on the flat view."""
    foot, right = scale * (photo.shape[0] - 1), scale * (photo.shape[1] - 1)
    return np.array([[[right, 0], [right, foot]], [[0, 0], [0, foot]]], np.float64)


class RectifyPipeline:
    """Stands for the pipeline: remembers how it was called, answers with the photo turned by 90 degrees."""

    def __init__(self) -> None:
        self.calls: list[tuple[Any, ...]] = []
        self.field_of_view_rad: float | None = math.pi / 3
        self.convergence: float | None = 0.0123
        self.pages = 2
        self.mesh = np.array([[[0, 1 / 3], [1, 0]], [[0, 1], [1, 1]]], np.float64)
        self.surface: PlaneSurface | StripsSurface | MeshSurface = PlaneSurface((0.0, 0.6, 0.8))

    def __call__(
        self, photo: Any, parameters: Any, exif_focal_length_px: Any, ocr: Any, origin: Origin = "photo"
    ) -> RectifyResult:
        self.calls.append((photo.shape, parameters, exif_focal_length_px, ocr))
        return RectifyResult(
            np.ascontiguousarray(np.rot90(photo)),
            "planar",
            Evidence(self.convergence, None, 0.41),
            CameraEstimate(55.5, self.field_of_view_rad, "exif", (29.5, 19.25), "estimated"),
            self.surface,
            Orientation(270, False, 0.98),
            self.mesh,
            (Notice("focal-length-unknown", "Say it."),),
            {"text": 12.345, "remap": np.float64(3.0)},
        )

    def rectify_spread(
        self, photo: Any, parameters: Any, exif_focal_length_px: Any, ocr: Any, origin: Origin = "photo"
    ) -> RectifiedPages:
        """Stands for `rectify_spread`: as many pages as `pages`, the second one half as high."""
        result = self(photo, parameters, exif_focal_length_px, ocr)
        half = replace(result, image=np.ascontiguousarray(result.image[::2]))
        return RectifiedPages(
            (result, half)[: self.pages], (Notice("of-all", "Of all pages."),), {"text": 1.0}
        )


class MosaicPipeline:
    """Stands for `mosaic`: places all photos but the last one, answers with the first one."""

    def __init__(self) -> None:
        self.calls: list[tuple[Any, ...]] = []
        self.scale = 1.23456

    def __call__(
        self, photos: Any, parameters: Any, exif_focal_lengths_px: Any, ocr: Any, cameras: Any
    ) -> MosaicResult:
        shapes = [photo.shape for photo in photos]
        self.calls.append((shapes, parameters, exif_focal_lengths_px, ocr, cameras))
        mesh = np.array([[[0, 1 / 3], [9, 0]], [[0, 9], [9, 9]]], np.float64)
        return MosaicResult(
            photos[0],
            0,
            (*(Patch(True, mesh, self.scale, 1.0, 0.0) for _ in photos[1:]), Patch(False)),
            (
                Pair(
                    a=0,
                    b=1,
                    matches=900,
                    votes=400,
                    runner_up_votes=12,
                    overlap_fraction=0.2346,
                    residual_px=0.0712,
                ),
            ),
            (len(photos) - 1,),
            Orientation(90, False, None),
            (Notice("not-placed", "images[2] overlaps no other photo."),),
            {"registration": 12.345, "composition": np.float64(3.0)},
        )
