"""What the queue costs: time a job, and memory while many uploads pass."""

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
MOST_GROWTH = 1.05
"""Of the memory of a worker after its first photos, and of an API process after its first tenth of the uploads."""
FIRST_PHOTOS = 50
UPLOAD_BYTES = 10_000_000
_ROUNDS = 100
KEY = {"X-API-Key": KEYS[0]}


@contextmanager
def roomy_deployment(*, on_postgresql: bool) -> Iterator[Deployment]:
    """A deployment whose limits the measurements do not reach."""
    with ExitStack() as stack:
        cluster = stack.enter_context(running_cluster(durable=True)) if on_postgresql else None
        folder = Path(stack.enter_context(TemporaryDirectory()))
        yield Deployment(
            cluster,
            database_url=cluster.make_database() if cluster else "",
            data_dir=folder,
            api_keys=API_KEYS,
            max_jobs=10_000,
            max_jobs_per_key=10_000,
            jobs_per_worker=100_000,
        )


def start(stack: ExitStack, *processes: Process) -> None:
    """Start the processes, and stop them with the stack."""
    for process in processes:
        process.start()
        stack.callback(process.stop)


def measure_overhead(jobs: int) -> bool:
    """Answers of an API process without workers beside those of a local pool, in turns; work that does nothing."""
    request = Request("/rectify", {"format": "png"}, mixed_requests()[0].image)
    with ExitStack() as stack:
        queue = stack.enter_context(roomy_deployment(on_postgresql=True))
        pool = stack.enter_context(roomy_deployment(on_postgresql=False))
        api = Process(queue, idle_service.MODULE, workers=0)
        worker = Process(queue, idle_service.MODULE, "worker", workers=1)
        local = Process(pool, idle_service.MODULE, workers=1)
        start(stack, worker, api, local)
        client = stack.enter_context(httpx.Client(timeout=120))
        seconds: dict[Process, list[float]] = {api: [], local: []}
        for _ in range(min(jobs, _ROUNDS)):
            for process, times in seconds.items():
                begin_s = time.monotonic()
                request.send(client, process.url, KEY).raise_for_status()
                times.append(time.monotonic() - begin_s)
    by_queue, by_pool = (median(seconds[each]) for each in (api, local))
    print(
        f"Median of {len(seconds[api])} answers: local pool {1000 * by_pool:.1f} ms, queue {1000 * by_queue:.1f} ms; "
        f"the queue adds {1000 * (by_queue - by_pool):.1f} ms.",
        flush=True,
    )
    return by_queue - by_pool <= MOST_OVERHEAD_S


def measure_uploads(jobs: int) -> bool:
    """Memory of an API process while jobs with uploads of 10 MB pass, whose work does nothing."""
    request = Request("/rectify", {"format": "png"}, mixed_requests()[0].image + bytes(UPLOAD_BYTES))
    with ExitStack() as stack:
        deployment = stack.enter_context(roomy_deployment(on_postgresql=True))
        api = Process(deployment, idle_service.MODULE, workers=0)
        worker = Process(deployment, idle_service.MODULE, "worker", workers=1)
        start(stack, worker, api)

        def send(first: int, count: int) -> None:
            clients = Clients([api], [request], count, first=first)
            clients.run({}, 0.0)
            assert all(each.is_right for each in clients.outcomes)

        return _watch_memory("API process", jobs, max(1, jobs // 10), send, api.resident_bytes)


def measure_worker(jobs: int) -> bool:
    """Memory of a worker while it works on many photos, and the processor time of a start."""
    requests = mixed_requests()
    with ExitStack() as stack:
        service = Process(stack.enter_context(roomy_deployment(on_postgresql=False)), workers=1)
        start(stack, service)
        print(f"Start of a service with one worker: {service.cpu_s():.1f} s of processor time.")
        client = stack.enter_context(httpx.Client(timeout=120))

        def send(first: int, count: int) -> None:
            for index in range(first, first + count):
                requests[index % len(requests)].send(client, service.url, KEY).raise_for_status()

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
