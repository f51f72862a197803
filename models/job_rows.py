"""Rows of jobs: as records, and what happens to a row when its job waits again or ends."""

from datetime import datetime, timedelta
from typing import Any, cast

from sqlalchemy import Row, func, select
from sqlalchemy.orm import Session

from models.documents import decode_document, encode_document
from models.job_records import (
    CHANGES,
    DeliveriesJson,
    Delivery,
    DeliveryJson,
    HeadJson,
    JobDraft,
    JobEnd,
    JobState,
    ProblemJson,
    RequestJson,
    StoredJob,
)
from models.job_statements import JOBS
from models.tables import JobRow


def queue_again(row: JobRow, ready_at: datetime) -> None:
    """The job waits again, and has no lease."""
    row.state, row.token, row.lease_until = "queued", None, None
    row.ready_at = ready_at
    row.revision += 1


def new_values(draft: JobDraft, now: datetime) -> dict[str, object]:
    """All columns of the row of a job that is accepted `now`."""
    values = dict.fromkeys(JOBS.c.keys())
    return {
        **values,
        "id": draft.id,
        "owner": draft.owner,
        "operation": draft.operation,
        "request": encode_document(draft.request),
        "input_key": draft.input_key,
        "input_bytes": draft.input_bytes,
        "repeat_key": draft.repeat_key,
        "digest": draft.digest,
        "priority": draft.priority,
        "state": "queued",
        "progress": 0.0,
        "revision": 0,
        "attempts": 0,
        "returns": 0,
        "answer_bytes": 0,
        "created_at": now,
        "ready_at": now,
        "callback_url": draft.callback_url,
    }


def end_values(end: JobEnd, now: datetime, ttl_s: float) -> dict[str, object]:
    """Values of the statements that end a job, which is kept for `ttl_s` seconds. Its callback is due."""
    return {
        "now": now,
        "new_state": end.state,
        "new_expires_at": now + timedelta(seconds=ttl_s),
        "new_answer": None if end.answer is None else encode_document(end.answer),
        "new_problem": None if end.problem is None else encode_document(end.problem),
        "new_answer_key": end.answer_key,
        "new_answer_bytes": end.answer_bytes,
    }


def blob_keys(row: JobRow | Row[*tuple[Any, ...]]) -> list[str]:
    """Keys of its input and its answer."""
    return [key for key in (row.input_key, row.answer_key) if key is not None]


def stored_job(row: JobRow | Row[Any]) -> StoredJob:
    """The job as a record."""
    return StoredJob(
        id=row.id,
        owner=row.owner,
        request=decode_document(row.request, RequestJson),
        input_key=row.input_key,
        state=cast(JobState, row.state),
        stage=row.stage,
        progress=row.progress,
        revision=row.revision,
        attempts=row.attempts,
        created_at=row.created_at,
        started_at=row.started_at,
        ended_at=row.ended_at,
        answer=None if row.answer is None else decode_document(row.answer, HeadJson),
        answer_key=row.answer_key,
        problem=None if row.problem is None else decode_document(row.problem, ProblemJson),
        callback_url=row.callback_url,
        deliveries=tuple(deliveries_of(row)),
    )


def deliveries_of(row: JobRow | Row[Any]) -> list[Delivery]:
    """The log of its callback's deliveries."""
    noted = [] if row.deliveries is None else decode_document(row.deliveries, DeliveriesJson)["log"]
    return [
        Delivery(datetime.fromisoformat(each["at"]), each["status"], each["failure"], each["seconds"])
        for each in noted
    ]


def _delivery_document(delivery: Delivery) -> DeliveryJson:
    return {
        "at": delivery.at.isoformat(),
        "status": delivery.status,
        "failure": delivery.failure,
        "seconds": delivery.seconds,
    }


def add_delivery(row: JobRow, delivery: Delivery) -> None:
    """Add to the log of deliveries."""
    log = [_delivery_document(each) for each in (*deliveries_of(row), delivery)]
    row.deliveries = encode_document({"log": log})


def tell_change(session: Session, row: JobRow) -> None:
    """With the commit, PostgreSQL sends the job's id and its revision to those who listen to `CHANGES`."""
    if session.get_bind().dialect.name == "postgresql":
        session.execute(select(func.pg_notify(CHANGES, f"{row.id} {row.revision}")))
