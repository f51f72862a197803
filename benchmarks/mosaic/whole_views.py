"""Several photos that each show the whole of one sheet: the joint answer beside the best of the single ones.

python -m benchmarks mosaic_whole_views [--limit N] [--only TEXT] [--read] [--update-baseline]

Flat, smooth and creased sheets on a desk, in two or three photos of one camera from other places under other lamps. The
best single photo is chosen by the truth, after the fact: more photos must not make the page worse. `--read` has
Tesseract read the joint page, and each photo laid into the same frame by the true map, of which the best counts.
"""

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.places import BASELINE, data_folder
from benchmarks.common.reading import Reader, character_score, make_reader
from benchmarks.common.residuals import fit_similarity, mesh_on_page
from benchmarks.rectify.cases import load_pages
from benchmarks.rectify.sheet_experiments import CROSSED, CRUMPLED, FOLDED, LAMPS
from benchmarks.rectify.true_map import flatten_onto
from benchmarks.rectify.whole_sheets import MARGIN, SIZE, SMOOTH, pose_of_width
from services.contract.mosaic import MosaicParameters
from services.contract.rectify import RectifyParameters
from services.errors import DocumentError
from services.mosaic.pipeline import mosaic
from services.mosaic.results import MosaicResult
from services.rectify.pipeline import rectify
from simulation.degradation import PHONE
from simulation.flat_page import Page, Points
from simulation.photo import SimulatedPhoto
from simulation.scenes import View
from simulation.sheets import take_photo, with_margins
from simulation.surfaces import Shape
from simulation.truth import Truth

NAME = "mosaic_whole_views"
_SETS = 6
"""Of each kind."""
_LOST = 100.0
"""Error of a photo or a set without an answer, percent."""
METRICS = {"joint_percent": Metric(0.02), "joint_95_percent": Metric(0.05)}


@dataclass(frozen=True, slots=True)
class WholeViews:
    """One set: a sheet of this kind, with the number that draws its page, poses and lamps."""

    kind: str
    number: int

    @property
    def name(self) -> str:
        """As figures are filed under."""
        return f"{self.kind} {self.number}"

    @property
    def photos(self) -> int:
        """Two and three in turns."""
        return 2 + self.number % 2

    @property
    def shape(self) -> Shape:
        """The sheet's."""
        creased = {"folded": FOLDED, "crossed": CROSSED, "crumpled": CRUMPLED}
        return SMOOTH[self.kind] if self.kind in SMOOTH else creased[self.kind][self.number]


KINDS = (*SMOOTH, "folded", "crossed", "crumpled")


def all_sets() -> Iterator[WholeViews]:
    """Kinds in turns, so that any first few are varied."""
    for number in range(_SETS):
        for kind in KINDS:
            yield WholeViews(kind, number)


def photograph(case: WholeViews, pages: Sequence[Page]) -> list[SimulatedPhoto]:
    """The photos of a set; what is drawn depends on its number alone."""
    number = list(all_sets()).index(case)
    rng = np.random.default_rng(9000 + number)
    page = with_margins(pages[number % len(pages)], MARGIN)
    focal_length_px = rng.uniform(2000, 3200)
    photos = []
    for place in range(case.photos):
        view = View(case.name, focal_length_px, rng.uniform(4, 32), rng.uniform(0, 360), rng.uniform(-12, 12))
        camera = view.camera(*SIZE)
        pose = pose_of_width(view, page, case.shape, camera, rng.uniform(0.5, 0.68))
        truth = Truth(page, case.shape, 0.0, pose, camera)
        photos.append(take_photo(truth, LAMPS[(number + place) % len(LAMPS)], PHONE, rng))
    return photos


def errors_percent(shown: Points, page: Points, width: float) -> tuple[float, float]:
    """Median and 95th percentile of the distances that the best similarity leaves, percent of the page's width."""
    a, b = fit_similarity(shown, page)
    left = np.abs(a * (shown @ np.array([1, 1j])) + b - page @ np.array([1, 1j]))
    return (
        float(100 * np.median(left) / width),
        float(100 * np.percentile(left, 95) / width),
    )


def single_error_percent(photo: SimulatedPhoto) -> float:
    """Median error of one photo's own answer."""
    try:
        result = rectify(photo.image, RectifyParameters(upright=False))
    except DocumentError:
        return _LOST
    height, width = result.image.shape[:2]
    return errors_percent(*mesh_on_page(result.mesh, width, height, photo.truth), photo.truth.page.width)[0]


def joint_points(result: MosaicResult, photos: Sequence[SimulatedPhoto]) -> tuple[Points, Points]:
    """Points of the joint page that photos show, and what the page has there, (N, 2) each."""
    shown, page = [], []
    for photo, patch in zip(photos, result.patches, strict=True):
        if patch.mesh is None:
            continue
        truth, (rows, columns) = photo.truth, patch.mesh.shape[:2]
        x = np.linspace(0, truth.camera.width - 1, columns)
        y = np.linspace(0, truth.camera.height - 1, rows)
        points, mesh = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2), patch.mesh.reshape(-1, 2)
        seen = truth.on_page(points) & np.isfinite(mesh).all(axis=1)
        shown.append(mesh[seen])
        page.append(truth.photo_to_page(points[seen]))
    return np.concatenate(shown), np.concatenate(page)


