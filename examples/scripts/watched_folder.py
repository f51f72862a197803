"""Photos that are put into a folder become searchable PDFs in another.

python watched_folder.py IN OUT [--url http://127.0.0.1:8000] [--once]

A photo is sent when its size has not changed for a turn. It then moves to IN/done, or to IN/failed with a text
file that has the problem. It needs the client: pip install ./clients/python
"""

import argparse
import sys
import time
from pathlib import Path

from document_rectification_client import Client, ProblemError

SUFFIXES = {".jpg", ".jpeg", ".png", ".webp", ".tif", ".tiff", ".heic", ".pdf"}


def work_through(folder: Path, out: Path, client: Client, sizes: dict[Path, int]) -> int:
    """Send all photos that are complete; number of PDFs made. `sizes` are those of the last turn."""
    made = 0
    for photo in sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES):
        size = photo.stat().st_size
        if sizes.get(photo) != size:  # still being written
            sizes[photo] = size
            continue
        del sizes[photo]
        try:
            pdf = client.flatten([photo], text=True)
        except ProblemError as problem:
            failed = folder / "failed"
            failed.mkdir(exist_ok=True)
            (failed / f"{photo.name}.txt").write_text(f"{problem}\n", encoding="utf-8")
            photo.rename(failed / photo.name)
            continue
        pdf.save(out / f"{photo.stem}.pdf")
        done = folder / "done"
        done.mkdir(exist_ok=True)
        photo.rename(done / photo.name)
        made += 1
    return made


def main(arguments: list[str]) -> int:
    """Watch until interrupted, or work through the folder once."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--url", default="http://127.0.0.1:8000")
    parser.add_argument("--once", action="store_true", help="stop when the folder has been worked through")
    parser.add_argument("--every-s", type=float, default=2.0)
    asked = parser.parse_args(arguments)
    asked.out.mkdir(parents=True, exist_ok=True)
    client = Client(asked.url)
    sizes: dict[Path, int] = {}
    while True:
        work_through(asked.folder, asked.out, client, sizes)
        if asked.once and not sizes:
            return 0
        time.sleep(asked.every_s)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
