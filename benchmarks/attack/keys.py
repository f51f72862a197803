"""Attacks by those who have a key, or a line of API_KEYS_FILE; and settings that would leave the service open.

Where what was answered is no problem document, the code says what was found: `hidden` or `shown`, `refused` for a
service that does not start.
"""

import base64
import hashlib
import hmac
import json
import os
import signal
import struct
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import httpx

from benchmarks.attack import texts
from benchmarks.attack.clients import Answer, answer_of, send_raw
from benchmarks.attack.images import picture
from benchmarks.attack.row import Attack
from benchmarks.learning.server_processes import Server

KEYS = Path(__file__).with_name("keys.txt")
_LATER = {"Prefer": "respond-async"}
_TIMEOUT_S = 90.0
_COUNTS_WITHIN_S = 5.0
"""A changed file of keys."""
_TOLD = "everybody could use the service"


def key_of(name: str) -> dict[str, str]:
    """The header with the key of a name in the file."""
    return {"X-API-Key": f"key-of-{name}"}


def _line(name: str, role: str) -> str:
    return f"{name} {role} {_digest(name)}\n"


def _digest(name: str) -> str:
    return hashlib.sha256(f"key-of-{name}".encode()).hexdigest()


def _by_token(url: str, token: str) -> Answer:
    return answer_of(httpx.get(url + "/layout/models", params={"token": token}, timeout=_TIMEOUT_S))


def _forged(url: str, key: str, purpose: bytes, valid_s: int) -> Answer:
    """What a token is answered that is signed with what a line of the file has."""
    body = struct.pack(">Q", int(time.time()) + valid_s)
    signature = hmac.digest(key.encode(), purpose + body, "sha256")[:16]
    return _by_token(url, base64.urlsafe_b64encode(body + signature).decode().rstrip("="))


def _prolonged(url: str) -> Answer:
    token = httpx.post(url + "/tokens", headers=key_of("rita"), timeout=_TIMEOUT_S).json()["token"]
    signature = base64.urlsafe_b64decode(token)[8:]
    body = struct.pack(">Q", int(time.time()) + 10**8)
    return _by_token(url, base64.urlsafe_b64encode(body + signature).decode())


def _started(url: str, setting: str, content: str, said: str) -> Answer:
    """Whether a service starts with this setting, or with a file of this content."""
    with TemporaryDirectory() as folder:
        value = content
        if setting == "api_keys_file":
            (Path(folder) / "keys").write_text(content, encoding="utf-8")
            value = str(Path(folder) / "keys")
        server = Server(Path(folder), workers=1, **{setting: value})
        try:
            server.start()
        except RuntimeError as error:
            return Answer(0, "refused" if said in str(error) else "refused without a reason")
        finally:
            server.stop()
    return Answer(200, "started")


