"""Archives that cost, lie or are damaged: they are refused before they cost anything, and never as a defect."""

import io
import json
import tracemalloc
import zipfile
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest

from app.http.archives import UploadedArchive
from services.errors import DocumentError, InvalidOption, TooLarge
from tests.app.hostile_archives import DIRECTORY, END, entry, mutated, packed, streamed, with_directory
from tests.app.scripted_layout import PAGE
from tests.app.scripted_models import model_document
from tests.app.scripts import upload
from tests.app.serving import serving
from tests.app.test_problems import assert_problem
from tests.counts import repeats

ROUTES = ("/layout/models/letter/samples/archive", "/layout/import")
MOST_BYTES = 1_000_000
LABELLED = {**PAGE, "zones": [{**PAGE["zones"][0], "label": "sender"}]}
MANIFEST = {"format": "layout-models", "format_version": 1, "models": [{"name": "memo", "settings": {}}]}
FILES = [
    ("manifest.json", json.dumps(MANIFEST).encode()),
    ("models/memo/model.json", json.dumps(model_document("memo", "sender")).encode()),
    ("models/memo/samples/1.json", json.dumps(LABELLED).encode()),
    ("models/memo/samples/2.json", b" " * 3000),
    ("1.png", upload("")),
]
GOOD = packed(FILES)


@pytest.fixture(scope="module")
def client() -> Iterator[httpx.Client]:
    with serving(max_archive_bytes=MOST_BYTES) as client:
        yield client


def send(client: httpx.Client, path: str, content: bytes) -> httpx.Response:
    return client.post(path, files={"archive": ("a.zip", content)})


def opened(content: bytes, most_files: int = 50) -> UploadedArchive:
    return UploadedArchive(io.BytesIO(content), "archive", MOST_BYTES, most_files)


@pytest.mark.parametrize(
    "content",
    [GOOD, packed(FILES, zipfile.ZIP_STORED), streamed(FILES)],
    ids=["deflated", "stored", "written into a pipe"],
)
def test_every_file_comes_out_as_it_went_in(content: bytes) -> None:
    archive = opened(content)
    assert [(file.path, archive.read(file.path, 10_000)) for file in archive.files()] == FILES


def test_names_of_files_are_read_as_the_archive_says() -> None:
    files = [("größe/Ä.json", b"1"), ("b/A.Tar.PNG", b"2"), ("plain", b"3")]
    assert [(file.path, file.stem, file.suffix) for file in opened(packed(files)).files()] == [
        ("größe/Ä.json", "Ä", ".json"),
        ("b/A.Tar.PNG", "A.Tar", ".png"),
        ("plain", "plain", ""),
    ]


def test_a_name_may_have_1024_bytes() -> None:
    name = "ä" * 512
    assert [file.path for file in opened(packed([(name, b"1")])).files()] == [name]


@pytest.mark.parametrize(
    "comment",
    [b"hi PK\5\6 there" + bytes(40), END + bytes(18), END * 16_383],
    ids=["the mark", "an empty archive", "many marks"],
)
def test_a_comment_may_have_the_mark_of_the_end(comment: bytes) -> None:
    buffer = io.BytesIO(GOOD)
    with zipfile.ZipFile(buffer, "a") as archive:
        archive.comment = comment
    assert [file.path for file in opened(buffer.getvalue()).files()] == [path for path, _ in FILES]


def _lying_about_sizes() -> bytes:
    return with_directory(GOOD, [entry(b"a.json", method=8, sizes=(50, MOST_BYTES + 1))])


