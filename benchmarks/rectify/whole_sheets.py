"""Whole sheets on a desk: a plane, a book's page, a wave and a cone, at two thirds and at half of the photo's width.

python -m benchmarks whole_sheets [--limit N] [--update-baseline]

All four sides are in view, so that sides and text show the shape together: 12 poses of each shape and size, tilted by
4 to 32 degrees in any direction, without a focal length in EXIF.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.places import BASELINE, data_folder
from benchmarks.common.residuals import field_of_view_error_deg, mesh_residual_percent
from benchmarks.rectify.cases import load_pages
from benchmarks.rectify.sheet_experiments import LAMPS
from services.contract.rectify import RectifyParameters
from services.errors import NoText
from services.rectify.pipeline import rectify
from simulation.camera import Camera, Pose
from simulation.degradation import PHONE
from simulation.flat_page import Page
from simulation.photo import SimulatedPhoto
from simulation.scenes import BOOK, CONE, PLANE, WAVE, View
from simulation.sheets import take_photo, with_margins
from simulation.surfaces import Shape
from simulation.truth import Truth

SIZE = (1600, 2000)
SMOOTH: dict[str, Shape] = {"plane": PLANE, "book": BOOK, "wave": WAVE, "cone": CONE}
_SHARES = {"two thirds": 2 / 3, "half": 0.5}
_POSES = 12
MARGIN = 0.08
"""Blank paper beside the print, as a share of the sheet's width."""
METRICS = {"mesh_percent": Metric(0.02), "field_of_view_deg": Metric(0.1)}
"""Figures of a photo that are compared with the committed ones."""


@dataclass(frozen=True, slots=True)
class WholeSheet:
    """One photo: a `shape` that fills a `share` of the photo's width, in the pose of this number."""

    shape: str
    share: str
    pose: int

    @property
    def name(self) -> str:
        """As figures are filed under."""
        return f"{self.shape} {self.share} {self.pose}"


def all_sheets() -> Iterator[WholeSheet]:
    """Shapes and sizes in turns, so that any first few are varied."""
    for pose in range(_POSES):
        for shape in SMOOTH:
            for share in _SHARES:
                yield WholeSheet(shape, share, pose)


def photograph_whole(case: WholeSheet, pages: Sequence[Page]) -> SimulatedPhoto:
    """The dirty photo of a case; pose, ground and dirt depend on its number alone."""
    number = list(all_sheets()).index(case)
    rng = np.random.default_rng(4000 + number)
    view = View(
        case.name, rng.uniform(2000, 3200), rng.uniform(4, 32), rng.uniform(0, 360), rng.uniform(-12, 12)
    )
    page = with_margins(pages[number % len(pages)], MARGIN)
    camera, shape = view.camera(*SIZE), SMOOTH[case.shape]
    pose = pose_of_width(view, page, shape, camera, _SHARES[case.share])
    return take_photo(Truth(page, shape, 0.0, pose, camera), LAMPS[number % len(LAMPS)], PHONE, rng)


def pose_of_width(view: View, page: Page, shape: Shape, camera: Camera, share: float) -> Pose:
    """The pose of `view` in which the sheet takes `share` of the photo's width."""
    pose = view.pose(page, shape, camera)
    for _ in range(10):
        width = float(np.ptp(Truth(page, shape, 0.0, pose, camera).outline()[:, 0]))
        x, y, z = (part * width / (share * camera.width) for part in pose.translation)
        pose = replace(pose, translation=(x, y, z))
    return pose


def measure(photo: SimulatedPhoto) -> dict[str, float]:
    """Errors of the answer: of the mesh after the best similarity, in percent of the width (100 of a refused photo)."""
    try:
        result = rectify(photo.image, RectifyParameters(upright=False))
    except NoText:
        return {"mesh_percent": 100.0}
    height, width = result.image.shape[:2]
    return {
        "mesh_percent": mesh_residual_percent(result.mesh, width, height, photo.truth),
        "field_of_view_deg": field_of_view_error_deg(result.camera.focal_length_px, photo.truth),
    }


def main(arguments: Sequence[str]) -> int:
    """Print a line a photo and percentiles; compare with the committed figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks whole_sheets", description=__doc__)
    parser.add_argument("--limit", type=int, default=None, help="photos, of 96")
    parser.add_argument("--update-baseline", action="store_true")
    asked = parser.parse_args(arguments)
    cv2.setNumThreads(1)
    pages, _ = load_pages(data_folder(None))
    figures: Figures = {}
    for case in list(all_sheets())[: asked.limit]:
        found = figures[case.name] = measure(photograph_whole(case, pages))
        print(f"{case.name:20s} mesh {found['mesh_percent']:.3f} % of the width", flush=True)
    for shape in (*SMOOTH, ""):
        errors = [found["mesh_percent"] for name, found in figures.items() if name.startswith(shape)]
        if errors:
            print(
                f"{len(errors)} photos {shape:5s}: median {np.median(errors):.3f} %, "
                f"95 % {np.percentile(errors, 95):.3f}, largest {max(errors):.3f}; "
                f"over 0.5 %: {sum(error > 0.5 for error in errors)}"
            )
    report, fine = judge(BASELINE / "whole_sheets.json", figures, METRICS, update=asked.update_baseline)
    print(report)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
