"""Changes of jobs, as PostgreSQL notifies of them with the commit that made them."""

import asyncio
import logging

import psycopg
from psycopg import sql

from app.jobs.following import Followers
from app.jobs.postgresql import CONNECT, RESTART_PAUSE_S, Failure, conninfo_of
from models.job_records import CHANGES

log = logging.getLogger(__name__)


class ChangeListener:
    """Listens as long as the process runs, by a connection of its own; without it `Followers` look more often."""

    def __init__(self, database_url: str, followers: Followers) -> None:
        self._conninfo = conninfo_of(database_url)
        self._followers = followers
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Begin."""
        self._task = asyncio.create_task(self._keep_listening())

    async def stop(self) -> None:
        """End."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    async def _keep_listening(self) -> None:
        while True:
            try:
                await self._listen()
            except Failure as error:
                log.warning("no notifications of changes of jobs: %s", error)
            finally:
                self._followers.expect(is_notified=False)
            await asyncio.sleep(RESTART_PAUSE_S)

    async def _listen(self) -> None:
        """Raises one of `Failure` when the connection breaks."""
        connection = await psycopg.AsyncConnection.connect(self._conninfo, autocommit=True, **CONNECT)
        async with connection:
            await connection.execute(sql.SQL("LISTEN {}").format(sql.Identifier(CHANGES)))
            self._followers.expect(is_notified=True)
            async for change in connection.notifies():
                job_id, _, revision = change.payload.partition(" ")
                if revision.isdecimal():  # anybody with the database's password may send there
                    self._followers.hear(job_id, int(revision))
