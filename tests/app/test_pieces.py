"""Uploads in pieces: nothing that has come is lost or mixed up, and each has its owner, its bounds and its end."""

import base64
import errno
import hashlib
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import httpx
import pytest

from app.http.tus import Checksum, ChecksumMismatch, name_in
from app.storage.layout_store import DATABASE
from app.storage.uploads import PIECE_BYTES
from services.contract.images import Encoding, PageReply
from services.contract.mosaic import MosaicLimits, MosaicParameters
from services.errors import InvalidOption
from tests.app import scripted_rectify
from tests.app.pools import named
from tests.app.raw import connect
from tests.app.scripted import OPERATIONS
from tests.app.scripts import JPEG, upload
from tests.app.serving import POLL_S, serving
from tests.app.test_problems import assert_problem
from tests.models.databases import make_file
from tests.models.s3_server import BUCKET, S3Server

ALICE, BOB, ADMIN = ({"X-API-Key": key} for key in ("alice-secret", "bob-secret", "root-secret"))
TUS = {"Tus-Resumable": "1.0.0"}
PIECE = {**TUS, "Content-Type": "application/offset+octet-stream"}
PHOTO = upload("")
CUTS = 10


def digest(
    uploads: list[bytes], parameters: MosaicParameters, encoding: Encoding, limits: MosaicLimits
) -> PageReply:
    """The scripted mosaic, with a warning that has the digests of the photos."""
    reply = scripted_rectify.mosaic(uploads, parameters, encoding, limits)
    assert reply.answer is not None
    notice = next(each for each in reply.answer.warnings if each.code == "bytes")
    notice.detail = " ".join(hashlib.sha256(each).hexdigest() for each in uploads)
    return reply


@pytest.fixture(scope="module")
def client() -> Iterator[httpx.Client]:
    keys = ("alice:alice-secret", "bob:bob-secret", "admin:root-secret")
    with serving(replace(OPERATIONS, mosaic=named(digest)), api_keys=keys) as client:
        client.headers.update(ALICE)
        yield client


def begin(client: httpx.Client, length: int, name: str = "photo.jpg", **more: str) -> httpx.Response:
    metadata = f"filetype aW1hZ2U=,filename {base64.b64encode(name.encode()).decode()}"
    return client.post(
        "/uploads", headers={**TUS, "Upload-Length": str(length), "Upload-Metadata": metadata, **more}
    )


def begun(client: httpx.Client, length: int, name: str = "photo.jpg") -> str:
    """The path of a new upload."""
    answer = begin(client, length, name)
    assert (answer.status_code, answer.headers["tus-resumable"]) == (201, "1.0.0"), answer.text
    assert answer.headers["location"] == f"/uploads/{answer.json()['id']}"
    return answer.headers["location"]


def send(client: httpx.Client, path: str, offset: int, content: bytes, **more: str) -> httpx.Response:
    return client.patch(path, headers={**PIECE, "Upload-Offset": str(offset), **more}, content=content)


def offset_of(client: httpx.Client, path: str) -> int:
    answer = client.head(path, headers=TUS)
    assert (answer.status_code, answer.headers["cache-control"]) == (200, "no-store")
    return int(answer.headers["upload-offset"])


def whole(client: httpx.Client, content: bytes = PHOTO, name: str = "photo.jpg") -> str:
    """The id of a complete upload."""
    path = begun(client, len(content), name)
    answer = send(client, path, 0, content)
    assert (answer.status_code, answer.content, answer.headers["upload-offset"]) == (
        204,
        b"",
        str(len(content)),
    )
    return path.removeprefix("/uploads/")


def cut(client: httpx.Client, path: str, offset: int, content: bytes) -> None:
    """Announce all that is left, send `content`, break the connection, and wait until the service has kept it."""
    length = int(client.head(path, headers=TUS).headers["upload-length"])
    head = (
        f"PATCH {path} HTTP/1.1\r\nHost: test\r\nX-API-Key: {client.headers['X-API-Key']}\r\n"
        f"Content-Type: {PIECE['Content-Type']}\r\nTus-Resumable: 1.0.0\r\nUpload-Offset: {offset}\r\n"
        f"Content-Length: {length - offset}\r\n\r\n"
    )
    with connect(client) as connection:
        connection.sendall(head.encode() + content)
    until(lambda: offset_of(client, path) == offset + len(content))


