"""Paper formats of simulated photos: the aspect of the sheet, and which format is named.

python -m benchmarks paper [--photos N] [--flat N] [--update-baseline]

Photos with the whole sheet in view (A4, Letter, Legal, and a square of no format; flat and gently bent; every second
one with the focal length that EXIF names), and as many on which the sheet goes on beyond the photo. Then flat sheets of
formats and of odd aspects, two thirds of them in one-point perspective, which does not show the focal length: whether
the aspect is within two of its stated deviations, and whether an odd sheet is named as a format.
"""

import argparse
import sys
from collections.abc import Sequence

import numpy as np

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.places import BASELINE
from services.contract.rectify import RectifyParameters
from services.documents.paper_size import FORMATS, SheetSize, measure_size
from services.errors import NoText
from services.geometry.camera import TYPICAL_FOCAL_LENGTH
from services.rectify.pipeline import rectify
from simulation.degradation import PHONE, degrade, desk_texture
from simulation.pages import own_pages
from simulation.photo import SimulatedPhoto, simulate_photo
from simulation.scenes import CURVATURE_SERIES, PHOTO_SIZE, PLANE, View

_SIZE = (1200, 1600)
_PAGE_WIDTH = 900
_SHEETS = {**{name: FORMATS[name] for name in ("a4", "letter", "legal")}, "square": (200.0, 200.0)}
_IN_VIEW, _BEYOND = 0.03, -0.08
"""Margin round the sheet, as a share of the photo."""
_FLAT_SHEETS = {
    **{name: FORMATS[name][0] / FORMATS[name][1] for name in ("a4", "letter", "legal")},
    "bank card": 53.98 / 85.6,
    **{f"odd {aspect}": aspect for aspect in (0.5, 0.545, 0.67, 0.735, 0.82, 0.9)},
}
"""Short side over long one. The odd ones are at least 3 % from each format."""
METRICS = {
    "aspect_error_percent": Metric(0.1),
    "named_right": Metric(0.0, larger_is_better=True),
    "named_wrongly": Metric(0.0),
    "beyond_two_deviations": Metric(0.0),
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


def take_flat(index: int, sheet: str) -> SimulatedPhoto:
    """One dirty photo of a flat sheet, upright or not; two of three are taken from straight above a side of it."""
    rng = np.random.default_rng(9000 + index)
    aspect = _FLAT_SHEETS[sheet] if rng.random() < 0.5 else 1 / _FLAT_SHEETS[sheet]
    width = round(_PAGE_WIDTH * min(1.0, aspect * 1.3))
    page = own_pages(width, round(width / aspect))[index % 5]
    azimuth_deg = rng.uniform(0, 360) if index % 3 == 2 else 90.0 * rng.integers(4) + rng.normal(0, 1)
    focal_px = TYPICAL_FOCAL_LENGTH * np.hypot(*PHOTO_SIZE) * np.exp(rng.normal(0, 0.25))
    view = View(str(index), focal_px, rng.uniform(8, 35), azimuth_deg, rng.uniform(-8, 8))
    camera = view.camera(*_SIZE)
    desk = desk_texture(camera.width, camera.height, rng)
    pose = view.pose(page, PLANE, camera, margin=_IN_VIEW)
    photo = simulate_photo(page, PLANE, 0.0, pose, camera, background=desk)
    return SimulatedPhoto(degrade(photo.image, PHONE, rng), photo.truth)


def aspect_error(size: SheetSize, photo: SimulatedPhoto) -> float:
    """Logarithm of the sheet's aspect over the true one; the view may be turned."""
    assert size.aspect is not None
    true = float(np.log(photo.truth.page.width / photo.truth.page.height))
    found = float(np.log(size.aspect))
    return min(found - true, -found - true, key=abs)


def measure_flat(count: int, figures: Figures) -> None:
    """Print a line a photo of a flat sheet, and how often the stated deviation holds; add to `figures`."""
    errors: dict[bool, list[float]] = {False: [], True: []}
    beyond = wrong = 0
    for index in range(count):
        sheet, exif = list(_FLAT_SHEETS)[index % len(_FLAT_SHEETS)], index // len(_FLAT_SHEETS) % 2 == 1
        photo = take_flat(index, sheet)
        size = measure(photo, exif=exif)
        if size is None or size.aspect is None or size.aspect_deviation is None:
            print(f"{index:2d} {sheet}: {'refused' if size is None else size.reason}")
            continue
        error = aspect_error(size, photo)
        case = {
            "aspect_error_percent": 100 * abs(error),
            "beyond_two_deviations": float(abs(error) > 2 * size.aspect_deviation),
            "named_wrongly": float(size.paper not in (None, sheet)),
        }
        figures[f"{index} {sheet} flat"] = case
        errors[exif].append(abs(error))
        beyond, wrong = beyond + int(case["beyond_two_deviations"]), wrong + int(case["named_wrongly"])
        print(
            f"{index:2d} {sheet:9s} {'exif' if exif else '    '} {'any view' if index % 3 == 2 else 'one point'}: "
            f"aspect off by {100 * abs(error):.2f} %, said {100 * size.aspect_deviation:.2f} %, {size.paper}",
            flush=True,
        )
    measured = sum(map(len, errors.values()))
    print(
        f"{measured} flat sheets: aspect beyond two deviations {beyond}, named wrongly {wrong}; off by "
        + ", ".join(
            f"{100 * np.median(found):.2f} % (median), {100 * np.percentile(found, 95):.2f} (95 %) {name} EXIF"
            for found, name in ((errors[False], "without"), (errors[True], "with"))
            if found
        )
    )


def measure(photo: SimulatedPhoto, *, exif: bool) -> SheetSize | None:
    """What the product says of the sheet; None for a photo that is refused."""
    focal_px = photo.truth.camera.focal_length_px if exif else None
    try:
        result = rectify(photo.image, RectifyParameters(upright=False), focal_px)
    except NoText:
        return None
    height, width = result.image.shape[:2]
    assumed = result.camera.source == "assumed"
    return measure_size(
        "auto", result.corners, result.mesh, width, height, camera_assumed=assumed, seen=result.sheet_aspect
    )


def measure_views(count: int, figures: Figures) -> None:
    """Print a line a photo with the sheet in view or beyond it, and the shares; add to `figures`."""
    errors: list[float] = []
    right = wrong = unnamed = wrong_beyond = 0
    for index in range(count):
        sheet = list(_SHEETS)[index % len(_SHEETS)]
        photo = take(index, sheet, margin=_IN_VIEW)
        size = measure(photo, exif=index % 2 == 0)
        found = None if size is None else size.paper
        wanted = sheet if sheet in FORMATS else None
        right, unnamed = right + (found == wanted), unnamed + (found is None and wanted is not None)
        wrong += found not in (None, wanted)
        case = {"named_right": float(found == wanted), "named_wrongly": float(found not in (None, wanted))}
        if size is not None and size.aspect is not None:
            error = 100.0 * abs(aspect_error(size, photo))
            errors.append(error)
            case["aspect_error_percent"] = error
        figures[f"{index} {sheet}"] = case
        print(
            f"{index:2d} {sheet:7s} {'exif' if index % 2 == 0 else '    '} {'bent' if index % 3 == 2 else 'flat'}: "
            f"aspect off by {case.get('aspect_error_percent', np.nan):.2f} %, {found} "
            f"{'' if size is None or found == wanted else size.reason}",
            flush=True,
        )
    for index in range(count):
        sheet = list(_SHEETS)[index % len(_SHEETS)]
        size = measure(take(100 + index, sheet, margin=_BEYOND), exif=index % 2 == 0)
        named = size is not None and size.paper is not None
        wrong_beyond += named
        figures[f"{index} {sheet} beyond the photo"] = {"named_wrongly": float(named)}
        if named:
            print(f"{index} {sheet} beyond the photo: {size}")
    print(
        f"{count} photos with the sheet in view: aspect off by {np.median(errors):.2f} % (median), "
        f"{np.percentile(errors, 95):.2f} (95 %), in {len(errors)} photos; right {right}, not named {unnamed}, wrong "
        f"{wrong}. {count} without: named {wrong_beyond}"
    )


def main(arguments: Sequence[str]) -> int:
    """Print a line a photo and the shares; compare with the committed figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks paper", description=__doc__)
    parser.add_argument("--photos", type=int, default=20, help="with the sheet in view, and as many without")
    parser.add_argument("--flat", type=int, default=60, help="flat sheets, of formats and odd ones")
    parser.add_argument("--update-baseline", action="store_true")
    asked = parser.parse_args(arguments)
    figures: Figures = {}
    if asked.photos:
        measure_views(asked.photos, figures)
    measure_flat(asked.flat, figures)
    report, fine = judge(BASELINE / "paper.json", figures, METRICS, update=asked.update_baseline)
    print(report)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
