"""Callbacks: a client's server hears of a job's end, by the convention of Standard Webhooks.

Deliveries are at least once: the id of a message stays the same, so that a receiver can recognize a repetition. They
are times in the rows of the jobs, so that any process that runs jobs sends them, also after a restart.
"""

import asyncio
import json
import logging
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import UTC, datetime

from standardwebhooks import Webhook

from app.jobs.callback_request import CallbackFailed, CallbackRequest
from app.storage.layout_store import LayoutStore
from models.errors import StoreError
from models.job_records import Delivery, StoredJob
from services.errors import InvalidOption

log = logging.getLogger(__name__)

AT_ONCE = 4
"""Callbacks that are sent at once."""
POLL_EVERY_S = 1.0
STEP_TIMEOUT_S = 10.0
"""Time for the connection, and for the answer."""
TIMEOUT_S = 25.0
"""Time for the whole delivery."""
CLAIM_S = 60.0
"""A delivery that a killed process has begun is sent again after this long."""
PAUSES_S = (5.0, 30.0, 120.0, 600.0, 1800.0)
"""Pauses between deliveries that fail. The last one is 43 minutes after the job's end: within the hour that jobs are
kept by default."""


@dataclass(frozen=True, slots=True)
class CallbackSettings:
    """Which hosts may be called, and with which secret; `app.settings` documents them."""

    hosts: tuple[str, ...]
    internal_hosts: tuple[str, ...]
    secret: str
    root_path: str
    pauses_s: Sequence[float] = PAUSES_S


class Callbacks:
    """Sends the callbacks of jobs that have ended."""

    def __init__(self, store: LayoutStore, settings: CallbackSettings) -> None:
        self._store = store
        self._settings = settings
        self._threads = ThreadPoolExecutor(AT_ONCE, "callbacks")
        self._tasks: list[asyncio.Task[None]] = []
        self.failures = 0
        """Deliveries that failed."""

    def start(self) -> None:
        """Begin, if a secret is configured."""
        if self._settings.secret:
            self._tasks = [asyncio.create_task(self._send_all()) for _ in range(AT_ONCE)]

    async def stop(self) -> None:
        """End. What has begun and is not noted is sent again by another process."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._threads.shutdown(wait=False, cancel_futures=True)

    async def _send_all(self) -> None:
        while True:
            try:
                job = await self._store.call(lambda store: store.claim_callback(CLAIM_S))
                if job is not None:
                    await self.deliver(job)
                    continue
            except StoreError as error:
                log.warning("callbacks cannot be sent: %s", error.detail)
            except Exception:
                log.exception("a callback could not be sent")
            await asyncio.sleep(POLL_EVERY_S)

    async def deliver(self, job: StoredJob) -> None:
        """Send the callback of a job once, and note what became of it."""
        begin_s, status, failure = time.monotonic(), None, None
        try:
            status = await self._post(job)
            if not 200 <= status < 300:
                failure = "the answer is not 2xx"
        except (CallbackFailed, InvalidOption) as error:
            failure = str(error)
        except TimeoutError:
            failure = f"no answer within {TIMEOUT_S:g} s"
        earlier, pauses_s = len(job.deliveries), self._settings.pauses_s
        next_s = None if failure is None or earlier >= len(pauses_s) else pauses_s[earlier]
        delivery = Delivery(datetime.now(UTC), status, failure, round(time.monotonic() - begin_s, 3))
        await self._store.call(lambda store: store.note_delivery(job.id, delivery, next_s))
        if failure is not None:
            self.failures += 1
        log.info(
            "callback", extra={"job": job.id, "status": status, "failure": failure, "attempt": earlier + 1}
        )

    async def _post(self, job: StoredJob) -> int:
        assert job.callback_url is not None
        settings, now = self._settings, datetime.now(UTC)
        request = CallbackRequest(job.callback_url, settings.hosts, settings.internal_hosts)
        body = json.dumps(message_of(job, settings.root_path))
        message_id = f"msg_{job.id}"
        headers = {
            "Content-Type": "application/json",
            "User-Agent": "document-rectification",
            "webhook-id": message_id,
            "webhook-timestamp": str(int(now.timestamp())),
            "webhook-signature": Webhook(settings.secret).sign(message_id, now, body),
        }
        sending = asyncio.get_running_loop().run_in_executor(
            self._threads, request.send, body.encode(), headers, STEP_TIMEOUT_S
        )
        try:
            async with asyncio.timeout(TIMEOUT_S):
                return await asyncio.shield(sending)
        finally:
            request.abort()


def message_of(job: StoredJob, root_path: str) -> dict[str, object]:
    """What the client's server gets: the kind of the event, its time, the job's state and where its result is."""
    assert job.ended_at is not None
    path = f"{root_path}/jobs/{job.id}"
    data = {
        "id": job.id,
        "state": job.state,
        "problem": job.problem,
        "links": {"job": path, "result": f"{path}/result"},
    }
    return {"type": f"job.{job.state}", "timestamp": job.ended_at.isoformat(), "data": data}
