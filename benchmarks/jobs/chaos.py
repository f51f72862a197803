"""`python -m benchmarks jobs`: accepted jobs of several keys while processes are killed and PostgreSQL restarts.

Each request has an Idempotency-Key, and is sent again until it is accepted. Every answer is compared with that of the
same request without a job. At the end the logs and blobs are counted: no job may be lost, or have two answers.
"""

import argparse
import random
import threading
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import httpx

from benchmarks.common.places import REPOSITORY
from benchmarks.common.postgresql import Cluster, running_cluster
from benchmarks.jobs.processes import Deployment, Process

LONGEST_S = 1800.0
KEYS = ("first", "second", "third")
CHAOS = ("kill a worker", "kill an API process", "restart PostgreSQL", "rolling restart")
CLIENTS = 4
_RETRY_S = 0.3


@dataclass(frozen=True, slots=True)
class Request:
    """A request for work; `varying` are the names in its JSON that differ from one answer to the next."""

    path: str
    file: str
    part: str
    options: dict[str, str]
    varying: tuple[str, ...] = ()

    def send(self, url: str, headers: dict[str, str]) -> httpx.Response:
        """The answer of the service at `url`."""
        content = (REPOSITORY / "examples" / self.file).read_bytes()
        files = {self.part: (self.file, content)}
        return httpx.post(url + self.path, files=files, data=self.options, headers=headers, timeout=120)

    def essence(self, response: httpx.Response) -> object:
        """What must be equal in every answer: the bytes of an image; of JSON all but what varies."""
        if "json" not in response.headers["content-type"]:
            return response.status_code, response.content
        return response.status_code, {k: v for k, v in response.json().items() if k not in self.varying}


REQUESTS = (
    Request("/rectify", "c.jpg", "image", {"format": "png"}),
    Request("/rectify", "d.jpg", "image", {"format": "json", "embed": "true"}, ("timings_ms",)),
    Request("/layout", "letter-1.png", "image", {"ocr": "off"}, ("id", "timings_ms")),
    Request("/layout", "letter-2.png", "image", {"ocr": "off", "format": "png"}),
)


@dataclass(slots=True)
class Outcome:
    """What a client saw of one job."""

    job: str
    is_right: bool
    attempts: int
    seconds: float


class Trial:
    """A deployment and its clients."""

    def __init__(self, apis: Sequence[Process], workers: Sequence[Process], jobs: int) -> None:
        self.apis, self.workers, self.jobs = apis, workers, jobs
        self.outcomes: list[Outcome] = []
        self.disruptions: Counter[str] = Counter()
        self._expected = [self._essence(each) for each in REQUESTS]
        self._is_over = threading.Event()

    def _essence(self, request: Request) -> object:
        response = request.send(self.apis[0].url, {"X-API-Key": KEYS[0]})
        response.raise_for_status()
        return request.essence(response)

    def run(self, cluster: Cluster, chaos_every_s: float) -> None:
        """Send all jobs and wait for all answers, with a disruption every `chaos_every_s` seconds (0: none)."""
        disrupting = threading.Thread(target=self._disrupt, args=(cluster, chaos_every_s))
        disrupting.start()
        try:
            with ThreadPoolExecutor(CLIENTS) as threads:
                accepted = list(threads.map(self._accept, range(self.jobs)))
                self.outcomes = list(threads.map(self._follow, accepted))
        finally:
            self._is_over.set()
            disrupting.join()

    def _call(self, method: str, path: str, headers: dict[str, str], index: int = -1) -> httpx.Response:
        """An answer that is final, of any API process that is up."""
        deadline = time.monotonic() + LONGEST_S
        while time.monotonic() < deadline:
            url = random.choice(self.apis).url
            try:
                if url and method == "POST":
                    response = REQUESTS[index % len(REQUESTS)].send(url, headers)
                elif url:
                    response = httpx.get(url + path, headers=headers, timeout=60)
                if url and response.status_code != httpx.codes.SERVICE_UNAVAILABLE:
                    return response
            except httpx.TransportError:
                pass
            time.sleep(_RETRY_S)
        raise TimeoutError(f"{method} {path}: no answer")

    def _accept(self, index: int) -> tuple[int, str, dict[str, str], float]:
        headers = {"X-API-Key": KEYS[index % len(KEYS)]}
        asked = {**headers, "Prefer": "respond-async", "Idempotency-Key": f"job {index}"}
        response = self._call("POST", "", asked, index)
        assert response.status_code == httpx.codes.ACCEPTED, response.text
        return index, response.headers["location"], headers, time.monotonic()

    def _follow(self, accepted: tuple[int, str, dict[str, str], float]) -> Outcome:
        index, path, headers, begin_s = accepted
        while True:
            job: dict[str, Any] = self._call("GET", path, headers).json()
            if job.get("state") not in ("queued", "running"):
                break
            time.sleep(_RETRY_S)
        result = self._call("GET", path + "/result", headers)
        kind = index % len(REQUESTS)
        is_right = REQUESTS[kind].essence(result) == self._expected[kind]
        if not is_right:
            print(f"job {index}: {job}\n{result.status_code} {result.text[:200]}")
        return Outcome(path.rpartition("/")[2], is_right, job.get("attempts", 0), time.monotonic() - begin_s)

    def _disrupt(self, cluster: Cluster, every_s: float) -> None:
        chooser, starting = random.Random(1), ThreadPoolExecutor(len(self.workers) + len(self.apis))
        for what in cycle(CHAOS):
            if not every_s or self._is_over.wait(every_s):
                break
            if what == "restart PostgreSQL":
                cluster.restart()
            elif what == "rolling restart":
                for process in (*self.workers, *self.apis):
                    if process.is_up:
                        process.stop()
                        process.start()
            else:
                up = [each for each in (self.workers if what == "kill a worker" else self.apis) if each.is_up]
                if not up:
                    continue
                process = chooser.choice(up)
                process.kill()
                starting.submit(process.start)  # the next disruption does not wait for it
            self.disruptions[what] += 1
            for process in self.apis:
                process.measure()
        starting.shutdown()


