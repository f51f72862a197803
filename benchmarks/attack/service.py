"""`python -m benchmarks attack`: every attack on a service, with what it must answer.

While the attacks run, `/health/live` is asked ten times a second and an honest photo is sent again and again. The
table names each answer, its time, and the slowest answer of `/health/live` until the next row, with the processor time
that the server itself used meanwhile; then the memory of the server and of its largest worker.
"""

import argparse
import time
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.attack.row import Attack
from benchmarks.attack.table import ATTACKS
from benchmarks.attack.watch import Watch
from benchmarks.learning.server_processes import Server

LONGEST_LIVE_S = 1.0
MOST_SERVER_MIB = 300
LONGEST_ANSWER_S = 15.0
"""Of a PDF of one page; the slow body is allowed its 60 s."""


def main(arguments: Sequence[str]) -> int:
    """Run the table; 1 if an answer is wrong, the service was silent or large, or an honest client got nothing."""
    parser = argparse.ArgumentParser(prog="benchmarks attack", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="only the rows that the suite runs")
    parser.add_argument("--only", default="", help="only rows whose name contains this")
    options = parser.parse_args(arguments)
    rows = [row for row in ATTACKS if options.only in row.name and (row.is_quick or not options.quick)]
    watches: list[Watch] = []
    wrong = 0
    for environment, group in groupby(sorted(rows, key=_environment_of), key=_environment_of):
        with TemporaryDirectory() as folder:
            server = Server(Path(folder), **{"workers": 2, **dict(environment)})
            server.start()
            try:
                watch = Watch(server.url, server.pid)
                watch.start()
                wrong += sum(not _run(row, server.url, watch) for row in group)
                watch.stop()
            finally:
                server.stop()
        watches.append(watch)
    slowest = max((watch.slowest() for watch in watches), key=lambda life: life.seconds)
    server_mib = max(watch.server_bytes for watch in watches) >> 20
    honest = [status for watch in watches for status in watch.honest]
    print(f"\n{len(rows) - wrong} of {len(rows)} attacks are answered as they must be.")
    print(
        f"/health/live: {sum(len(watch.lives) for watch in watches)} answers, the slowest after "
        f"{slowest.seconds:.2f} s (at most {LONGEST_LIVE_S:g}); the server used {slowest.own_s:.2f} s of "
        "processor time meanwhile."
    )
    print(f"Honest requests: {len(honest)}, with status {sorted(set(honest))}.")
    print(
        f"Peak memory: server {server_mib} MiB (at most {MOST_SERVER_MIB}), largest worker "
        f"{max(watch.worker_bytes for watch in watches) >> 20} MiB."
    )
    refused = [status for status in honest if status not in (200, 422, 503)]
    return int(bool(wrong or refused or slowest.seconds > LONGEST_LIVE_S or server_mib > MOST_SERVER_MIB))


def _environment_of(row: Attack) -> list[tuple[str, str]]:
    return sorted(row.environment.items())


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
