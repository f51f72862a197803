"""Blobs: written wholly or not at all, bounded, swept by age."""

import os
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from models.blobs import PART_BYTES, BlobNotFound, Blobs, BlobTooLarge
from models.errors import StoreUnavailable
from tests.models.s3_server import BUCKET, S3Server


def parts_of(*parts: bytes, then: Exception | None = None) -> Iterator[bytes]:
    yield from parts
    if then is not None:
        raise then


def files(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[S3Server]:
    server = S3Server()
    for name, value in server.environment.items():
        monkeypatch.setenv(name, value)
    yield server
    server.stop()


@pytest.fixture(params=["", "memory:///", f"s3://{BUCKET}/some/prefix"], ids=["folder", "bucket", "s3"])
def blobs(request: pytest.FixtureRequest, tmp_path: Path) -> Blobs:
    """Files; a bucket of the library's that needs no network; and one behind the S3 protocol."""
    if request.param.startswith("s3"):
        request.getfixturevalue("server")
    return Blobs(request.param, tmp_path)


@pytest.mark.parametrize("size", [0, 1, PART_BYTES, 2 * PART_BYTES + 7])
def test_what_is_put_comes_back(blobs: Blobs, tmp_path: Path, size: int) -> None:
    content = os.urandom(size)
    assert blobs.put("a/whole", content, size) == size
    pieces = [content[at : at + 65_536] for at in range(0, size, 65_536)]
    assert blobs.put("a/parts", parts_of(*pieces), size) == size
    assert blobs.get("a/whole") == blobs.get("a/parts") == content
    blobs.delete("a/whole", "a/parts", "a/never")
    for key in ("a/whole", "a/parts"):
        with pytest.raises(BlobNotFound):
            blobs.get(key)
    assert files(tmp_path) == []


def test_without_its_folder_nothing_is_known_of_a_blob(tmp_path: Path) -> None:
    """As a folder of another machine whose network is down: the blob is not said to be gone."""
    blobs = Blobs("", tmp_path / "blobs")
    blobs.put("a", b"x", 1)
    (tmp_path / "blobs").rename(tmp_path / "away")
    for call in (blobs.get, blobs.delete, lambda key: blobs.put(key, b"y", 1)):
        with pytest.raises(StoreUnavailable):
            call("a")
    (tmp_path / "away").rename(tmp_path / "blobs")
    assert blobs.get("a") == b"x"


@pytest.mark.parametrize("count", [1, 8])
def test_a_blob_that_fails_leaves_nothing(blobs: Blobs, tmp_path: Path, count: int) -> None:
    part = b"x" * (PART_BYTES // 2)
    with pytest.raises(BlobTooLarge):
        blobs.put("a", parts_of(*[part] * count, b"y"), len(part) * count)
    with pytest.raises(BlobTooLarge):
        blobs.put("a", b"xy", 1)
    with pytest.raises(ZeroDivisionError):
        blobs.put("a", parts_of(*[part] * count, then=ZeroDivisionError()), 1 << 30)
    with pytest.raises(BlobNotFound):
        blobs.get("a")
    assert files(tmp_path) == []


def test_blobs_of_a_bucket_are_swept_by_age_and_use(blobs: Blobs) -> None:
    for key in ("jobs/a/input", "jobs/used/input", "pages/a"):
        blobs.put(key, b"x", 1)
    now = datetime.now(UTC)
    assert blobs.sweep("jobs", now - timedelta(hours=1), lambda key: False) == 0
    assert blobs.sweep("jobs", now + timedelta(hours=1), lambda key: "used" in key) == 1
    assert blobs.get("jobs/used/input") == blobs.get("pages/a") == b"x"
    blobs.check()


def test_a_file_is_read_in_parts(tmp_path: Path) -> None:
    blobs = Blobs("", tmp_path)
    blobs.put("a", bytes(2 * PART_BYTES + 7), 1 << 30)
    assert [len(part) for part in blobs.read("a")] == [PART_BYTES, PART_BYTES, 7]


def test_old_files_without_a_use_are_swept(tmp_path: Path) -> None:
    blobs = Blobs("", tmp_path)
    for key in ("jobs/old/input", "jobs/used/input", "jobs/new/input", "pages/old"):
        blobs.put(key, b"x", 1)
    old_s = (datetime.now(UTC) - timedelta(hours=1)).timestamp()
    for key in ("jobs/old/input", "jobs/used/input", "pages/old"):
        os.utime(tmp_path / key, (old_s, old_s))
    before = datetime.now(UTC) - timedelta(minutes=30)
    assert blobs.sweep("jobs", before, lambda key: "used" in key) == 1
    assert files(tmp_path) == ["jobs/new/input", "jobs/used/input", "pages/old"]


def test_a_store_that_is_away_is_unavailable(tmp_path: Path) -> None:
    folder = tmp_path / "blobs"
    blobs = Blobs("", folder)
    blobs.check()
    folder.rmdir()
    folder.write_text("a file in place of the folder", encoding="ascii")
    with pytest.raises(StoreUnavailable):
        blobs.check()
    for content in (b"x", parts_of(b"x")):
        with pytest.raises(StoreUnavailable):
            blobs.put("a/b", content, 1)


def test_a_large_blob_is_an_upload_in_parts(server: S3Server, tmp_path: Path) -> None:
    blobs = Blobs(f"s3://{BUCKET}/jobs", tmp_path)
    content = os.urandom(2 * PART_BYTES + 7)
    blobs.put("a/input", content, len(content))
    assert server.bucket.requests.count("PUT partNumber uploadId") == 3
    assert server.bucket.objects == {"jobs/a/input": content}
    assert server.bucket.uploads == {}


def test_an_upload_whose_part_fails_is_aborted(server: S3Server, tmp_path: Path) -> None:
    blobs = Blobs(f"s3://{BUCKET}", tmp_path)
    server.bucket.refused_parts = {2}
    with pytest.raises(StoreUnavailable):
        blobs.put("a", bytes(2 * PART_BYTES + 7), 1 << 30)
    assert (server.bucket.uploads, server.bucket.aborted, server.bucket.objects) == ({}, 1, {})
    server.bucket.refused_parts = set()
    assert blobs.put("a", bytes(2 * PART_BYTES + 7), 1 << 30) == len(server.bucket.objects["a"])


def test_a_bucket_that_is_away_is_unavailable_until_it_is_back(server: S3Server, tmp_path: Path) -> None:
    blobs = Blobs(f"s3://{BUCKET}", tmp_path)
    blobs.put("a", b"x", 1)
    with server.away():
        for call in (blobs.get, blobs.delete, lambda key: blobs.put(key, b"y", 1), lambda _: blobs.check()):
            with pytest.raises(StoreUnavailable):
                call("a")
    assert blobs.get("a") == b"x"


def test_a_bucket_that_is_not_there_is_unavailable(server: S3Server, tmp_path: Path) -> None:
    blobs = Blobs("s3://another", tmp_path)
    for call in (blobs.get, blobs.delete, lambda key: blobs.put(key, b"y", 1), lambda _: blobs.check()):
        with pytest.raises(StoreUnavailable):
            call("a")


def test_a_server_without_tls_has_to_be_allowed(
    server: S3Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("AWS_ALLOW_HTTP")
    with pytest.raises(StoreUnavailable):
        Blobs(f"s3://{BUCKET}", tmp_path).check()
    assert server.bucket.requests == []


@pytest.mark.parametrize("url", ["nonsense", "ftp://example.org/x"])
def test_a_url_of_no_store_is_refused(tmp_path: Path, url: str) -> None:
    with pytest.raises(StoreUnavailable):
        Blobs(url, tmp_path)
