"""What the parts that talk to PostgreSQL beside the store have in common."""

import re
from typing import Any, Final

import psycopg
from procrastinate.exceptions import ProcrastinateException

CONNECT: Final[dict[str, Any]] = {"connect_timeout": 5, "keepalives_idle": 30, "tcp_user_timeout": 15000}
"""libpq's settings by which a dead connection is noticed: seconds, seconds, milliseconds."""
RESTART_PAUSE_S = 1.0
"""Pause before a broken connection is made again."""
Failure = (ProcrastinateException, psycopg.Error, OSError, TimeoutError)
"""What the libraries raise when the database cannot be used."""


def conninfo_of(database_url: str) -> str:
    """DATABASE_URL in the form that libpq reads: without the name of a driver."""
    return re.sub(r"^postgres(ql)?(\+\w+)?://", "postgresql://", database_url)
