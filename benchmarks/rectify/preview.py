"""Previews beside full answers: CPU seconds, and how far their meshes are apart.

python -m benchmarks preview [--simulated N] [--close N] [--photos NAME ...]
"""

import argparse
import io
import sys
import time
from collections.abc import Iterator, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.interpolate import LinearNDInterpolator

from benchmarks.common.places import data_folder
from benchmarks.common.residuals import fit_similarity
from services.arrays import Points, RgbImage
from services.contract.images import DocumentLimits, Encoding
from services.contract.rectify import RectifyParameters
from services.errors import DocumentError
from services.operations.rectify_documents import rectify_uploads
from simulation.degradation import PHONE, degrade
from simulation.pages import own_pages
from simulation.photo import simulate_photo
from simulation.scenes import BOOK, PLANE, POSES, WAVE, photograph

_SIZE = (3000, 4000)
_BEYOND = -0.08
"""Margin round the sheet in close photos, as a share of the photo: its sides are out of view, text decides."""
_RUNS = 3
"""Of a preview; the least time counts."""


def simulated_photos(count: int) -> Iterator[tuple[str, bytes]]:
    """Photos of 12 megapixels, planar and bent in turns, as JPEG."""
    pages = own_pages()
    for index in range(count):
        shape, rng = (PLANE, BOOK)[index % 2], np.random.default_rng(index)
        page, view = pages[index % len(pages)], POSES[index % len(POSES)]
        photo = photograph(page, view, 0.0, shape, dirt=PHONE, rng=rng, size=_SIZE).image
        yield f"{'planar' if shape is PLANE else 'bent'} {index}", _as_jpeg(photo)


def close_photos(count: int) -> Iterator[tuple[str, bytes]]:
    """Photos of 12 megapixels, planar and bent in turns, as JPEG; the sheet's sides are out of view."""
    pages = own_pages()
    for index in range(count):
        shape, rng = (PLANE, BOOK, PLANE, WAVE)[index % 4], np.random.default_rng(100 + index)
        page, view = pages[index % len(pages)], POSES[(index // 2) % len(POSES)]
        camera = view.camera(*_SIZE)
        pose = view.pose(page, shape, camera, margin=_BEYOND)
        photo = degrade(simulate_photo(page, shape, 0.0, pose, camera).image, PHONE, rng)
        yield f"close {'planar' if shape is PLANE else 'bent'} {index}", _as_jpeg(photo)


def _as_jpeg(photo: RgbImage) -> bytes:
    file = io.BytesIO()
    Image.fromarray(photo).save(file, "JPEG", quality=90)
    return file.getvalue()


def answer(upload: bytes, *, preview: bool) -> tuple[dict[str, object], float]:
    """The JSON of an upload, and its CPU seconds."""
    parameters = RectifyParameters(upright=False, preview=preview)
    start = time.process_time()
    reply = rectify_uploads([upload], parameters, Encoding("json"), DocumentLimits())
    return reply.answer.model_dump(mode="json"), time.process_time() - start


def distance(full: dict[str, object], preview: dict[str, object]) -> NDArray[np.float64] | None:
    """Distances (N,) of the page's points in the preview from those in the full answer, over the page's width.

    The meshes are compared where both show the photo, after the best similarity, since they may be cut differently.
    """
    photo, output = _nodes(full)
    shown, flat = _nodes(preview)
    found = LinearNDInterpolator(shown, flat)(photo)
    sheet = full["corners"]
    inside = np.isfinite(found).all(axis=1)
    if isinstance(sheet, list) and all(corner is not None for corner in sheet):
        border = np.array(sheet, np.float32)
        inside &= [cv2.pointPolygonTest(border, (float(x), float(y)), False) >= 0 for x, y in photo]
    if inside.sum() < 50:
        return None
    turn, shift = fit_similarity(found[inside], output[inside])
    ones = np.array([1, 1j])
    left = np.abs(turn * (found[inside] @ ones) + shift - output[inside] @ ones)
    return np.asarray(left / float(str(full["width"])), np.float64)


def _nodes(document: dict[str, object]) -> tuple[Points, Points]:
    """Photo points (N, 2) and output pixels (N, 2) of the mesh's nodes."""
    mesh = document["mesh"]
    assert isinstance(mesh, dict)
    source = np.array(mesh["source"])
    width, height = float(str(document["width"])), float(str(document["height"]))
    x, y = np.meshgrid(
        np.linspace(0, width - 1, source.shape[1]), np.linspace(0, height - 1, source.shape[0])
    )
    return source.reshape(-1, 2), np.column_stack([x.ravel(), y.ravel()])


def main(arguments: Sequence[str]) -> int:
    """Print a line a photo, and medians."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks preview", description=__doc__)
    parser.add_argument("--simulated", type=int, default=6, help="simulated photos of 12 MP")
    parser.add_argument("--close", type=int, default=4, help="of which the sheet's sides are out of view")
    parser.add_argument("--photos", nargs="*", default=[], help="files in photos or photos_more, or paths")
    asked = parser.parse_args(arguments)
    folder = data_folder(None)
    uploads = [*simulated_photos(asked.simulated), *close_photos(asked.close)]
    for name in asked.photos:
        path = next(p for p in (folder / "photos" / name, folder / "photos_more" / name) if p.is_file())
        uploads.append((name, path.read_bytes()))
    rows: list[tuple[float, float, float, float]] = []
    for name, upload in uploads:
        try:
            full, spent = answer(upload, preview=False)
            previews = [answer(upload, preview=True) for _ in range(_RUNS)]
        except DocumentError as error:
            print(f"{name}: {error.code}")
            continue
        left = distance(full, previews[0][0])
        quick = min(seconds for _, seconds in previews)
        rms, far = (np.nan, np.nan) if left is None else (np.sqrt(np.mean(left**2)), np.percentile(left, 95))
        rows.append((spent, quick, float(rms), float(far)))
        evidence = previews[0][0]["evidence"]
        source = "+".join(evidence["source"]) if isinstance(evidence, dict) else ""
        print(
            f"{name:32s} full {full['kind']} {spent:5.2f} s  preview {previews[0][0]['kind']} by {source} "
            f"{quick:5.2f} s  apart {100 * rms:.2f} % (RMS), {100 * far:.2f} % (95 %)",
            flush=True,
        )
    middle = np.nanmedian(np.array(rows), axis=0)
    print(
        f"median of {len(rows)}: full {middle[0]:.2f} s, preview {middle[1]:.2f} s, apart {100 * middle[2]:.2f} % RMS; "
        f"within 1 %: {sum(row[2] < 0.01 for row in rows)}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
