"""Feedback on one class to several servers over one database, while servers are killed: nothing is lost or half.

python -m benchmarks.learning_store [--servers 4] [--posts 250] [--kill-every 5]

Needs no data: the pages are letters that the project sets itself.
"""

import argparse
import json
import random
import sqlite3
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event, Thread
from typing import Any

import httpx
import numpy as np

from benchmarks.common.figures import plain_values, write_json
from benchmarks.common.places import OUTPUT
from benchmarks.layout.part import table
from benchmarks.learning.pages import verdict
from benchmarks.learning.server_processes import Server
from models.repository import Store
from services.layout.model.model_document import model_from_document
from simulation.labelled_pages import letter_page

CLASS = "letter"
SAMPLES = 3
AGAIN_EVERY = 10
"""So many accepted feedbacks are followed by the same request once more."""
MOST_TRIES = 200
PATIENCE_S = 60.0
PAUSE_S = 0.1
DATABASE = "layout.sqlite3"


@dataclass(slots=True)
class Storm:
    """What the clients saw; `accepted` has the feedbacks' ids by their keys."""

    accepted: dict[str, str] = field(default_factory=dict)
    latencies_s: list[float] = field(default_factory=list)
    tries: int = 0
    refusals: dict[str, int] = field(default_factory=dict)
    differing: int = 0
    kills: int = 0
    wall_s: float = 0.0


def _pages(count: int) -> list[dict[str, Any]]:
    """Different ones: a page that was verified before would be no new sample."""
    return [letter_page(np.random.default_rng(seed), draw=False).document() for seed in range(count)]


def _without_labels(page: dict[str, Any]) -> dict[str, Any]:
    zones = [{key: value for key, value in zone.items() if key != "label"} for zone in page["zones"]]
    return {**page, "zones": zones}


def _labels(page: dict[str, Any]) -> dict[str, str | None]:
    return {str(zone["id"]): zone["label"] for zone in page["zones"]}


def teach(client: httpx.Client, url: str, pages: Sequence[dict[str, Any]]) -> int:
    """Make the model from a few samples; its version."""
    for page in pages[:SAMPLES]:
        client.post(f"{url}/layout/models/{CLASS}/samples", json=page).raise_for_status()
    client.post(f"{url}/layout/models/{CLASS}/initialize").raise_for_status()
    return int(client.get(f"{url}/layout/models/{CLASS}").headers["etag"].strip('"'))


def recognize_all(
    client: httpx.Client, servers: Sequence[Server], pages: Sequence[dict[str, Any]]
) -> list[str]:
    """Ids of the pages' results."""

    def recognize(number: int) -> str:
        page = _without_labels(pages[number])
        server = servers[number % len(servers)]
        answer = client.post(f"{server.url}/layout", data={"zones": json.dumps(page), "models": CLASS})
        return str(answer.raise_for_status().json()["id"])

    with ThreadPoolExecutor(len(servers)) as clients:
        return list(clients.map(recognize, range(len(pages))))


def post_with_retries(
    client: httpx.Client,
    servers: Sequence[Server],
    first: int,
    path: str,
    body: object,
    key: str,
    storm: Storm,
) -> str:
    """Send until some server has accepted it: the same key to the next server after each failure; the answer's id.

    Raises
    ------
    RuntimeError
        When it is refused for good, or too often.
    """
    for number in range(MOST_TRIES):
        url = servers[(first + number) % len(servers)].url
        if not url:
            time.sleep(PAUSE_S / len(servers))
            continue
        storm.tries += 1
        try:
            answer = client.post(url + path, json=body, headers={"Idempotency-Key": key})
        except httpx.TransportError as error:
            reason = type(error).__name__
        else:
            if answer.status_code == 200:
                return str(answer.json()["id"])
            reason = f"{answer.status_code} {answer.json().get('code', '')}"
            if answer.status_code < 500:
                raise RuntimeError(f"{key}: {reason}: {answer.text}")
        storm.refusals[reason] = storm.refusals.get(reason, 0) + 1
        time.sleep(random.uniform(0, PAUSE_S))
    raise RuntimeError(f"{key}: no server has accepted it in {MOST_TRIES} tries")


def storm_of_feedback(
    client: httpx.Client,
    servers: Sequence[Server],
    results: Sequence[str],
    pages: Sequence[dict[str, Any]],
    kill_every_s: float,
    tell: Callable[[int], None],
) -> Storm:
    """One client a server posts its share of feedback, one after another, while servers are killed at random."""
    storm, over = Storm(), Event()

    def follow(who: int) -> None:
        for number in range(who, len(results), len(servers)):
            path = f"/layout/results/{results[number]}/feedback"
            body = {"class": CLASS, "labels": _labels(pages[number])}
            key = f"feedback-{number}"
            start = time.perf_counter()
            accepted = post_with_retries(client, servers, who, path, body, key, storm)
            storm.latencies_s.append(time.perf_counter() - start)
            storm.accepted[key] = accepted
            if number % AGAIN_EVERY == 0:
                again = post_with_retries(client, servers, who + 1, path, body, key, storm)
                storm.differing += again != accepted
            tell(len(storm.accepted))

    def kill() -> None:
        rng = random.Random(7)
        while not over.wait(kill_every_s * rng.uniform(0.5, 1.5)):
            server = rng.choice(servers)
            server.kill()
            storm.kills += 1
            server.start()

    killer = Thread(target=kill)
    start = time.perf_counter()
    if kill_every_s > 0:
        killer.start()
    try:
        with ThreadPoolExecutor(len(servers)) as clients:
            list(clients.map(follow, range(len(servers))))
    finally:
        storm.wall_s = time.perf_counter() - start
        over.set()
        if kill_every_s > 0:
            killer.join()
    return storm


