"""A connection to PostgreSQL that does not wait without end.

A server that is stopped, or a network that drops packets, answers neither with data nor with an error. The server's own
timeouts do not help then: it is the client that must give up.
"""

from typing import Any, ClassVar, TypeVar

import psycopg
from psycopg.errors import _WaitTimeout

T = TypeVar("T")


class BoundedConnection(psycopg.Connection[Any]):
    """A connection whose every exchange with the server is limited in time; after that it is closed."""

    longest_wait_s: ClassVar[float] = 15.0

    def wait(self, gen: Any, interval: float = 0.1, timeout: float | None = None) -> Any:
        """Result of an exchange. Raises `OperationalError`, and closes the connection, when it takes too long."""
        try:
            return super().wait(gen, interval, self.longest_wait_s if timeout is None else timeout)
        except _WaitTimeout:
            self.pgconn.finish()
            raise psycopg.OperationalError(f"no answer within {self.longest_wait_s:g} s") from None


def bounded(longest_wait_s: float) -> type[BoundedConnection]:
    """The class of connections that wait at most `longest_wait_s` seconds for an answer."""
    return type("BoundedConnection", (BoundedConnection,), {"longest_wait_s": longest_wait_s})
