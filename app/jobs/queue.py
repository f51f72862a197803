"""The queue in PostgreSQL, by which API processes and workers on several machines share jobs (Procrastinate).

An entry of the queue is a ticket: it says that a job waits, and wakes one free slot of one worker. Which job that slot
takes is decided by the rows of the jobs, so that owners take turns. A ticket is stored with its job, in one
transaction. Later tickets may be lost or too many: what counts is in the rows. `QueueDispatch.settle` adds missing
tickets and deletes those of dead workers.
"""

import asyncio
import logging
from contextlib import suppress
from typing import Any

import procrastinate
import psycopg
from procrastinate.jobs import Status
from procrastinate.schema import SchemaManager

from app.jobs.postgresql import CONNECT, RESTART_PAUSE_S, Failure, conninfo_of
from app.jobs.running import JobRunner
from app.storage.probe import PROBE_TIMEOUT_S
from models.errors import StoreError, StoreUnavailable
from models.job_records import MOST_WAIT_S
from models.records import CLOCKS_DIFFER_S

log = logging.getLogger(__name__)

QUEUE = "document_jobs"
ASK_EVERY_S = 2.0
"""Pause after which a worker asks for tickets; usually the database notifies it."""
STALLED_AFTER_S = 60.0
"""Silence after which a worker counts as dead and its tickets are deleted; well above the time of a graceful stop,
during which a worker does not report to the queue."""
MOST_TICKETS = 1000
"""Tickets that are added at once."""
_ANSWER_S = 5.0
_SCHEMA_LOCK = 0x6A6F6273  # key of PostgreSQL's advisory lock: any number that no other program uses
_TASK = "run_job"
_MISSING = """
SELECT (SELECT count(*) FROM jobs WHERE state = 'queued'
        AND (ready_at <= now() OR ready_at > now() + %(longest)s * interval '1 second'))
     - (SELECT count(*) FROM procrastinate_jobs WHERE status = 'todo' AND queue_name = %(queue)s) AS missing
"""
_ALIVE = """
SELECT count(*) AS alive FROM procrastinate_workers WHERE last_heartbeat > now() - interval '30 seconds'
"""


