"""Lists of many results over HTTP: the time of one part, and the server's processor time."""

import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import httpx
import numpy as np

from app.storage.layout_store import DATABASE
from benchmarks.common.baseline import Figures
from benchmarks.jobs import idle_service
from benchmarks.jobs.processes import Deployment, Process
from benchmarks.layout.part import Part, Result, Results, table
from benchmarks.layout.specimens import Specimen
from models.records import ResultDraft, ReviewDraft
from models.repository import Store

RESULTS = 10_000
ZONES = 40
AT_ONCE = 50
"""Results of one answer."""
PARTS = 40
"""Answers that follow each other, from the first on."""
TTL_S = 86_400.0
SEED = 5
LISTS = {
    "order of gain": {"state": "open", "order": "gain"},
    "order of confidence": {"state": "open", "order": "confidence"},
    "newest first": {"order": "newest"},
}


def _jobs(specimens: Sequence[Specimen]) -> list[str]:
    return [f"{RESULTS} results"]


def _measure(job: str, specimens: Sequence[Specimen]) -> Result:
    with TemporaryDirectory() as folder:
        _fill(Path(folder))
        service = Process(Deployment(data_dir=folder), idle_service.MODULE, workers=1)
        service.start()
        try:
            with httpx.Client(base_url=service.url, timeout=60) as client:
                return {name: _follow(client, service, options) for name, options in LISTS.items()}
        finally:
            service.stop()


def _fill(folder: Path) -> None:
    rng = np.random.default_rng(SEED)
    zones = [
        {"id": f"z{n}", "box": [10.0, 20.0 * n, 900.0, 20.0 * n + 16], "label": "body"} for n in range(ZONES)
    ]
    with Store.open(folder / DATABASE) as store:
        for _ in range(RESULTS // 100):
            drafts = [
                ResultDraft(
                    {"result": {"zones": zones}},
                    review=ReviewDraft(float(gain), float(sure), "letter", ZONES, "review"),
                )
                for gain, sure in zip(rng.gamma(2.0, 1.0, 100), rng.random(100), strict=True)
            ]
            store.add_document({}, drafts, TTL_S)


def _follow(client: httpx.Client, service: Process, options: dict[str, str]) -> dict[str, float]:
    """Milliseconds of `PARTS` answers, each beginning where the one before ended."""
    asked: dict[str, str | int] = {**options, "limit": AT_ONCE}
    cpu_s, answers_ms, seen = service.cpu_s(), [], set()
    for _ in range(PARTS):
        begin_s = time.perf_counter()
        answer = client.get("/layout/results", params=asked).raise_for_status().json()
        answers_ms.append(1000 * (time.perf_counter() - begin_s))
        seen |= {each["id"] for each in answer["results"]}
        asked["cursor"] = answer["next"]
    assert len(seen) == PARTS * AT_ONCE
    return {
        "median_ms": median(answers_ms),
        "slowest_ms": max(answers_ms),
        "cpu_ms": 1000 * (service.cpu_s() - cpu_s) / PARTS,
    }


def _report(results: Results) -> str:
    rows = [
        [f"{job}, {name}", each["median_ms"], each["slowest_ms"], each["cpu_ms"]]
        for job, lists in results.items()
        for name, each in lists.items()
    ]
    head = ("list", "median ms", "slowest ms", "server's CPU ms")
    return table(f"{AT_ONCE} results an answer, {PARTS} answers one after another", head, rows)


def _figures(results: Results) -> Figures:
    return {}  # times belong to a machine


LISTS_OVER_HTTP = Part(_jobs, _measure, _report, _figures)
