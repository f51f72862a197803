"""Accepted jobs of several keys while processes are killed and PostgreSQL restarts.

Each request has an Idempotency-Key, and is sent again until it is accepted. Every answer is compared with that of the
same request without a job. At the end the logs and blobs are counted: no job may be lost, or have two answers.
"""

import random
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from benchmarks.common.postgresql import running_cluster
from benchmarks.jobs.clients import LOST, Clients
from benchmarks.jobs.processes import Deployment, Process
from benchmarks.jobs.requests import API_KEYS, thousand_requests
from benchmarks.jobs.supervisor import Supervisor

DIED_TWICE = "worker-died"
"""The end of a job whose worker was killed in both attempts, as documented. It is counted, and no wrong answer."""


AWAY_S = 60.0
"""Longer than the leases of jobs, the patience of the store's calls, and that of the proxies before a service."""
AWAY = f"PostgreSQL away for {AWAY_S:g} s"


@dataclass(frozen=True, slots=True)
class Chaos:
    """`every_s`: seconds for which all processes are up before the next disruption; 0: there is none."""

    jobs: int
    every_s: float
    apis: int = 2
    workers: int = 2


def disturb_cluster(chaos: Chaos, *, only: str = "") -> bool:
    """API processes and workers on PostgreSQL, all of which are killed and restarted; whether all went well.

    `only` is the one disruption that there is.
    """
    with ExitStack() as stack:
        cluster = stack.enter_context(running_cluster(durable=True))
        folder = Path(stack.enter_context(TemporaryDirectory()))
        deployment = _deployment(chaos, folder, cluster.make_database())
        workers = [Process(deployment, "app", "worker", workers=1) for _ in range(chaos.workers)]
        apis = [Process(deployment, workers=0) for _ in range(chaos.apis)]
        supervisor = stack.enter_context(Supervisor((*workers, *apis)))
        chooser = random.Random(1)

        def kill_one(of: Sequence[Process]) -> Callable[[], None]:
            return lambda: chooser.choice(of).kill()  # the supervisor starts it again

        def restart_all() -> None:
            for process in supervisor.processes:
                supervisor.restart(process)

        def be_away() -> None:
            with cluster.away():
                time.sleep(AWAY_S)

        clients = Clients(apis, thousand_requests(), chaos.jobs)
        begin_s = time.monotonic()
        disruptions: dict[str, Callable[[], None]] = {
            "kill a worker": kill_one(workers),
            "kill an API process": kill_one(apis),
            "restart PostgreSQL": cluster.restart,
            "rolling restart": restart_all,
        }
        clients.run({only: be_away} if only else disruptions, chaos.every_s, supervisor.await_all)
        print(f"PostgreSQL, {len(apis)} API processes, {len(workers)} workers:")
        return _report(clients, deployment, supervisor, folder, time.monotonic() - begin_s)


def disturb_service(chaos: Chaos) -> bool:
    """One service on SQLite, which is killed and restarted in turns; whether all went well."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory()))
        deployment = _deployment(chaos, folder)
        service = Process(deployment, workers=chaos.workers)
        supervisor = stack.enter_context(Supervisor((service,)))

        clients = Clients([service], thousand_requests(), chaos.jobs)
        begin_s = time.monotonic()
        disruptions: dict[str, Callable[[], None]] = {
            "kill the service": service.kill,
            "restart the service": lambda: supervisor.restart(service),
        }
        clients.run(disruptions, chaos.every_s, supervisor.await_all)
        print(f"SQLite, one service with {chaos.workers} workers:")
        return _report(clients, deployment, supervisor, folder, time.monotonic() - begin_s)


def _deployment(chaos: Chaos, folder: Path, database_url: str = "") -> Deployment:
    return Deployment(
        database_url=database_url,
        data_dir=folder,
        api_keys=API_KEYS,
        max_jobs=2 * chaos.jobs,
        max_jobs_per_key=2 * chaos.jobs,
        max_job_result_bytes=4 << 30,
    )


def _report(
    clients: Clients, deployment: Deployment, supervisor: Supervisor, folder: Path, seconds: float
) -> bool:
    outcomes = clients.outcomes
    died = sum(each.code == DIED_TWICE for each in outcomes)
    wrong = sum(not each.is_right and each.code not in (DIED_TWICE, LOST) for each in outcomes)
    twice = sum(deployment.ends[each.job] > 1 for each in outcomes)
    lost = clients.jobs - len({each.job for each in outcomes if each.code != LOST})
    answers = Counter(path.parent.name for path in folder.glob("blobs/jobs/*/answer-*"))
    inputs = len(list(folder.glob("blobs/jobs/*/input")))
    again = sum(each.attempts > 1 for each in outcomes)
    recoveries_s = deployment.recoveries_s or [0.0]
    print(f"{len(outcomes)} jobs in {seconds:.0f} s ({60 * len(outcomes) / seconds:.0f} a minute).")
    print("Disruptions: " + (", ".join(f"{n} x {what}" for what, n in clients.disruptions.items()) or "none"))
    refusals = ", ".join(f"{n} x {code}" for code, n in Counter(clients.refusals).items()) or "none"
    print(f"Starts that failed and were repeated: {supervisor.failed_starts}. Answers 503: {refusals}.")
    print(
        f"Lost: {lost}. Wrong answers: {wrong}. Answered twice: {twice}. Tried twice: {again}; of them {died} died "
        f"twice ({DIED_TWICE})."
    )
    print(
        f"Jobs whose process was killed: {len(deployment.recoveries_s)}; they ran again after at most "
        f"{max(recoveries_s):.1f} s (median {median(recoveries_s):.1f})."
    )
    print(
        f"Slowest job: {max(each.seconds for each in outcomes):.1f} s. Blobs left: {inputs} inputs; "
        f"jobs with more than one answer blob: {sum(count > 1 for count in answers.values())}."
    )
    peak_mib = max(each.peak_bytes for each in clients.services) >> 20
    print(f"Peak memory of a process that listens: {peak_mib} MiB.", flush=True)
    return not (lost or wrong or twice)
