"""The statements that every job passes, made once: to make one takes as long as to execute it.

Each call is one statement where it can be, because every exchange with the server is waited for.
"""

from collections.abc import Mapping
from typing import Any, Final, cast

from sqlalchemy import (
    Row,
    String,
    Table,
    Update,
    bindparam,
    case,
    delete,
    func,
    insert,
    select,
    update,
)
from sqlalchemy.orm import Session

from models.job_records import CHANGES, FINAL_STATES
from models.tables import JobRow, UtcDateTime

UNFINISHED: Final = ("queued", "running")
JOBS: Final = cast(Table, JobRow.__table__)
_NOW: Final = bindparam("now", type_=UtcDateTime())
_NEW_STATE: Final = bindparam("new_state", type_=String())
_IS_OF_OWNER: Final = JOBS.c.owner.is_not_distinct_from(bindparam("of_owner"))
_LATEST: Final = bindparam("latest", type_=UtcDateTime())
"""Later times are of a clock that was wrong (`models.clocks`)."""
_MAY_START: Final = (JOBS.c.state == "queued") & ((JOBS.c.ready_at <= _NOW) | (JOBS.c.ready_at > _LATEST))


class StateChange:
    """An update of one row with a new revision. PostgreSQL notifies those who listen of it with the commit."""

    def __init__(self, statement: Update) -> None:
        changed = statement.values(revision=JOBS.c.revision + 1).returning(*JOBS.c)
        notified = func.pg_notify(CHANGES, func.concat(JOBS.c.id, " ", JOBS.c.revision))
        self._by_dialect = {"postgresql": changed.returning(notified), "sqlite": changed}

    def execute(self, session: Session, values: Mapping[str, object]) -> Row[Any] | None:
        """The changed row; None if there was none to change."""
        statement = self._by_dialect[session.get_bind().dialect.name]
        return session.execute(statement, values).one_or_none()


ADD: Final = insert(JOBS).returning(*JOBS.c)
READ: Final = select(JOBS).where(JOBS.c.id == bindparam("of_id"))
REVISIONS: Final = select(JOBS.c.id, JOBS.c.revision).where(JOBS.c.id.in_(bindparam("ids", expanding=True)))
UNFINISHED_TOTALS: Final = select(
    func.count(),
    func.coalesce(func.sum(JOBS.c.input_bytes), 0),
    func.coalesce(func.sum(case((_IS_OF_OWNER, 1), else_=0)), 0),
).where(JOBS.c.state.in_(UNFINISHED))
"""Number of unfinished jobs, bytes of their inputs, number of those of `of_owner`."""
WAITING_OWNERS: Final = (
    select(JOBS.c.priority, JOBS.c.owner, func.min(JOBS.c.created_at))
    .where(_MAY_START)
    .group_by(JOBS.c.priority, JOBS.c.owner)
)
"""Priority, owner and the time of the oldest one of the jobs that may start `now`; `latest` is that of a wait."""
_NEXT: Final = (
    select(JOBS.c.id)
    .where(_MAY_START, JOBS.c.priority == bindparam("of_priority"), _IS_OF_OWNER)
    .order_by(case((JOBS.c.created_at > _LATEST, 0), else_=1), JOBS.c.created_at, JOBS.c.id)
    .limit(1)
    .with_for_update(skip_locked=True)
)
CLAIM: Final = StateChange(
    update(JOBS)
    .where(JOBS.c.id == _NEXT.scalar_subquery())
    .values(
        state="running",
        token=bindparam("new_token"),
        attempts=JOBS.c.attempts + 1,
        started_at=_NOW,
        lease_until=bindparam("until"),
    )
)
"""The oldest job of a priority and an owner that may start."""
_END: Final = update(JOBS).values(
    state=_NEW_STATE,
    token=None,
    lease_until=None,
    ended_at=_NOW,
    expires_at=bindparam("new_expires_at"),
    answer=bindparam("new_answer"),
    problem=bindparam("new_problem"),
    answer_key=bindparam("new_answer_key"),
    answer_bytes=bindparam("new_answer_bytes"),
    callback_at=case((JOBS.c.callback_url.is_(None), None), else_=_NOW),
    progress=case((_NEW_STATE == "succeeded", 1.0), else_=JOBS.c.progress),
)
END_BY_LEASE: Final = StateChange(
    _END.where(JOBS.c.id == bindparam("of_id"), JOBS.c.token == bindparam("of_token"))
)
END_BY_ANYBODY: Final = StateChange(
    _END.where(JOBS.c.id == bindparam("of_id"), JOBS.c.state.not_in(FINAL_STATES))
)
DELETE: Final = (
    delete(JOBS)
    .where(JOBS.c.id == bindparam("of_id"), JOBS.c.state.in_(FINAL_STATES))
    .returning(JOBS.c.input_key, JOBS.c.answer_key)
)
"""A job that has ended."""
