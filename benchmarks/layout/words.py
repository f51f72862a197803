"""The words that the engine reads on the labelled pages, kept between runs: reading is what takes the time."""

import os
import pickle
from pathlib import Path

from benchmarks.layout.truth import LabelledPage
from services.arrays import GrayImage
from services.imaging.illumination import flatten_illumination
from services.ocr.engine import OcrEngine, Word


class PageWords:
    """Reads pages by `engine`; keeps words in `folder` as ID.pkl, where a folder is given.

    The files are this benchmark's own: never point `folder` at pickles of strangers.
    """

    def __init__(self, engine: OcrEngine | None, folder: Path | None) -> None:
        self._engine = engine
        self._folder = folder

    def read(self, page: LabelledPage, image: GrayImage) -> list[Word] | None:
        """Words on `image` (H, W) of `page`; None where neither an engine nor kept words are at hand."""
        kept = None if self._folder is None else self._folder / f"{page.name}.pkl"
        if kept is not None and kept.is_file():
            words: list[Word] = pickle.loads(kept.read_bytes())
            return words
        if self._engine is None:
            return None
        words = self._engine.read_page(flatten_illumination(image))
        if kept is not None:
            kept.parent.mkdir(parents=True, exist_ok=True)
            part = kept.with_suffix(f".{os.getpid()}")
            part.write_bytes(pickle.dumps(words))
            part.replace(kept)
        return words
