"""The store's calls for jobs: accepted work that outlives every process.

A worker that takes a job gets a lease with a token. It renews the lease while it works. When the lease has ended, the
job is given to another worker with another token, so that a late writer cannot change the job any more. The end of a
job is written once.
"""

import secrets
from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import ColumnElement, Row, case, func, or_, select, update
from sqlalchemy.orm import Session

from models.clocks import is_over, latest, oldest_first
from models.errors import JobKeyReused, NoSuchJob, QueueFull
from models.job_records import (
    FINAL_STATES,
    MOST_CALLBACK_WAIT_S,
    MOST_WAIT_S,
    Delivery,
    JobBounds,
    JobDraft,
    JobEnd,
    Lease,
    Progress,
    QueueStatus,
    StoredJob,
)
from models.job_rows import (
    add_delivery,
    blob_keys,
    end_values,
    new_values,
    queue_again,
    stored_job,
    tell_change,
)
from models.job_statements import (
    ADD,
    CLAIM,
    DELETE,
    END_BY_ANYBODY,
    END_BY_LEASE,
    JOBS,
    READ,
    REVISIONS,
    UNFINISHED,
    UNFINISHED_TOTALS,
    WAITING_OWNERS,
)
from models.tables import JobRow
from models.transactions import Transactions

MOST_RETURNS = 60
"""Largest number of times that a job is handed back because the service could not run it."""


