"""Feedback on one class to several servers over one database, while they are killed: nothing is lost or half.

python -m benchmarks learning_store [--servers 4] [--posts 250] [--kill-every 5] [--kills 1000] [--database sqlite]

With `--database postgresql` the servers share a PostgreSQL of their own, and every fourth kill is one of all its
processes. Needs no data: the pages are letters that the project sets itself.
"""

import argparse
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import httpx
import numpy as np

from benchmarks.common.figures import plain_values, write_json
from benchmarks.common.places import OUTPUT
from benchmarks.common.postgresql import running_cluster
from benchmarks.layout.part import table
from benchmarks.learning.pages import verdict
from benchmarks.learning.server_processes import Server
from benchmarks.learning.storm import SAMPLES, Storm, storm_of_feedback, teach
from benchmarks.learning.storm_checks import asking, doubts, inspect

PATIENCE_S = 60.0
DATABASE = "layout.sqlite3"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save; 1 when something was lost."""
    options = _parser().parse_args(arguments)
    count = options.servers * options.posts
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory()))
        client = stack.enter_context(httpx.Client(timeout=PATIENCE_S))
        where: Path | str = folder / DATABASE
        more: dict[str, object] = {}
        crash = None
        if options.database == "postgresql":
            cluster = stack.enter_context(running_cluster(durable=True))
            where = cluster.make_database()
            more, crash = {"database_url": where}, cluster.crash
        servers = [
            Server(
                folder,
                workers=1,
                max_samples_per_model=count + SAMPLES,
                max_results=max(2 * count, 1000),
                max_models=10,
                **more,
            )
            for _ in range(options.servers)
        ]
        try:
            for server in servers:
                server.start()
            first_version = teach(client, servers[0].url)
            start = time.perf_counter()

            def tell(done: int) -> None:
                if done % max(1, count // 20) == 0:
                    spent = time.perf_counter() - start
                    print(f"[{done}/{count} {spent:.0f}s] feedback", file=sys.stderr, flush=True)

            storm = storm_of_feedback(client, servers, count, options.kill_every, options.kills, tell, crash)
            left = sum(server.left_behind() for server in servers)
        finally:
            for server in servers:
                server.stop()
        with asking(where) as ask:
            checks, doubtful = inspect(where, ask, first_version, storm), doubts(ask, storm)
    figures = _figures(options, storm, checks, left, doubtful)
    print(_report(options, storm, checks, figures))
    good = all(found == wanted for _, found, wanted in checks)
    write_json(OUTPUT / f"learning_store_{options.database}.json", plain_values(figures))
    return 0 if good else 1


def _figures(
    options: argparse.Namespace,
    storm: Storm,
    checks: Sequence[Sequence[object]],
    left: int,
    doubtful: tuple[int, int],
) -> dict[str, Any]:
    latencies = 1000 * np.array(storm.latencies_s)
    return {
        "servers": options.servers,
        "feedback": len(storm.accepted),
        "taken_back": len(storm.taken_back),
        "undo_in_doubt": doubtful[0],
        "undo_in_doubt_done": doubtful[1],
        "database": options.database,
        "kills": storm.kills,
        "database_kills": storm.database_kills,
        "wall_s": storm.wall_s,
        "per_second": len(storm.accepted) / storm.wall_s,
        "tries": storm.tries,
        "refusals": storm.refusals,
        "latency_ms": {
            "median": float(np.median(latencies)),
            "p95": float(np.percentile(latencies, 95)),
            "most": float(latencies.max()),
        },
        "left_behind": left,
        "checks": {str(what): [found, wanted] for what, found, wanted in checks},
    }


def _report(
    options: argparse.Namespace,
    storm: Storm,
    checks: Sequence[Sequence[object]],
    figures: dict[str, Any],
) -> str:
    latency = figures["latency_ms"]
    rows = [[what, found, wanted, verdict(found == wanted)] for what, found, wanted in checks]
    refusals = ", ".join(f"{why} {count}" for why, count in sorted(storm.refusals.items())) or "none"
    killed = f"{storm.kills} times kill -9"
    if storm.database_kills:
        killed += f", {storm.database_kills} times of the database"
    return "\n".join(
        [
            table(
                f"{options.servers} servers, {len(storm.accepted)} feedbacks on one class, {killed}",
                ("after it", "found", "wanted", "met"),
                rows,
            ),
            f"{figures['per_second']:.1f} feedbacks a second over {storm.wall_s:.0f} s; answer after "
            f"{latency['median']:.0f} ms median, {latency['p95']:.0f} ms p95, {latency['most']:.0f} ms at most, with "
            "all tries",
            f"{len(storm.taken_back)} undos were answered; {figures['undo_in_doubt']} were sent and not answered, of "
            f"them {figures['undo_in_doubt_done']} were done",
            f"{storm.tries} requests; failed: {refusals}",
            f"processes that killed servers have left behind: {figures['left_behind']}",
        ]
    )


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks learning_store",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--servers", type=int, default=4, help="server processes, and clients")
    parser.add_argument("--posts", type=int, default=250, help="feedbacks of each client")
    parser.add_argument(
        "--kill-every", type=float, default=5.0, help="seconds between kills on average; 0: none"
    )
    parser.add_argument("--kills", type=int, default=1000, help="ends after so many kills")
    parser.add_argument("--database", choices=("sqlite", "postgresql"), default="sqlite")
    return parser
