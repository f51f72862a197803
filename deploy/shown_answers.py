"""How docs/api/ shows an answer: a line of its head, then the shape of its JSON, or some lines of another text."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from http import HTTPStatus
from io import BytesIO
from itertools import islice
from typing import Any
from zipfile import ZipFile

import pikepdf
from PIL import Image

MOST_ITEMS = 4
"""Of numbers, as a box or a direction has; of anything else one item is shown."""
MOST_NAMES = 12
"""Of an object whose names are data, as words and attributes are: of longer ones `SHOWN_NAMES` are shown."""
SHOWN_NAMES = 3
MOST_LETTERS = 200
"""Of a text in JSON."""
MOST_LINES = 24
"""Of a text that is not JSON."""
MOST_FILES = 2
"""Of an archive, by their names."""
WIDTH = 118
"""Letters in a line."""
HEADERS = re.compile(
    r"(Location|Link|Retry-After|Preference-Applied|Content-Disposition|(Document|Upload)-[\w-]+): .+|ETag: \"\d+\""
)
"""What a client reads of the head; of the marks of content, versions of models."""
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
        return bool(self.body and re.fullmatch(r"application/(.*\+)?json", self.media_type))

    @property
    def is_text(self) -> bool:
        """Whether it is another text."""
        return bool(re.fullmatch(r"text/.*|application/(.*xml|jsonl)", self.media_type))


def shortened(value: Any, levels: int | None = None) -> Any:
    """The value with its long lists, objects and texts cut, and numbers of six digits.

    Parameters
    ----------
    value
        What JSON can say.
    levels
        How many objects within each other are shown; deeper ones are `{...}`. None: all of them.
    """
    deeper = None if levels is None else levels - 1
    if isinstance(value, dict):
        if value and levels == 0:
            return "{...}"
        kinds = {type(each) for each in value.values()}
        shown = (
            SHOWN_NAMES if len(value) > MOST_NAMES and (kinds <= {int, float} or len(kinds) == 1) else None
        )
        cut = {key: shortened(each, deeper) for key, each in islice(value.items(), shown)}
        return cut if shown is None else {**cut, "...": f"... {len(value) - shown} more"}
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, str):
        return value if len(value) <= MOST_LETTERS else f"{value[:MOST_LETTERS]}..."
    if not isinstance(value, list):
        return value
    most = MOST_ITEMS if all(isinstance(each, int | float) for each in value) else 1
    left = len(value) - most
    items = [shortened(each, levels) for each in value[:most]]
    return [*items, *([f"... {left} more"] if left > 0 else [])]


def in_lines(value: Any, indent: int = 0, before: int = 0) -> str:
    """JSON in lines of at most `WIDTH` letters where its texts allow it.

    What fits into the rest of a line, after `before` letters, stays in it. Of larger values each item begins a line;
    inside the answer, short ones share it.
    """
    line = json.dumps(value, ensure_ascii=False)
    if not value or not isinstance(value, dict | list) or indent + before + len(line) < WIDTH:
        return line
    space = " " * (indent + 2)
    if isinstance(value, dict):
        names = [f"{json.dumps(key, ensure_ascii=False)}: " for key in value]
        each, opening, closing = list(value.values()), "{", "}"
    else:
        names, each, opening, closing = [""] * len(value), value, "[", "]"
    lines = [""]
    for name, item in zip(names, each, strict=True):
        text = f"{name}{in_lines(item, indent + 2, len(name))},"
        room = WIDTH - indent - 3 - len(lines[-1])
        if indent and lines[-1] and "\n" not in lines[-1] + text and len(text) < room:
            lines[-1] += f" {text}"
        else:
            lines.append(text)
    text = "\n".join(f"{space}{line}" for line in lines[1:]).removesuffix(",")
    return f"{opening}\n{text}\n{' ' * indent}{closing}"


def head(answer: Answer) -> str:
    """Status, media type, what a file is, and the headers that a client reads, in a line."""
    parts = [f"{answer.status} {HTTPStatus(answer.status).phrase}"]
    if answer.body:
        parts.append(f"`{answer.media_type}`")
        parts += _file(answer)
    named = (
        f"`{line}`"
        for line in (f"{name}: {value}" for name, value in answer.headers.items())
        if HEADERS.fullmatch(line)
    )
    return ", ".join([*parts, *named])


def fenced(media_type: str, text: str) -> str:
    """A block of code with the text of an answer."""
    fence = next((name for end, name in FENCES.items() if media_type.endswith(end)), "text")
    return f"```{fence}\n{text}\n```"


def lines_of(media_type: str, text: str) -> str:
    """Some lines of an answer that is a text."""
    if media_type == "text/event-stream":
        first, *_, last = text.strip().split("\n\n")
        lines = [*first.splitlines(), "", "...", "", *last.splitlines()]
    else:
        lines = re.sub(
            r"<style>.*?</style>", "<style>...</style>", text.strip(), flags=re.DOTALL
        ).splitlines()
    left = len(lines) - MOST_LINES
    shown = [line if len(line) <= WIDTH else f"{line[: WIDTH - 4]} ..." for line in lines[:MOST_LINES]]
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
        more = [f"{len(names) - MOST_FILES} more"] * (len(names) > MOST_FILES)
        return [f"{len(names)} files ({', '.join([*names[:MOST_FILES], *more])})", size]
    return []