def main(arguments: Sequence[str]) -> int:
    """Run the trial; 1 if a job is lost, has a wrong answer, or has two."""
    parser = argparse.ArgumentParser(prog="benchmarks jobs", description=__doc__)
    parser.add_argument("--jobs", type=int, default=1000)
    parser.add_argument("--apis", type=int, default=2)
    parser.add_argument("--workers", type=int, default=2, help="worker processes, each with one worker")
    parser.add_argument(
        "--chaos-every", type=float, default=10.0, help="seconds between disruptions; 0: none"
    )
    options = parser.parse_args(arguments)
    with ExitStack() as stack:
        cluster = stack.enter_context(running_cluster(durable=True))
        folder = Path(stack.enter_context(TemporaryDirectory()))
        deployment = Deployment(
            database_url=cluster.make_database(),
            data_dir=folder,
            api_keys=",".join(f"{key}:{key}" for key in KEYS),
            max_jobs=2 * options.jobs,
            max_jobs_per_key=2 * options.jobs,
        )
        workers = [Process(deployment, "worker", workers=1) for _ in range(options.workers)]
        apis = [Process(deployment, workers=0) for _ in range(options.apis)]
        for process in (*workers, *apis):
            process.start()
            stack.callback(process.stop)
        trial = Trial(apis, workers, options.jobs)
        begin_s = time.monotonic()
        trial.run(cluster, options.chaos_every)
        seconds = time.monotonic() - begin_s
        for process in apis:
            process.measure()
        return _report(trial, deployment, folder, seconds)


def _report(trial: Trial, deployment: Deployment, folder: Path, seconds: float) -> int:
    outcomes = trial.outcomes
    wrong = sum(not each.is_right for each in outcomes)
    twice = sum(deployment.ends[each.job] > 1 for each in outcomes)
    lost = trial.jobs - len({each.job for each in outcomes})
    answers = Counter(path.parent.name for path in folder.glob("blobs/jobs/*/answer-*"))
    inputs = len(list(folder.glob("blobs/jobs/*/input")))
    again = sum(each.attempts > 1 for each in outcomes)
    print(f"{len(outcomes)} jobs in {seconds:.0f} s ({60 * len(outcomes) / seconds:.0f} a minute).")
    print("Disruptions: " + (", ".join(f"{n} x {what}" for what, n in trial.disruptions.items()) or "none"))
    print(f"Lost: {lost}. Wrong answers: {wrong}. Answered twice: {twice}. Tried twice: {again}.")
    print(
        f"Slowest job: {max(each.seconds for each in outcomes):.1f} s. Blobs left: {inputs} inputs; "
        f"jobs with more than one answer blob: {sum(count > 1 for count in answers.values())}."
    )
    print(f"Peak memory of an API process: {max(each.peak_bytes for each in trial.apis) >> 20} MiB.")
    return int(bool(lost or wrong or twice))
