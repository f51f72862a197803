"""`python -m benchmarks soak`: half an hour of mixed traffic on one service, on SQLite and on PostgreSQL.

Clients flatten photos, recognize pages, add and delete samples, give feedback and take it back, claim and skip, send
jobs, list, export, ask for what is not there, send damaged files and leave in the middle. Every few seconds memory,
descriptors and threads of the server, memory of its workers, and the temporary files are measured. After the first
third they must be flat: the last third may lie above the second by what `Bound` says.
"""

import argparse
import json
import random
import socket
import statistics
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import httpx
import psutil

from benchmarks.attack.clients import part_head, request_head
from benchmarks.attack.images import picture
from benchmarks.common.places import REPOSITORY
from benchmarks.common.plots import draw_panels
from benchmarks.common.postgresql import running_cluster
from benchmarks.learning.server_processes import Server

EXAMPLES = REPOSITORY / "examples"
EVERY_S = 5.0
CLIENTS = 4
_TIMEOUT_S = 120.0
SETTINGS = {
    "workers": 1,
    "result_ttl_s": 60,
    "max_results": 300,
    "job_ttl_s": 60,
    "max_kept_images_bytes": 2**24,
    "max_samples_per_model": 50,
    "jobs_per_worker": 50,
}
"""What is stored reaches its limits in the first third."""


@dataclass(frozen=True, slots=True)
class Bound:
    """Most growth from the second to the last third: a share of the value, and a number besides."""

    share: float
    more: float


BOUNDS = {
    "server MiB": Bound(0.05, 2.0),
    "worker MiB": Bound(0.05, 10.0),
    "descriptors": Bound(0.0, 3.0),
    "threads": Bound(0.0, 2.0),
    "temporary files": Bound(0.0, 2.0),
    "temporary MiB": Bound(0.0, 8.0),
    "blobs MiB": Bound(0.1, 4.0),
}
"""Medians of thirds are compared, so single uploads in progress do not count."""


def main(arguments: Sequence[str]) -> int:
    """Print what grew; 1 if something did, or an answer was a defect."""
    parser = argparse.ArgumentParser(prog="benchmarks soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--store", choices=("sqlite", "postgresql"), default="sqlite")
    parser.add_argument("--pause", type=float, default=0.5, help="seconds between two requests of a client")
    parser.add_argument("--plot", type=Path, help="a picture of the series")
    options = parser.parse_args(arguments)
    with TemporaryDirectory() as name, _database(options.store) as database:
        folder, spool = Path(name) / "data", Path(name) / "tmp"
        spool.mkdir()
        server = Server(folder, **SETTINGS, **database, tmpdir=spool)
        server.start()
        try:
            soak = Soak(server, folder, spool, options.pause)
            soak.run(60.0 * options.minutes)
        finally:
            server.stop()
    if options.plot is not None:
        soak.plot(options.plot)
    return int(not soak.report(options.store))


@contextmanager
def _database(store: str) -> Iterator[dict[str, str]]:
    if store == "sqlite":
        yield {}
        return
    with running_cluster() as cluster:
        yield {"database_url": cluster.make_database()}


class Soak:
    """The clients, and what was measured meanwhile."""

    def __init__(self, server: Server, folder: Path, spool: Path, pause_s: float) -> None:
        self._server, self._folder, self._spool = server, folder, spool
        self._pause_s = pause_s
        self._over = threading.Event()
        self.answers: Counter[tuple[str, int]] = Counter()
        self.series: dict[str, list[float]] = {name: [] for name in BOUNDS}

    def run(self, seconds: float) -> None:
        """Send requests for so long, and measure."""
        clients = [threading.Thread(target=self._client, args=(number,)) for number in range(CLIENTS)]
        for client in clients:
            client.start()
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            self._over.wait(EVERY_S)
            self._measure()
        self._over.set()
        for client in clients:
            client.join(2 * _TIMEOUT_S)

    def report(self, store: str) -> bool:
        """Print the figures; whether all are flat and no answer was a defect."""
        is_flat = True
        print(f"{store}: {sum(self.answers.values())} requests, {len(self.series['threads'])} measurements")
        for name, values in self.series.items():
            third = len(values) // 3
            middle, last = (statistics.median(part) for part in (values[third : 2 * third], values[-third:]))
            bound = BOUNDS[name]
            grown = last - middle > bound.share * middle + bound.more
            is_flat &= not grown
            print(
                f"  {name:16} second third {middle:8.1f}  last third {last:8.1f}{'   GROWS' if grown else ''}"
            )
        for (request, status), count in sorted(self.answers.items()):
            print(f"    {request:22} {status} {count:6d}")
        defects = [key for key in self.answers if key[1] >= 500 and key[1] != 503]
        return is_flat and not defects

    def plot(self, path: Path) -> None:
        """Draw the series, one panel each."""
        times = [EVERY_S * number / 60.0 for number in range(len(self.series["threads"]))]
        panels = {name: {"measured": (times, values)} for name, values in self.series.items()}
        draw_panels(path, panels, {"measured": "#4878a8"}, "minutes", "", columns=2)

    def _measure(self) -> None:
        with suppress(psutil.NoSuchProcess):
            process = psutil.Process(self._server.pid)
            workers = [child.memory_info().rss for child in process.children(recursive=True)]
            files = [file for file in self._spool.rglob("*") if file.is_file()]
            blobs = self._folder / "blobs"
            found = {
                "server MiB": process.memory_info().rss / 2**20,
                "worker MiB": max(workers, default=0) / 2**20,
                "descriptors": float(process.num_fds()),
                "threads": float(process.num_threads()),
                "temporary files": float(len(files)),
                "temporary MiB": _bytes_of(files) / 2**20,
                "blobs MiB": _bytes_of(file for file in blobs.rglob("*") if file.is_file()) / 2**20,
            }
            for name, value in found.items():
                self.series[name].append(value)

    def _client(self, number: int) -> None:
        rng = random.Random(number)
        requests = list(REQUESTS.items())
        with httpx.Client(base_url=self._server.url, timeout=_TIMEOUT_S) as client:
            while not self._over.wait(self._pause_s):
                name, send = rng.choice(requests)
                try:
                    status = send(client, rng)
                except httpx.TransportError:
                    status = 599
                self.answers[name, status] += 1


