"""What must be true of the store after clients have given feedback and servers were killed."""

import sqlite3
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import psycopg

from benchmarks.learning.storm import CLASS, SAMPLES, Storm
from models.repository import Store
from services.layout.model.model_document import model_from_document

Ask = Callable[[str], list[tuple[Any, ...]]]
"""The rows of a statement, on the database itself."""
_SAMPLES_ALONE = """
SELECT id FROM layout_samples WHERE origin = 'feedback'
AND id NOT IN (SELECT sample_id FROM layout_feedback WHERE sample_id IS NOT NULL)
"""
_LINKS_ALONE = """
SELECT id FROM layout_feedback WHERE id NOT IN (SELECT feedback_id FROM layout_feedback_models)
UNION ALL
SELECT feedback_id FROM layout_feedback_models WHERE feedback_id NOT IN (SELECT id FROM layout_feedback)
"""
_PLACES_ALONE = "SELECT result_id FROM layout_reviews WHERE result_id NOT IN (SELECT id FROM layout_results)"


@contextmanager
def asking(where: Path | str) -> Iterator[Ask]:
    """Statements on the database of a file or a URL, past the store."""
    if isinstance(where, Path):
        with closing(sqlite3.connect(where)) as database:
            yield lambda statement: database.execute(statement).fetchall()
    else:
        with psycopg.connect(where, autocommit=True) as connection:
            yield lambda statement: connection.execute(statement.encode()).fetchall()


def _integrity(ask: Ask) -> list[list[object]]:
    """SQLite's checks of itself. PostgreSQL checks its references with every write."""
    [[integrity]], broken = ask("PRAGMA integrity_check"), ask("PRAGMA foreign_key_check")
    return [["PRAGMA integrity_check", integrity, "ok"], ["broken references", len(broken), 0]]


def doubts(ask: Ask, storm: Storm) -> tuple[int, int]:
    """How many undos were sent and not answered, and how many of them were done all the same."""
    ids = {row[0] for row in ask("SELECT id FROM layout_feedback")}
    return len(storm.in_doubt), sum(storm.accepted[key] not in ids for key in storm.in_doubt)


def inspect(where: Path | str, ask: Ask, first_version: int, storm: Storm) -> list[list[object]]:
    """What must be true of the database after the storm: what, what is there, what is wanted."""
    ids = {row[0] for row in ask("SELECT id FROM layout_feedback")}
    certain = {id for key, id in storm.accepted.items() if key not in storm.taken_back | storm.in_doubt}
    doubtful = {storm.accepted[key] for key in storm.in_doubt}
    undone = len(storm.taken_back) + doubts(ask, storm)[1]
    [[samples]] = ask("SELECT count(*) FROM layout_samples WHERE origin = 'feedback'")
    [[versions]] = ask("SELECT count(*) FROM layout_model_versions")
    origins = Counter(dict(ask("SELECT origin, count(*) FROM layout_model_versions GROUP BY origin")))
    with Store.open(where) as store:
        last = store.model(CLASS).version or 0
        learned, unreadable = [], 0
        for version in range(first_version, last + 1):
            document = store.model(CLASS, version).document
            try:
                learned.append(model_from_document(document).samples)
            except ValueError:
                unreadable += 1
    steps = {after - before for before, after in pairwise(learned)}
    kept = len(storm.accepted) - undone
    return [
        *(_integrity(ask) if isinstance(where, Path) else []),
        ["version of the model", last, first_version + len(storm.accepted) + undone],
        ["versions kept", versions, last],
        ["versions by feedback", origins["feedback"], len(storm.accepted)],
        ["versions by undo", origins["undo"], undone],
        ["versions that cannot be read", unreadable, 0],
        ["pages that a version has learned more or less than the one before", sorted(steps - {1, -1}), []],
        ["pages that the last version has learned", learned[-1], SAMPLES + kept],
        ["accepted feedback that is missing, its undo neither answered nor in doubt", len(certain - ids), 0],
        ["feedback that no client was told of, or that was taken back", len(ids - certain - doubtful), 0],
        ["samples by feedback", samples, kept],
        ["samples without feedback", len(ask(_SAMPLES_ALONE)), 0],
        ["feedback without its model, or links without feedback", len(ask(_LINKS_ALONE)), 0],
        ["places in the queue without a result", len(ask(_PLACES_ALONE)), 0],
        ["feedback that was answered differently the second time", storm.differing, 0],
    ]