class JobRepository(Transactions):
    """Jobs by id."""

    def add_job(
        self, draft: JobDraft, bounds: JobBounds, also: Callable[[Any], None] | None = None
    ) -> tuple[StoredJob, bool]:
        """Store a job; False as the second value if it is an earlier one with the same `repeat_key`.

        `also` is called with the driver's connection in the transaction that stores a new job.

        Raises
        ------
        QueueFull
            When there are too many unfinished jobs, or too many bytes of their inputs.
        JobKeyReused
            When the earlier job had another digest.
        """
        with self._changing() as (session, _):
            values = new_values(draft, self._clock())
            if (earlier := self._repeated(session, draft.repeat_key, draft.digest)) is not None:
                return earlier, False
            _require_room(session, draft.owner, draft.input_bytes, bounds)
            row = session.execute(ADD, values).one()
            if also is not None:
                also(session.connection().connection.driver_connection)
            return stored_job(row), True

    def repeated_job(self, repeat_key: str, digest: str) -> StoredJob | None:
        """The job with this key; None: there is none. Raises `JobKeyReused` when it had another digest."""
        with self._writing() as session:
            return self._repeated(session, repeat_key, digest)

    def has_job_of_key(self, repeat_key: str) -> bool:
        """Whether a job that has not expired has this key."""
        is_kept = or_(JobRow.expires_at.is_(None), ~self._is_expired())
        wanted = select(JobRow.id).where(JobRow.repeat_key == repeat_key, is_kept)
        with self._reading() as session:
            return session.execute(wanted).first() is not None

    def _repeated(self, session: Session, repeat_key: str | None, digest: str | None) -> StoredJob | None:
        if repeat_key is None:
            return None
        of_key = JobRow.repeat_key == repeat_key
        # A new job may have the key of one that has expired.
        session.execute(update(JOBS).where(of_key, self._is_expired()).values(repeat_key=None))
        row = session.execute(select(JobRow).where(of_key)).scalar_one_or_none()
        if row is None:
            return None
        if row.digest != digest:
            raise JobKeyReused(
                "this Idempotency-Key came with a different request. Send a new key for new work"
            )
        return stored_job(row)

    def job(self, job_id: str) -> StoredJob:
        """A job that has not expired. Raises `NoSuchJob`."""
        with self._glancing() as session:
            row = session.execute(READ, {"of_id": job_id}).one_or_none()
            if row is None or self._has_expired(row):
                raise NoSuchJob(f"there is no job {job_id[:64]!r}, or no longer", job_id)
            return stored_job(row)

    def job_revisions(self, job_ids: Sequence[str]) -> dict[str, int]:
        """The revisions of jobs that exist."""
        with self._glancing() as session:
            return {id: revision for id, revision in session.execute(REVISIONS, {"ids": job_ids})}

    def require_queue_room(self, bounds: JobBounds, owner: str | None, input_bytes: int) -> None:
        """Raise `QueueFull` when a job of this owner would not be accepted now."""
        with self._glancing() as session:
            _require_room(session, owner, input_bytes, bounds)

    def claim_job(self, lease_s: float) -> Lease | None:
        """Take the queued job that is next; None: there is none that may start now.

        Of the jobs with the highest priority, next is the oldest one of the owner with the fewest running jobs, and
        of several such owners that of the one who has waited longest since a job of his was started.
        """
        now, token = self._clock(), secrets.token_hex(16)
        with self._writing() as session:
            for priority, owner in _owners_in_turn(session, now):
                values = {
                    "of_priority": priority,
                    "of_owner": owner,
                    "now": now,
                    "latest": latest(now, MOST_WAIT_S),
                    "new_token": token,
                    "until": now + timedelta(seconds=lease_s),
                }
                row = CLAIM.execute(session, values)
                if row is not None:
                    return Lease(stored_job(row), token)
        return None

    def renew_leases(self, reports: Sequence[Progress], lease_s: float) -> set[str]:
        """Renew the leases of running jobs and note their progress; the ids of those whose lease is lost."""
        until = self._clock() + timedelta(seconds=lease_s)
        lost = set()
        with self._writing() as session:
            for report in sorted(reports, key=_id_of):  # all lock rows in one order
                row = session.get(JobRow, report.job_id, with_for_update=True)
                if row is None or row.token != report.token:
                    lost.add(report.job_id)
                    continue
                row.lease_until = until
                stage, progress = report.stage or row.stage, max(row.progress, report.progress)
                if (stage, progress) != (row.stage, row.progress):
                    row.stage, row.progress = stage, progress
                    row.revision += 1
                    tell_change(session, row)
        return lost

    def end_job(self, job_id: str, token: str | None, end: JobEnd, ttl_s: float) -> bool:
        """Write the end of a job, and keep the job for `ttl_s` seconds; False if it has ended already.

        `token` is that of the lease. False also means that the lease is lost. None: the job is cancelled, whoever
        runs it.
        """
        now = self._clock()
        values = {"of_id": job_id, **end_values(end, now, ttl_s)}
        with self._writing() as session:
            if token is None:
                return END_BY_ANYBODY.execute(session, values) is not None
            return END_BY_LEASE.execute(session, {"of_token": token, **values}) is not None

    def return_job(self, job_id: str, token: str, wait_s: float, *, is_attempt: bool) -> bool:
        """Hand a running job back; it may start again after `wait_s` seconds (`MOST_WAIT_S` at most).

        False: the lease is lost.

        `is_attempt` is False where the job could not run through no fault of its own. That happens `MOST_RETURNS` times
        at most; then every return counts as an attempt.
        """
        with self._writing() as session:
            row = session.get(JobRow, job_id, with_for_update=True)
            if row is None or row.token != token:
                return False
            if not is_attempt and row.returns < MOST_RETURNS:
                row.attempts -= 1
                row.returns += 1
            queue_again(row, self._clock() + timedelta(seconds=min(wait_s, MOST_WAIT_S)))
            tell_change(session, row)
            return True

    def settle_stalled_jobs(
        self, most_attempts: int, failure: Callable[[StoredJob], JobEnd], ttl_s: float, lease_s: float
    ) -> tuple[int, int]:
        """Queue running jobs again whose lease has ended, or end them after `most_attempts` attempts.

        `failure` is their end, `lease_s` the length of leases. The numbers of both.
        """
        now, again, failed = self._clock(), 0, 0
        with self._writing() as session:
            stalled = (
                select(JobRow)
                .where(JobRow.state == "running", is_over(JobRow.lease_until, now, lease_s))
                .with_for_update(skip_locked=True)
            )
            for row in session.execute(stalled).scalars():
                if row.attempts < most_attempts:
                    queue_again(row, now)
                    tell_change(session, row)
                    again += 1
                else:
                    end = failure(stored_job(row))
                    END_BY_ANYBODY.execute(session, {"of_id": row.id, **end_values(end, now, ttl_s)})
                    failed += 1
        return again, failed

    def delete_job(self, job_id: str) -> list[str]:
        """Delete a finished job; the keys of its blobs. An unfinished one remains."""
        with self._writing() as session:
            row = session.execute(DELETE, {"of_id": job_id}).one_or_none()
            return [] if row is None else blob_keys(row)

    def purge_jobs(self, most_jobs: int, most_answer_bytes: int) -> list[str]:
        """Delete finished jobs that have expired, and the oldest ones over a limit; the keys of their blobs.

        A job whose callback is not delivered yet remains until it expires.
        """
        finished, now = JobRow.state.in_(FINAL_STATES), self._clock()
        counted = select(
            func.count(),
            func.coalesce(func.sum(JobRow.answer_bytes), 0),
            func.coalesce(func.sum(case((self._is_expired(), 1), else_=0)), 0),
        )
        keys: list[str] = []

        def is_full(jobs: int, answer_bytes: int) -> bool:
            return jobs > most_jobs or answer_bytes > most_answer_bytes

        with self._glancing() as session:
            jobs, answer_bytes, expired = session.execute(counted).one()
        if not expired and not is_full(jobs, answer_bytes):
            return keys  # by far the most frequent case, for which no row is read
        with self._writing() as session:
            # Rows that another process changes are left to the next purge, so that nobody waits for another.
            over = select(JobRow).where(finished, self._is_expired()).with_for_update(skip_locked=True)
            for row in session.execute(over).scalars():
                keys += blob_keys(row)
                session.delete(row)
            session.flush()
            jobs, answer_bytes, _ = session.execute(counted).one()
            oldest = select(JobRow).where(finished, JobRow.callback_at.is_(None))
            oldest = oldest.order_by(*oldest_first(JobRow.ended_at, now)).with_for_update(skip_locked=True)
            for row in session.execute(oldest.execution_options(yield_per=100)).scalars():
                if not is_full(jobs, answer_bytes):
                    break
                keys += blob_keys(row)
                session.delete(row)
                jobs -= 1
                answer_bytes -= row.answer_bytes
        return keys

    def claim_callback(self, claim_s: float) -> StoredJob | None:
        """A job whose callback is due; None: there is none.

        Nobody else gets it for `claim_s` seconds (`MOST_CALLBACK_WAIT_S` at most).
        """
        now = self._clock()
        is_due = is_over(JobRow.callback_at, now, MOST_CALLBACK_WAIT_S)
        due = select(JobRow).where(is_due).order_by(JobRow.callback_at).limit(1)
        with self._glancing() as session:
            if session.execute(due).first() is None:
                return None
        with self._writing() as session:
            row = session.execute(due.with_for_update(skip_locked=True)).scalar_one_or_none()
            if row is None:
                return None
            row.callback_at = now + timedelta(seconds=min(claim_s, MOST_CALLBACK_WAIT_S))
            return stored_job(row)

    def note_delivery(self, job_id: str, delivery: Delivery, next_s: float | None) -> None:
        """Add to a job's log of deliveries; the next one is due in `next_s` seconds, None: it was the last.

        It is due in `MOST_CALLBACK_WAIT_S` at most.
        """
        with self._writing() as session:
            row = session.get(JobRow, job_id, with_for_update=True)
            if row is None:
                return
            add_delivery(row, delivery)
            wait = None if next_s is None else timedelta(seconds=min(next_s, MOST_CALLBACK_WAIT_S))
            row.callback_at = None if wait is None else self._clock() + wait

    def queue_status(self) -> QueueStatus:
        """Numbers of unfinished jobs."""
        with self._glancing() as session:
            counted = select(
                JobRow.state, func.count(), func.sum(JobRow.input_bytes), func.min(JobRow.created_at)
            )
            rows = session.execute(counted.where(JobRow.state.in_(UNFINISHED)).group_by(JobRow.state)).all()
        counts = {state: count for state, count, _, _ in rows}
        oldest = min((created for *_, created in rows), default=None)
        return QueueStatus(
            counts.get("queued", 0),
            counts.get("running", 0),
            sum(size for _, _, size, _ in rows),
            0.0 if oldest is None else max(0.0, (self._clock() - oldest).total_seconds()),
        )

    def has_job(self, job_id: str) -> bool:
        """Whether there is such a job, also if it has expired."""
        with self._glancing() as session:
            return session.execute(READ, {"of_id": job_id}).first() is not None

    def _has_expired(self, row: JobRow | Row[Any]) -> bool:
        return row.expires_at is not None and row.expires_at <= self._clock()

    def _is_expired(self) -> ColumnElement[bool]:
        return JobRow.expires_at <= self._clock()


