"""The running service under load: photos a minute of one worker and of two, and how long answers take.

python -m benchmarks rectify_load [--seconds S] [--megapixels M]

Clients first keep all workers busy: that is the capacity. Then requests arrive at random (a Poisson process) at 50 and
at 90 % of it. It needs two free processors, which the client shares.
"""

import argparse
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from tempfile import TemporaryDirectory

import cv2
import httpx
import numpy as np

from benchmarks.jobs.processes import Deployment, Process
from benchmarks.layout.part import table
from simulation.degradation import PHONE
from simulation.pages import own_pages
from simulation.scenes import BOOK, PLANE, POSES, photograph

LOADS = (0.5, 0.9)
WORKERS = (1, 2)
LEAST_SPEED_UP = 1.9
QUEUE_LENGTH = 64
SEED = 9
JPEG_QUALITY = 90


def make_photos(megapixels: float) -> list[bytes]:
    """A flat and a bent page on a desk, as JPEG."""
    height = round(1000 * (megapixels * 4 / 3) ** 0.5)
    size = (round(0.75 * height), height)
    rng = np.random.default_rng(SEED)
    pages = own_pages()
    photos = (
        photograph(pages[0], POSES[1], 0.0, PLANE, dirt=PHONE, rng=rng, size=size).image,
        photograph(pages[3], POSES[2], 0.0, BOOK, dirt=PHONE, rng=rng, size=size).image,
    )
    options = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    return [cv2.imencode(".jpg", photo[:, :, ::-1], options)[1].tobytes() for photo in photos]


class Load:
    """Uploads of photos to one service, and the seconds that each answer took."""

    def __init__(self, url: str, photos: Sequence[bytes]) -> None:
        self._client = httpx.Client(base_url=url, timeout=600, limits=httpx.Limits(max_connections=200))
        self._photos = photos
        self._next = count()
        self.seconds: list[float] = []

    def close(self) -> None:
        """Close the connections."""
        self._client.close()

    def send(self) -> None:
        """One photo, the next of them in turn."""
        photo = self._photos[next(self._next) % len(self._photos)]
        begin_s = time.monotonic()
        answer = self._client.post("/rectify", files={"image": ("photo.jpg", photo)}).raise_for_status()
        assert answer.headers["content-type"].startswith("image/")
        self.seconds.append(time.monotonic() - begin_s)

    def saturate(self, clients: int, seconds: float) -> float:
        """Photos a second while so many clients send one after another."""
        begin_s = time.monotonic()
        ends: list[float] = []

        def work() -> None:
            while time.monotonic() - begin_s < seconds:
                self.send()
                ends.append(time.monotonic())

        threads = [threading.Thread(target=work) for _ in range(clients)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        return len(ends) / (max(ends) - begin_s)

    def arrive(self, rate: float, seconds: float, rng: np.random.Generator) -> list[float]:
        """Seconds of answers to requests that arrive at random, `rate` a second."""
        self.seconds.clear()
        begin_s = at_s = time.monotonic()
        threads = []
        while at_s - begin_s < seconds:
            time.sleep(max(0.0, at_s - time.monotonic()))
            threads.append(threading.Thread(target=self.send))
            threads[-1].start()
            at_s += rng.exponential(1.0 / rate)
        for thread in threads:
            thread.join()
        return list(self.seconds)


@contextmanager
def _service(workers: int) -> Iterator[tuple[Process, float]]:
    """The service, and the seconds until it was ready."""
    with TemporaryDirectory() as folder:
        process = Process(Deployment(data_dir=folder, queue_length=QUEUE_LENGTH), workers=workers)
        begin_s = time.monotonic()
        process.start()
        started_s = time.monotonic() - begin_s
        try:
            yield process, started_s
        finally:
            process.stop()


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print; 1 if two workers are not as much faster as they must be."""
    parser = argparse.ArgumentParser(
        prog="benchmarks rectify_load",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--seconds", type=float, default=40.0, help="of each load")
    parser.add_argument("--megapixels", type=float, default=3.0)
    options = parser.parse_args(arguments)
    photos = make_photos(options.megapixels)
    rows, capacities = [], []
    for workers in WORKERS:
        with _service(workers) as (process, started_s):
            started_cpu_s = process.cpu_s()
            load = Load(process.url, photos)
            for _ in range(2 * workers):
                load.send()
            capacities.append(load.saturate(workers + 1, options.seconds))
            row: list[object] = [f"{workers} workers", started_s, started_cpu_s, 60 * capacities[-1]]
            rng = np.random.default_rng(SEED)
            for share in LOADS:
                seconds = load.arrive(share * capacities[-1], options.seconds, rng)
                row += [float(np.median(seconds)), float(np.percentile(seconds, 95))]
            load.close()
            rows.append(row)
            print(f"{workers} of {max(WORKERS)} measured", flush=True)
    of_loads = (f"{100 * share:.0f} %: {what}" for share in LOADS for what in ("median s", "95 % s"))
    head = ("service", "start s", "start CPU s", "photos a minute", *of_loads)
    print(table(f"/rectify, photos of {options.megapixels:g} megapixels, flat and bent in turn", head, rows))
    print(f"Two workers: {capacities[1] / capacities[0]:.2f} times one.")
    return int(capacities[1] / capacities[0] < LEAST_SPEED_UP)
