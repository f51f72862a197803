"""What honest clients get while attacks go on: the time of `/health/live`, answers of photos, and memory."""

import threading
import time
from dataclasses import dataclass

import httpx
import psutil

from benchmarks.attack.images import picture

HONEST_KEY = {"X-API-Key": "key-of-honest"}
"""Of the client that sends photos; in a service without keys it means nothing."""
_PAUSE_S = 0.1
_FRESH = httpx.Limits(max_keepalive_connections=0)
"""Every request has a connection of its own, as those of a probe have."""


@dataclass(frozen=True, slots=True)
class Life:
    """One answer of `/health/live`. `own_s` is the processor time that the server itself used meanwhile.

    Where `seconds` is large and `own_s` is small, the server waited for a processor: its event loop was not blocked.
    """

    at_s: float
    seconds: float
    own_s: float


class Watch:
    """Two clients, until they are stopped: one asks for life, the other sends honest photos."""

    def __init__(self, url: str, pid: int) -> None:
        self._url, self._server = url, psutil.Process(pid)
        self._stopped = threading.Event()
        self._threads = [threading.Thread(target=each, daemon=True) for each in (self._ask, self._send)]
        self.lives: list[Life] = []
        self.honest: list[int] = []
        self.server_bytes = self.worker_bytes = 0

    def start(self) -> None:
        """Begin."""
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """End both clients."""
        self._stopped.set()
        for thread in self._threads:
            thread.join(120)

    def slowest(self, since_s: float = 0.0) -> Life:
        """The slowest answer of `/health/live` since this time of the monotonic clock."""
        none = Life(since_s, 0.0, 0.0)
        return max((life for life in self.lives if life.at_s >= since_s), key=_seconds, default=none)

    def _ask(self) -> None:
        with httpx.Client(base_url=self._url, timeout=60, limits=_FRESH) as client:
            while not self._stopped.wait(_PAUSE_S):
                begin_s, used_s = time.monotonic(), self._used_s()
                client.get("/health/live")
                end_s = time.monotonic()
                self.lives.append(Life(end_s, end_s - begin_s, self._used_s() - used_s))
                self._measure()

    def _send(self) -> None:
        with httpx.Client(base_url=self._url, timeout=120, limits=_FRESH, headers=HONEST_KEY) as client:
            while not self._stopped.wait(_PAUSE_S):
                response = client.post("/rectify", files={"image": picture()})
                self.honest.append(response.status_code)

    def _used_s(self) -> float:
        times = self._server.cpu_times()
        return float(times.user + times.system)

    def _measure(self) -> None:
        self.server_bytes = max(self.server_bytes, self._server.memory_info().rss)
        for child in self._server.children(recursive=True):
            try:
                self.worker_bytes = max(self.worker_bytes, child.memory_info().rss)
            except psutil.NoSuchProcess:
                continue


def _seconds(life: Life) -> float:
    return life.seconds
