"""API processes and workers of one deployment, which are killed and started again."""

import json
import os
import subprocess
import sys
import time
from collections import Counter, deque
from collections.abc import Iterable
from contextlib import suppress
from threading import Lock, Thread

import psutil

from benchmarks.common.places import REPOSITORY
from benchmarks.common.postgresql import Cluster

MOST_SECONDS = 900.0
"""Until a process is up. It took more than 300 s where others used both processors."""
_READER_S = 10.0
"""Until the log of a process that has ended is read to its end."""
_LINES_TOLD = 5
"""Of the log of a process that did not start."""


class NotStarted(RuntimeError):
    """A process ended before it was up, or took too long."""


def cpu_s_of(processes: Iterable[psutil.Process]) -> float:
    """Processor time of processes and of their children that have ended, seconds."""
    total_s = 0.0
    for process in processes:
        with suppress(psutil.NoSuchProcess):
            total_s += sum(process.cpu_times()[:4])
    return total_s


class Deployment:
    """What all processes have in common: their settings, and what they logged of jobs."""

    def __init__(self, cluster: Cluster | None = None, **settings: object) -> None:
        self.cluster = cluster
        self.environment = {name.upper(): str(value) for name, value in settings.items()}
        self.ends: Counter[str] = Counter()
        """Number of answers that were written, by job."""
        self.recoveries_s: list[float] = []
        """For each job whose process was killed: seconds until it ran elsewhere."""
        self.starts_s: list[float] = []
        """For each process, the time at which it began its first job."""
        self.ended_s: list[float] = []
        """Times at which jobs ended."""
        self._running: dict[str, Process] = {}
        self._known: set[Process] = set()
        self._killed_s: dict[str, float] = {}
        self._lock = Lock()

    def note(self, line: str, process: "Process") -> None:
        """Keep what a line of a process's log says of a job."""
        with self._lock:
            if '"job started"' in line:
                job = json.loads(line)["job"]
                if process not in self._known:
                    self._known.add(process)
                    self.starts_s.append(time.monotonic())
                self._running[job] = process
                if job in self._killed_s:
                    self.recoveries_s.append(time.monotonic() - self._killed_s.pop(job))
            elif '"job ended"' in line:
                entry = json.loads(line)
                if self._running.get(entry["job"]) is process:
                    del self._running[entry["job"]]
                if entry.get("state") in ("succeeded", "failed"):
                    self.ends[entry["job"]] += 1
                    self.ended_s.append(time.monotonic())
                    self._killed_s.pop(entry["job"], None)

    def note_kill(self, process: "Process") -> None:
        """From now on the jobs that the process ran have no worker."""
        with self._lock:
            for job in [job for job, place in self._running.items() if place is process]:
                del self._running[job]
                self._killed_s[job] = time.monotonic()


class Process:
    """`python -m app`, with `worker` a worker; `url` is empty while it does not listen."""

    def __init__(self, deployment: Deployment, *arguments: str, workers: int) -> None:
        self._deployment = deployment
        self._command = [sys.executable, "-m", *(arguments or ("app",))]
        self._workers = workers
        self._process: subprocess.Popen[str] | None = None
        self._reader: Thread | None = None
        self._last_lines: deque[str] = deque(maxlen=_LINES_TOLD)
        self.url = ""
        self.is_up = False
        self.peak_bytes = 0

    def start(self) -> None:
        """Return when it is up. Raises `NotStarted`."""
        environment = {**os.environ, **self._deployment.environment, "WORKERS": str(self._workers)}
        process = self._process = subprocess.Popen(
            self._command,
            cwd=REPOSITORY,
            env={**environment, "HOST": "127.0.0.1", "PORT": "0"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self._reader = Thread(target=self._read, args=(process,), daemon=True)
        self._reader.start()
        deadline = time.monotonic() + MOST_SECONDS
        while not self.is_up:
            if process.poll() is not None or time.monotonic() > deadline:
                self.kill()
                raise NotStarted("".join(self._last_lines))
            time.sleep(0.05)

    def _read(self, process: "subprocess.Popen[str]") -> None:
        assert process.stdout is not None
        for line in process.stdout:
            if process is not self._process:
                pass  # what a killed process has left in the pipe
            elif "running on http" in line:
                self.url = "http://127.0.0.1:" + line.split("127.0.0.1:")[1].split()[0].rstrip('",')
                self.is_up = True
            elif "the worker takes jobs" in line:
                self.is_up = True
            self._last_lines.append(line)
            self._deployment.note(line, self)
        process.stdout.close()

    def family(self) -> list[psutil.Process]:
        """The process itself, first, and all that it has started; empty if it is gone."""
        if self._process is None:
            return []
        try:
            itself = psutil.Process(self._process.pid)
            return [itself, *itself.children(recursive=True)]
        except psutil.NoSuchProcess:
            return []

    def cpu_s(self) -> float:
        """Processor time of the process and of those that it has started."""
        return cpu_s_of(self.family())

    def resident_bytes(self) -> int:
        """Memory of the process itself; 0 if it is gone."""
        try:
            return int(self.family()[0].memory_info().rss)
        except (IndexError, psutil.NoSuchProcess):
            return 0

    def measure(self) -> None:
        """Note the memory of the process itself."""
        self.peak_bytes = max(self.peak_bytes, self.resident_bytes())

    def kill(self) -> None:
        """kill -9 of the process and of the workers that it has started."""
        running = self._process, self._reader
        for process in self.family():
            try:
                process.kill()
            except psutil.NoSuchProcess:
                continue
        self._await_end(*running)
        self._deployment.note_kill(self)

    def stop(self) -> None:
        """As a rolling deployment does: SIGTERM, and the grace period."""
        process, reader = self._process, self._reader
        if process is not None and process.poll() is None:
            process.terminate()
            try:
                process.wait(MOST_SECONDS)
            except subprocess.TimeoutExpired:
                self.kill()
        self._await_end(process, reader)

    def wait(self) -> None:
        """Return when it has ended and its log is read."""
        self._await_end(self._process, self._reader)

    def _await_end(self, process: "subprocess.Popen[str] | None", reader: Thread | None) -> None:
        if process is not None:
            process.wait()
        if reader is not None:
            reader.join(_READER_S)
        if process is self._process:  # else it has been started again
            self.is_up, self.url = False, ""
