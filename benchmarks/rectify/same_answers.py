"""`python -m benchmarks same_answers OTHER`: whether this checkout answers as another one does.

`OTHER` is a commit (taken by `git archive`) or the folder of a checkout. Both answer the same requests of /rectify, of
previews and of /mosaic by their own operations, each in a process of its own. The whole documents and the pixels of the
views are compared; only times, ids and dates are not. What differs is answered again, three times.
Answers are kept under a digest of the code that made them. The inputs are the examples, and 60 real
photos where the data are there.
"""

import argparse
import hashlib
import io
import json
import os
import subprocess
import sys
import tarfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from app.engine.worker import SINGLE_THREAD_ENVIRONMENT
from benchmarks.common.places import MEMORY, REPOSITORY, data_folder

ANSWERING = Path(__file__).with_name("answering.py")
EXAMPLES = REPOSITORY / "examples"
PHOTO_FOLDERS = ("photos", "photos_more", "photos_app", "cases")
PICTURES = frozenset({".jpg", ".png", ".heic", ".tif", ".pdf"})
REAL_PHOTOS = 60
EVERYWHERE: tuple[dict[str, object], ...] = ({}, {"preview": True}, {"pages": "both"})
"""Options that are asked of every input."""
IN_TURN: tuple[dict[str, object], ...] = (
    {"kind": "planar"},
    {"kind": "curved"},
    {"crop": "text"},
    {"crop": "photo"},
    {"upright": False},
    {"on_no_text": "keep"},
    {"illumination": "normalize"},
    {"text": True},
    {"preview": True, "kind": "curved"},
)
"""Options of which every input is asked one."""
FEW = (
    "examples/photo.jpg",
    "cases/flower.jpg",
    "photos/no-text-banknote.jpg",
    "photos/no-text-ruled-grid.jpg",
    "photos/planar-dark-desk.jpg",
    "photos/textbook-figures.jpg",
    "photos_more/docunet-6-1.jpg",
    "photos_more/docunet-42-1.jpg",
)
"""Inputs of quick runs: each shape that a page can have, with text and without, and an opened book."""
EXAMPLE_SETS = (("left.png", "right.png"), ("a.jpg", "b.jpg", "c.jpg", "d.jpg"))
REAL_SETS = ("n2_o20_0_patent", "n4_o40_1_patent")
MOST_DIFFERENCES = 4
REPEATS = 3
"""Answers that differ are computed again, on both sides: the last bits of some sums depend on where arrays lie
in memory, and an iterative fit makes 4e-9 of them (a preview of examples/d.jpg has two answers)."""


@dataclass(frozen=True, slots=True)
class Request:
    """A request of a flow; the name is the input's with the options."""

    name: str
    flow: str
    files: tuple[Path, ...]
    options: dict[str, object] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """Digest of all that the answer depends on but the code."""
        digest = hashlib.sha256(f"{self.flow} {json.dumps(self.options, sort_keys=True)}".encode())
        for file in (ANSWERING, *self.files):
            digest.update(hashlib.sha256(file.read_bytes()).digest())
        return digest.hexdigest()[:20]


def main(arguments: Sequence[str]) -> int:
    """Print a line for each request; 1 if an answer differs."""
    parser = argparse.ArgumentParser(prog="benchmarks same_answers", description=__doc__)
    parser.add_argument("other", nargs="?", default="HEAD", help="a commit, or the folder of a checkout")
    parser.add_argument("--few", action="store_true", help="eight inputs only")
    parser.add_argument("--data", default=None, help="folder of the data (DOCUMENT_DATA, ../shared/data)")
    parser.add_argument("--fresh", action="store_true", help="answer anew what was answered before")
    options = parser.parse_args(arguments)
    requests = list(find_requests(data_folder(options.data), few=options.few))
    with checkout(options.other) as other:
        old = [[answer] for answer in answers(other, requests, fresh=options.fresh)]
        new = [[answer] for answer in answers(REPOSITORY, requests, fresh=options.fresh)]
        for _ in range(REPEATS):
            doubted = [k for k in range(len(requests)) if nearest(old[k], new[k])]
            for folder, known in ((other, old), (REPOSITORY, new)):
                again = answers(folder, [requests[k] for k in doubted], fresh=True)
                for k, answer in zip(doubted, again, strict=True):
                    known[k].append(answer)
    different = 0
    for request, theirs, ours in zip(requests, old, new, strict=True):
        found = nearest(theirs, ours)
        different += bool(found)
        print(f"{request.name}: {'; '.join(found[:MOST_DIFFERENCES]) or 'same'}")
    print(f"{len(requests)} answers, {different} of them differ.")
    return int(different > 0)


