"""What the queue costs: time a job, jobs a minute by workers, memory while many uploads pass."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import httpx

from benchmarks.common.postgresql import running_cluster
from benchmarks.jobs import idle_service
from benchmarks.jobs.clients import Clients
from benchmarks.jobs.processes import Deployment, Process
from benchmarks.jobs.requests import API_KEYS, KEYS, Request, mixed_requests

MOST_OVERHEAD_S = 0.05
LEAST_SPEED_UP = 1.9
MOST_GROWTH = 1.05
"""Of the memory of a worker after its first photos, and of an API process after its first tenth of the uploads."""
FIRST_PHOTOS = 50
UPLOAD_BYTES = 10_000_000
_ROUNDS = 100
_KEY = {"X-API-Key": KEYS[0]}


@contextmanager
def _deployment(*, on_postgresql: bool) -> Iterator[Deployment]:
    with ExitStack() as stack:
        url = stack.enter_context(running_cluster(durable=True)).make_database() if on_postgresql else ""
        folder = Path(stack.enter_context(TemporaryDirectory()))
        yield Deployment(
            database_url=url,
            data_dir=folder,
            api_keys=API_KEYS,
            max_jobs=10_000,
            max_jobs_per_key=10_000,
            jobs_per_worker=100_000,
        )


def _started(stack: ExitStack, *processes: Process) -> None:
    for process in processes:
        process.start()
        stack.callback(process.stop)


def measure_overhead(jobs: int) -> bool:
    """Answers of an API process without workers beside those of a local pool, in turns; work that does nothing."""
    request = Request("/rectify", {"format": "png"}, mixed_requests()[0].image)
    with ExitStack() as stack:
        queue = stack.enter_context(_deployment(on_postgresql=True))
        pool = stack.enter_context(_deployment(on_postgresql=False))
        api = Process(queue, idle_service.MODULE, workers=0)
        worker = Process(queue, idle_service.MODULE, "worker", workers=1)
        local = Process(pool, idle_service.MODULE, workers=1)
        _started(stack, worker, api, local)
        client = stack.enter_context(httpx.Client(timeout=120))
        seconds: dict[Process, list[float]] = {api: [], local: []}
        for _ in range(min(jobs, _ROUNDS)):
            for process, times in seconds.items():
                begin_s = time.monotonic()
                request.send(client, process.url, _KEY).raise_for_status()
                times.append(time.monotonic() - begin_s)
    by_queue, by_pool = (median(seconds[each]) for each in (api, local))
    print(
        f"Median of {len(seconds[api])} answers: local pool {1000 * by_pool:.1f} ms, queue {1000 * by_queue:.1f} ms; "
        f"the queue adds {1000 * (by_queue - by_pool):.1f} ms.",
        flush=True,
    )
    return by_queue - by_pool <= MOST_OVERHEAD_S


def measure_scaling(jobs: int) -> bool:
    """Jobs a minute of one worker and of two, which start when all jobs are accepted. It needs two free processors."""
    preview = mixed_requests()[2]
    a_minute = []
    for count in (1, 2):
        with ExitStack() as stack:
            deployment = stack.enter_context(_deployment(on_postgresql=True))
            api = Process(deployment, workers=0)
            _started(stack, api)
            with httpx.Client(timeout=120) as client:
                for _ in range(jobs):
                    headers = {**_KEY, "Prefer": "respond-async"}
                    preview.send(client, api.url, headers).raise_for_status()
            _started(stack, *(Process(deployment, "app", "worker", workers=1) for _ in range(count)))
            while len(deployment.ended_s) < jobs:
                time.sleep(0.5)
            # The first processes start one after another: only what all workers did together counts.
            begin_s = deployment.starts_s[-1] if count > 1 else deployment.starts_s[0]
            ended = [at_s for at_s in deployment.ended_s if at_s > begin_s]
            a_minute.append(60 * len(ended) / (max(ended) - begin_s))
    one, two = a_minute
    print(f"One worker: {one:.1f} jobs a minute; two: {two:.1f}, {two / one:.2f} times.", flush=True)
    return two / one >= LEAST_SPEED_UP


def measure_uploads(jobs: int) -> bool:
    """Memory of an API process while jobs with uploads of 10 MB pass, whose work does nothing."""
    request = Request("/rectify", {"format": "png"}, mixed_requests()[0].image + bytes(UPLOAD_BYTES))
    with ExitStack() as stack:
        deployment = stack.enter_context(_deployment(on_postgresql=True))
        api = Process(deployment, idle_service.MODULE, workers=0)
        worker = Process(deployment, idle_service.MODULE, "worker", workers=1)
        _started(stack, worker, api)

        def send(first: int, count: int) -> None:
            clients = Clients([api], [request], count, first=first)
            clients.run({}, 0.0)
            assert all(each.is_right for each in clients.outcomes)

        return _watch_memory("API process", jobs, max(1, jobs // 10), send, api.resident_bytes)


def measure_worker(jobs: int) -> bool:
    """Memory of a worker while it works on many photos, and the processor time of a start."""
    requests = mixed_requests()
    with ExitStack() as stack:
        service = Process(stack.enter_context(_deployment(on_postgresql=False)), workers=1)
        _started(stack, service)
        print(f"Start of a service with one worker: {service.cpu_s():.1f} s of processor time.")
        client = stack.enter_context(httpx.Client(timeout=120))

        def send(first: int, count: int) -> None:
            for index in range(first, first + count):
                requests[index % len(requests)].send(client, service.url, _KEY).raise_for_status()

        def largest() -> int:
            return max(each.memory_info().rss for each in service.family()[1:])

        return _watch_memory("Worker", jobs, min(FIRST_PHOTOS, jobs), send, largest)


def _watch_memory(
    what: str, jobs: int, first: int, send: Callable[[int, int], None], resident_bytes: Callable[[], int]
) -> bool:
    """Print the memory after `first` jobs, after half, and after all; whether it does not grow."""
    sizes, done = [], 0
    for until in (first, jobs // 2, jobs):
        send(done, max(0, until - done))
        done = max(done, until)
        sizes.append(resident_bytes())
        print(f"{what}: {sizes[-1] / 2**20:.1f} MiB after {done} jobs.", flush=True)
    return _growth(sizes) <= MOST_GROWTH


def _growth(sizes: Sequence[int]) -> float:
    return max(sizes) / sizes[0]
