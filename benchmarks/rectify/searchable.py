"""Searchable PDFs of simulated photos: words found, places of their boxes, files that open.

python -m benchmarks searchable [--photos N] [--update-baseline]
"""

import argparse
import io
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import pikepdf
import pypdfium2
from scipy.spatial import cKDTree

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.places import BASELINE
from services.arrays import Points
from services.contract.images import DocumentLimits, Encoding
from services.contract.rectify import RectifyParameters
from services.errors import DocumentError
from services.imaging.codec import encode_image
from services.operations.page_reading import read_flat_page, reading_engine
from services.operations.rectify_documents import rectify_uploads
from services.operations.replies import finished_pdf
from services.text.photo_places import locate_points
from simulation.degradation import PHONE
from simulation.flat_page import Page
from simulation.pages import own_pages
from simulation.photo import SimulatedPhoto
from simulation.scenes import BOOK, PLANE, POSES, photograph

_SIZE = (1800, 2400)
_PAGE = (1200, 1875)
_WIDTH_IN = 8.27
_BOX_DPI = 150.0
METRICS = {
    "found_percent": Metric(0.5, larger_is_better=True),
    "box_median_px": Metric(0.1),
    "box_p95_px": Metric(0.5),
}
"""Figures of a photo that are compared with the committed ones."""


@dataclass(frozen=True, slots=True, eq=False)
class PdfWords:
    """Words of a PDF's page as a reader finds them, and their boxes (N, 4) in shares of the page, from the top left."""

    words: tuple[str, ...]
    boxes: np.ndarray


def read_pdf(data: bytes) -> PdfWords:
    """Words that PDFium finds on the first page."""
    page = pypdfium2.PdfDocument(data)[0]
    width, height = page.get_size()
    text = page.get_textpage()
    words: list[str] = []
    boxes: list[tuple[float, float, float, float]] = []
    letters, corners = "", []
    for index in range(text.count_chars() + 1):
        letter = text.get_text_range(index, 1) if index < text.count_chars() else " "
        if letter.strip():
            letters += letter
            corners.append(text.get_charbox(index))
        elif letters:
            left, bottom, right, top = (
                fold([c[k] for c in corners]) for k, fold in enumerate((min, min, max, max))
            )
            words.append(letters)
            boxes.append((left / width, 1 - top / height, right / width, 1 - bottom / height))
            letters, corners = "", []
    return PdfWords(tuple(words), np.array(boxes).reshape(-1, 4))


def opens(data: bytes) -> bool:
    """Whether the file needs no repair, by qpdf."""
    with pikepdf.open(io.BytesIO(data)) as document:
        return not document.check_pdf_syntax()


def found(words: Sequence[str], page: Page) -> int:
    """How many of the page's words are among `words`, each as often as it is printed."""
    wanted = Counter(word.text for line in page.lines for word in line)
    return sum((wanted & Counter(words)).values())


def clean_pdf(page: Page) -> bytes:
    """PDF of the page itself, with the text that the OCR reads on it."""
    engine, language = reading_engine(None)
    image = page.image if page.image.ndim == 3 else cv2.cvtColor(page.image, cv2.COLOR_GRAY2RGB)
    text = read_flat_page(np.asarray(image, np.uint8), engine, language)
    return finished_pdf(encode_image(image, "pdf"), [text], Encoding("pdf"), [300.0])


def ink_boxes(page: Page) -> np.ndarray:
    """Boxes (N, 4) of the ink of the page's words: the layer has these, and a typeface's boxes are higher."""
    gray = page.image if page.image.ndim == 2 else page.image.min(axis=2)
    boxes = []
    for word in (word for line in page.lines for word in line):
        x0, y0, x1, y1 = (round(edge) for edge in word.box)
        rows, columns = np.nonzero(gray[y0:y1, x0:x1] < 128)
        found = len(rows) > 0
        boxes.append(
            (x0 + columns.min(), y0 + rows.min(), x0 + columns.max() + 1, y0 + rows.max() + 1)
            if found
            else word.box
        )
    return np.array(boxes, np.float64)


