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

MOST_SECONDS = 300.0
"""Until a process is up, on a busy machine."""


class Deployment:
    """What all processes have in common: their settings, and what they logged of the ends of jobs."""

    def __init__(self, **settings: object) -> None:
        self.environment = {name.upper(): str(value) for name, value in settings.items()}
        self.ends: Counter[str] = Counter()
        """Number of answers that were written, by job."""
        self.lines: list[str] = []
        self._lock = Lock()

    def note(self, line: str) -> None:
        """Keep what a line of a log says of the end of a job."""
        with self._lock:
            self.lines[:] = [*self.lines[-50:], line]
            if '"job ended"' in line:
                entry = json.loads(line)
                if entry.get("state") in ("succeeded", "failed"):
                    self.ends[entry["job"]] += 1


class Process:
    """`python -m app`, with `worker` a worker; `url` is empty while it does not listen."""

    def __init__(self, deployment: Deployment, *arguments: str, workers: int) -> None:
        self._deployment = deployment
        self._arguments = arguments
        self._workers = workers
        self.url = ""
        self.is_up = False
        self.peak_bytes = 0

    def start(self) -> None:
        """Return when it is up. Raises RuntimeError when it ends instead."""
        environment = {**os.environ, **self._deployment.environment, "WORKERS": str(self._workers)}
        self._process = subprocess.Popen(
            [sys.executable, "-m", "app", *self._arguments],
            cwd=REPOSITORY,
            env={**environment, "HOST": "127.0.0.1", "PORT": "0"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        Thread(target=self._read, args=(self._process,), daemon=True).start()
        deadline = time.monotonic() + MOST_SECONDS
        while not self.is_up:
            if self._process.poll() is not None or time.monotonic() > deadline:
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
            self._deployment.note(line)
        process.stdout.close()

    def measure(self) -> None:
        """Note the memory of the process itself."""
        try:
            self.peak_bytes = max(self.peak_bytes, psutil.Process(self._process.pid).memory_info().rss)
        except psutil.NoSuchProcess:
            return

    def kill(self) -> None:
        """kill -9 of the process and of the workers that it has started."""
        self.is_up, self.url = False, ""
        family = psutil.Process(self._process.pid).children(recursive=True)
        self._process.kill()
        for child in family:
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
