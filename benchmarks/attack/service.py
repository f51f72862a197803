"""`python -m benchmarks attack`: every attack on a service of its own, with what it must answer.

While the attacks run, `/health/live` is asked ten times a second and an honest photo is sent again and again. The
table names each answer, its time, and the slowest answer of `/health/live` until the next row, with the processor time
that the server itself used meanwhile; then the memory of the server and of its largest worker.
"""

import argparse
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.attack.table import ATTACKS, Attack
from benchmarks.attack.watch import Watch
from benchmarks.learning.server_processes import Server

LONGEST_LIVE_S = 1.0
LONGEST_ANSWER_S = 15.0
"""Of a PDF of one page; the slow body is allowed its 60 s."""


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
            wrong = sum(not _run(row, server.url, watch) for row in rows)
            watch.stop()
        finally:
            server.stop()
    slowest = watch.slowest()
    print(f"\n{len(rows) - wrong} of {len(rows)} attacks are answered as they must be.")
    print(
        f"/health/live: {len(watch.lives)} answers, the slowest after {slowest.seconds:.2f} s; the server used "
        f"{slowest.own_s:.2f} s of processor time meanwhile."
    )
    print(f"Honest requests: {len(watch.honest)}, with status {sorted(set(watch.honest))}.")
    print(
        f"Peak memory: server {watch.server_bytes >> 20} MiB, largest worker {watch.worker_bytes >> 20} MiB."
    )
    refused = [status for status in watch.honest if status not in (200, 422, 503)]
    return int(bool(wrong or refused or slowest.seconds > LONGEST_LIVE_S))


def _run(row: Attack, url: str, watch: Watch) -> bool:
    begin_s = time.monotonic()
    answer = row.send(url)
    seconds = time.monotonic() - begin_s
    is_right = answer.code in row.codes
    mark = "" if is_right else f"   WRONG: must be {' or '.join(row.codes)}"
    late = "   LATE" if seconds > LONGEST_ANSWER_S else ""
    life = watch.slowest(begin_s)
    print(
        f"{row.name:45} {answer.status:4} {answer.code:22} {seconds:6.2f} s   live {life.seconds:5.2f} s, of them "
        f"{life.own_s:5.2f} the server's{late}{mark}",
        flush=True,
    )
    return is_right
