"""Where the benchmarks' data and figures lie."""

import os
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
OUTPUT = REPOSITORY / "benchmarks" / "output"
MEMORY = OUTPUT / "memory"
BASELINE = REPOSITORY / "benchmarks" / "baseline"


def data_folder(given: str | None) -> Path:
    """`given`, else the environment's DOCUMENT_DATA, else ../shared/data beside the repository."""
    return Path(given or os.environ.get("DOCUMENT_DATA") or REPOSITORY.parent / "shared" / "data")
