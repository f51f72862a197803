"""Paper formats of simulated photos: the aspect of the sheet, and which format is named.

python -m benchmarks paper [--photos N] [--update-baseline]

Photos with the whole sheet in view (A4, Letter, Legal, and a square of no format; flat and gently bent; every second
one with the focal length that EXIF names), and as many on which the sheet goes on beyond the photo.
"""

import argparse
import sys
from collections.abc import Sequence

import numpy as np

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.places import BASELINE
from services.contract.rectify import RectifyParameters
from services.documents.paper_size import FORMATS, PageSize, measure_size
from services.errors import NoText
from services.rectify.pipeline import rectify
from simulation.degradation import PHONE, degrade, desk_texture
from simulation.pages import own_pages
from simulation.photo import SimulatedPhoto, simulate_photo
from simulation.scenes import CURVATURE_SERIES, PLANE, View

_SIZE = (1200, 1600)
_PAGE_WIDTH = 900
_SHEETS = {**{name: FORMATS[name] for name in ("a4", "letter", "legal")}, "square": (200.0, 200.0)}
_IN_VIEW, _BEYOND = 0.03, -0.08
"""Margin round the sheet, as a share of the photo."""
METRICS = {
    "aspect_error_percent": Metric(0.1),
    "named_right": Metric(0.0, larger_is_better=True),
    "named_wrongly": Metric(0.0),
}
"""Figures of a photo that are compared with the committed ones."""


def take(index: int, sheet: str, *, margin: float) -> SimulatedPhoto:
    """One dirty photo of a sheet; every third is gently bent."""
    rng = np.random.default_rng(700 + index)
    width_mm, height_mm = _SHEETS[sheet]
    page = own_pages(_PAGE_WIDTH, round(_PAGE_WIDTH * height_mm / width_mm))[index % 5]
    focal_px = rng.uniform(2000, 2800)
    view = View(str(index), focal_px, rng.uniform(8, 32), rng.uniform(0, 360), rng.uniform(-8, 8))
    shape = CURVATURE_SERIES[0] if index % 3 == 2 else PLANE
    camera = view.camera(*_SIZE)
    desk = desk_texture(camera.width, camera.height, rng)
    photo = simulate_photo(
        page, shape, 0.0, view.pose(page, shape, camera, margin=margin), camera, background=desk
    )
    return SimulatedPhoto(degrade(photo.image, PHONE, rng), photo.truth)


def measure(photo: SimulatedPhoto, *, exif: bool) -> PageSize | None:
    """What the product says of the sheet; None for a photo that is refused."""
    focal_px = photo.truth.camera.focal_length_px if exif else None
    try:
        result = rectify(photo.image, RectifyParameters(upright=False), focal_px)
    except NoText:
        return None
    height, width = result.image.shape[:2]
    assumed = result.camera.source == "assumed"
    return measure_size("auto", result.corners, result.mesh, width, height, camera_assumed=assumed)


def main(arguments: Sequence[str]) -> int:
    """Print a line a photo and the shares; compare with the committed figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks paper", description=__doc__)
    parser.add_argument("--photos", type=int, default=20, help="with the sheet in view, and as many without")
    parser.add_argument("--update-baseline", action="store_true")
    asked = parser.parse_args(arguments)
    figures: Figures = {}
    errors: list[float] = []
    right = wrong = unnamed = wrong_beyond = 0
    for index in range(asked.photos):
        sheet = list(_SHEETS)[index % len(_SHEETS)]
        photo = take(index, sheet, margin=_IN_VIEW)
        size = measure(photo, exif=index % 2 == 0)
        found = None if size is None else size.paper
        wanted = sheet if sheet in FORMATS else None
        right, unnamed = right + (found == wanted), unnamed + (found is None and wanted is not None)
        wrong += found not in (None, wanted)
        case = {"named_right": float(found == wanted), "named_wrongly": float(found not in (None, wanted))}
        if size is not None and size.aspect is not None:
            true = photo.truth.page.width / photo.truth.page.height
            error = 100.0 * abs(np.log(min(size.aspect, 1 / size.aspect) / min(true, 1 / true)))
            errors.append(float(error))
            case["aspect_error_percent"] = float(error)
        figures[f"{index} {sheet}"] = case
        print(
            f"{index:2d} {sheet:7s} {'exif' if index % 2 == 0 else '    '} {'bent' if index % 3 == 2 else 'flat'}: "
            f"aspect off by {case.get('aspect_error_percent', np.nan):.2f} %, {found} "
            f"{'' if size is None or found == wanted else size.reason}",
            flush=True,
        )
    for index in range(asked.photos):
        sheet = list(_SHEETS)[index % len(_SHEETS)]
        size = measure(take(100 + index, sheet, margin=_BEYOND), exif=index % 2 == 0)
        named = size is not None and size.paper is not None
        wrong_beyond += named
        figures[f"{index} {sheet} beyond the photo"] = {"named_wrongly": float(named)}
        if named:
            print(f"{index} {sheet} beyond the photo: {size}")
    print(
        f"{asked.photos} photos with the sheet in view: aspect off by {np.median(errors):.2f} % (median), "
        f"{np.percentile(errors, 95):.2f} (95 %), in {len(errors)} photos; right {right}, not named {unnamed}, wrong "
        f"{wrong}. {asked.photos} without: named {wrong_beyond}"
    )
    report, fine = judge(BASELINE / "paper.json", figures, METRICS, update=asked.update_baseline)
    print(report)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
