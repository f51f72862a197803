"""The options that the benchmarks share."""

import argparse
import sys

from benchmarks.common.workers import MOST_WORKERS


def make_parser(name: str, description: str | None) -> argparse.ArgumentParser:
    """Parser of `python -m benchmarks <name>` with the shared options."""
    parser = argparse.ArgumentParser(
        prog=f"python -m benchmarks {name}",
        description=description,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--data", default=None, help="folder of the data (default: DOCUMENT_DATA, else ../shared/data)")
    add("--reader", choices=("tesseract", "rapidocr"), default="tesseract", help="the judge of the images")
    add("--rapidocr-python", default=sys.executable, help="a Python that has rapidocr and onnxruntime")
    add("--page-dewarp", default=None, help="page-dewarp's command (default: PAGE_DEWARP, else the PATH)")
    add("--workers", type=int, default=MOST_WORKERS, help="processes, 1 or 2")
    add("--fresh", action="store_true", help="keep nothing of earlier runs (see benchmarks/README.md)")
    add("--update-baseline", action="store_true", help="adopt these figures as the baseline")
    return parser
