"""The real photos of the data: which there are, of what kind, and what is known of the page."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

FOLDERS = ("photos", "photos_more")
SUFFIXES = (".jpg", ".jpeg", ".png")
KINDS = ("folded", "crumpled", "curved", "receipt", "book", "planar", "no-text")
"""In the order of the tables; "no-text" are photos without a known text, whatever their shape."""

_KIND_BY_NAME = {
    "book": "book",
    "textbook": "book",
    "folded": "folded",
    "sheet": "folded",
    "hand": "curved",
    "handwritten": "planar",
}
"""By the first word of a name, where the folder's README has no table of kinds; any other is planar."""


@dataclass(frozen=True, slots=True)
class RealPhoto:
    """A photo, with the page's text ("" where it is not known) and a flat scan where there is one."""

    path: Path
    kind: str
    truth: str = ""
    scan: Path | None = None

    @property
    def name(self) -> str:
        """The file's name without its suffix."""
        return self.path.stem


def find_photos(data: Path, folders: Sequence[str] = FOLDERS) -> list[RealPhoto]:
    """All photos of the data's folders, by name."""
    found = []
    for folder in folders:
        kinds = _kinds_in_table(data / folder / "README.md")
        for path in (data / folder).glob("*"):
            if path.suffix.lower() in SUFFIXES and not path.stem.endswith(".scan"):
                found.append(_photo(path, kinds))
    return sorted(found, key=lambda photo: photo.name)


def varied(photos: Sequence[RealPhoto], limit: int | None) -> list[RealPhoto]:
    """The first `limit` photos when the kinds take turns; all of them, as they are, without a limit."""
    if limit is None:
        return list(photos)
    turns: dict[str, int] = {}
    ranked = []
    for photo in photos:
        turns[photo.kind] = turns.get(photo.kind, -1) + 1
        ranked.append((turns[photo.kind], KINDS.index(photo.kind), photo.name, photo))
    return [photo for *_, photo in sorted(ranked, key=lambda entry: entry[:3])][:limit]


def _photo(path: Path, kinds: dict[str, str]) -> RealPhoto:
    text, scan = path.with_suffix(".txt"), path.with_suffix(".scan.jpg")
    truth = text.read_text(encoding="utf-8") if text.is_file() else ""
    kind = kinds.get(path.stem) or _KIND_BY_NAME.get(path.stem.split("-")[0], "planar")
    return RealPhoto(path, kind if truth else "no-text", truth, scan if scan.is_file() else None)


def _kinds_in_table(readme: Path) -> dict[str, str]:
    """Name -> kind, from a README's table whose first columns they are."""
    if not readme.is_file():
        return {}
    rows = re.findall(r"^\| *([^|]+?) *\| *([^|]+?) *\|", readme.read_text(encoding="utf-8"), re.MULTILINE)
    return {name: kind for name, kind in rows if kind in KINDS}
