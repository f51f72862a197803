"""Jobs a minute of one worker and of two, and who uses the processors meanwhile."""

import subprocess
import sys
import time
from contextlib import ExitStack
from dataclasses import dataclass

import httpx
import psutil

from benchmarks.jobs.costs import KEY, roomy_deployment, start
from benchmarks.jobs.processes import Process, cpu_s_of
from benchmarks.jobs.requests import mixed_requests

LEAST_SPEED_UP = 1.9
WORKERS, API, DATABASE, BENCHMARK, OTHERS = (
    "workers",
    "API process",
    "PostgreSQL",
    "benchmark",
    "other programs",
)
_LOOK_EVERY_S = 0.25
_COMPUTATION_S = 4.0
_COMPUTATION = """
import time, cv2, numpy as np
cv2.setNumThreads(1)
image = np.random.default_rng(1).integers(0, 255, (1000, 700), np.uint8)
begin_s, rounds = time.monotonic(), 0
while time.monotonic() < begin_s + {seconds}:
    cv2.medianBlur(image, 5), np.sort(image, axis=0), [number * number for number in range(20_000)]
    rounds += 1
print(rounds / (time.monotonic() - begin_s))
"""
"""What a worker does, roughly: filters and sorts of an image that fits no cache, and Python."""


@dataclass(frozen=True, slots=True)
class Window:
    """Jobs that ended while all workers were busy, and the processor time that was used meanwhile, seconds."""

    jobs: int
    seconds: float
    cpu_s: dict[str, float]

    @property
    def jobs_a_minute(self) -> float:
        return 60 * self.jobs / self.seconds

    @property
    def jobs_a_cpu_minute(self) -> float:
        """Jobs a minute of the workers' own processor time."""
        return 60 * self.jobs / self.cpu_s[WORKERS]

    def __str__(self) -> str:
        shares = ", ".join(f"{who} {100 * cpu_s / self.seconds:.0f}" for who, cpu_s in self.cpu_s.items())
        return (
            f"{self.jobs_a_minute:.1f} jobs a minute, {self.jobs_a_cpu_minute:.1f} a minute of the workers' processor "
            f"time; % of a processor: {shares}"
        )


def measure_scaling(jobs: int) -> bool:
    """Jobs a minute of one worker and of two, which start when all jobs are accepted. It needs two free processors."""
    one, two = (_measure(jobs, workers) for workers in (1, 2))
    alone, together = (_computations_a_second(processes) for processes in (1, 2))
    speed_up = two.jobs_a_minute / one.jobs_a_minute
    corrected = 2 * two.jobs_a_cpu_minute / one.jobs_a_cpu_minute
    print(f"One worker: {one}.\nTwo workers: {two}.\nTwo are {speed_up:.2f} times as fast as one.")
    print(
        f"By the workers' own processor time, as if the others had processors of their own: {corrected:.2f} times. "
        f"A mere computation in two processes of this machine: {together / alone:.2f} times.",
        flush=True,
    )
    return speed_up >= LEAST_SPEED_UP


def _measure(jobs: int, workers: int) -> Window:
    preview = mixed_requests()[2]
    with ExitStack() as stack:
        deployment = stack.enter_context(roomy_deployment(on_postgresql=True))
        api = Process(deployment, workers=0)
        start(stack, api)
        with httpx.Client(timeout=120) as client:
            for _ in range(jobs):
                preview.send(client, api.url, {**KEY, "Prefer": "respond-async"}).raise_for_status()
        running = [Process(deployment, "app", "worker", workers=1) for _ in range(workers)]

        def cpu_s() -> dict[str, float]:
            assert deployment.cluster is not None
            used = {
                WORKERS: sum(each.cpu_s() for each in running),
                API: api.cpu_s(),
                DATABASE: cpu_s_of(deployment.cluster.processes()),
                BENCHMARK: cpu_s_of([psutil.Process()]),
            }
            machine = psutil.cpu_times()
            busy_s = machine.user + machine.nice + machine.system + machine.irq + machine.softirq
            return {**used, OTHERS: busy_s - sum(used.values())}

        start(stack, *running)
        # The first processes start one after another, and end one after another: only what all workers did together
        # counts.
        while len(deployment.starts_s) < workers:
            time.sleep(_LOOK_EVERY_S)
        begin_s, ended, before = time.monotonic(), len(deployment.ended_s), cpu_s()
        while len(deployment.ended_s) < jobs - workers:
            time.sleep(_LOOK_EVERY_S)
        seconds, ended, after = time.monotonic() - begin_s, len(deployment.ended_s) - ended, cpu_s()
    return Window(ended, seconds, {who: after[who] - before[who] for who in after})


def _computations_a_second(processes: int) -> float:
    """Of so many processes together, which compute for `_COMPUTATION_S` at the same time."""
    command = [sys.executable, "-c", _COMPUTATION.format(seconds=_COMPUTATION_S)]
    running = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(processes)]
    return sum(float(each.communicate()[0]) for each in running)
