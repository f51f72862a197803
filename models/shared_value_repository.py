"""The store's calls for small values that all processes share."""

import secrets

from models.tables import SharedValueRow
from models.transactions import Transactions

SECRET_BYTES = 32


class SharedValueRepository(Transactions):
    """Values by name."""

    def secret(self, name: str) -> bytes:
        """The secret of this name, `SECRET_BYTES` random bytes; whoever asks first makes it."""
        with self._glancing() as session:
            row = session.get(SharedValueRow, name)
        if row is not None:
            return row.value
        with self._changing() as (session, _):  # of several processes one makes it
            row = session.get(SharedValueRow, name)
            if row is None:
                row = SharedValueRow(
                    name=name, value=secrets.token_bytes(SECRET_BYTES), written_at=self._clock()
                )
                session.add(row)
            return row.value

    def shared_value(self, name: str) -> bytes | None:
        """The value of this name; None: nobody has written one."""
        with self._glancing() as session:
            row = session.get(SharedValueRow, name)
        return None if row is None else row.value

    def share_value(self, name: str, value: bytes) -> None:
        """Write the value of this name in place of the one before."""
        with self._changing() as (session, _):
            session.merge(SharedValueRow(name=name, value=value, written_at=self._clock()))