def until(is_so: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 20
    while not is_so():
        assert time.monotonic() < deadline
        time.sleep(POLL_S)


def test_a_mosaic_of_40_mb_whose_connection_breaks_ten_times_is_that_of_the_whole_photos(
    client: httpx.Client,
) -> None:
    photos = [
        PHOTO + bytes([number]) + hashlib.sha256(bytes([number])).digest() * 312_500 for number in range(4)
    ]
    assert sum(map(len, photos)) > 40_000_000
    paths = [begun(client, len(photo), f"{number}.jpg") for number, photo in enumerate(photos)]
    breaks = 0
    for path, photo in zip(paths, photos, strict=True):
        step = len(photo) // 3 + 1
        while (offset := offset_of(client, path)) < len(photo):
            if breaks < CUTS and offset + step < len(photo):
                cut(client, path, offset, photo[offset : offset + step])
                breaks += 1
            elif breaks < CUTS:
                cut(client, path, offset, photo[offset:-1])
                breaks += 1
                assert send(client, path, len(photo) - 1, photo[-1:]).status_code == 204
            else:
                assert send(client, path, offset, photo[offset:]).status_code == 204
    assert breaks == CUTS
    ids = [path.removeprefix("/uploads/") for path in paths]
    resumed = client.post("/mosaic", data={"upload": ids, "format": "json"})
    files = [("images", (f"{number}.jpg", photo)) for number, photo in enumerate(photos)]
    direct = client.post("/mosaic", files=files, data={"format": "json"})
    assert resumed.status_code == 200
    assert resumed.content == direct.content  # with the digests of the photos
    assert hashlib.sha256(photos[3]).hexdigest() in resumed.text
    for path in paths:
        assert client.delete(path, headers=TUS).status_code == 204


@pytest.mark.parametrize(
    ("path", "part"),
    [
        ("/rectify", "image"),
        ("/rectify/image", "image"),
        ("/rectify/pdf", "image"),
        ("/rectify/text", "image"),
        ("/rectify/pages", "image"),
        ("/mosaic", "images"),
        ("/mosaic/image", "images"),
        ("/mosaic/pdf", "images"),
        ("/mosaic/json", "images"),
        ("/layout", "image"),
    ],
)
def test_every_form_takes_ids_in_place_of_files(client: httpx.Client, path: str, part: str) -> None:
    name, content = "my Ünterlage.jpg", PHOTO if path != "/layout" else JPEG
    id, other = whole(client, content, name), whole(client, content + b" ", "b.jpg")
    # The second file stands between the ids: files take the places of their parts.
    by_id = [("upload", (None, id)), (part, ("c.jpg", content)), ("upload", (None, other))]
    files = [(part, (name, content)), (part, ("c.jpg", content)), (part, ("b.jpg", content + b" "))]
    count = 1 if path == "/rectify/image" else 3
    named_files, sent = client.post(path, files=by_id[:count]), client.post(path, files=files[:count])
    assert (named_files.status_code, sent.status_code) == (200, 200), named_files.text
    unequal = {"date", "x-request-id", "document-result", "etag", "content-length"}
    assert {key: value for key, value in named_files.headers.items() if key not in unequal} == {
        key: value for key, value in sent.headers.items() if key not in unequal
    }
    if path != "/layout":  # its answers have an id
        assert named_files.content == sent.content


def test_a_name_may_have_quotes(client: httpx.Client) -> None:
    """Also where a job has put the form together again."""
    id = whole(client, name='my "own" \\ photo.jpg')
    job = client.post("/rectify", data={"upload": id}, headers={"Prefer": "respond-async"}).json()
    until(lambda: client.get(f"/jobs/{job['id']}").json()["ended"] is not None)
    for answer in (client.post("/rectify", data={"upload": id}), client.get(job["links"]["result"])):
        assert answer.headers["content-disposition"].endswith('"photo-flat.jpg"')
    id = whole(client, name='my "own" photo.jpg')
    assert (
        "my%20%22own%22%20photo"
        in client.post("/rectify", data={"upload": id}).headers["content-disposition"]
    )


def test_an_id_is_all_that_a_form_needs_also_without_parts(client: httpx.Client) -> None:
    assert client.post("/rectify", data={"upload": whole(client)}).status_code == 200


def test_a_job_has_its_own_copy_and_the_upload_stays_for_another_request(client: httpx.Client) -> None:
    id = whole(client)
    headers = {"Prefer": "respond-async", "Idempotency-Key": "pieces"}
    first, again, sent = (
        client.post("/rectify", headers=headers, **body)  # type: ignore[arg-type]
        for body in (
            {"data": {"upload": id}},
            {"data": {"upload": id}},
            {"files": {"image": ("photo.jpg", PHOTO)}},
        )
    )
    assert first.status_code == 202
    assert first.headers["location"] == again.headers["location"] == sent.headers["location"]
    assert client.delete(f"/uploads/{id}", headers=TUS).status_code == 204
    until(lambda: client.get(first.headers["location"]).json()["ended"] is not None)
    assert client.get(first.json()["links"]["result"]).content == b"flat as jpeg"


@pytest.mark.parametrize(("offset", "size"), [(0, 10), (9, 1), (11, 9), (20, 0), (9_000, 1)])
def test_gaps_and_overlaps_are_refused(client: httpx.Client, offset: int, size: int) -> None:
    path = begun(client, 20)
    assert send(client, path, 0, b"0123456789").status_code == 204
    answer = send(client, path, offset, b"x" * size)
    assert assert_problem(answer, 409, "wrong-offset")
    assert answer.headers["tus-resumable"] == "1.0.0"
    assert offset_of(client, path) == 10
    assert send(client, path, 10, b"").headers["upload-offset"] == "10"
    octets = {"Content-Type": "application/octet-stream"}  # as generated clients send it
    assert send(client, path, 10, b"x", **octets).headers["upload-offset"] == "11"


def test_more_than_the_length_is_refused_and_a_piece_of_it_is_not_kept(client: httpx.Client) -> None:
    path = begun(client, 20)
    assert_problem(send(client, path, 0, b"x" * 21), 413, "too-large")
    assert offset_of(client, path) == 0

    def chunks() -> Iterator[bytes]:
        yield from (b"x" * 15, b"x" * 15)

    answer = client.patch(path, headers={**PIECE, "Upload-Offset": "0"}, content=chunks())
    assert_problem(answer, 413, "too-large")
    assert offset_of(client, path) == 0


def test_of_two_pieces_for_one_place_one_is_kept(client: httpx.Client) -> None:
    path = begun(client, 20)
    head = (
        f"PATCH {path} HTTP/1.1\r\nHost: test\r\nX-API-Key: alice-secret\r\nTus-Resumable: 1.0.0\r\n"
        f"Content-Type: {PIECE['Content-Type']}\r\nUpload-Offset: 0\r\nContent-Length: 20\r\n\r\n"
    )
    with connect(client) as connection:
        connection.sendall(head.encode() + b"a" * 10)
        assert send(client, path, 0, b"b" * 5).status_code == 204
        connection.sendall(b"a" * 10)
        assert connection.recv(100).startswith(b"HTTP/1.1 409 ")
    assert offset_of(client, path) == 5


def test_a_piece_with_a_checksum_is_kept_as_a_whole_or_not_at_all(client: httpx.Client) -> None:
    path, content = begun(client, PIECE_BYTES + 9), b"x" * (PIECE_BYTES + 9)
    for algorithm in ("sha1", "sha256"):
        sums = [
            base64.b64encode(hashlib.new(algorithm, each).digest()).decode()
            for each in (content, content[:-1])
        ]
        wrong = send(client, path, 0, content, **{"Upload-Checksum": f"{algorithm} {sums[1]}"})
        assert_problem(wrong, 460, "checksum-mismatch")
        assert offset_of(client, path) == 0
    assert send(client, path, 0, content, **{"Upload-Checksum": f"sha256 {sums[0]}"}).status_code == 204
    assert offset_of(client, path) == len(content)


def test_whoever_is_not_the_owner_finds_nothing(client: httpx.Client) -> None:
    path = begun(client, 20)
    for answer in (
        client.get(path, headers=BOB),
        send(client, path, 0, b"x", **BOB),
        client.delete(path, headers={**BOB, **TUS}),
        client.post("/rectify", data={"upload": path.removeprefix("/uploads/")}, headers=BOB),
        client.get("/uploads/nothing"),
    ):
        assert_problem(answer, 404, "not-found")
    assert client.get(path, headers=ADMIN).json() == client.get(path).json()
    assert client.get(path).json()["offset"] == 0


def test_what_cannot_be_used_is_refused(client: httpx.Client) -> None:
    path = begun(client, 20)
    unfinished = client.post("/rectify", data={"upload": path.removeprefix("/uploads/")})
    assert assert_problem(unfinished, 422, "invalid-option")["field"] == "upload"
    whole_path = client.post("/rectify", data={"upload": path})
    assert "the id alone" in str(assert_problem(whole_path, 404, "not-found")["detail"])
    file = client.post("/rectify", files={"upload": ("a", b"x")})
    assert assert_problem(file, 422, "invalid-option")["field"] == "upload"
    assert (
        assert_problem(client.post("/rectify", data={"upload": ""}), 400, "bad-request")["field"] == "image"
    )
    assert client.delete(path, headers={"Tus-Resumable": "2"}).status_code == 412
    for version in ({}, {"Tus-Resumable": "0.2.2"}):
        headers = {**version, "Upload-Length": "1"}
        refused = client.post("/uploads", headers=headers)
        assert_problem(refused, 412, "conflict")
        assert refused.headers["tus-version"] == "1.0.0"
    assert client.head(path, headers={"Tus-Resumable": "2"}).status_code == 412
    assert_problem(
        client.patch(path, headers=TUS | {"Upload-Offset": "0"}, content=b"x"), 415, "unsupported-media-type"
    )
    unplaced = client.patch(path, headers=PIECE, content=b"x")
    assert assert_problem(unplaced, 422, "invalid-option")["field"] == "Upload-Offset"
    for length in ("", "-1", "x", "1e3"):
        unknown = begin(client, 1, **{"Upload-Length": length})
        assert assert_problem(unknown, 422, "invalid-option")["field"] == "Upload-Length"
    assert_problem(begin(client, 161 << 20), 413, "too-large")
    assert_problem(begin(client, 1, "x" * 256), 422, "invalid-option")


def test_files_of_uploads_count_as_those_of_the_body(tmp_path: Path) -> None:
    with serving(data_dir=tmp_path, max_document_upload_bytes=1500, max_upload_bytes=1024) as client:
        client.headers["X-API-Key"] = "none"
        id, large = whole(client, PHOTO + b" " * 900), whole(client, PHOTO + b" " * 1100)
        assert client.post("/rectify", data={"upload": id}).status_code == 200
        twice = client.post("/rectify", data={"upload": [id, id]})
        assert_problem(twice, 413, "too-large")
        assert "MAX_DOCUMENT_UPLOAD_BYTES" in twice.json()["detail"]
        alone = client.post("/rectify", data={"upload": large})
        assert_problem(alone, 413, "too-large")
        assert "MAX_UPLOAD_BYTES" in alone.json()["detail"]


def test_a_key_and_all_keys_have_limits(tmp_path: Path) -> None:
    limits = {"max_kept_uploads": 3, "max_kept_uploads_per_key": 2, "max_kept_uploads_bytes": 2048}
    with serving(data_dir=tmp_path, api_keys=("alice:alice-secret", "bob:bob-secret"), **limits) as client:
        client.headers.update(ALICE)
        paths = [begun(client, 10), begun(client, 10)]
        answers = [begin(client, 10), begin(client, 2030, **BOB)]
        assert begin(client, 10, **BOB).status_code == 201
        answers.append(begin(client, 10, **BOB))
        for answer, setting in zip(answers, ("_PER_KEY", "_BYTES", "MAX_KEPT_UPLOADS)"), strict=True):
            assert_problem(answer, 503, "busy")
            assert setting in answer.json()["detail"]
            assert answer.headers["retry-after"] == "60"
        assert client.delete(paths[0], headers=TUS).status_code == 204
        assert begin(client, 10).status_code == 201


def test_options_tell_what_the_service_can(client: httpx.Client) -> None:
    answer = client.options("/uploads")
    assert (answer.status_code, answer.headers["tus-version"]) == (204, "1.0.0")
    assert answer.headers["tus-extension"].split(",") == ["creation", "expiration", "checksum", "termination"]
    assert int(answer.headers["tus-max-size"]) == 160 << 20


def test_processes_share_uploads_in_a_bucket_also_without_workers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    server = S3Server()
    for name, value in server.environment.items():
        monkeypatch.setenv(name, value)
    make_file(tmp_path / DATABASE)
    shared = {"data_dir": tmp_path, "blob_url": f"s3://{BUCKET}/prefix"}
    try:
        with serving(workers=0, **shared) as one, serving(**shared) as other:
            path = begun(one, len(PHOTO))
            assert send(other, path, 0, PHOTO[:9]).status_code == 204
            assert send(one, path, 9, PHOTO[9:]).status_code == 204
            assert send(other, path, 9, PHOTO[9:]).status_code == 409
            pieces = [key for key in server.bucket.objects if "/uploads/" in key]
            assert len(pieces) == 2
            for service in (one, other):
                done = service.post("/rectify", data={"upload": path.removeprefix("/uploads/")})
                assert (done.status_code, done.content) == (200, b"flat as jpeg")
            assert one.delete(path, headers=TUS).status_code == 204
            assert not [key for key in server.bucket.objects if "/uploads/" in key]
    finally:
        server.stop()


def test_what_has_expired_is_gone_with_its_pieces(tmp_path: Path) -> None:
    pieces = tmp_path / "blobs" / "uploads"
    with serving(data_dir=tmp_path) as client:
        client.headers["X-API-Key"] = "none"
        path, other = begun(client, 20), begun(client, 20)
        assert send(client, path, 0, b"x" * 5).status_code == send(client, other, 0, b"x").status_code == 204
        with closing(sqlite3.connect(tmp_path / DATABASE)) as database, database:
            before = datetime.now(UTC) - timedelta(seconds=1)
            database.execute(
                "UPDATE uploads SET expires_at = ? WHERE id = ?", (f"{before:%F %T}.0", path[9:])
            )
        assert_problem(client.get(path), 404, "not-found")
        assert_problem(send(client, path, 5, b"x"), 404, "not-found")
        assert {each.name for each in pieces.iterdir()} == {path[9:], other[9:]}
    with serving(data_dir=tmp_path) as client:  # sweeps at its start
        until(lambda: [each.name for each in pieces.iterdir()] == [other[9:]])
        assert client.get(other).json()["offset"] == 1


def test_the_name_of_a_file_is_read_as_the_protocol_writes_it() -> None:
    encoded = base64.b64encode("ä b.jpg".encode()).decode()
    assert name_in(f"is_confidential,filename {encoded}, filetype aQ==") == "ä b.jpg"
    assert name_in("") is None
    assert name_in("filename") is None
    for wrong in ("filename %%%", "filename /w==", f"filename {base64.b64encode(b'a' + bytes(1)).decode()}"):
        with pytest.raises(InvalidOption):
            name_in(wrong)


def test_a_checksum_is_of_a_known_algorithm_and_of_all_that_came() -> None:
    for wrong in ("", "sha1", "crc32 AAAA", "sha1 %"):
        with pytest.raises(InvalidOption):
            Checksum(wrong)
    checksum = Checksum(f"sha1 {base64.b64encode(hashlib.sha1(b'ab').digest()).decode()}")
    checksum.add(b"a")
    with pytest.raises(ChecksumMismatch):
        checksum.check()
    checksum.add(b"b")
    checksum.check()


def test_a_full_disk_is_told_and_what_was_kept_stays(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = begun(client, 20)
    assert send(client, path, 0, b"x" * 5).status_code == 204

    async def full(file: object, data: bytes) -> None:
        raise OSError(errno.ENOSPC, "no space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("starlette.datastructures.UploadFile.write", full)
        assert_problem(send(client, path, 5, b"x"), 503, "store-unavailable")
    assert send(client, path, 5, b"x").headers["upload-offset"] == "6"
