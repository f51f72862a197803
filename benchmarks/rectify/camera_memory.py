"""What ten earlier photos of a camera bring: mesh errors of planar photos with and without its memory.

python -m benchmarks camera_memory [--photos N] [--earlier N] [--whole]

The photos have the pages, poses and skews of the experiment `planar`; each pose is a camera of its own. In some poses
the text lines are almost parallel in the photo and hardly show the focal length: these make the 95th percentile.
The sides of the sheet are out of view, because they show the focal length too (`--whole`: the experiment's own photos).
The earlier photos are of other pages, tilts and directions.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.common.places import data_folder
from benchmarks.common.residuals import mesh_residual_percent
from benchmarks.rectify.cases import EXPERIMENTS, all_cases, load_pages, photograph_case
from services.contract.cameras import CameraMemory, remember
from services.contract.rectify import RectifyParameters
from services.errors import NoText
from services.geometry.photo_frame import PhotoFrame
from services.rectify.analysis.focal_length import seen_focal_length
from services.rectify.pipeline import rectify
from services.rectify.results import RectifyResult
from simulation.degradation import PHONE, degrade
from simulation.flat_page import Page
from simulation.pages import own_pages
from simulation.photo import SimulatedPhoto, simulate_photo
from simulation.scenes import PHOTO_SIZE, PLANE, View

_SIZE = (1400, 1800)
"""Of photos without the sheet's sides."""
_BEYOND = -0.08
"""Margin round the sheet, as a share of the photo: its sides are out of view, text decides."""
_PLAIN = RectifyParameters(upright=False, camera="it")


def take_earlier(index: int, focal_px: float) -> SimulatedPhoto:
    """One earlier photo of a camera, tilted by 3 to 35 degrees in any direction."""
    rng = np.random.default_rng(index)
    view = View(str(index), focal_px, rng.uniform(3, 35), rng.uniform(0, 360), rng.uniform(-8, 8))
    page = own_pages(900, 1406)[index % 5]
    return take(page, view, 0.0, rng)


def take(page: Page, view: View, skew_rad: float, rng: np.random.Generator) -> SimulatedPhoto:
    """A dirty photo of a flat page, the sides of its sheet out of view."""
    camera = view.camera(*_SIZE)
    # The pose is that of the page without skew: what the skew turns out of view is cut off.
    photo = simulate_photo(page, PLANE, skew_rad, view.pose(page, PLANE, camera, margin=_BEYOND), camera)
    return SimulatedPhoto(degrade(photo.image, PHONE, rng), photo.truth)


def flatten(photo: SimulatedPhoto, parameters: RectifyParameters) -> RectifyResult | None:
    """The result; None for a photo that is refused."""
    try:
        return rectify(photo.image, parameters)
    except NoText:
        return None


def error_of(result: RectifyResult | None, photo: SimulatedPhoto) -> float:
    """RMS error of the mesh after the best similarity, percent of the page's width; 100 for a refused photo."""
    if result is None:
        return 100.0
    height, width = result.image.shape[:2]
    return mesh_residual_percent(result.mesh, width, height, photo.truth)


def learn(camera: int, focal_px: float, count: int) -> CameraMemory | None:
    """What `count` earlier photos show of a camera; None if none of them shows its focal length."""
    frame, seen = PhotoFrame(*_SIZE), []
    for index in range(count):
        result = flatten(take_earlier(1000 * camera + index, focal_px), _PLAIN)
        shown = None if result is None else seen_focal_length(frame, result.camera, _PLAIN, None)
        if shown is not None:
            seen.append((float(np.log(shown[0] / frame.unit_px)), shown[1]))
    if not seen:
        print(f"camera {camera + 1}: no page showed its focal length")
        return None
    memory = remember("it", seen)
    true = float(np.log(focal_px / PhotoFrame(*PHOTO_SIZE).unit_px))
    print(
        f"camera {camera + 1}: {len(seen)} of {count} photos showed it, log focal length {memory.log_focal:.3f} +- "
        f"{memory.deviation:.3f}, true {true:.3f}",
        flush=True,
    )
    return memory


def main(arguments: Sequence[str]) -> int:
    """Print a line a camera and a photo, and percentiles."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks camera_memory", description=__doc__)
    parser.add_argument(
        "--whole", action="store_true", help="the sheet's sides in view, as in the experiment"
    )
    parser.add_argument("--photos", type=int, default=60, help="photos of the experiment, of 60")
    parser.add_argument("--earlier", type=int, default=10, help="earlier photos of each camera")
    asked = parser.parse_args(arguments)
    experiment = EXPERIMENTS["planar"]
    pages = {page.name: page for page in load_pages(data_folder(None))[0]}
    memories = [
        learn(number, view.focal_length_px, asked.earlier) for number, view in enumerate(experiment.views)
    ]
    pairs: list[tuple[float, float]] = []
    for case in all_cases(experiment, tuple(pages), degraded=True)[: asked.photos]:
        page, memory = pages[case.page], memories[case.pose]
        photo = (
            photograph_case(case, page)
            if asked.whole
            else take(
                page,
                experiment.views[case.pose],
                experiment.skews_rad[case.skew],
                np.random.default_rng(1000 + case.number),
            )
        )
        without = flatten(photo, _PLAIN)
        known = without if memory is None else flatten(photo, replace(_PLAIN, cameras=(memory,)))
        pairs.append((error_of(without, photo), error_of(known, photo)))
        sources = [None if each is None else each.camera.source for each in (without, known)]
        print(
            f"  {case.name:36s} {pairs[-1][0]:.3f} % {sources[0]}, with memory {pairs[-1][1]:.3f} % {sources[1]}",
            flush=True,
        )
    before, after = np.percentile(np.array(pairs), [50, 95], axis=0).T
    print(
        f"{len(pairs)} photos: median {before[0]:.3f} % without, {after[0]:.3f} % with memory; "
        f"95th percentile {before[1]:.3f} % and {after[1]:.3f} %"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