class QueueDispatch:
    """Runs up to `slots` jobs at once in this process, as tickets arrive; 0: it only adds tickets."""

    def __init__(self, database_url: str, runner: JobRunner, slots: int) -> None:
        self._url = conninfo_of(database_url)
        self._runner = runner
        self._slots = slots
        self._free = asyncio.Semaphore(max(1, slots))
        self._running: set[asyncio.Task[None]] = set()
        self._worker: asyncio.Task[None] | None = None
        self._probe: asyncio.Task[dict[str, Any]] | None = None
        connector = procrastinate.PsycopgConnector(
            conninfo=self._url,
            kwargs=CONNECT,
            configure=_commit_each_statement,
            min_size=1,
            max_size=6,
            timeout=_ANSWER_S,
        )
        self._app = procrastinate.App(connector=connector)
        self._ticket = self._app.task(name=_TASK, queue=QUEUE)(self._use_ticket)
        # The store's connections are not asynchronous. This application has none of its own.
        within = procrastinate.App(connector=procrastinate.SyncPsycopgConnector(conninfo=self._url))
        self._enlisted = within.task(name=_TASK, queue=QUEUE)(self._use_ticket)

    async def start(self) -> None:
        """Begin to run jobs.

        Raises
        ------
        StoreUnavailable
            When the queue's tables cannot be made.
        """
        try:
            await asyncio.to_thread(_make_tables, self._url)
            await self._app.open_async()
        except Failure as error:
            raise StoreUnavailable(f"the queue of jobs cannot be opened: {error}") from error
        if self._slots:
            self._runner.start()
            self._worker = asyncio.create_task(self._keep_working())

    def enlist(self, job_id: str, connection: object) -> None:
        """Add a ticket in the transaction that stores the job. Raises `StoreUnavailable`."""
        try:
            self._enlisted.configure(connection=connection).defer(job_id=job_id)
        except Failure as error:
            raise StoreUnavailable(f"the queue of jobs cannot be used: {error}") from error

    async def announce(self) -> None:
        """Nothing: the ticket came with the job, and the database notifies workers of it."""

    async def settle(self) -> None:
        """Add missing tickets, and delete those of dead workers.

        Raises
        ------
        StoreUnavailable
        """
        try:
            async with asyncio.timeout(2 * _ANSWER_S):
                stalled = await self._app.job_manager.get_stalled_jobs(
                    queue=QUEUE, seconds_since_heartbeat=STALLED_AFTER_S
                )
                for job in stalled:
                    await self._app.job_manager.finish_job(job, Status.FAILED, delete_job=True)
                row = await self._app.connector.execute_query_one_async(
                    _MISSING, queue=QUEUE, longest=MOST_WAIT_S + CLOCKS_DIFFER_S
                )
                for _ in range(min(int(row["missing"]), MOST_TICKETS)):
                    await self._ticket.defer_async(job_id="")
        except Failure as error:
            raise StoreUnavailable(f"the queue of jobs cannot be used: {error}") from error

    async def live_workers(self) -> int | None:
        """Number of processes that run jobs; None: the queue does not answer."""
        # A cancelled query waits for the server too, so a probe that hangs is left to itself and asked again.
        if self._probe is None or self._probe.done():
            self._probe = asyncio.create_task(self._app.connector.execute_query_one_async(_ALIVE))
        probe = self._probe
        await asyncio.wait((probe,), timeout=PROBE_TIMEOUT_S)
        if not probe.done() or probe.cancelled() or probe.exception() is not None:
            return None
        return int(probe.result()["alive"])

    async def stop(self, grace_s: float) -> None:
        """Take no more jobs; those that still run after `grace_s` seconds are handed back."""
        worker, self._worker = self._worker, None
        if worker is not None:
            worker.cancel()
        if self._running:
            await asyncio.wait(self._running, timeout=grace_s)
        for task in tuple(self._running):
            task.cancel()
        await asyncio.gather(*self._running, return_exceptions=True)
        if worker is not None:
            await asyncio.wait((worker,), timeout=_ANSWER_S)
            await self._runner.stop()
        with suppress(*Failure):
            async with asyncio.timeout(_ANSWER_S):
                await self._app.close_async()

    async def _keep_working(self) -> None:
        """Run the library's worker, and start it again when the database was away."""
        while True:
            try:
                await self._app.run_worker_async(
                    queues=[QUEUE],
                    concurrency=self._slots,
                    fetch_job_polling_interval=ASK_EVERY_S,
                    delete_jobs="always",
                    install_signal_handlers=False,
                    shutdown_graceful_timeout=1.0,
                    update_heartbeat_interval=5.0,
                    stalled_worker_timeout=STALLED_AFTER_S,
                )
            except Exception as error:
                log.warning("the queue of jobs cannot be read: %s", error)
            await asyncio.sleep(RESTART_PAUSE_S)

    async def _use_ticket(self, job_id: str) -> None:
        """Run one job. It goes on when the library's worker ends, for example because the database is away."""
        task = asyncio.create_task(self._run_one())
        self._running.add(task)
        task.add_done_callback(self._running.discard)
        await asyncio.shield(task)

    async def _run_one(self) -> None:
        async with self._free:
            try:
                await self._runner.run_one()
            except StoreError as error:
                log.warning("no job could be taken: %s", error.detail)


async def _commit_each_statement(connection: psycopg.AsyncConnection[Any]) -> None:
    """The library's transactions are single statements: two exchanges with the server less for each."""
    await connection.set_autocommit(True)


def _make_tables(url: str) -> None:
    """Make the queue's tables if they are not there. Of several processes one does it."""
    with psycopg.connect(url, **CONNECT) as connection:
        connection.execute("SELECT pg_advisory_xact_lock(%s)", (_SCHEMA_LOCK,))
        found = connection.execute("SELECT to_regclass('procrastinate_jobs')").fetchone()
        if found is None or found[0] is None:
            connection.execute(SchemaManager.get_schema())