def pose_errors_deg(result: MosaicResult, photos: Sequence[SimulatedPhoto]) -> tuple[float, float] | None:
    """Largest error of a camera's turn against the reference's, and median error of the sheet's normals, degrees.

    None where the photos were not laid on one sheet.
    """
    sheet = result.surface
    if sheet is None:
        return None
    cameras = {index: patch.camera for index, patch in enumerate(result.patches) if patch.camera is not None}
    first = photos[sheet.reference].truth
    turns = []
    for index, camera in cameras.items():
        true = photos[index].truth.pose.rotation() @ first.pose.rotation().T
        cosine = 0.5 * (np.trace(np.array(camera.rotation) @ true.T) - 1)
        turns.append(float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))))
    X, camera = np.array(sheet.nodes), cameras[sheet.reference]
    middles = 0.25 * (X[:-1, :-1] + X[1:, :-1] + X[:-1, 1:] + X[1:, 1:]).reshape(-1, 3)
    along, down = X[1:, 1:] - X[:-1, :-1], X[1:, :-1] - X[:-1, 1:]
    normals = np.cross(along, down).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    seen = camera.focal_length_px * middles[:, :2] / middles[:, 2:] + camera.principal_point
    on_page = first.on_page(seen)
    cosines = np.einsum("ni,ni->n", normals[on_page], first.normals(seen[on_page]))
    return max(turns), float(np.degrees(np.median(np.arccos(np.clip(cosines, -1, 1)))))


def measure(photos: Sequence[SimulatedPhoto], reader: Reader | None = None) -> dict[str, float]:
    """Figures of one set; CPU s of the joint answer over those of all single ones."""
    begin = time.process_time()
    best = min(single_error_percent(photo) for photo in photos)
    between = time.process_time()
    try:
        result = mosaic([photo.image for photo in photos], MosaicParameters(upright=False))
    except DocumentError:
        return {"best_percent": best, "joint_percent": _LOST, "joint_95_percent": _LOST}
    spent = time.process_time() - between
    points = joint_points(result, photos)
    median, most = errors_percent(*points, photos[0].truth.page.width)
    pose = pose_errors_deg(result, photos)
    sheet = {} if pose is None else {"turn_deg": pose[0], "normals_deg": pose[1]}
    read = {} if reader is None else _read(reader, result, photos, *points)
    return {
        "best_percent": best,
        "joint_percent": median,
        "joint_95_percent": most,
        "unplaced": float(len(result.unplaced)),
        "cpu_ratio": spent / (between - begin),
        **sheet,
        **read,
    }


def _read(
    reader: Reader, result: MosaicResult, photos: Sequence[SimulatedPhoto], shown: Points, page: Points
) -> dict[str, float]:
    """Character scores of the joint page and of the best photo by the true map, in the joint page's frame."""
    height, width = result.image.shape[:2]
    lines = [" ".join(word.text for word in line) for line in photos[0].truth.page.lines]
    true = [flatten_onto(photo.image, photo.truth, (width, height), shown, page) for photo in photos]
    scores = [
        100 * character_score(lines, reader.read(image).text)
        for image in (result.image, *true)
        if image is not None
    ]
    return {"characters": scores[0], "true_map_characters": max(scores[1:])}


def main(arguments: Sequence[str]) -> int:
    """Print a line a set, and percentiles; compare with the committed figures."""
    parser = argparse.ArgumentParser(prog=f"python -m benchmarks {NAME}", description=__doc__)
    parser.add_argument("--limit", type=int, default=None, help=f"sets, of {_SETS * len(KINDS)}")
    parser.add_argument("--only", default="", help="only sets whose name contains this")
    parser.add_argument("--read", action="store_true", help="characters that Tesseract reads, too")
    parser.add_argument("--update-baseline", action="store_true")
    asked = parser.parse_args(arguments)
    cv2.setNumThreads(1)
    pages, _ = load_pages(data_folder(None))
    figures: Figures = {}
    reader = make_reader("tesseract", "") if asked.read else None
    for case in [case for case in all_sets() if asked.only in case.name][: asked.limit]:
        found = figures[case.name] = measure(photograph(case, pages), reader)
        print(
            f"{case.name:12s} {case.photos} photos  best single {found['best_percent']:.3f} %  joint "
            f"{found['joint_percent']:.3f}, 95 % {found['joint_95_percent']:.3f}  CPU {found.get('cpu_ratio', 0):.2f}"
            + (
                f"  turn {found['turn_deg']:.2f} deg, normals {found['normals_deg']:.2f}"
                if "turn_deg" in found
                else ""
            )
            + (
                f"  characters {found['characters']:.2f}, true map {found['true_map_characters']:.2f}"
                if "characters" in found
                else ""
            ),
            flush=True,
        )
    for kind in (*KINDS, ""):
        rows = [row for name, row in figures.items() if name.startswith(kind)]
        if rows:
            worse = np.array([row["joint_percent"] - row["best_percent"] for row in rows])
            joint = [row["joint_percent"] for row in rows]
            ends = np.median([row["joint_95_percent"] for row in rows])
            print(
                f"{len(rows)} sets {kind:9s}: joint median {np.median(joint):.3f} %, largest {max(joint):.3f}, "
                f"95th percentiles {ends:.3f} (median); worse "
                f"than the best single by over 0.03: {np.sum(worse > 0.03)}, by over 0.1: {np.sum(worse > 0.1)}"
            )
    report, fine = judge(BASELINE / f"{NAME}.json", figures, METRICS, update=asked.update_baseline)
    print(report)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
