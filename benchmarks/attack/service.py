"""`python -m benchmarks attack`: every attack on a service of its own, with what it must answer.

While the attacks run, `/health/live` is asked ten times a second and an honest photo is sent again and again. The
table names each answer, its time, and the memory of the server and of its largest worker.
"""

import argparse
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import httpx
import psutil

from benchmarks.attack.images import picture
from benchmarks.attack.table import ATTACKS, Attack
from benchmarks.learning.server_processes import Server

LONGEST_LIVE_S = 1.0
LONGEST_ANSWER_S = 15.0
"""Of a PDF of one page; the slow body is allowed its 60 s."""
_PAUSE_S = 0.1


class Watch(threading.Thread):
    """Asks for life and sends honest requests, until it is stopped."""

    def __init__(self, url: str, pid: int) -> None:
        super().__init__(daemon=True)
        self._url, self._server = url, psutil.Process(pid)
        self._stopped = threading.Event()
        self.live_s: list[float] = []
        self.honest: list[int] = []
        self.server_bytes = self.worker_bytes = 0

    def run(self) -> None:
        """Ask until `stop`."""
        while not self._stopped.wait(_PAUSE_S):
            begin = time.monotonic()
            httpx.get(self._url + "/health/live", timeout=60)
            self.live_s.append(time.monotonic() - begin)
            files = {"image": picture()}
            self.honest.append(httpx.post(self._url + "/rectify", files=files, timeout=120).status_code)
            self._measure()

    def _measure(self) -> None:
        self.server_bytes = max(self.server_bytes, self._server.memory_info().rss)
        for child in self._server.children(recursive=True):
            try:
                self.worker_bytes = max(self.worker_bytes, child.memory_info().rss)
            except psutil.NoSuchProcess:
                continue

    def stop(self) -> None:
        """End the thread."""
        self._stopped.set()
        self.join(120)


def main(arguments: Sequence[str]) -> int:
    """Run the table; 1 if an answer is wrong, the service was silent, or an honest client got nothing."""
    parser = argparse.ArgumentParser(prog="benchmarks attack", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="only the rows that the suite runs")
    parser.add_argument("--only", default="", help="only rows whose name contains this")
    options = parser.parse_args(arguments)
    rows = [row for row in ATTACKS if options.only in row.name and (row.is_quick or not options.quick)]
    with TemporaryDirectory() as folder:
        server = Server(Path(folder), workers=2)
        server.start()
        try:
            watch = Watch(server.url, server.pid)
            watch.start()
            wrong = sum(not _run(row, server.url) for row in rows)
            watch.stop()
        finally:
            server.stop()
    slowest = max(watch.live_s, default=0.0)
    print(f"\n{len(rows) - wrong} of {len(rows)} attacks are answered as they must be.")
    print(f"/health/live: {len(watch.live_s)} answers, the slowest after {slowest:.2f} s.")
    print(f"Honest requests: {len(watch.honest)}, with status {sorted(set(watch.honest))}.")
    print(
        f"Peak memory: server {watch.server_bytes >> 20} MiB, largest worker {watch.worker_bytes >> 20} MiB."
    )
    refused = [status for status in watch.honest if status not in (200, 422, 503)]
    return int(bool(wrong or refused or slowest > LONGEST_LIVE_S))


def _run(row: Attack, url: str) -> bool:
    begin = time.monotonic()
    answer = row.send(url)
    seconds = time.monotonic() - begin
    is_right = answer.code in row.codes
    mark = "" if is_right else f"   WRONG: must be {' or '.join(row.codes)}"
    late = "   LATE" if seconds > LONGEST_ANSWER_S else ""
    print(f"{row.name:45} {answer.status:4} {answer.code:22} {seconds:6.2f} s{late}{mark}", flush=True)
    return is_right
