"""ZIP archives that cost, lie or are damaged, to both routes that take one."""

import io
import json
import struct
import warnings
import zipfile
from collections.abc import Callable, Iterable
from functools import cache, partial

import httpx

from benchmarks.attack.clients import Answer, answer_of
from benchmarks.attack.row import Attack

_TIMEOUT_S = 300.0
_MIB = bytes(2**20)
_SAMPLES, _IMPORT = "/layout/models/z/samples/archive", "/layout/import"
_PAGE = {
    "width": 20,
    "height": 30,
    "zones": [{"id": "z1", "box": [1, 2, 9, 8], "label": "sender", "text": "a"}],
}


@cache
def bomb(method: int, mib: int, files: int = 1) -> bytes:
    """Files of zeros, `mib` MiB each, beside a manifest."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as archive:
        archive.writestr("manifest.json", _manifest(["z"]))
        for number in range(files):
            with archive.open(f"models/z/samples/{number}.json", "w", force_zip64=True) as opened:
                for _ in range(mib):
                    opened.write(_MIB)
    return buffer.getvalue()


def packed(files: Iterable[tuple[str, bytes]]) -> bytes:
    """An archive of these files; a path may come twice."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
            for path, content in files:
                archive.writestr(path, content)
    return buffer.getvalue()


def directory_of(entries: Iterable[bytes], before: bytes = b"") -> bytes:
    """An archive that has only a directory, behind the bytes `before`."""
    directory = b"".join(entries)
    count = min(0xFFFF, len(directory) // 46)
    return (
        before
        + directory
        + struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, count, count, len(directory), len(before), 0)
    )


def entry(path: bytes, flags: int = 0, size: int = 0, offset: int = 0) -> bytes:
    """An entry of a directory: a stored file."""
    numbers = (20, 20, flags, 0, 0, 33, 0, size, size, len(path), 0, 0, 0, 0, 0, offset)
    return struct.pack("<4s6H3L5H2L", b"PK\1\2", *numbers) + path


def million(path: bytes) -> bytes:
    """A directory of a million entries, each with this path."""
    return directory_of([entry(path)] * 1_000_000)


def empty_files(classes: int = 200, files: int = 4999) -> bytes:
    """An import of many classes and of many files, which belong to none of them."""
    names = [f"class-{number}" for number in range(classes)]
    return packed(
        [("manifest.json", _manifest(names)), *((f"{number}.json", b"") for number in range(files))]
    )


def long_names(files: int, name_bytes: int) -> bytes:
    """An import whose megabytes are the names of damaged files of one class."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("manifest.json", _manifest(["z"]))
    whole = buffer.getvalue()
    begin = whole.index(b"PK\1\2")
    own = whole[begin : whole.index(b"PK\5\6")]
    names = (f"models/z/samples/{number}\U0001f600".encode() for number in range(files))
    entries = (
        entry(name + b"\1" * (name_bytes - len(name)), flags=0x800, offset=begin + 30 * number)
        for number, name in enumerate(names)
    )
    return directory_of([own, *entries], whole[:begin] + bytes(30 * files))


def import_many(url: str, files: int = 5001, of_class: int = 834) -> Answer:
    """The answer to an import of samples as the service exports them; "incomplete" when some did not come."""
    with httpx.Client(base_url=url, timeout=_TIMEOUT_S) as client:
        client.post("/layout/models/seed/samples", json=_PAGE).raise_for_status()
        exported = zipfile.ZipFile(io.BytesIO(client.get("/layout/export?models=seed").content))
        [path] = [path for path in exported.namelist() if "/samples/" in path]
        page = json.loads(exported.read(path))
        names = [f"many-{number}" for number in range(-(-files // of_class))]
        samples = []
        for number in range(files):
            page["zones"][0]["text"] = str(number)
            samples.append(
                (f"models/{names[number // of_class]}/samples/{number}.json", json.dumps(page).encode())
            )
        archive = packed([("manifest.json", _manifest(names)), *samples])
        response = client.post(_IMPORT, files={"archive": ("a.zip", archive)})
        answer = answer_of(response)
        if answer.code == "ok":
            came = sum(each["samples_added"] + each["samples_known"] for each in response.json()["models"])
            answer = answer if came == files else Answer(answer.status, "incomplete")
        for name in ("seed", *names):
            client.delete(f"/layout/models/{name}")
    return answer


def _manifest(names: list[str]) -> bytes:
    models = [{"name": name, "settings": {}} for name in names]
    return json.dumps({"format": "layout-models", "format_version": 1, "models": models}).encode()


def _send(path: str, make: Callable[[], bytes], url: str) -> Answer:
    return answer_of(httpx.post(url + path, files={"archive": ("a.zip", make())}, timeout=_TIMEOUT_S))


def _both(
    name: str, make: Callable[[], bytes], codes: tuple[str, ...], is_quick: bool = True
) -> tuple[Attack, Attack]:
    return (
        Attack(f"{name}, as samples", partial(_send, _SAMPLES, make), codes, is_quick),
        Attack(f"{name}, imported", partial(_send, _IMPORT, make), codes, is_quick),
    )


_INVALID, _LARGE = ("invalid-option",), ("too-large",)
_FILE = [("1.json", b"{}"), ("manifest.json", _manifest(["z"]))]

ATTACKS = (
    *_both("1500 MiB of zeros by bzip2", partial(bomb, zipfile.ZIP_BZIP2, 1500), _INVALID, is_quick=False),
    *_both("1500 MiB of zeros by LZMA", partial(bomb, zipfile.ZIP_LZMA, 1500), _INVALID, is_quick=False),
    *_both("1 MiB of zeros by LZMA", partial(bomb, zipfile.ZIP_LZMA, 1), _INVALID),
    *_both(
        "200 files of 8 MiB of zeros", partial(bomb, zipfile.ZIP_DEFLATED, 8, 200), _LARGE, is_quick=False
    ),
    *_both("a directory of a million files", partial(million, b"1.json"), _LARGE, is_quick=False),
    *_both("two files of one path", lambda: packed([*_FILE, *_FILE]), _INVALID),
    *_both(
        "a file at a wrong offset",
        lambda: directory_of([entry(b"1.json", size=9, offset=10**6)], bytes(99)),
        _INVALID,
    ),
    *_both(
        "files that share bytes",
        lambda: directory_of([entry(b"%d.json" % number, size=9000) for number in range(1000)], bytes(9999)),
        _INVALID,
    ),
    *_both(
        "a name that is no UTF-8",
        lambda: directory_of([entry(b"\xff.json", flags=0x800)], bytes(99)),
        _INVALID,
    ),
    *_both("half an archive", lambda: packed(_FILE)[:-30], _INVALID),
    Attack(
        "200 files with names of 60 KB, imported",
        partial(_send, _IMPORT, partial(long_names, 200, 60_000)),
        _INVALID,
    ),
    Attack("200 classes and 4999 empty files", partial(_send, _IMPORT, empty_files), ("ok",), is_quick=False),
    Attack("an import of 5001 exported samples", import_many, ("ok",), is_quick=False),
)
