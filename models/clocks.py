"""Times that a clock has written which was wrong: ends that lie too far ahead, and the order of what came earlier.

A clock that ran ahead and was corrected leaves times in the future. A time limit that lies further ahead than it can
has ended. What has a time in the future came before the correction, so it is older than what comes now.
"""

from datetime import datetime, timedelta
from typing import Any, overload

from sqlalchemy import ColumnElement, case

from models.records import CLOCKS_DIFFER_S

Time = ColumnElement[datetime] | Any


def latest(now: datetime, longest_s: float = 0.0) -> datetime:
    """The latest end that a limit of `longest_s` seconds can have at `now`, by any clock that is right."""
    return now + timedelta(seconds=longest_s + CLOCKS_DIFFER_S)


@overload
def is_over(until: datetime, now: datetime, longest_s: float) -> bool: ...
@overload
def is_over(until: Time, now: datetime, longest_s: float) -> ColumnElement[bool]: ...
def is_over(until: Any, now: datetime, longest_s: float) -> Any:
    """Whether a limit of at most `longest_s` seconds has ended: it is in the past, or too far ahead. Also in SQL."""
    return (until <= now) | (until > latest(now, longest_s))


def oldest_first(time: Time, now: datetime) -> tuple[ColumnElement[Any], ...]:
    """The order of arrival by a column of times: those too far ahead first, since they are from before a correction."""
    return case((time > latest(now), 0), else_=1), time
