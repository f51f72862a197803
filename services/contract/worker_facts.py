"""What a worker says of itself after its warm-up."""

from typing import NamedTuple


class WorkerFacts(NamedTuple):
    """Name of the worker's OCR engine (None: it has none), and the languages that it reads by Tesseract's names."""

    ocr: str | None = None
    languages: tuple[str, ...] = ()
