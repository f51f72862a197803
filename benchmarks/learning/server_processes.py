"""The service as processes of its own, which may be killed and started again on the same folder."""

import json
import os
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from threading import Thread

import psutil

from benchmarks.common.places import REPOSITORY

MOST_SECONDS = 90.0
"""Until it listens, on a busy machine; and until it has stopped."""


class Server:
    """`python -m app` on a free port of the loopback; `url` is empty while it does not listen."""

    def __init__(self, data_dir: Path, code: Path = REPOSITORY, **settings: object) -> None:
        """`code` is the checkout that serves."""
        self._code = code
        self._settings = {name.upper(): str(value) for name, value in settings.items()}
        self._settings |= {"DATA_DIR": str(data_dir), "HOST": "127.0.0.1", "PORT": "0"}
        self._process: subprocess.Popen[str] | None = None
        self._started: list[psutil.Process] = []
        self.url = ""

    def start(self) -> None:
        """Return when it listens.

        Raises
        ------
        RuntimeError
            When it ends instead, or does not listen in time.
        """
        process = subprocess.Popen(
            [sys.executable, "-m", "app"],
            cwd=self._code,
            env={**os.environ, **self._settings},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self._process = process
        lines: list[str] = []
        ports: list[str] = []

        def read() -> None:
            assert process.stdout is not None
            for line in process.stdout:
                if not ports and "running on http" in line:
                    with suppress(ValueError):
                        ports.append(json.loads(line)["message"].split("127.0.0.1:")[1].split()[0])
                lines[:] = [*lines[-20:], line]
            process.stdout.close()

        Thread(target=read, daemon=True).start()
        deadline = time.monotonic() + MOST_SECONDS
        while not ports:
            if process.poll() is not None or time.monotonic() > deadline:
                raise RuntimeError("the service did not start:\n" + "".join(lines))
            time.sleep(0.02)
        self.url = f"http://127.0.0.1:{ports[0]}"

    @property
    def pid(self) -> int:
        """Process id of the server."""
        assert self._process is not None
        return self._process.pid

    def kill(self) -> None:
        """kill -9 of the server process alone, as the kernel does when memory runs out."""
        assert self._process is not None
        self.url = ""
        with suppress(psutil.NoSuchProcess):
            self._started += psutil.Process(self._process.pid).children(recursive=True)
        self._process.kill()
        self._process.wait(MOST_SECONDS)

    def left_behind(self) -> int:
        """How many processes that killed servers had started are still there."""
        return sum(
            process.is_running() and process.status() != psutil.STATUS_ZOMBIE for process in self._started
        )

    def stop(self) -> None:
        """As an operator does; what is left of killed ones is killed too."""
        self.url = ""
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(MOST_SECONDS)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait(MOST_SECONDS)
        for process in self._started:
            with suppress(psutil.NoSuchProcess):
                process.kill()
