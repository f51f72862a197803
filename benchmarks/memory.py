"""What does not depend on our own code, kept between runs: how photos and their true maps read, the peer's pages.

It is filed under digests of the pictures themselves, so nothing stale is ever found; a new version of the
reader or of the peer is what `--fresh` is for.
"""

import hashlib
import json
import os
from dataclasses import asdict
from pathlib import Path

from benchmarks.peers import run_page_dewarp
from benchmarks.plots import load_picture, save_picture
from benchmarks.reading import Reader, Reading, prepare
from benchmarks.stopwatch import Usage
from services.arrays import GrayImage, RgbImage
from services.ocr.engine import OcrEngine, Word


class Memory:
    """Files in `folder`; with None, everything is done anew and nothing is kept."""

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder

    def read(self, reader: Reader, image: RgbImage | GrayImage) -> Reading:
        """What `reader` reads in the image."""
        if self.folder is None:
            return reader.read(image)
        file = self._file(reader.name, prepare(image), ".json")
        if file.is_file():
            return Reading(**json.loads(file.read_text(encoding="utf-8")))
        reading = reader.read(image)
        _write(file, json.dumps(asdict(reading)))
        return reading

    def page_words(self, engine: OcrEngine, image: GrayImage) -> list[Word]:
        """Words that `engine` reads on the page, as it is."""
        if self.folder is None:
            return engine.read_page(image)
        file = self._file(f"{engine.name} words", image, ".json")
        if file.is_file():
            told = json.loads(file.read_text(encoding="utf-8"))
            return [Word(text, (x0, y0, x1, y1), sure) for text, (x0, y0, x1, y1), sure in told]
        words = engine.read_page(image)
        _write(file, json.dumps([(word.text, word.box, word.confidence) for word in words]))
        return words

    def page_dewarp(self, command: str, photo: RgbImage) -> tuple[RgbImage | None, Usage, str]:
        """See `run_page_dewarp`; only its pages are kept, with what they took: a failure is tried again."""
        if self.folder is None:
            return run_page_dewarp(command, photo)
        file = self._file(command, photo, ".json")
        picture = file.with_suffix(".png")
        if file.is_file():
            return load_picture(picture), Usage(**json.loads(file.read_text(encoding="utf-8"))), ""
        page, usage, trouble = run_page_dewarp(command, photo)
        if page is not None:
            save_picture(picture, page)
            _write(file, json.dumps(asdict(usage)))
        return page, usage, trouble

    def _file(self, who: str, image: RgbImage | GrayImage, suffix: str) -> Path:
        assert self.folder is not None
        digest = hashlib.sha256(f"{who} {image.shape} ".encode())
        digest.update(image.tobytes())
        return self.folder / (digest.hexdigest()[:32] + suffix)


def _write(file: Path, text: str) -> None:
    """Whole or not at all, whoever else writes it at the same time."""
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_suffix(f".{os.getpid()}")
    part.write_text(text, encoding="utf-8")
    part.replace(file)