def box_errors(boxes: np.ndarray, words: Sequence[str], page: Page) -> list[float]:
    """Largest distance of an edge of each box (N, 4), page pixels, from that of its word, in pixels at `_BOX_DPI`.

    A word of the PDF belongs to the nearest printed word of the same text.
    """
    printed = [word for line in page.lines for word in line]
    truth = ink_boxes(page)
    tree = cKDTree((truth[:, :2] + truth[:, 2:]) / 2)
    scale = _WIDTH_IN * _BOX_DPI / page.width
    errors = []
    for box, word in zip(boxes, words, strict=True):
        if not np.isfinite(box).all():
            continue
        _, near = tree.query((box[:2] + box[2:]) / 2, k=3)
        same = [k for k in near if printed[k].text == word]
        if same:
            errors.append(float(np.abs(truth[same[0]] - box).max()) * scale)
    return errors


def on_page(shares: np.ndarray, document: dict[str, object], photo: SimulatedPhoto) -> np.ndarray:
    """Boxes (N, 4) on the true page, in its pixels, of boxes in shares of the flat view of `document`."""
    mesh = document["mesh"]
    assert isinstance(mesh, dict)
    width, height = int(str(document["width"])), int(str(document["height"]))
    corners: Points = shares[:, [0, 1, 2, 1, 2, 3, 0, 3]].reshape(-1, 2) * [width, height] - 0.5
    places = locate_points(np.array(mesh["source"]), width, height, corners)
    flat = photo.truth.photo_to_page(places).reshape(-1, 4, 2) + 0.5  # edges, not centres, of pixels
    return np.column_stack([flat.min(axis=1), flat.max(axis=1)])


def main(arguments: Sequence[str]) -> int:
    """Print a line a photo, and the sums; compare with the committed figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks searchable", description=__doc__)
    parser.add_argument("--photos", type=int, default=20, help="planar and bent in turns")
    parser.add_argument("--update-baseline", action="store_true")
    asked = parser.parse_args(arguments)
    pages = own_pages(*_PAGE)
    clean: dict[str, tuple[int, list[float]]] = {}
    figures: Figures = {}
    ours = theirs = sound = 0
    errors: list[float] = []
    spent: list[float] = []
    for index in range(asked.photos):
        page, shape = pages[index // 2 % len(pages)], (PLANE, BOOK)[index % 2]
        if page.name not in clean:
            read = read_pdf(clean_pdf(page))
            own = box_errors(read.boxes * np.tile([page.width, page.height], 2), read.words, page)
            clean[page.name] = found(read.words, page), [float(v) for v in np.percentile(own, [50, 95])]
        view, rng = POSES[index % len(POSES)], np.random.default_rng(100 + index)
        photo = photograph(page, view, 0.0, shape, dirt=PHONE, rng=rng, size=_SIZE)
        name = f"{page.name} {'planar' if shape is PLANE else 'bent'} pose {view.name}"
        start = time.process_time()
        try:
            reply = rectify_uploads(
                [encode_image(photo.image, "jpeg", 92)],
                RectifyParameters(text=True),
                Encoding("pdf"),
                DocumentLimits(),
            )
        except DocumentError as error:
            print(f"{name}: {error.code}")
            figures[name] = {"found_percent": 0.0}
            theirs += clean[page.name][0]
            continue
        spent.append(time.process_time() - start)
        read = read_pdf(reply.body)
        sound += opens(reply.body)
        count, (of_clean, floor) = found(read.words, page), clean[page.name]
        ours, theirs = ours + count, theirs + of_clean
        own = box_errors(on_page(read.boxes, reply.answer.model_dump(mode="json"), photo), read.words, page)
        errors += own
        middle, far = (float(v) for v in np.percentile(own, [50, 95]))
        figures[name] = {"found_percent": 100 * count / of_clean, "box_median_px": middle, "box_p95_px": far}
        print(
            f"{name:26s} found {count} of {of_clean} of the clean page's ({100 * count / of_clean:.1f} %), boxes "
            f"{middle:.2f} px (95 %: {far:.2f}; clean page {floor[0]:.2f}, {floor[1]:.2f}), {spent[-1]:.1f} CPU s",
            flush=True,
        )
    print(
        f"{asked.photos} photos: {ours} of {theirs} words ({100 * ours / max(theirs, 1):.2f} %), boxes at 150 dpi "
        f"{np.median(errors):.2f} px, 95 % {np.percentile(errors, 95):.2f}; {sound} files open without repair; "
        f"{np.median(spent):.1f} CPU s"
    )
    report, fine = judge(BASELINE / "searchable.json", figures, METRICS, update=asked.update_baseline)
    print(report)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
