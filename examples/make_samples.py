"""Makes the sample photos and labelled pages of this folder: `python -m examples.make_samples`.

All of them are simulated, so anybody may use them for anything.
"""

import json
from io import BytesIO
from pathlib import Path

import img2pdf
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pillow_heif import register_heif_opener

from simulation.degradation import PHONE
from simulation.labelled_pages import LabelledPage, document_pages, letter_page
from simulation.mosaic_sets import photograph_set
from simulation.pages import own_pages
from simulation.scenes import BOOK, POSES, photograph

FOLDER = Path(__file__).parent
PHOTO_PX = (1500, 1900)
"""Width and height of photos of a whole page: small files, in which text can still be read."""
PART_PX = 1400
"""Longest side of photos of parts of a page."""


def make_samples(folder: Path = FOLDER) -> None:
    """Write all samples into `folder`."""
    _make_photos(folder)
    _make_parts(folder)
    _make_letters(folder)


def _make_photos(folder: Path) -> None:
    """A photo of a bent page on a desk, as a phone takes it."""
    page = own_pages(1100, 1700)[0]
    taken = photograph(page, POSES[0], 0.0, BOOK, dirt=PHONE, rng=np.random.default_rng(1), size=PHOTO_PX)
    photo = Image.fromarray(taken.image)
    photo.save(folder / "photo.jpg", quality=75)
    register_heif_opener()
    photo.save(folder / "photo.heic", quality=50)


def _make_parts(folder: Path) -> None:
    """Four overlapping photos of one page, and two overlapping scans of it."""
    page = own_pages(1600, 2500)[0]
    for name, image in zip(
        "abcd", photograph_set(page, 4, 0.3, np.random.default_rng(4)).images, strict=True
    ):
        photo = Image.fromarray(image)
        photo.thumbnail((PART_PX, PART_PX), Image.Resampling.LANCZOS)
        photo.save(folder / f"{name}.jpg", quality=75)
    sheet = Image.fromarray(page.image).convert("L").resize((1000, 1563), Image.Resampling.LANCZOS)
    for name, box in (("left", (0, 0, 600, 1563)), ("right", (400, 0, 1000, 1563))):
        sheet.crop(box).quantize(16).save(folder / f"{name}.png", optimize=True)


def _make_letters(folder: Path) -> None:
    """Two labelled letters, a page to recognize, and a letter of two pages."""
    for number in (1, 2):
        letter = letter_page(np.random.default_rng(number))
        _save(letter.image, folder / f"letter-{number}.png")
        (folder / f"letter-{number}.json").write_text(_labels(letter), encoding="utf-8")
    _save(letter_page(np.random.default_rng(7)).image, folder / "page.png")
    pages = [page.image for page in document_pages(np.random.default_rng(3), "letter", 2)]
    files = []
    for number, image in enumerate(pages, 1):
        assert image is not None
        path = folder / f"page-{number}.jpg"
        Image.fromarray(image).convert("L").save(path, quality=60, dpi=(150, 150))
        files.append(path.read_bytes())
    (folder / "letter.pdf").write_bytes(img2pdf.convert(files))


def _labels(page: LabelledPage) -> str:
    """The page as a sample; one zone a line."""
    document = page.document()
    zones = ",\n  ".join(json.dumps(zone) for zone in document["zones"])
    return f'{{"width": {page.width}, "height": {page.height}, "zones": [\n  {zones}\n]}}\n'


def _save(image: NDArray[np.uint8] | None, path: Path) -> None:
    """Write a page of print as a small PNG."""
    assert image is not None
    stream = BytesIO()
    Image.fromarray(image).convert("L").quantize(8).save(stream, "PNG", optimize=True)
    path.write_bytes(stream.getvalue())


if __name__ == "__main__":
    make_samples()
