"""The service as a process of its own, as an operator runs it."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread
from typing import Any

import psutil

from app.storage.layout_store import DATABASE
from tests.end_to_end.forked import ROOT, ForkedProcess, template
from tests.models.databases import make_file

SCRIPTED = "tests.end_to_end.scripted_service"
PRODUCT = "app"


@dataclass(slots=True)
class Service:
    """A running server process; `lines` is what it has logged so far."""

    process: "ForkedProcess | subprocess.Popen[str]"
    lines: list[dict[str, Any]] = field(default_factory=list)
    other_output: list[str] = field(default_factory=list)
    port: int = 0

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def read(self) -> None:
        """Collect the log until the process ends."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            try:
                self.lines.append(json.loads(line))
            except json.JSONDecodeError:
                self.other_output.append(line)

    def wait_until_up(self, seconds: float = 60) -> None:
        """Return when it listens."""
        deadline = time.monotonic() + seconds
        while not self.port:
            assert self.process.poll() is None, self.other_output
            assert time.monotonic() < deadline
            for line in self.lines:
                if line["message"] == "the worker takes jobs":
                    return
                if "running on http" in line["message"]:
                    self.port = int(line["message"].split("127.0.0.1:")[1].split()[0])
            time.sleep(0.02)

    def descendants(self) -> list[psutil.Process]:
        """Every process that this one has started, and those that they have."""
        return psutil.Process(self.process.pid).children(recursive=True)

    def terminate(self) -> None:
        """Ask it to stop, as `docker stop` does."""
        self.process.send_signal(signal.SIGTERM)


@contextmanager
def running(
    module: str = SCRIPTED, *arguments: str, fresh: bool = False, **settings: object
) -> Iterator[Service]:
    """The service in a process of its own, on a free port of the loopback; with the argument `worker`, a worker.

    The process is a fork of a template, which saves the imports; with `fresh`, Python starts anew, as an operator's
    does. What the service remembers is gone with the block, unless `data_dir` is given.
    """
    with TemporaryDirectory() as folder:
        if not fresh:
            make_file(Path(folder) / DATABASE)
        with _running([module, *arguments], fresh, {"data_dir": folder, **settings}) as service:
            yield service


@contextmanager
def _running(command: list[str], fresh: bool, settings: dict[str, object]) -> Iterator[Service]:
    own = {name.upper(): str(value) for name, value in settings.items()}
    environment = {**os.environ, "HOST": "127.0.0.1", "PORT": "0", **own}
    process = _start(command, environment) if fresh else template().fork(command, environment)
    service = Service(process)
    reader = Thread(target=service.read)
    reader.start()
    try:
        service.wait_until_up()
        yield service
    finally:
        if process.poll() is None:
            process.terminate()
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait(10)
            raise
        finally:
            reader.join(10)
            assert process.stdout is not None
            process.stdout.close()


def _start(command: list[str], environment: dict[str, str]) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-m", *command],
        cwd=ROOT,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def ended(module: str = SCRIPTED, **settings: object) -> tuple[int, list[dict[str, Any]]]:
    """Exit status and log of a service that is expected to give up."""
    own = {name.upper(): str(value) for name, value in settings.items()}
    process = template().fork([module], {**os.environ, "HOST": "127.0.0.1", "PORT": "0", **own})
    with process.stdout:
        lines = [json.loads(line) for line in process.stdout]
    return process.wait(60), lines