def nearest(old: Sequence[object], new: Sequence[object]) -> list[str]:
    """The fewest differences between one of the `old` answers to a request and one of the `new`."""
    return min((differences(a, b) for a in old for b in new), key=len)


def find_requests(data: Path, *, few: bool = False) -> Iterator[Request]:
    """The requests of all inputs, or of `FEW`; those of the examples alone where the `data` are absent."""
    inputs = {f"examples/{file.name}": file for file in pictures(EXAMPLES)}
    real = {f"{name}/{file.name}": file for name in PHOTO_FOLDERS for file in pictures(data / name)}
    if not real:
        print(f"There are no photos in {data}: only the examples are compared.")
    names = sorted(real)
    chosen = {names[k * len(names) // REAL_PHOTOS] for k in range(REAL_PHOTOS)} if real else set()
    every = inputs | real
    for number, name in enumerate(FEW if few else [*inputs, *sorted(chosen | (set(FEW) & set(real)))]):
        if name in every:
            for options in (*EVERYWHERE, IN_TURN[number % len(IN_TURN)]):
                yield Request(titled(name, options), "rectify", (every[name],), options)
    sets = [tuple(EXAMPLES / part for part in parts) for parts in EXAMPLE_SETS]
    if few:
        sets = sets[:1]
    else:
        real_sets = [tuple(sorted((data / "mosaic" / name).glob("patch_*"))) for name in REAL_SETS]
        sets += [files for files in real_sets if files]
    for files in sets:
        yield Request(titled(f"mosaic of {files[0].parent.name}/{files[0].name} ...", {}), "mosaic", files)


def pictures(folder: Path) -> list[Path]:
    """The pictures and PDFs in `folder`, without flat scans."""
    return sorted(f for f in folder.glob("*") if f.suffix in PICTURES and not f.stem.endswith(".scan"))


def titled(name: str, options: dict[str, object]) -> str:
    """The name of a request."""
    return " ".join([name, *(f"{key}={value}" for key, value in options.items())])


@contextmanager
def checkout(other: str) -> Iterator[Path]:
    """The folder of `other`: itself, or that of a commit's services for as long as the block runs."""
    if Path(other).is_dir():
        yield Path(other).resolve()
        return
    archive = subprocess.run(
        ["git", "archive", other, "services"], cwd=REPOSITORY, check=True, capture_output=True
    ).stdout
    with TemporaryDirectory() as folder:
        with tarfile.open(fileobj=io.BytesIO(archive)) as files:
            files.extractall(folder, filter="data")
        yield Path(folder)


def answers(folder: Path, requests: Sequence[Request], *, fresh: bool = False) -> list[object]:
    """What the checkout in `folder` answers to the `requests`; those that it has answered before are read."""
    kept = MEMORY / "same_answers" / code_digest(folder)
    kept.mkdir(parents=True, exist_ok=True)
    files = [kept / f"{request.key}.json" for request in requests]
    lines = [
        json.dumps(
            {
                "flow": request.flow,
                "files": [str(path) for path in request.files],
                "options": request.options,
                "answer": str(file),
            }
        )
        for request, file in zip(requests, files, strict=True)
        if fresh or not file.exists()
    ]
    if lines:
        environment = os.environ | SINGLE_THREAD_ENVIRONMENT | {"PYTHONPATH": str(folder)}
        # Safe path (-P): the folder of the program is not searched, so that the services are those of the checkout.
        subprocess.run(
            [sys.executable, "-P", str(ANSWERING)],
            input="\n".join(lines),
            text=True,
            cwd=folder,
            env=environment,
            check=True,
        )
    return [json.loads(file.read_text(encoding="utf-8")) for file in files]


def code_digest(folder: Path) -> str:
    """Digest of the services in `folder`."""
    digest = hashlib.sha256()
    for file in sorted((folder / "services").rglob("*")):
        if file.is_file() and "__pycache__" not in file.parts:
            digest.update(
                f"{file.relative_to(folder)} {hashlib.sha256(file.read_bytes()).hexdigest()}".encode()
            )
    return digest.hexdigest()[:20]


def differences(old: object, new: object, place: str = "") -> list[str]:
    """Where two answers of JSON's types differ, each with both values."""
    if isinstance(old, dict) and isinstance(new, dict):
        keys = [*old, *(key for key in new if key not in old)]
        return [
            found
            for key in keys
            for found in differences(old.get(key), new.get(key), f"{place}.{key}".lstrip("."))
        ]
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        pairs = enumerate(zip(old, new, strict=True))
        return [found for k, (a, b) in pairs for found in differences(a, b, f"{place}[{k}]")]
    return [] if old == new else [f"{place}: {str(old)[:60]} -> {str(new)[:60]}"]
