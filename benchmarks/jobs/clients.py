"""Clients that send jobs to a deployment, and compare every answer with that of the same request without a job."""

import random
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import cycle
from typing import Any

import httpx

from benchmarks.jobs.processes import Process
from benchmarks.jobs.requests import KEYS, Request

LONGEST_S = 1800.0
"""Until a request is answered finally, or a job has ended."""
LOST = "lost"
"""In place of the code of a problem: the job did not end in this time."""
CLIENTS = 4
_RETRY_S = 0.3


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a client saw of one job. `seconds` counts from the acceptance to the answer."""

    job: str
    is_right: bool
    attempts: int
    seconds: float
    code: str = ""
    """Code of the problem with which it failed."""


@dataclass(frozen=True, slots=True)
class _Accepted:
    index: int
    path: str
    headers: dict[str, str]
    begin_s: float

    @property
    def id(self) -> str:
        return self.path.rpartition("/")[2]


class Clients:
    """`CLIENTS` clients of several keys; `services` are the processes that listen."""

    def __init__(
        self, services: Sequence[Process], requests: Sequence[Request], jobs: int, *, first: int = 0
    ) -> None:
        """`first` is the number of jobs that other clients have sent to these services before."""
        self.services, self.requests, self.jobs = services, requests, jobs
        self._first = first
        self.outcomes: list[Outcome] = []
        self.disruptions: Counter[str] = Counter()
        self.refusals: list[str] = []
        """Codes of the answers 503 after which a client came again."""
        self._client = httpx.Client(timeout=120)
        self._expected = [self._essence(each) for each in requests]
        self._is_over = threading.Event()

    def _essence(self, request: Request) -> object:
        response = request.send(self._client, self.services[0].url, {"X-API-Key": KEYS[0]})
        response.raise_for_status()
        return request.essence(response)

    def run(
        self,
        disruptions: Mapping[str, Callable[[], None]],
        every_s: float,
        settle: Callable[[], None] = lambda: None,
    ) -> None:
        """Send all jobs and wait for all answers, with one disruption after another (`every_s` 0: none).

        The next one follows `every_s` seconds after `settle` has returned: where starting a process takes minutes,
        none would be up for long enough to do anything. A disruption that fails is told.
        """
        disrupting = threading.Thread(target=self._disrupt, args=(disruptions, every_s, settle))
        disrupting.start()
        try:
            with ThreadPoolExecutor(CLIENTS) as threads:
                accepted = list(threads.map(self._accept, range(self._first, self._first + self.jobs)))
                self.outcomes = list(threads.map(self._follow, accepted))
        finally:
            self._is_over.set()
            disrupting.join()
            self._client.close()

    def _call(self, method: str, path: str, headers: dict[str, str], index: int = -1) -> httpx.Response:
        """An answer that is final, of any process that listens."""
        deadline = time.monotonic() + LONGEST_S
        while time.monotonic() < deadline:
            url = random.choice(self.services).url
            try:
                if url and method == "POST":
                    response = self.requests[index % len(self.requests)].send(self._client, url, headers)
                elif url:
                    response = self._client.get(url + path, headers=headers)
                if url and response.status_code != httpx.codes.SERVICE_UNAVAILABLE:
                    return response
                if url:
                    self.refusals.append(response.json()["code"])
            except httpx.TransportError:
                pass
            time.sleep(_RETRY_S)
        raise TimeoutError(f"{method} {path}: no answer")

    def _accept(self, index: int) -> _Accepted:
        headers = {"X-API-Key": KEYS[index % len(KEYS)]}
        asked = {**headers, "Prefer": "respond-async", "Idempotency-Key": f"job {index}"}
        response = self._call("POST", "", asked, index)
        if response.status_code != httpx.codes.ACCEPTED:
            raise RuntimeError(f"job {index} was not accepted: {response.status_code} {response.text}")
        return _Accepted(index, response.headers["location"], headers, time.monotonic())

    def _follow(self, accepted: _Accepted) -> Outcome:
        deadline = time.monotonic() + LONGEST_S
        while True:
            job: dict[str, Any] = self._call("GET", accepted.path, accepted.headers).json()
            if job.get("state") not in ("queued", "running"):
                break
            if time.monotonic() > deadline:
                print(f"job {accepted.index} does not end: {job}", flush=True)
                return Outcome(accepted.id, False, job.get("attempts", 0), LONGEST_S, LOST)
            self._listen(accepted)
        seconds = time.monotonic() - accepted.begin_s
        result = self._call("GET", accepted.path + "/result", accepted.headers)
        kind = accepted.index % len(self.requests)
        is_right = self.requests[kind].essence(result) == self._expected[kind]
        if not is_right:
            print(f"job {accepted.index}: {job}\n{result.status_code} {result.text[:200]}", flush=True)
        code = (job.get("problem") or {}).get("code", "")
        return Outcome(accepted.id, is_right, job.get("attempts", 0), seconds, code)

    def _listen(self, accepted: _Accepted) -> None:
        """Return when the stream of the job's events ends: with the job, or with the process that sends it."""
        url = random.choice(self.services).url
        try:
            with self._client.stream(
                "GET", f"{url}{accepted.path}/events", headers=accepted.headers
            ) as response:
                for _ in response.iter_lines():
                    pass
                if response.is_success:
                    return
        except httpx.TransportError:
            pass
        time.sleep(_RETRY_S)

    def _disrupt(
        self,
        disruptions: Mapping[str, Callable[[], None]],
        every_s: float,
        settle: Callable[[], None],
    ) -> None:
        for what, disrupt in cycle(disruptions.items()):
            settle()
            if not every_s or self._is_over.wait(every_s):
                return
            try:
                disrupt()
                self.disruptions[what] += 1
            except Exception as error:
                print(f"{what}: {type(error).__name__}: {error}", flush=True)
                self.disruptions[f"{what} (failed)"] += 1
            for process in self.services:
                process.measure()
