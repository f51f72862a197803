"""Services forked by a template process (`service_template`), with the interface of `subprocess.Popen`."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TextIO

from app.engine.worker import SINGLE_THREAD_ENVIRONMENT

ROOT = Path(__file__).parent.parent.parent
STARTED_WITHIN_S = 120
"""Longest time until the template has imported everything and forked the first service."""


class ForkedProcess:
    """A process that the template has forked; `stdout` is all its output."""

    def __init__(self, life: socket.socket, stdout: TextIO) -> None:
        life.settimeout(STARTED_WITHIN_S)
        self.pid = int(life.recv(64))
        self.returncode: int | None = None
        self.stdout = stdout
        self._life = life
        self._lock = threading.Lock()

    def poll(self) -> int | None:
        """Exit status (negative: the signal), or None while it runs."""
        try:
            return self.wait(0)
        except subprocess.TimeoutExpired:
            return None

    def wait(self, timeout: float) -> int:
        """Exit status, once it has ended.

        Raises
        ------
        subprocess.TimeoutExpired
        """
        with self._lock:
            if self.returncode is None:
                self._life.settimeout(timeout)
                try:
                    self.returncode = int(self._life.recv(64))
                except (BlockingIOError, TimeoutError) as error:
                    raise subprocess.TimeoutExpired("forked service", timeout) from error
                self._life.close()
            return self.returncode

    def send_signal(self, number: int) -> None:
        """Send a signal, if it runs."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        """Send SIGTERM."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """Send SIGKILL."""
        self.send_signal(signal.SIGKILL)


class Template:
    """The template process; it ends with this object."""

    def __init__(self) -> None:
        self._control, far_end = socket.socketpair()
        with far_end:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "tests.end_to_end.service_template", str(far_end.fileno())],
                cwd=ROOT,
                env={**os.environ, **SINGLE_THREAD_ENVIRONMENT},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,  # as the output of services is; nothing is written to it
                pass_fds=(far_end.fileno(),),
            )

    def fork(self, command: Sequence[str], environment: Mapping[str, str]) -> ForkedProcess:
        """A process that runs `python -m` with this command and environment."""
        order = json.dumps({"command": command, "environment": dict(environment)}).encode()
        output, written = os.pipe()
        life, far_end = socket.socketpair()
        with far_end:
            socket.send_fds(self._control, [order], [written, far_end.fileno()])
        os.close(written)
        return ForkedProcess(life, os.fdopen(output, encoding="utf-8"))


template = cache(Template)
"""The template of this process, which starts with the first service."""
