"""How docs/api/ shows an answer: what matters of its head, then its shape: JSON cut and in lines, some lines of texts."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from http import HTTPStatus
from io import BytesIO
from typing import Any
from zipfile import ZipFile

import pikepdf
from PIL import Image

MOST_ITEMS = 4
"""Of numbers, as a box or a direction has; of anything else one item is shown."""
MOST_NAMES = 12
"""Of an object whose names are data, as words or labels."""
MOST_LETTERS = 200
"""Of a text in JSON."""
MOST_LINES = 14
"""Of a text that is not JSON."""
WIDTH = 118
"""Letters in a line."""
HEADERS = re.compile(
    r"Location|Link|ETag|Retry-After|Preference-Applied|Document-.*|Content-Disposition|Tus-Resumable|Upload-.*"
)
"""What a client reads of the head."""
FENCES = {"json": "json", "html": "html", "xml": "xml"}
"""How a text is coloured, by the end of its media type."""
INCH_MM = 25.4
PDF_POINTS = 72


@dataclass(frozen=True, slots=True)
class Answer:
    """What a request was answered; names of headers are as `HEADERS` spells them."""

    status: int
    headers: Mapping[str, str]
    body: bytes

    @property
    def media_type(self) -> str:
        """Without its parameters; empty where there is no body."""
        return self.headers.get("Content-Type", "").partition(";")[0]

    @property
    def is_json(self) -> bool:
        """Whether it is one JSON document."""
        return bool(re.fullmatch(r"application/(.*\+)?json", self.media_type))


def shortened(value: Any) -> Any:
    """The value with its long lists and texts cut, and numbers of six digits."""
    if isinstance(value, dict):
        return {key: shortened(each) for key, each in value.items()}
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, str):
        return value if len(value) <= MOST_LETTERS else f"{value[:MOST_LETTERS]}..."
    if not isinstance(value, list):
        return value
    most = MOST_ITEMS if all(isinstance(each, int | float) for each in value) else 1
    left = len(value) - most
    return [*map(shortened, value[:most]), *([f"... {left} more"] if left > 0 else [])]


def in_lines(value: Any, indent: int = 0, before: int = 0) -> str:
    """JSON in lines of `WIDTH` letters where it can be; what fits into the rest of a line, behind `before`, stays one."""
    line = json.dumps(value, ensure_ascii=False)
    if not value or not isinstance(value, dict | list) or before + len(line) < WIDTH - indent:
        return line
    names = [f"{json.dumps(key, ensure_ascii=False)}: " for key in value] if isinstance(value, dict) else None
    each = value.values() if isinstance(value, dict) else value
    space = " " * (indent + 2)
    lines = [
        f"{space}{name}{in_lines(item, indent + 2, len(name))}"
        for name, item in zip(names or [""] * len(value), each, strict=True)
    ]
    opening, closing = "{}" if isinstance(value, dict) else "[]"
    return f"{opening}\n" + ",\n".join(lines) + f"\n{' ' * indent}{closing}"


def head(answer: Answer) -> str:
    """Status, media type, what a file is, and the headers that a client reads, in a line."""
    parts = [f"{answer.status} {HTTPStatus(answer.status).phrase}"]
    if answer.body:
        parts.append(f"`{answer.media_type}`")
        parts += _file(answer)
    named = (f"`{name}: {value}`" for name, value in answer.headers.items() if HEADERS.fullmatch(name))
    return ", ".join([*parts, *named])


def body(answer: Answer, text: str) -> str:
    """A block of code with the text of an answer; nothing for files, and where there is no body."""
    if not text:
        return ""
    fence = next((name for end, name in FENCES.items() if answer.media_type.endswith(end)), "text")
    return f"```{fence}\n{text}\n```"


def lines_of(answer: Answer) -> str:
    """Some lines of an answer that is a text; empty for files."""
    if not re.fullmatch(r"text/.*|application/(.*xml|jsonl)", answer.media_type):
        return ""
    lines = answer.body.decode("utf-8").strip().splitlines()
    left = len(lines) - MOST_LINES
    shown = [line if len(line) <= WIDTH else f"{line[:WIDTH - 4]} ..." for line in lines[:MOST_LINES]]
    return "\n".join([*shown, *([f"... {left} more lines"] if left > 0 else [])])


def _file(answer: Answer) -> list[str]:
    """What a file is, and its size; nothing of texts."""
    size = f"{float(f'{len(answer.body) / 1000:.2g}'):g} kB"
    if answer.media_type.startswith("image/"):
        with Image.open(BytesIO(answer.body)) as image:
            return [f"{image.width} x {image.height} pixels", size]
    if answer.media_type == "application/pdf":
        with pikepdf.open(BytesIO(answer.body)) as pdf:
            left, bottom, right, top = (float(each) for each in pdf.pages[0].mediabox)
            mm = " x ".join(f"{each / PDF_POINTS * INCH_MM:.0f}" for each in (right - left, top - bottom))
            return [f"{len(pdf.pages)} page{'s' * (len(pdf.pages) > 1)}, {mm} mm", size]
    if answer.media_type == "application/zip":
        with ZipFile(BytesIO(answer.body)) as archive:
            names = archive.namelist()
        more = [f"{len(names) - MOST_ITEMS} more"] * (len(names) > MOST_ITEMS)
        return [f"{len(names)} files ({', '.join([*names[:MOST_ITEMS], *more])})", size]
    return []
