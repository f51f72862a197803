"""A worker that is killed costs one request; a server that is killed costs an upload no piece that it has kept."""

import os
import signal
import socket
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx

from app.storage.layout_store import DATABASE
from app.storage.uploads import PIECE_BYTES
from models.repository import Store
from tests.app.scripts import upload
from tests.end_to_end.processes import Service, running
from tests.models.databases import make_file


def post(service: Service, script: str) -> httpx.Response:
    return httpx.post(service.url + "/rectify", files={"image": upload(script)}, timeout=20)


def test_kill_9_costs_one_request(tmp_path: Path) -> None:
    with running(workers=2) as service, ThreadPoolExecutor(8) as clients:
        victim = clients.submit(post, service, f"wait {tmp_path}")
        deadline = time.monotonic() + 10
        while not (tmp_path / "running").exists():
            assert time.monotonic() < deadline
            time.sleep(0.01)
        others = [clients.submit(post, service, "sleep 0.05") for _ in range(6)]
        os.kill(int((tmp_path / "running").read_text(encoding="ascii")), signal.SIGKILL)
        answer = victim.result()
        assert (answer.status_code, answer.json()["code"]) == (500, "worker-died")
        assert answer.json()["request_id"] == answer.headers["x-request-id"]
        assert [other.result().status_code for other in others] == [200] * 6
        ready = httpx.get(service.url + "/health/ready")
        assert ready.status_code == 200


def test_the_killer_of_every_process_but_the_server() -> None:
    with running(fresh=True, workers=2) as service:
        for process in service.descendants():
            process.kill()
        deadline = time.monotonic() + 20
        while (answer := post(service, "")).status_code != 200:
            assert answer.json()["code"] == "worker-died"
            assert time.monotonic() < deadline
        assert httpx.get(service.url + "/health/live").status_code == 200


def test_after_kill_9_in_the_middle_of_a_piece_an_upload_has_what_was_kept(tmp_path: Path) -> None:
    content = os.urandom(2 * PIECE_BYTES + 500_000)
    tus = {"Tus-Resumable": "1.0.0", "Content-Type": "application/offset+octet-stream"}
    with running(data_dir=make_file(tmp_path / DATABASE).parent) as service:
        begun = httpx.post(f"{service.url}/uploads", headers={**tus, "Upload-Length": str(len(content))})
        path = begun.headers["location"]
        head = (
            f"PATCH {path} HTTP/1.1\r\nHost: test\r\nTus-Resumable: 1.0.0\r\nUpload-Offset: 0\r\n"
            f"Content-Type: {tus['Content-Type']}\r\nContent-Length: {len(content)}\r\n\r\n"
        )
        with socket.create_connection(("127.0.0.1", service.port), timeout=20) as connection:
            connection.sendall(head.encode() + content[:-1])
            deadline = time.monotonic() + 20
            while int(httpx.head(service.url + path).headers["upload-offset"]) < 2 * PIECE_BYTES:
                assert time.monotonic() < deadline
                time.sleep(0.02)
            service.process.kill()
            service.process.wait(20)
    with running(data_dir=tmp_path) as service:
        offset = int(httpx.head(service.url + path).headers["upload-offset"])
        assert 2 * PIECE_BYTES <= offset < len(content)
        rest = {**tus, "Upload-Offset": str(offset)}
        assert httpx.patch(service.url + path, headers=rest, content=content[offset:]).status_code == 204
    with Store.open(tmp_path / DATABASE) as store:
        upload = store.upload(path.removeprefix("/uploads/"))
    pieces = (tmp_path / "blobs" / path[1:] / piece.name for piece in upload.pieces)
    assert b"".join(piece.read_bytes() for piece in pieces) == content
