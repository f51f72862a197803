"""The shared pages with labelled zones (data/layout)."""

import json
from dataclasses import dataclass
from pathlib import Path

from benchmarks.common.places import data_folder
from services.layout.page import Page, Zone

TITLES_REAL = tuple(f"titles/real/{name}" for name in ("jose", "juliacon", "rescience"))
TITLES_MADE = tuple(f"titles/made/{name}" for name in ("acm", "elsevier", "ieee", "llncs", "revtex"))
LETTERS = ("letters/real", "letters/made")
SETS = (*TITLES_REAL, *TITLES_MADE, *LETTERS)
"""Sets whose zones are labelled; "letters/real_other" has classes only."""


@dataclass(frozen=True, slots=True)
class LabelledPage:
    """A page of the truth: its zones with labels, its class ("jose", "letter", ...), and where it lies."""

    name: str
    page: Page
    class_name: str
    file: Path

    @property
    def image(self) -> Path:
        """File of the page's picture."""
        return self.file.with_suffix(".webp")


def layout_folder(data: str | None = None) -> Path:
    """Folder of the sets in `data` (see `data_folder`)."""
    return data_folder(data) / "layout"


def load_page(file: Path) -> tuple[Page, str]:
    """True zones of a page (ID.json) in the order of the file, and its class.

    A zone has what a segmenter could know of it besides its label: one without text is a figure, without
    lines or font size; a font size of 0 is None.
    """
    told = json.loads(file.read_text(encoding="utf-8"))
    zones = tuple(_zone(each) for each in told["zones"])
    return Page(float(told["width"]), float(told["height"]), zones), str(told["class"])


def _zone(told: dict[str, object]) -> Zone:
    box = told["box"]
    assert isinstance(box, list)
    x0, y0, x1, y1 = (float(edge) for edge in box)
    text = str(told.get("text") or "")
    label = told.get("label")
    lines, font_size = told.get("lines"), told.get("font_size")
    printed = bool(text.strip())
    return Zone(
        id=str(told["id"]),
        box=(x0, y0, x1, y1),
        kind="text" if printed else "figure",
        lines=lines if printed and isinstance(lines, int) and lines > 0 else None,
        font_size=float(font_size) if isinstance(font_size, int | float) and font_size > 0 else None,
        text=text,
        label=None if label is None else str(label),
    )


def load_set(name: str, data: str | None = None) -> list[LabelledPage]:
    """Pages of a set ("titles/real/jose", "letters/made", ...) by name; empty where the data is absent."""
    files = sorted((layout_folder(data) / name).glob("*.json"))
    return [LabelledPage(file.stem, *load_page(file), file) for file in files]