def _removed_key(url: str, *, is_asked: bool) -> Answer:
    """What a key gets that was taken out of the file of a running service; `is_asked`: SIGHUP follows."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "keys"
        path.write_text(_line("rita", "reader") + _line("boss", "admin"), encoding="utf-8")
        server = Server(Path(folder), workers=1, api_keys_file=path)
        server.start()
        try:
            token = httpx.post(server.url + "/tokens", headers=key_of("rita")).json()["token"]
            path.write_text(_line("boss", "admin"), encoding="utf-8")
            if is_asked:
                os.kill(server.pid, signal.SIGHUP)
            deadline = time.monotonic() + _COUNTS_WITHIN_S
            while (answer := _by_token(server.url, token)).status == 200 and time.monotonic() < deadline:
                time.sleep(0.05)
            return answer
        except httpx.HTTPError:
            return Answer(0, "closed")
        finally:
            server.stop()


def _proposals(url: str) -> Answer:
    """Whether a job of a verifier that is called admin looks at unknown pages of other keys."""
    with httpx.Client(base_url=url, timeout=_TIMEOUT_S) as client:
        page = client.post("/layout", data={"zones": texts.zones()}, headers=key_of("boss")).json()["id"]
        client.post(
            f"/layout/results/{page}/feedback", json={"class": None}, headers=key_of("boss")
        ).raise_for_status()
        job = client.post("/layout/proposals", headers={**key_of("admin"), **_LATER}).headers["location"]
        while client.get(job, headers=key_of("admin")).json()["state"] not in ("succeeded", "failed"):
            time.sleep(0.05)
        found = client.get(f"{job}/result", headers=key_of("admin"))
    if found.status_code != 200:
        return answer_of(found)
    return Answer(200, "shown" if found.json()["looked_at"]["unknown_pages"] else "hidden")


def _feedback(url: str) -> Answer:
    """Whether a reader is shown what another key has said of a page."""
    with httpx.Client(base_url=url, timeout=_TIMEOUT_S) as client:
        page = json.loads(texts.zones())
        for zone in page["zones"]:
            zone["label"] = "date"
        client.post("/layout/models/memo/samples", json=page, headers=key_of("boss")).raise_for_status()
        client.post("/layout/models/memo/initialize", headers=key_of("boss")).raise_for_status()
        result = client.post("/layout", data={"zones": texts.zones()}, headers=key_of("boss")).json()["id"]
        client.post(
            f"/layout/results/{result}/feedback", json={"class": "memo"}, headers=key_of("boss")
        ).raise_for_status()
        path = "/layout/models/memo/feedback"
        told, shown = (client.get(path, headers=key_of(name)) for name in ("boss", "rita"))
    assert told.json()["feedback"]
    return Answer(shown.status_code, "shown" if shown.json()["feedback"] else "hidden")


def _of_reader(method: str, path: str, url: str) -> Answer:
    return answer_of(httpx.request(method, url + path, headers=key_of("rita"), timeout=_TIMEOUT_S))


def _jobs(url: str) -> Answer:
    """What the last of six jobs of one key is answered."""
    files = {"image": picture()}
    answers = [
        httpx.post(url + "/rectify", files=files, headers={**key_of("rita"), **_LATER}, timeout=_TIMEOUT_S)
        for _ in range(6)
    ]
    accepted = sum(answer.status_code == 202 for answer in answers)
    return answer_of(answers[-1]) if accepted == 2 else Answer(202, f"{accepted} accepted")


def _waiting(path: str, url: str) -> Answer:
    return answer_of(
        httpx.post(url + path, files={"image": picture()}, headers=key_of("rita"), timeout=_TIMEOUT_S)
    )


def _with_header(name: str, value: bytes, url: str) -> Answer:
    return send_raw(
        url,
        b"POST /layout/proposals HTTP/1.1\r\nHost: attack\r\nContent-Length: 0\r\nConnection: close\r\n",
        name.encode() + b": " + value + b"\r\n\r\n",
    )


def _slow_pages(url: str) -> Answer:
    """What a document is answered whose first page is done and whose others take too long."""
    files = [("image", picture("PNG")), *[("image", picture("JPEG", (3000, 3400)))] * 19]
    fields = {"format": "json", "on_no_text": "keep", "text": "true"}
    answer = httpx.post(url + "/rectify", files=files, data=fields, timeout=_TIMEOUT_S)
    if answer.status_code != 200:
        return answer_of(answer)
    late = [page for page in answer.json()["pages"] if "problem" in page]
    assert all(page["problem"]["code"] == "timed-out" for page in late)
    return Answer(200, "some pages" if late else "all pages")


_OF_FILE = {"API_KEYS_FILE": str(KEYS)}
_NO_WORKERS = {"WORKERS": "0", "QUEUE_TIMEOUT_S": "2"}
_FEW_JOBS = {**_OF_FILE, **_NO_WORKERS, "MAX_JOBS_PER_KEY": "2"}
_FORBIDDEN = ("forbidden",)
_ENTRY = f"rita:sha256:{_digest('rita')}"


def _of_file(name: str, send: Callable[[str], Answer], *codes: str) -> Attack:
    return Attack(name, send, codes, is_quick=False, environment=_OF_FILE)


def _start(name: str, setting: str, content: str, said: str) -> Attack:
    send = partial(_started, setting=setting, content=content, said=said)
    return Attack(name, send, ("refused",), is_quick=False)


ATTACKS = (
    _of_file(
        "a token signed with a line of the file",
        partial(_forged, key=_ENTRY, purpose=b"document-rectification token 1", valid_s=60),
        *_FORBIDDEN,
    ),
    _of_file(
        "such a token for ten years",
        partial(_forged, key=_ENTRY, purpose=b"document-rectification token 1", valid_s=3 * 10**8),
        *_FORBIDDEN,
    ),
    _of_file(
        "a token signed with a digest",
        partial(_forged, key=_digest("rita"), purpose=b"document-rectification token 2", valid_s=60),
        *_FORBIDDEN,
    ),
    _of_file("a token with a later end", _prolonged, *_FORBIDDEN),
    _of_file(
        "a digest in place of its key",
        lambda url: answer_of(httpx.get(url + "/layout/models", headers={"X-API-Key": _digest("boss")})),
        *_FORBIDDEN,
    ),
    _of_file("a verifier called admin, by a job", _proposals, "hidden"),
    _of_file("feedback of another key", _feedback, "hidden"),
    *(
        _of_file(f"{method} {path}%0a", partial(_of_reader, method, path + "%0a"), "not-found")
        for method, path in (
            ("GET", "/audit"),
            ("POST", "/layout"),
            ("POST", "/layout/proposals"),
            ("POST", "/rectify"),
        )
    ),
    _start("a file of keys without a key", "api_keys_file", "# nobody\n", _TOLD),
    _start("API_KEYS of a comma", "api_keys", ",", _TOLD),
    _start("API_KEYS that is empty", "api_keys", "", _TOLD),
    _start("a name without a key", "api_keys", "admin:", "everybody could guess"),
    _start("a digest twice in the file", "api_keys_file", _line("rita", "reader") * 2, "already, as rita"),
    Attack("a key taken out of the file", partial(_removed_key, is_asked=False), _FORBIDDEN, is_quick=False),
    Attack("SIGHUP to the service", partial(_removed_key, is_asked=True), _FORBIDDEN, is_quick=False),
    Attack("six jobs of a key that may have two", _jobs, ("busy",), False, _FEW_JOBS),
    *(
        Attack(f"{path} without any worker", partial(_waiting, path), ("busy",), False, _NO_WORKERS)
        for path in ("/rectify", "/layout")
    ),
    Attack("20 pages, and time for some", _slow_pages, ("some pages",), False, {"DOCUMENT_TIMEOUT_S": "2"}),
    Attack("an Origin that is no address", partial(_with_header, "Origin", b"http://["), _FORBIDDEN),
    Attack("an Origin of random bytes", partial(_with_header, "Origin", b"\xff\xfe://\xfd"), _FORBIDDEN),
    Attack(
        "a length of 5000 digits",
        partial(_with_header, "Content-Length", b"9" * 5000),
        ("not-a-problem", "closed"),  # the server cannot read such a request, and has no path for its answer
    ),
    Attack(
        "a request id of 60 kB", partial(_with_header, "X-Request-ID", b"\xff" * 60_000), ("ok", "closed")
    ),
)
