"""The server that processes of tests are forked from: it has loaded what any of them imports."""

import multiprocessing

from services.contract.operations import Operations

CONTEXT = multiprocessing.get_context("forkserver")
LOADED = (
    *Operations().modules,
    "tests.app.scripted",
    "tests.app.jobs",
    "tests.models.writers",
    "sqlalchemy.dialects.sqlite",
    "sqlalchemy.dialects.postgresql",
    "psycopg",
    "tesserocr",
)


def load_for_workers() -> None:
    """Have the fork server of this process load `LOADED`, whenever it is started and whoever starts it.

    It is one for all engines and stores of a run. By itself it loads what the first of them asks for, and workers of
    the others import their modules one by one: half a second of each of some hundred workers.
    """
    load = CONTEXT.set_forkserver_preload
    CONTEXT.set_forkserver_preload = lambda names: load([*LOADED, *names])  # type: ignore[method-assign]
    load(list(LOADED))
