"""The app behind a real server in this process."""

import json
import sqlite3
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import httpx
import uvicorn

from app.main import create_app
from app.settings import Settings
from app.storage.layout_store import DATABASE
from models.tables import Table
from services.contract.operations import Operations
from tests.app.loop_watch import LoopWatch, watched
from tests.app.scripted import OPERATIONS
from tests.app.scripted_layout import PAGE
from tests.models.databases import make_file

SETTINGS = {
    "workers": 1,
    "queue_length": 4,
    "worker_memory_bytes": 1 << 30,
    "job_timeout_s": 20.0,
    "shutdown_grace_s": 5,
    "review_ahead": 0,  # no work that no request has asked for
}
POLL_S = 0.02
"""Pause of a test between two looks at the service: without one, both would compete for the processor."""


@contextmanager
def serving(operations: Operations = OPERATIONS, **settings: object) -> Iterator[httpx.Client]:
    """A client of a service with these settings; the service is up inside of the block.

    What it remembers is gone with the block, unless `data_dir` is given.
    """
    with TemporaryDirectory() as folder:
        make_file(Path(folder) / DATABASE)
        with _serving(operations, {"data_dir": folder, **settings}) as client:
            yield client


@contextmanager
def watched_serving(operations: Operations, **settings: object) -> Iterator[tuple[httpx.Client, LoopWatch]]:
    """The same, with a watch over the steps of the service's loop. `settings` have its `data_dir`."""
    with watched() as watch, _serving(operations, settings, watch) as client:
        yield client, watch


def forget_everything(client: httpx.Client, data_dir: Path) -> None:
    """Take all rows out of the database of a running service, as if it were new."""
    state = "store_state"
    with closing(sqlite3.connect(data_dir / DATABASE)) as database, database:
        for name in sorted(set(Table.metadata.tables) - {state}):
            database.execute(f"DELETE FROM {name}")
        database.execute(f"UPDATE {state} SET revision = revision + 1")
    # The service reads its models again when the revision has changed. Here it reads that there are none, so that
    # it cannot take a later model for an earlier one of the same name and version.
    client.post("/layout", data={"zones": json.dumps(PAGE)}).raise_for_status()
    with closing(sqlite3.connect(data_dir / DATABASE)) as database, database:
        for name in ("layout_reviews", "layout_results", "layout_unknown_pages"):
            database.execute(f"DELETE FROM {name}")


@contextmanager
def _serving(
    operations: Operations, settings: dict[str, object], watch: LoopWatch | None = None
) -> Iterator[httpx.Client]:
    app = create_app(Settings(**{**SETTINGS, **settings}), operations)  # type: ignore[arg-type]
    server = uvicorn.Server(uvicorn.Config(app, port=0, lifespan="on", log_config=None, access_log=False))
    up = threading.Event()
    startup = server.startup

    async def startup_and_tell(sockets: object = None) -> None:
        try:
            await startup()
        finally:
            up.set()

    server.startup = startup_and_tell  # type: ignore[method-assign]
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        assert up.wait(60)
        assert server.started
        if watch is not None:
            watch.thread = thread.ident
        port = server.servers[0].sockets[0].getsockname()[1]
        with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=30) as client:
            yield client
    finally:
        server.should_exit = True
        thread.join(30)
        assert not thread.is_alive()