def inspect(path: Path, first_version: int, storm: Storm) -> list[list[object]]:
    """What must be true of the database after the storm: what, what is there, what is wanted."""
    wanted = len(storm.accepted)
    with sqlite3.connect(path) as database:
        [integrity] = database.execute("PRAGMA integrity_check").fetchone()
        broken = database.execute("PRAGMA foreign_key_check").fetchall()
        [rows] = database.execute("SELECT count(*) FROM layout_feedback").fetchone()
        ids = {row[0] for row in database.execute("SELECT id FROM layout_feedback")}
        [samples] = database.execute(
            "SELECT count(*) FROM layout_samples WHERE origin = 'feedback'"
        ).fetchone()
        [told] = database.execute("SELECT count(*) FROM layout_feedback_models").fetchone()
        [versions] = database.execute("SELECT count(*) FROM layout_model_versions").fetchone()
    with Store.open(path) as store:
        last = store.model(CLASS).version or 0
        learned, unreadable = [], 0
        for version in range(first_version, last + 1):
            document = store.model(CLASS, version).document
            try:
                learned.append(model_from_document(document).samples)
            except ValueError:
                unreadable += 1
    steps = {after - before for before, after in pairwise(learned)}
    return [
        ["PRAGMA integrity_check", integrity, "ok"],
        ["broken references", len(broken), 0],
        ["version of the model", last, first_version + wanted],
        ["versions kept", versions, first_version + wanted],
        ["versions that cannot be read", unreadable, 0],
        ["pages that a version has learned more than the one before", sorted(steps), [1]],
        ["pages that the last version has learned", learned[-1], SAMPLES + wanted],
        ["feedback", rows, wanted],
        [
            "feedback that no client was told of, or that is missing",
            len(ids ^ set(storm.accepted.values())),
            0,
        ],
        ["feedback with its versions", told, wanted],
        ["samples by feedback", samples, wanted],
        ["feedback that was answered differently the second time", storm.differing, 0],
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save; 1 when something was lost."""
    options = _parser().parse_args(arguments)
    count = options.servers * options.posts
    pages = _pages(SAMPLES + count)
    with TemporaryDirectory() as folder, httpx.Client(timeout=PATIENCE_S) as client:
        servers = [
            Server(
                Path(folder),
                workers=1,
                max_samples_per_model=count + SAMPLES,
                max_results=max(count, 1000),
                max_models=10,
            )
            for _ in range(options.servers)
        ]
        try:
            for server in servers:
                server.start()
            first_version = teach(client, servers[0].url, pages)
            print(f"{count} pages are recognized ...", file=sys.stderr, flush=True)
            results = recognize_all(client, servers, pages[SAMPLES:])
            start = time.perf_counter()

            def tell(done: int) -> None:
                if done % max(1, count // 20) == 0:
                    spent = time.perf_counter() - start
                    print(f"[{done}/{count} {spent:.0f}s] feedback", file=sys.stderr, flush=True)

            storm = storm_of_feedback(client, servers, results, pages[SAMPLES:], options.kill_every, tell)
            left = sum(server.left_behind() for server in servers)
        finally:
            for server in servers:
                server.stop()
        checks = inspect(Path(folder) / DATABASE, first_version, storm)
    print(_report(options, storm, checks, left))
    good = all(found == wanted for _, found, wanted in checks)
    write_json(OUTPUT / "learning_store.json", plain_values(_figures(options, storm, checks, left)))
    return 0 if good else 1


def _figures(
    options: argparse.Namespace, storm: Storm, checks: Sequence[Sequence[object]], left: int
) -> dict[str, Any]:
    latencies = 1000 * np.array(storm.latencies_s)
    return {
        "servers": options.servers,
        "feedback": len(storm.accepted),
        "kills": storm.kills,
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


def _report(options: argparse.Namespace, storm: Storm, checks: Sequence[Sequence[object]], left: int) -> str:
    figures = _figures(options, storm, checks, left)
    latency = figures["latency_ms"]
    rows = [[what, found, wanted, verdict(found == wanted)] for what, found, wanted in checks]
    refusals = ", ".join(f"{why} {count}" for why, count in sorted(storm.refusals.items())) or "none"
    return "\n".join(
        [
            table(
                f"{options.servers} servers x {options.posts} feedbacks on one class, {storm.kills} times kill -9",
                ("after it", "found", "wanted", "met"),
                rows,
            ),
            f"{figures['per_second']:.1f} feedbacks a second over {storm.wall_s:.0f} s; answer after "
            f"{latency['median']:.0f} ms median, {latency['p95']:.0f} ms p95, {latency['most']:.0f} ms at most, with "
            "all tries",
            f"{storm.tries} requests; failed: {refusals}",
            f"processes that killed servers have left behind: {left}",
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
    return parser
