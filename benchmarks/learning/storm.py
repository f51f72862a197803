"""Clients that give feedback and take it back while servers, and the database, are killed."""

import json
import random
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from threading import Event, Thread
from typing import Any

import httpx
import numpy as np

from benchmarks.learning.server_processes import Server
from simulation.labelled_pages import letter_page

CLASS = "letter"
SAMPLES = 3
AGAIN_EVERY = 10
"""So many accepted feedbacks are followed by the same request once more."""
TAKEN_BACK_EVERY = 3
"""So many accepted feedbacks are followed by an undo, which is sent once."""
LONGEST_S = 300.0
"""Until a request is given up; a server that starts on a busy machine takes half a minute."""
PAUSE_S = 0.1


@dataclass(slots=True)
class Storm:
    """What the clients saw; `accepted` has the feedbacks' ids by their keys.

    `taken_back` has the keys whose undo was answered, `in_doubt` those whose undo was sent and not answered: the server
    was killed before it wrote, or between that and its answer.
    """

    accepted: dict[str, str] = field(default_factory=dict)
    taken_back: set[str] = field(default_factory=set)
    in_doubt: set[str] = field(default_factory=set)
    latencies_s: list[float] = field(default_factory=list)
    tries: int = 0
    refusals: dict[str, int] = field(default_factory=dict)
    differing: int = 0
    kills: int = 0
    database_kills: int = 0
    wall_s: float = 0.0

    def note(self, reason: str) -> None:
        """Count a request that got no answer or a refusal."""
        self.refusals[reason] = self.refusals.get(reason, 0) + 1


def page_of(number: int) -> dict[str, Any]:
    """A letter of its own: a page that was verified before would be no new sample."""
    return letter_page(np.random.default_rng(number), draw=False).document()


def teach(client: httpx.Client, url: str) -> int:
    """Make the model from a few samples; its version."""
    for number in range(SAMPLES):
        client.post(f"{url}/layout/models/{CLASS}/samples", json=page_of(number)).raise_for_status()
    client.post(f"{url}/layout/models/{CLASS}/initialize").raise_for_status()
    return int(client.get(f"{url}/layout/models/{CLASS}").headers["etag"].strip('"'))


class Clients:
    """One client a server, each with its share of the pages."""

    def __init__(self, client: httpx.Client, servers: Sequence[Server], storm: Storm) -> None:
        self._client = client
        self._servers = servers
        self._storm = storm

    def follow(self, who: int, count: int, over: Event, tell: Callable[[int], None]) -> None:
        """Recognize pages and give feedback on them, one after another, until `over`."""
        storm = self._storm
        for number in range(who, count, len(self._servers)):
            if over.is_set():
                return
            page = page_of(SAMPLES + number)
            result = self._recognize(who, page)
            path, key = f"/layout/results/{result}/feedback", f"feedback-{number}"
            labels = {str(zone["id"]): zone["label"] for zone in page["zones"]}
            body = {"json": {"class": CLASS, "labels": labels}, "headers": {"Idempotency-Key": key}}
            start = time.perf_counter()
            accepted = str(self.accepted(who, path, **body)["id"])
            storm.latencies_s.append(time.perf_counter() - start)
            storm.accepted[key] = accepted
            if number % AGAIN_EVERY == 0:
                storm.differing += self.accepted(who + 1, path, **body)["id"] != accepted
            if number % TAKEN_BACK_EVERY == 1:
                self.take_back(who, path, key)
            tell(len(storm.accepted))

    def _recognize(self, who: int, page: dict[str, Any]) -> str:
        zones = [{key: value for key, value in zone.items() if key != "label"} for zone in page["zones"]]
        data = {"zones": json.dumps({**page, "zones": zones}), "models": CLASS}
        return str(self.accepted(who, "/layout", data=data)["id"])

    def accepted(self, first: int, path: str, **request: Any) -> dict[str, Any]:
        """The answer 200: the same request goes to the next server after each failure.

        Raises
        ------
        RuntimeError
            When it is refused for good, or for too long.
        """
        deadline, number = time.monotonic() + LONGEST_S, first
        while time.monotonic() < deadline:
            answer = self._send("POST", self._url(number), path, **request)
            if answer is not None and answer.status_code == 200:
                return dict(answer.json())
            if answer is not None and answer.status_code < 500:
                raise RuntimeError(f"{path}: {answer.status_code} {answer.text}")
            time.sleep(random.uniform(0, PAUSE_S))
            number += 1
        raise RuntimeError(f"{path}: no server has accepted it in {LONGEST_S:g} s")

    def take_back(self, who: int, path: str, key: str) -> None:
        """Send the undo until a server answers; a request that breaks off leaves it in doubt.

        Raises
        ------
        RuntimeError
            When the feedback is not there, though it was accepted.
        """
        deadline, number = time.monotonic() + LONGEST_S, who
        while time.monotonic() < deadline:
            url = self._url(number)
            answer = self._send("DELETE", url, path)
            if answer is not None and answer.status_code < 300:
                self._storm.taken_back.add(key)
                return
            if answer is not None and answer.status_code < 500:
                raise RuntimeError(f"undo of {key}: {answer.status_code} {answer.text}")
            # 503 `store-unavailable` may be said of a commit that was done before the connection broke.
            if url and (answer is None or answer.json().get("code") == "store-unavailable"):
                self._storm.in_doubt.add(key)
                return
            time.sleep(random.uniform(0, PAUSE_S))
            number += 1
        raise RuntimeError(f"undo of {key}: no server has answered in {LONGEST_S:g} s")

    def _url(self, number: int) -> str:
        return self._servers[number % len(self._servers)].url

    def _send(self, method: str, url: str, path: str, **request: Any) -> httpx.Response | None:
        """The answer of a server; None: it broke off, or the server (with an empty `url`) does not run now."""
        if not url:
            return None
        self._storm.tries += 1
        try:
            answer = self._client.request(method, url + path, **request)
        except httpx.TransportError as error:
            self._storm.note(type(error).__name__)
            return None
        if answer.status_code >= 500:
            self._storm.note(f"{answer.status_code} {answer.json().get('code', '')}")
        return answer


def storm_of_feedback(
    client: httpx.Client,
    servers: Sequence[Server],
    count: int,
    kill_every_s: float,
    most_kills: int,
    tell: Callable[[int], None],
    crash_database: Callable[[], None] | None = None,
) -> Storm:
    """Feedback on `count` pages, or until `most_kills`: of servers at random, every fourth time of the database."""
    storm, over = Storm(), Event()
    clients = Clients(client, servers, storm)

    def kill() -> None:
        rng = random.Random(7)
        while storm.kills + storm.database_kills < most_kills:
            if over.wait(kill_every_s * rng.uniform(0.5, 1.5)):
                return
            if crash_database is not None and (storm.kills + storm.database_kills) % 4 == 3:
                crash_database()
                storm.database_kills += 1
                continue
            server = rng.choice(servers)
            server.kill()
            storm.kills += 1
            server.start()
        over.set()

    killer = Thread(target=kill)
    start = time.perf_counter()
    if kill_every_s > 0:
        killer.start()
    try:
        with ThreadPoolExecutor(len(servers)) as threads:
            running = [threads.submit(clients.follow, who, count, over, tell) for who in range(len(servers))]
            for each in running:
                each.result()
    finally:
        storm.wall_s = time.perf_counter() - start
        over.set()
        if kill_every_s > 0:
            killer.join()
    return storm
