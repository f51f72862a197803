"""What is read: flat views with known text, by kind, and which of them are set aside."""

import csv
import json
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from benchmarks.common.memory import kept_picture
from benchmarks.common.plots import load_picture
from benchmarks.rectify.app_scans import SET_ASIDE
from benchmarks.rectify.real_photos import find_photos
from benchmarks.rectify.subject import rectify_file
from services.arrays import RgbImage
from services.errors import DocumentError
from services.imaging.illumination import flatten_illumination
from services.ocr.engine import Word, mean_confidence
from services.operations.reader import ocr_engine
from simulation.pages import load_page

PARTS = ("photos", "app", "receipts", "pages")
VIEW_CODE = ("geometry", "imaging", "rectify", "sheet", "texture_flow")
"""Folders of `services` whose code a kept view depends on."""
_SURE = 0.6
"""Least mean confidence of a line of a scan that counts as known text."""


@dataclass(frozen=True, slots=True)
class Case:
    """A page to be read: where it is, its lines of text, and the true values of a receipt.

    `group` is the sheet, firm or shop; whole groups are set aside.
    """

    part: str
    path: Path
    group: str
    lines: tuple[str, ...]
    language: str = "eng"
    values: dict[str, str] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Part and file."""
        return f"{self.part}/{self.path.stem}"

    @property
    def is_set_aside(self) -> bool:
        """Whether the page was not looked at while the code was written."""
        return self.group in SET_ASIDE if self.part == "app" else zlib.crc32(self.group.encode()) % 3 == 0


def find_cases(data: Path, part: str) -> Iterator[Case]:
    """Pages of one part of the data, in the order of their names; none where the data are absent."""
    return {"photos": _photos, "app": _app_scans, "receipts": _receipts, "pages": _pages}[part](data)


def view_of(case: Case, memory: Path | None) -> RgbImage | None:
    """The flat view (H, W, 3) that is read: of a photo as the product draws it; None where it is refused."""
    if case.part in ("receipts", "pages"):
        return load_picture(case.path)
    code = [file for folder in VIEW_CODE for file in sorted(Path("services", folder).rglob("*.py"))]
    return kept_picture(memory, [case.path, *code], lambda: _flat_view(case))


def _flat_view(case: Case) -> RgbImage | None:
    try:
        return rectify_file(case.path, ocr_engine(case.language))[1]().image
    except DocumentError:
        return None


def _photos(data: Path) -> Iterator[Case]:
    for photo in find_photos(data):
        if photo.truth:
            name = photo.name
            sheet = name.rsplit("-", 1)[0] if name.startswith(("docunet", "sheet", "doceng")) else name
            lines = tuple(line for line in photo.truth.splitlines() if line.strip())
            yield Case("photos", photo.path, sheet, lines)


def _app_scans(data: Path) -> Iterator[Case]:
    engine = ocr_engine("rus")
    for scan in sorted((data / "photos_app").glob("*.scan.jpg")) if engine else []:
        sheet, kept = scan.name.removesuffix(".scan.jpg"), scan.name
        photos = sorted((data / "photos_app").glob(f"{sheet}-set*.jpg"))
        gray = cv2.imread(str(scan), cv2.IMREAD_GRAYSCALE)
        assert engine is not None
        assert gray is not None, kept
        lines = lines_of(engine.read_page(flatten_illumination(np.asarray(gray, np.uint8))))
        known = tuple(text_of(line) for line in lines if mean_confidence(line) >= _SURE)
        for photo in photos:
            yield Case("app", photo, sheet, known, "rus")


def _receipts(data: Path) -> Iterator[Case]:
    for file in sorted((data / "layout" / "receipts").glob("*.json")):
        values = json.loads(file.read_text(encoding="utf-8"))
        with file.with_suffix(".csv").open(encoding="utf-8", newline="") as boxes:
            lines = printed_rows([",".join(row[8:]) for row in csv.reader(boxes)], _boxes(file))
        yield Case(
            "receipts", file.with_suffix(".jpg"), values.get("company", file.stem), lines, "eng", values
        )


def _boxes(file: Path) -> np.ndarray:
    """Boxes (N, 4) of the lines of a receipt."""
    with file.with_suffix(".csv").open(encoding="utf-8", newline="") as rows:
        corners = np.array([[float(value) for value in row[:8]] for row in csv.reader(rows)])
    corners = corners.reshape(-1, 4, 2)
    return np.hstack([corners.min(axis=1), corners.max(axis=1)])


def printed_rows(texts: Sequence[str], boxes: np.ndarray) -> tuple[str, ...]:
    """Lines of print of boxed texts (N, 4): those that share half of the lower one's height, from left to right."""
    rows: list[list[int]] = []
    for index in np.argsort(boxes[:, 1] + boxes[:, 3], kind="stable").tolist():
        last = boxes[rows[-1][-1]] if rows else None
        box = boxes[index]
        if last is not None:
            common = min(last[3], box[3]) - max(last[1], box[1])
            if common >= 0.5 * min(last[3] - last[1], box[3] - box[1]):
                rows[-1].append(index)
                continue
        rows.append([index])
    return tuple(" ".join(texts[k] for k in sorted(row, key=lambda k: boxes[k, 0])) for row in rows)


def _pages(data: Path) -> Iterator[Case]:
    for file in sorted((data / "pages").glob("*.png")):
        page = load_page(file)
        lines = tuple(" ".join(word.text for word in line) for line in page.lines)
        yield Case("pages", file, file.stem, lines)


def lines_of(words: Sequence[Word]) -> list[list[Word]]:
    """The engine's own lines, in its order."""
    lines: dict[int | None, list[Word]] = {}
    for word in words:
        lines.setdefault(word.line, []).append(word)
    return list(lines.values())


def text_of(line: Sequence[Word]) -> str:
    """Words of a line with spaces between them."""
    return " ".join(word.text for word in line)
