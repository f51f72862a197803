"""Metrics for Prometheus, served at /metrics."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from prometheus_client import CollectorRegistry, Counter, Histogram, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from app.engine.base import EngineStatus, JobRecord
from app.http.paths import PathTemplates
from models.job_records import QueueStatus

MEDIA_TYPE = "text/plain; version=0.0.4; charset=utf-8"
SECONDS = (0.01, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0, 120.0)
METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})


@dataclass(frozen=True, slots=True)
class JobFacts:
    """The queue of all services (None: it cannot be read), and what this process has counted since its start."""

    queue: QueueStatus | None
    starts: int
    leases_lost: int
    callback_failures: int


class Metrics:
    """The metrics of one app. Labels take few values, regardless of what clients send."""

    def __init__(self, paths: Iterable[str] = ()) -> None:
        """`paths` are the path templates that are counted separately."""
        self.paths = PathTemplates(paths)
        self.registry = CollectorRegistry()
        self._requests = Counter(
            "http_requests", "Requests answered.", ("method", "path", "status"), registry=self.registry
        )
        self._latency = Histogram(
            "http_request_duration_seconds",
            "From the request's head to the response's end.",
            ("method", "path"),
            buckets=SECONDS,
            registry=self.registry,
        )
        self._jobs = Counter(
            "jobs", "Jobs by outcome: done, or the code of the problem.", ("outcome",), registry=self.registry
        )
        self._queue = Histogram(
            "job_queue_seconds", "From submission to a worker.", buckets=SECONDS, registry=self.registry
        )
        self._work = Histogram(
            "job_work_seconds", "Time in a worker.", buckets=SECONDS, registry=self.registry
        )

    def observe_request(self, method: str, path: str, status: int, seconds: float) -> None:
        """Count one answered request."""
        method = method if method in METHODS else "other"
        path = self.paths.match(path) or "other"
        self._requests.labels(method, path, str(status)).inc()
        self._latency.labels(method, path).observe(seconds)

    def observe_job(self, record: JobRecord) -> None:
        """Count one finished job."""
        self._jobs.labels(record.outcome).inc()
        self._queue.observe(record.queue_s)
        self._work.observe(record.work_s)

    def watch(self, status: Callable[[], EngineStatus]) -> None:
        """Export the engine's status too, read at each scrape."""
        self.registry.register(_EngineCollector(status))

    def watch_jobs(self, facts: Callable[[], JobFacts]) -> None:
        """Export what is known of the queue of jobs too."""
        self.registry.register(_JobsCollector(facts))

    def exposition(self) -> bytes:
        """All metrics in Prometheus' text format."""
        return generate_latest(self.registry)


class _EngineCollector(Collector):
    def __init__(self, status: Callable[[], EngineStatus]) -> None:
        self._status = status

    def collect(self) -> Iterator[Metric]:
        now = self._status()
        for name, value, meaning in (
            ("engine_live_workers", now.live_workers, "Worker processes that are up."),
            ("engine_capacity", now.capacity, "Seats: workers and places in the queue."),
            (
                "engine_admitted",
                now.admitted,
                "Seats taken by requests whose bodies are there.",
            ),
            ("engine_queue_depth", now.waiting, "Jobs that wait for a worker."),
            ("engine_running", now.running, "Jobs that have a worker."),
        ):
            yield GaugeMetricFamily(name, meaning, value=value)
        languages = GaugeMetricFamily("ocr_language", "Languages that OCR reads.", labels=["language"])
        for language in now.facts.languages:
            languages.add_metric([language], 1)
        yield languages
        yield CounterMetricFamily(
            "engine_worker_deaths", "Workers that ended unexpectedly.", value=now.worker_deaths
        )
        yield CounterMetricFamily(
            "engine_workers_recycled",
            "Workers replaced after their maximum number of jobs.",
            value=now.recycled_workers,
        )


class _JobsCollector(Collector):
    def __init__(self, facts: Callable[[], JobFacts]) -> None:
        self._facts = facts

    def collect(self) -> Iterator[Metric]:
        now = self._facts()
        if now.queue is not None:
            for name, value, meaning in (
                ("job_queue_depth", now.queue.queued, "Accepted jobs that wait, of all services."),
                ("job_queue_running", now.queue.running, "Accepted jobs that run, of all services."),
                ("job_queue_oldest_seconds", now.queue.oldest_s, "Age of the oldest unfinished job."),
                ("job_blob_bytes", now.queue.input_bytes, "Uploads of unfinished jobs."),
            ):
                yield GaugeMetricFamily(name, meaning, value=value)
        for name, value, meaning in (
            ("job_attempts", now.starts, "Starts of jobs by this process."),
            (
                "job_leases_lost",
                now.leases_lost,
                "Jobs that ended or went on elsewhere while this process ran them.",
            ),
            (
                "job_callback_failures",
                now.callback_failures,
                "Callbacks that were not delivered at an attempt.",
            ),
        ):
            yield CounterMetricFamily(name, meaning, value=value)
