"""Nine photos of 12 megapixels with text, as one PDF: CPU seconds, memory beside that of single pages.

python -m benchmarks documents [--pages N]

Three photos, real ones where the data are there, are sent several times. Documents and single pages run in processes of
their own, which have done nothing before but read a small page.
"""

import argparse
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

from benchmarks.common.places import data_folder
from benchmarks.common.stopwatch import measured
from benchmarks.rectify.preview import simulated_photos
from benchmarks.rectify.searchable import opens
from services.contract.images import DocumentLimits, Encoding
from services.contract.rectify import RectifyParameters
from services.operations.rectify_documents import rectify_uploads
from services.operations.warming import warm_up

_REAL = ("textbook-code.jpg", "textbook-figures.jpg", "worksheet-french.jpg")
"""Photos of 12 megapixels."""
_MOST_CPU_S = 25.0
_MOST_MEMORY = 1.2


@dataclass(frozen=True, slots=True)
class Spent:
    """CPU seconds, the largest resident size (MB), and whether all files are sound."""

    cpu_s: float
    peak_mb: float
    sound: bool


def photos(folder: Path) -> list[bytes]:
    """Three photos of 12 megapixels as JPEG, simulated where there are no real ones."""
    real = [folder / "photos" / name for name in _REAL]
    if all(path.is_file() for path in real):
        return [path.read_bytes() for path in real]
    return [upload for _, upload in simulated_photos(3)]


def make_pdfs(documents: Sequence[Sequence[bytes]]) -> Spent:
    """Work one document after another in this process."""
    warm_up()
    sound = True
    with measured() as usage:
        for uploads in documents:
            reply = rectify_uploads(uploads, RectifyParameters(text=True), Encoding("pdf"), DocumentLimits())
            sound &= opens(reply.body)
            del reply
    return Spent(usage.cpu_s, usage.peak_mb, sound)


def in_process(documents: Sequence[Sequence[bytes]]) -> Spent:
    """`make_pdfs` in a fresh process."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(make_pdfs, documents).result()


def main(arguments: Sequence[str]) -> int:
    """Print both, and whether the document is within what is wanted."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks documents", description=__doc__)
    parser.add_argument("--pages", type=int, default=9)
    asked = parser.parse_args(arguments)
    uploads = photos(data_folder(None))
    single = in_process([[upload] for upload in uploads])
    whole = in_process([[uploads[index % len(uploads)] for index in range(asked.pages)]])
    print(f"{len(uploads)} photos one by one: {single.cpu_s:.1f} CPU s, peak {single.peak_mb:.0f} MB")
    print(
        f"{asked.pages} photos as one PDF: {whole.cpu_s:.1f} CPU s (wanted: {_MOST_CPU_S:g}), "
        f"peak {whole.peak_mb:.0f} MB, {whole.peak_mb / single.peak_mb:.2f} times (wanted: "
        f"{_MOST_MEMORY:g}); opens without repair: {'yes' if whole.sound and single.sound else 'NO'}"
    )
    within = whole.cpu_s <= _MOST_CPU_S and whole.peak_mb <= _MOST_MEMORY * single.peak_mb
    return 0 if within and whole.sound and single.sound else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
