"""Uploads in pieces that do not fit, do not end, are another's, or are too many."""

import socket
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from threading import Barrier
from urllib.parse import urlsplit

import httpx

from app.storage.uploads import MOST_PIECES
from benchmarks.attack.clients import Answer, answer_of
from benchmarks.attack.images import picture
from benchmarks.attack.keys import KEYS, key_of
from benchmarks.attack.row import Attack

_TIMEOUT_S = 60.0
_TUS = {"Tus-Resumable": "1.0.0"}
_PIECE = {**_TUS, "Content-Type": "application/offset+octet-stream"}
_CLIENTS = 20
_MOST = "5"
_WITH_KEYS = {"API_KEYS_FILE": str(KEYS)}


def _begin(url: str, length: int | str, **headers: str) -> httpx.Response:
    return httpx.post(
        f"{url}/uploads", headers={**_TUS, "Upload-Length": str(length), **headers}, timeout=_TIMEOUT_S
    )


def _begun(url: str, length: int, **headers: str) -> str:
    """The address of a new upload."""
    return url + _begin(url, length, **headers).raise_for_status().headers["location"]


def _send(upload: str, offset: int, content: bytes, **headers: str) -> httpx.Response:
    return httpx.patch(
        upload,
        headers={**_PIECE, "Upload-Offset": str(offset), **headers},
        content=content,
        timeout=_TIMEOUT_S,
    )


def _second_piece(offset: int, content: bytes, **headers: str) -> Callable[[str], Answer]:
    """What a piece is answered where 10 of 20 bytes have come; a wrong offset afterwards is "moved"."""

    def send(url: str) -> Answer:
        upload = _begun(url, 20)
        _send(upload, 0, b"0123456789").raise_for_status()
        answer = answer_of(_send(upload, offset, content, **headers))
        kept = httpx.head(upload, timeout=_TIMEOUT_S).headers["upload-offset"]
        return answer if kept == "10" else Answer(answer.status, "moved")

    return send


def send_to_another_s(url: str) -> Answer:
    """What one key is answered that knows the id of another's upload: the answer that is not 404, or the last one."""
    upload, other = _begun(url, 20, **key_of("rita")), key_of("honest")
    id = upload.rpartition("/")[2]
    answers = [
        _send(upload, 0, b"x", **other),
        httpx.get(upload, headers=other, timeout=_TIMEOUT_S),
        httpx.delete(upload, headers={**_TUS, **other}, timeout=_TIMEOUT_S),
        httpx.post(f"{url}/rectify", data={"upload": id}, headers=other, timeout=_TIMEOUT_S),
    ]
    return answer_of(min(answers, key=lambda answer: answer.status_code))


def begin_too_many(url: str) -> Answer:
    """What is answered to one upload more than may be kept."""
    answer = _begin(url, 1)
    for _ in range(int(_MOST)):
        answer = _begin(url, 1)
    return answer_of(answer)


def never_finish(url: str) -> Answer:
    """What an honest client is answered, by an upload, while others hold pieces that do not end."""
    place = urlsplit(url)
    with ExitStack() as connections:
        for _ in range(_CLIENTS):
            path = urlsplit(_begun(url, 1_000_000)).path
            connection = connections.enter_context(
                socket.create_connection((place.hostname, place.port), timeout=_TIMEOUT_S)
            )
            head = "".join(f"{name}: {value}\r\n" for name, value in _PIECE.items())
            size = "Upload-Offset: 0\r\nContent-Length: 1000000\r\n\r\n"
            connection.sendall(
                f"PATCH {path} HTTP/1.1\r\nHost: attack\r\n{head}{size}".encode() + b"x" * 1000
            )
        photo = picture()
        upload = _begun(url, len(photo))
        _send(upload, 0, photo).raise_for_status()
        form = {"upload": upload.rpartition("/")[2]}
        return answer_of(httpx.post(f"{url}/rectify", data=form, timeout=_TIMEOUT_S))


def send_at_once(url: str) -> Answer:
    """Twenty pieces for one place at once: one is kept."""
    upload, barrier = _begun(url, 1000), Barrier(_CLIENTS)

    def send(number: int) -> int:
        barrier.wait(_TIMEOUT_S)
        return _send(upload, 0, bytes([number]) * 10).status_code

    with ThreadPoolExecutor(_CLIENTS) as threads:
        statuses = Counter(threads.map(send, range(_CLIENTS)))
    return Answer(200, "ok" if statuses == {204: 1, 409: _CLIENTS - 1} else f"{dict(statuses)}")


def send_single_bytes(url: str) -> Answer:
    """What is answered to the first of pieces of one byte that is refused."""
    upload = _begun(url, 10_000)
    with httpx.Client(headers=_PIECE, timeout=_TIMEOUT_S) as client:
        for offset in range(MOST_PIECES + 1):
            answer = client.patch(upload, headers={"Upload-Offset": str(offset)}, content=b"x")
            if answer.status_code != 204:
                break
    return answer_of(answer)


def name_an_unfinished_one(url: str) -> Answer:
    """What a form is answered that names an upload of which nothing has come."""
    form = {"upload": _begun(url, 20).rpartition("/")[2]}
    return answer_of(httpx.post(f"{url}/rectify", data=form, timeout=_TIMEOUT_S))


ATTACKS = (
    Attack("a gap between pieces", _second_piece(11, b"x"), ("wrong-offset",)),
    Attack("a piece over another one", _second_piece(5, b"x" * 15), ("wrong-offset",)),
    Attack("a piece beyond the end", _second_piece(10, b"x" * 11), ("too-large",)),
    Attack("a piece of another version", _second_piece(10, b"x", **{"Tus-Resumable": "9"}), ("conflict",)),
    Attack(
        "a piece that is not its checksum",
        _second_piece(10, b"x", **{"Upload-Checksum": "sha1 AAAA"}),
        ("checksum-mismatch",),
    ),
    Attack("an upload of a terabyte", lambda url: answer_of(_begin(url, 10**12)), ("too-large",)),
    Attack("an upload of -1 bytes", lambda url: answer_of(_begin(url, -1)), ("invalid-option",)),
    Attack("a form with an unfinished upload", name_an_unfinished_one, ("invalid-option",)),
    Attack("20 pieces that never end", never_finish, ("no-text",)),
    Attack("20 pieces for one place", send_at_once, ("ok",)),
    Attack(
        "an upload of nobody", lambda url: answer_of(_send(f"{url}/uploads/nobody", 0, b"x")), ("not-found",)
    ),
    Attack("1001 pieces of a byte", send_single_bytes, ("too-large",), is_quick=False),
    Attack("an upload of another key", send_to_another_s, ("not-found",), environment=_WITH_KEYS),
    Attack("too many uploads", begin_too_many, ("busy",), environment={"MAX_KEPT_UPLOADS": _MOST}),
)
