"""API processes and workers of one deployment, which are killed and started again."""

import json
import os
import subprocess
import sys
import time
from collections import Counter
from threading import Lock, Thread

import psutil

from benchmarks.common.places import REPOSITORY

MOST_SECONDS = 900.0
"""Until a process is up. It took more than 300 s where others used both processors."""


class Deployment:
    """What all processes have in common: their settings, and what they logged of jobs."""

    def __init__(self, **settings: object) -> None:
        self.environment = {name.upper(): str(value) for name, value in settings.items()}
        self.ends: Counter[str] = Counter()
        """Number of answers that were written, by job."""
        self.recoveries_s: list[float] = []
        """For each job whose process was killed: seconds until it ran elsewhere."""
        self.starts_s: list[float] = []
        """For each process, the time at which it began its first job."""
        self.ended_s: list[float] = []
        """Times at which jobs ended."""
        self.lines: list[str] = []
        self._running: dict[str, Process] = {}
        self._known: set[Process] = set()
        self._killed_s: dict[str, float] = {}
        self._lock = Lock()

    def note(self, line: str, process: "Process") -> None:
        """Keep what a line of a process's log says of a job."""
        with self._lock:
            self.lines[:] = [*self.lines[-9:], line]
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
        self.url = ""
        self.is_up = False
        self.peak_bytes = 0

    def start(self) -> None:
        """Return when it is up. Raises RuntimeError when it ends instead."""
        environment = {**os.environ, **self._deployment.environment, "WORKERS": str(self._workers)}
        self._process = subprocess.Popen(
            self._command,
            cwd=REPOSITORY,
            env={**environment, "HOST": "127.0.0.1", "PORT": "0"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        reader = Thread(target=self._read, args=(self._process,), daemon=True)
        reader.start()
        deadline = time.monotonic() + MOST_SECONDS
        while not self.is_up:
            if self._process.poll() is not None or time.monotonic() > deadline:
                reader.join(1.0)
                raise RuntimeError("a process did not start:\n" + "".join(self._deployment.lines))
            time.sleep(0.05)

    def _read(self, process: "subprocess.Popen[str]") -> None:
        assert process.stdout is not None
        for line in process.stdout:
            if "running on http" in line:
                self.url = "http://127.0.0.1:" + line.split("127.0.0.1:")[1].split()[0].rstrip('",')
                self.is_up = True
            elif "the worker takes jobs" in line:
                self.is_up = True
            self._deployment.note(line, self)
        process.stdout.close()

    def family(self) -> list[psutil.Process]:
        """The process itself, first, and all that it has started; empty if it is gone."""
        try:
            itself = psutil.Process(self._process.pid)
            return [itself, *itself.children(recursive=True)]
        except psutil.NoSuchProcess:
            return []

    def cpu_s(self) -> float:
        """Processor time of the process and of those that it has started and that still run."""
        return sum(sum(each.cpu_times()[:2]) for each in self.family())

    def resident_bytes(self) -> int:
        """Memory of the process itself; 0 if it is gone."""
        try:
            return int(psutil.Process(self._process.pid).memory_info().rss)
        except psutil.NoSuchProcess:
            return 0

    def measure(self) -> None:
        """Note the memory of the process itself."""
        self.peak_bytes = max(self.peak_bytes, self.resident_bytes())

    def kill(self) -> None:
        """kill -9 of the process and of the workers that it has started."""
        self.is_up, self.url = False, ""
        children = self.family()[1:]
        self._process.kill()
        self._deployment.note_kill(self)
        for child in children:
            try:
                child.kill()
            except psutil.NoSuchProcess:
                continue
        self._process.wait(MOST_SECONDS)

    def stop(self) -> None:
        """As a rolling deployment does: SIGTERM, and the grace period."""
        self.is_up, self.url = False, ""
        if self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(MOST_SECONDS)
            except subprocess.TimeoutExpired:
                self.kill()