HOSTILE: dict[str, tuple[Callable[[], bytes], type[DocumentError]]] = {
    "bzip2": (lambda: packed(FILES, zipfile.ZIP_BZIP2), InvalidOption),
    "lzma": (lambda: packed(FILES, zipfile.ZIP_LZMA), InvalidOption),
    "a password": (lambda: with_directory(GOOD, [entry(b"a.json", flags=1)]), InvalidOption),
    "two files of one path": (lambda: packed([*FILES, FILES[1]]), InvalidOption),
    "a name that is not UTF-8": (
        lambda: with_directory(GOOD, [entry(b"\xff.json", flags=0x800)]),
        InvalidOption,
    ),
    "no name": (lambda: with_directory(GOOD, [entry(b"")]), InvalidOption),
    "a long name": (lambda: with_directory(GOOD, [entry(b"a" * 1025)]), InvalidOption),
    "a long name of a folder": (lambda: with_directory(GOOD, [entry(b"a" * 1024 + b"/")]), InvalidOption),
    "bytes behind its end": (lambda: GOOD + b"x", InvalidOption),
    "files that share bytes": (
        lambda: with_directory(GOOD, [entry(b"a", sizes=(90, 90)), entry(b"b", sizes=(90, 90), offset=40)]),
        InvalidOption,
    ),
    "a file within the directory": (
        lambda: with_directory(GOOD, [entry(b"a", offset=GOOD.index(DIRECTORY) - 5)]),
        InvalidOption,
    ),
    "half a directory": (lambda: with_directory(GOOD, [entry(b"a" * 90)[:60]]), InvalidOption),
    "sizes of 64 bits that are not there": (
        lambda: with_directory(GOOD, [entry(b"a", sizes=(2**32 - 1, 1))]),
        InvalidOption,
    ),
    "too much together": (
        lambda: packed([(f"{number}.json", bytes(MOST_BYTES // 9)) for number in range(10)]),
        TooLarge,
    ),
    "too much as it says": (_lying_about_sizes, TooLarge),
    "too many files": (lambda: with_directory(GOOD, [entry(b"%d" % n) for n in range(51)]), TooLarge),
    "a million files": (
        lambda: with_directory(GOOD, [entry(b"1.json")] * 1_000_000),
        TooLarge,
    ),
    "a million folders": (
        lambda: with_directory(GOOD, [entry(b"a/")] * 1_000_000),
        TooLarge,
    ),
}


@pytest.mark.parametrize(("make", "error"), HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_archive_is_refused_before_it_costs_anything(
    make: Callable[[], bytes], error: type[DocumentError]
) -> None:
    content = make()
    tracemalloc.start()
    try:
        with pytest.raises(error) as refusal:
            opened(content)
        assert tracemalloc.get_traced_memory()[1] < 2_000_000
    finally:
        tracemalloc.stop()
    assert refusal.value.field == "archive"


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("name", ["bzip2", "lzma", "two files of one path", "files that share bytes"])
def test_both_routes_refuse_it(client: httpx.Client, route: str, name: str) -> None:
    assert (
        assert_problem(send(client, route, HOSTILE[name][0]()), 422, "invalid-option")["field"] == "archive"
    )


def _stated(size: int) -> bytes:
    """A deflated file of 3000 bytes that is said to have another size."""
    content = packed([("a.json", bytes(3000))])
    place = content.index(DIRECTORY) + 24
    return content[:place] + size.to_bytes(4, "little") + content[place + 4 :]


@pytest.mark.parametrize(
    "content",
    [
        _stated(2999),
        _stated(3001),
        _stated(0),
        packed([("a.json", b"x" * 99)], zipfile.ZIP_STORED).replace(b"xxxx", b"yxxx", 1),
        packed([("a.json", b"x" * 99)]).replace(b"PK\3\4", b"PK\3\5"),
        with_directory(GOOD, [entry(b"a.json", sizes=(9, 9), offset=3)]),
    ],
    ids=["smaller", "larger", "empty", "another content", "no header", "a wrong place"],
)
def test_a_file_that_is_not_what_the_directory_states_is_damaged(content: bytes) -> None:
    with pytest.raises(InvalidOption, match="damaged"):
        opened(content).read("a.json", MOST_BYTES)


def test_a_file_of_an_archive_has_a_limit_of_its_own() -> None:
    with pytest.raises(TooLarge, match="may have 2999 bytes"):
        opened(GOOD).read("models/memo/samples/2.json", 2999)


@pytest.mark.parametrize(
    "base", [GOOD, streamed(FILES), packed(FILES, zipfile.ZIP_STORED)], ids=["deflated", "streamed", "stored"]
)
def test_no_mutation_is_more_than_a_refusal(base: bytes) -> None:
    refused = 0
    for seed in range(repeats(300, 5000)):
        try:
            archive = opened(mutated(base, seed))
            for file in archive.files():
                try:
                    archive.read(file.path, 5000)
                except (InvalidOption, TooLarge):
                    refused += 1
        except (InvalidOption, TooLarge):
            refused += 1
    assert refused > 100


@pytest.mark.long
@pytest.mark.parametrize("route", ROUTES)
def test_no_mutation_is_answered_as_a_defect(client: httpx.Client, route: str) -> None:
    statuses = [send(client, route, _mutation(seed)).status_code for seed in range(repeats(50, 1000))]
    assert set(statuses) <= {200, 413, 422}
    assert len(set(statuses)) > 1


def _mutation(seed: int) -> bytes:
    """A mutated archive, or an archive of a mutated manifest."""
    if seed % 4:
        return mutated(GOOD, seed)
    changed = mutated(b"PK" + FILES[0][1], seed)
    return packed([("manifest.json", changed.removeprefix(b"PK")), *FILES[1:]])


def _export(count: int) -> bytes:
    def sample(number: int) -> Any:
        zone = {**PAGE["zones"][0], "label": "sender", "text": str(number)}
        return json.dumps({**PAGE, "zones": [zone]}).encode()

    samples = [(f"models/memo/samples/{number}.json", sample(number)) for number in range(count)]
    return packed([FILES[0], *samples])


def test_an_export_may_have_more_files_than_an_archive_of_samples() -> None:
    archive = UploadedArchive(io.BytesIO(_export(5001)), "archive", 2**30, most_files=50_000)
    assert len(archive.files()) == 5002
