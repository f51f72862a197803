"""The store's calls for small values that all processes share."""

import secrets
from datetime import timedelta

from sqlalchemy import delete, select

from models.clocks import latest
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

    def show_presence(self, kind: str, own: str, lasts_s: float) -> list[str]:
        """Write that `own` is there, for `lasts_s` seconds; the others of its kind that are there."""
        now = self._clock()
        of_kind = SharedValueRow.name.startswith(f"{kind} ", autoescape=True)
        with self._changing() as (session, _):
            session.merge(SharedValueRow(name=f"{kind} {own}", value=b"", written_at=now))
            session.flush()
            oldest = now - timedelta(seconds=lasts_s)
            is_past = (SharedValueRow.written_at < oldest) | (SharedValueRow.written_at > latest(now))
            session.execute(delete(SharedValueRow).where(of_kind, is_past))
            names = session.execute(select(SharedValueRow.name).where(of_kind)).scalars().all()
        return sorted(name.partition(" ")[2] for name in names if name != f"{kind} {own}")

    def end_presence(self, kind: str, own: str) -> None:
        """Write that `own` is there no longer."""
        with self._changing() as (session, _):
            session.execute(delete(SharedValueRow).where(SharedValueRow.name == f"{kind} {own}"))