def _id_of(report: Progress) -> str:
    return report.job_id


def _require_room(session: Session, owner: str | None, input_bytes: int, bounds: JobBounds) -> None:
    jobs, kept_bytes, own = session.execute(UNFINISHED_TOTALS, {"of_owner": owner}).one()
    if jobs >= bounds.most_jobs:
        raise QueueFull(f"{jobs} jobs are unfinished (MAX_JOBS)")
    if own >= bounds.most_jobs_of_owner:
        raise QueueFull(f"{own} jobs of this API key are unfinished (MAX_JOBS_PER_KEY)")
    if kept_bytes + input_bytes > bounds.most_input_bytes:
        raise QueueFull(f"the uploads of unfinished jobs have {kept_bytes} bytes (MAX_JOB_INPUT_BYTES)")


def _owners_in_turn(session: Session, now: datetime) -> list[tuple[int, str | None]]:
    """Pairs of priority and owner of the jobs that may start, in the order in which they are to be served."""
    waiting = session.execute(WAITING_OWNERS, {"now": now, "latest": latest(now, MOST_WAIT_S)}).all()
    if len(waiting) < 2:
        return [(priority, owner) for priority, owner, _ in waiting]
    started_at = case((JobRow.started_at <= latest(now), JobRow.started_at))
    owned = select(
        JobRow.owner, func.sum(case((JobRow.state == "running", 1), else_=0)), func.max(started_at)
    ).group_by(JobRow.owner)
    served = {owner: (running, last) for owner, running, last in session.execute(owned)}

    def turn(entry: tuple[int, str | None, datetime]) -> tuple[int, int, float, datetime]:
        priority, owner, oldest = entry
        running, last = served[owner]
        return -priority, running, 0.0 if last is None else last.timestamp(), oldest

    ordered = sorted(((priority, owner, oldest) for priority, owner, oldest in waiting), key=turn)
    return [(priority, owner) for priority, owner, _ in ordered]
