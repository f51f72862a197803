"""`python -m benchmarks.jobs.idle_service [worker]`: the service with operations that do nothing.

What is left is the cost of the queue, and of carrying uploads.
"""

import sys
from dataclasses import fields

from services.contract.answers.rectify import PagesResult
from services.contract.images import PageReply
from services.contract.operations import Operation, Operations
from services.contract.worker_facts import WorkerFacts

PNG = b"\x89PNG\r\n\x1a\n" + bytes(100)
IDLE = "benchmarks.jobs.idle_service:answer"
MODULE = "benchmarks.jobs.idle_service"


def answer(*_: object) -> PageReply:
    """The answer to every request."""
    return PageReply(PNG, "image/png", PagesResult.model_construct(pages=[], warnings=[], timings_ms={}))


def warm_up(*_: object) -> WorkerFacts:
    """What a worker says of itself."""
    return WorkerFacts()


def main(arguments: list[str]) -> None:
    """Serve, or run jobs."""
    from app.main import create_app, serve, work  # not above: workers import this module without the app

    names = dict.fromkeys((field.name for field in fields(Operations)), Operation(IDLE))
    operations = Operations(**{**names, "warm_up": Operation(f"{MODULE}:warm_up")})
    (work if arguments == ["worker"] else serve)(create_app(operations=operations))


if __name__ == "__main__":
    main(sys.argv[1:])
