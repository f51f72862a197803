"""One call in the pool."""

import asyncio
import time
from dataclasses import dataclass, field
from typing import Any

from app.engine.base import TimeLimit
from services.progress import ProgressSink


@dataclass(slots=True, eq=False)
class EngineJob:
    """A call that waits for a worker or has one. `answer` is the future that its caller awaits."""

    operation: str
    arguments: tuple[object, ...]
    time_limit: TimeLimit
    progress: ProgressSink | None
    answer: "asyncio.Future[Any]"
    started: "asyncio.Future[None]"
    queued_at: float = field(default_factory=time.monotonic)

    def tell(self, stage: str, fraction: float) -> None:
        """Report progress to the caller, unless it no longer waits for the answer."""
        if self.progress is not None and not self.answer.done():
            self.progress(stage, fraction)

    def listener(self, loop: asyncio.AbstractEventLoop) -> ProgressSink | None:
        """Thread-safe form of `tell`; None if no progress is wanted."""
        if self.progress is None:
            return None

        def listen(stage: str, fraction: float) -> None:
            loop.call_soon_threadsafe(self.tell, stage, fraction)

        return listen