def _bytes_of(files: Iterator[Path] | list[Path]) -> int:
    total = 0
    for file in files:
        with suppress(FileNotFoundError):
            total += file.stat().st_size
    return total


def _flatten(client: httpx.Client, rng: random.Random) -> int:
    asked = {"format": rng.choice(["jpeg", "pdf", "json"]), "max_width": "600"}
    return client.post("/rectify", files={"image": _example("a.jpg")}, data=asked).status_code


def _damaged(client: httpx.Client, rng: random.Random) -> int:
    data = bytearray(_example("a.jpg")[: rng.randrange(100, 40_000)])
    data[rng.randrange(len(data))] ^= 0xFF
    return client.post("/rectify", files={"image": bytes(data)}).status_code


def _leave(client: httpx.Client, rng: random.Random) -> int:
    with socket.create_connection((client.base_url.host, client.base_url.port or 80)) as connection:
        connection.sendall(request_head("/rectify", 500_000) + part_head() + bytes(rng.randrange(200_000)))
    return 0


def _recognize(client: httpx.Client, rng: random.Random) -> int:
    data = {"keep_image": "true", "ocr": "off"}
    return client.post("/layout", files={"image": _example("page.png")}, data=data).status_code


def _zones(client: httpx.Client, rng: random.Random) -> int:
    page = json.loads(_example("letter-1.json"))
    page["zones"] = [{key: value for key, value in zone.items() if key != "label"} for zone in page["zones"]]
    return client.post("/layout", data={"zones": json.dumps(page)}).status_code


def _sample(client: httpx.Client, rng: random.Random) -> int:
    page = json.loads(_example("letter-2.json"))
    page["zones"][0]["text"] = f"page {rng.randrange(1000)}"
    return client.post("/layout/models/letter/samples", json=page).status_code


def _forget_sample(client: httpx.Client, rng: random.Random) -> int:
    listed = client.get("/layout/models/letter/samples").json().get("samples", [])
    if len(listed) < 3:
        return 404
    one = rng.choice(listed)["id"]
    return client.delete(f"/layout/models/letter/samples/{one}").status_code


def _open_result(client: httpx.Client, rng: random.Random) -> str | None:
    listed = client.get("/layout/results", params={"limit": 50}).json().get("results", [])
    return rng.choice(listed)["id"] if listed else None


def _feedback(client: httpx.Client, rng: random.Random) -> int:
    result = _open_result(client, rng)
    if result is None:
        return 404
    found = client.get(f"/layout/results/{result}")
    if found.status_code != 200 or not found.json().get("zones"):
        return found.status_code
    zone = rng.choice(found.json()["zones"])["id"]
    body = {"class": "letter", "labels": {zone: rng.choice(["sender", "receiver", None])}}
    return client.post(f"/layout/results/{result}/feedback", json=body).status_code


def _undo(client: httpx.Client, rng: random.Random) -> int:
    result = _open_result(client, rng)
    return 404 if result is None else client.delete(f"/layout/results/{result}/feedback").status_code


def _claim(client: httpx.Client, rng: random.Random) -> int:
    result = _open_result(client, rng)
    if result is None:
        return 404
    answer = client.post(f"/layout/results/{result}/claim")
    if answer.status_code == 200:
        body = {"claim": answer.json()["claim"]}
        return client.post(
            f"/layout/results/{result}/{rng.choice(['skip', 'release'])}", json=body
        ).status_code
    return answer.status_code


def _train(client: httpx.Client, rng: random.Random) -> int:
    return client.post("/layout/models/letter/initialize").status_code


def _job(client: httpx.Client, rng: random.Random) -> int:
    headers = {"Prefer": "respond-async"}
    answer = client.post("/rectify", files={"image": _example("b.jpg")}, headers=headers)
    if answer.status_code == 202 and rng.random() < 0.3:
        return client.delete(answer.headers["Location"]).status_code
    return answer.status_code


def _read(client: httpx.Client, rng: random.Random) -> int:
    paths = [
        "/layout/models",
        "/layout/results?format=csv",
        "/audit",
        "/metrics",
        "/health/ready",
        "/openapi.json",
    ]
    paths += ["/layout/export", "/cameras", "/", "/layout/models/letter", "/jobs/none", "/nothing/there"]
    return client.get(rng.choice(paths)).status_code


def _example(name: str) -> bytes:
    if name not in _FILES:
        _FILES[name] = (EXAMPLES / name).read_bytes()
    return _FILES[name]


_FILES: dict[str, bytes] = {}
REQUESTS: dict[str, Callable[[httpx.Client, random.Random], int]] = {
    "flatten": _flatten,
    "blank photo": lambda client, rng: client.post("/rectify", files={"image": picture()}).status_code,
    "damaged photo": _damaged,
    "leave in the middle": _leave,
    "recognize an image": _recognize,
    "recognize zones": _zones,
    "add a sample": _sample,
    "delete a sample": _forget_sample,
    "feedback": _feedback,
    "undo": _undo,
    "claim, skip or release": _claim,
    "initialize": _train,
    "job": _job,
    "read": _read,
}
"""What clients do, each as often as the others; the status of the last answer."""
