"""What does not depend on our own code, kept between runs: how photos and their true maps read, the peers' pages.

It is filed under digests of the pictures themselves, so nothing stale is ever found; a new version of the
reader or of a peer is what `--fresh` is for.
"""

import hashlib
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

from benchmarks.common import scan_distances
from benchmarks.common.peers import run_page_dewarp, run_uvdoc
from benchmarks.common.plots import load_picture, save_picture
from benchmarks.common.reading import Reader, Reading, prepare
from benchmarks.common.scan_distances import ScanDistances, compare_with_scan
from benchmarks.common.stopwatch import Usage
from services.arrays import GrayImage, RgbImage
from services.ocr.engine import OcrEngine, Word

PeerPage = tuple[RgbImage | None, Usage, str]
"""A peer's page (None when it failed), what it took, and why it failed."""


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

    def distances(self, view: RgbImage, scan: RgbImage) -> ScanDistances:
        """See `compare_with_scan`; filed under its own code too, which is no one else's."""
        if self.folder is None:
            return compare_with_scan(view, scan)
        code = hashlib.sha256(Path(scan_distances.__file__).read_bytes())
        code.update(scan.tobytes())
        file = self._file(code.hexdigest(), view, ".json")
        if file.is_file():
            return ScanDistances(**json.loads(file.read_text(encoding="utf-8")))
        distances = compare_with_scan(view, scan)
        _write(file, json.dumps(asdict(distances)))
        return distances

    def page_dewarp(self, command: str, photo: RgbImage) -> PeerPage:
        """See `run_page_dewarp`; only its pages are kept, with what they took: a failure is tried again."""
        return self._peer("page-dewarp with jax", lambda: run_page_dewarp(command, photo), photo)

    def uvdoc(self, python: str, photo: RgbImage) -> PeerPage:
        """See `run_uvdoc`; kept like page-dewarp's pages."""
        return self._peer("UVDoc", lambda: run_uvdoc(python, photo), photo)

    def _peer(self, name: str, run: Callable[[], PeerPage], photo: RgbImage) -> PeerPage:
        """Filed under the peer's name, not its command: folders and machines differ."""
        if self.folder is None:
            return run()
        file = self._file(name, photo, ".json")
        picture = file.with_suffix(".png")
        if file.is_file():
            return load_picture(picture), Usage(**json.loads(file.read_text(encoding="utf-8"))), ""
        page, usage, trouble = run()
        if page is not None:
            save_picture(picture, page)
            _write(file, json.dumps(asdict(usage)))
        return page, usage, trouble

    def _file(self, who: str, image: RgbImage | GrayImage, suffix: str) -> Path:
        assert self.folder is not None
        digest = hashlib.sha256(f"{who} {image.shape} ".encode())
        digest.update(image.tobytes())
        return self.folder / (digest.hexdigest()[:32] + suffix)


def kept_picture(
    folder: Path | None, sources: Sequence[Path], make: Callable[[], RgbImage | None]
) -> RgbImage | None:
    """`make()`, kept under a digest of the files that it depends on; nothing is kept without a folder."""
    if folder is None:
        return make()
    digest = hashlib.sha256(b"".join(hashlib.sha256(file.read_bytes()).digest() for file in sources))
    file = folder / (digest.hexdigest()[:32] + ".png")
    none = file.with_suffix(".none")
    if file.is_file() or none.is_file():
        return load_picture(file) if file.is_file() else None
    made = make()
    if made is None:
        _write(none, "")
    else:
        folder.mkdir(parents=True, exist_ok=True)
        save_picture(file, made)
    return made


def _write(file: Path, text: str) -> None:
    """Whole or not at all, whoever else writes it at the same time."""
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_suffix(f".{os.getpid()}")
    part.write_text(text, encoding="utf-8")
    part.replace(file)
