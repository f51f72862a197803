"""What ten earlier photos of a camera bring: mesh errors of planar photos with and without its memory.

python -m benchmarks camera_memory [--photos N]
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.common.sheet_errors import measure_sheet
from services.contract.cameras import remember
from services.contract.rectify import RectifyParameters
from services.errors import NoText
from services.geometry.photo_frame import PhotoFrame
from services.rectify.focal_length import seen_focal_length
from services.rectify.pipeline import rectify
from services.rectify.results import RectifyResult
from simulation.degradation import PHONE, degrade
from simulation.pages import own_pages
from simulation.photo import SimulatedPhoto, simulate_photo
from simulation.scenes import PLANE, View

_SIZE = (1050, 1350)
_EARLIER = 10
_FOCAL_PX = (2100.0, 2700.0)
"""Cameras, for photos of the standard size: wider and narrower than the typical one."""
_BEYOND = -0.08
"""Margin round the sheet, as a share of the photo."""


def take(index: int, focal_px: float) -> SimulatedPhoto:
    """One photo of a page, tilted by 3 to 35 degrees; the sides of the sheet are out of view, so that text decides."""
    rng = np.random.default_rng(index)
    view = View(str(index), focal_px, rng.uniform(3, 35), rng.uniform(0, 360), rng.uniform(-8, 8))
    page = own_pages(900, 1406)[index % 5]
    camera = view.camera(*_SIZE)
    pose = view.pose(page, PLANE, camera, margin=_BEYOND)
    photo = simulate_photo(page, PLANE, 0.0, pose, camera)
    return SimulatedPhoto(degrade(photo.image, PHONE, rng), photo.truth)


def flatten(photo: SimulatedPhoto, parameters: RectifyParameters) -> RectifyResult | None:
    """The result; None for a photo that is refused."""
    try:
        return rectify(photo.image, parameters)
    except NoText:
        return None


def error_of(result: RectifyResult | None, photo: SimulatedPhoto) -> float:
    """95th percentile of the mesh's error, percent of the page's width; 100 for a photo that is refused."""
    if result is None:
        return 100.0
    height, width = result.image.shape[:2]
    return measure_sheet(result.mesh, width, height, photo.truth).mesh_p95_percent


def main(arguments: Sequence[str]) -> int:
    """Print a line a photo and percentiles."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks camera_memory", description=__doc__)
    parser.add_argument("--photos", type=int, default=12, help="photos that follow, of each camera")
    asked = parser.parse_args(arguments)
    plain = RectifyParameters(upright=False, camera="it", kind="planar")
    pairs: list[tuple[float, float]] = []
    for camera, focal_px in enumerate(_FOCAL_PX):
        frame, seen = PhotoFrame(*_SIZE), []
        for index in range(_EARLIER):
            photo = take(1000 * camera + index, focal_px)
            result = flatten(photo, plain)
            shown = None if result is None else seen_focal_length(frame, result.camera, plain, None)
            if shown is not None:
                seen.append((float(np.log(shown[0] / frame.unit_px)), shown[1]))
        if not seen:
            print(f"camera {camera}: no page showed its focal length")
            continue
        memory = remember("it", seen)
        true = float(np.log(take(0, focal_px).truth.focal_length_px / frame.unit_px))
        print(
            f"camera {camera}: {len(seen)} of {_EARLIER} photos showed it, log focal {memory.log_focal:.3f} "
            f"+- {memory.deviation:.3f}, true {true:.3f}",
            flush=True,
        )
        for index in range(_EARLIER, _EARLIER + asked.photos):
            photo = take(1000 * camera + index, focal_px)
            without = flatten(photo, plain)
            known = flatten(photo, replace(plain, cameras=(memory,)))
            pairs.append((error_of(without, photo), error_of(known, photo)))
            sources = [None if each is None else each.camera.source for each in (without, known)]
            print(
                f"  {pairs[-1][0]:.2f} % {sources[0]}, with memory {pairs[-1][1]:.2f} % {sources[1]}",
                flush=True,
            )
    before, after = np.percentile(np.array(pairs), [50, 95], axis=0).T
    print(
        f"{len(pairs)} photos: median {before[0]:.2f} % without, {after[0]:.2f} % with memory; "
        f"95th percentile {before[1]:.2f} % and {after[1]:.2f} %"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
