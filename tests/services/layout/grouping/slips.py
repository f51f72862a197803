"""Made receipts, whose total is a part of a line, and a model of them."""

from dataclasses import replace

import numpy as np

from services.layout.learning.initialization import initialize_model
from services.layout.learning.label_transfer import transfer_labels
from services.layout.model.layout_model import LayoutModel
from services.layout.page import Page
from services.layout.segmentation import FinePage, Line, compose_page
from services.ocr.engine import Word

EM = 16.0


def fine_page(*blocks: tuple[str, ...], top: float = 40.0) -> FinePage:
    """A page of blocks of lines; words are separated by blanks, two blanks are a wide space."""
    lines, boxes, words, grouped = [], [], [], []
    y = top
    for block in blocks:
        own = []
        for text in block:
            x, found = 30.0, []
            for chunk in text.split(" "):
                if not chunk:
                    x += 4 * EM
                    continue
                found.append(Word(chunk, (x, y, x + 8.0 * len(chunk), y + 12.0), 0.95))
                x += 8.0 * len(chunk) + 5.0
            box = (30.0, y, found[-1].box[2], y + 12.0)
            own.append(len(lines))
            lines.append(Line(np.arange(6), box, y + 12.0, EM, 8.0, 1.5))
            boxes.append(box)
            words.append(tuple(found))
            y += 22.0
        grouped.append(tuple(own))
        y += 30.0
    texts = tuple(" ".join(word.text for word in own) for own in words)
    return FinePage(
        500.0, 700.0, 1.0, tuple(lines), np.array(boxes), texts, tuple(words), frozenset(), tuple(grouped), ()
    )


def slip(number: int) -> FinePage:
    """A receipt: its head, and one block with a total that stands in any row."""
    rows = ["Cash  60.00", f"Total  {40 + number}.20", "Change  7.80", "Subtotal  38.00"]
    rows = rows[number % 4 :] + rows[: number % 4]
    return fine_page(("ACME TRADING LTD", "Tel 5550 123"), tuple(rows), top=40.0 + 9 * (number % 3))


def numbered(number: int) -> FinePage:
    """A bill whose number stands behind its key, without a colon or a wide space."""
    rows = ("Your account is due", f"Invoice No. 2026-01{number:02d}", "Thank you for your order")
    return fine_page(("ACME TRADING LTD", "Tel 5550 123"), rows, top=40.0 + 9 * (number % 3))


def sample(number: int) -> tuple[Page, Page]:
    """The slip with its total drawn as a zone of its own, and as segmentation finds it."""
    return _with_part(slip(number), f"{40 + number}.20", "total")


def _with_part(fine: FinePage, text: str, label: str) -> tuple[Page, Page]:
    found = compose_page(fine)
    word = next(w for own in fine.words for w in own if w.text == text)
    part = replace(found.zones[1], id="t", box=word.box, label=label, text=text, words=(), lines=1)
    head = replace(found.zones[0], label="head")
    verified = Page(found.width, found.height, (head, part))
    return verified, transfer_labels(verified, found)


def model_of_slips(count: int = 5) -> LayoutModel:
    """Of samples whose total is drawn."""
    return _model([sample(number) for number in range(count)])


def model_of_numbered(count: int = 4) -> LayoutModel:
    """Of samples whose number is drawn."""
    return _model([_with_part(numbered(k), f"2026-01{k:02d}", "number") for k in range(count)])


def _model(samples: list[tuple[Page, Page]]) -> LayoutModel:
    return initialize_model("slip", [page for page, _ in samples], found=[found for _, found in samples])
