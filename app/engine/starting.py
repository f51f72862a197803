"""When a worker that starts is given up.

A start is a few seconds of processor time. On a machine that others keep busy that may take minutes, and a new attempt
would begin anew: so a worker is given up when it does nothing, not when it is slow.
"""

import asyncio
import logging
import time

from app.engine.process import WorkerProcess

log = logging.getLogger(__name__)

MOST_START_S = 900.0
"""After this a start is given up even if the worker still computes."""


async def kill_if_hung(worker: WorkerProcess, after_s: float) -> None:
    """Kill the worker when it has neither computed nor waited for a processor for `after_s` seconds."""
    begin_s, used = time.monotonic(), -1
    while time.monotonic() - begin_s < MOST_START_S:
        await asyncio.sleep(after_s)
        before, used = used, worker.used_ticks()
        if worker.pid is not None and used == before and not worker.is_runnable():
            break
    log.warning("a starting worker is given up", extra={"worker": worker.pid})
    worker.kill()
