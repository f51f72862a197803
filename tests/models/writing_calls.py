"""Every call of the store that writes, on one small world, so that tests can have any two of them meet."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy import LargeBinary, select

from models.documents import decode_document
from models.errors import StoreError, StoreUnavailable
from models.feedback_records import FeedbackDraft, ModelChange, ModelUndo
from models.job_records import Delivery, JobBounds, JobDraft, JobEnd, Progress
from models.records import ReviewDraft, UploadBounds, UploadPiece
from models.repository import Store, utc_now
from models.tables import Table
from tests.models.feedback_drafts import draft
from tests.models.job_requests import RECTIFY

ROOM = JobBounds(4, 4, 1000)
"""The world has three unfinished jobs: there is room for one more."""
UPLOAD_ROOM = UploadBounds(3, 2, 20)
"""The world has one upload of 10 bytes: there is room for one more."""
_DONE = JobEnd("succeeded", {"status": 200, "headers": []}, None, 0)
_DIED = JobEnd("failed", None, None, 0, {"code": "worker-died"})
_THEN = datetime(2026, 11, 26, tzinfo=UTC)
_ID = re.compile(r"\b(?:[0-7][0-9A-HJKMNP-TV-Z]{25}|[0-9a-f]{32})\b")
_SECRETS = {"claim", "token"}


@dataclass(frozen=True, slots=True)
class World:
    """What is there before two calls meet; ids and secrets of it."""

    claimed: str = ""
    claim: str = ""
    free: str = ""
    corrected: str = ""
    corrections: frozenset[str] = frozenset()
    unknown: str = ""
    sample: str = ""
    queued: str = ""
    running: str = ""
    token: str = ""
    done: str = ""
    kept: str = ""
    upload: str = ""


def make_pages(store: Store) -> World:
    """Two classes, and three results in the queue: one of them verified, one claimed."""
    for version in (1, 2):
        store.add_version("letter", {"n": version}, "import")
    store.add_version("memo", {"n": 1}, "import")
    sample = store.add_sample("letter", {"page": "posted"}, key="sample").id
    claimed, free, corrected = (
        store.add_result({"result": {}, "page": {"n": n}}, 3600, None, None, _place(n)) for n in (1, 2, 3)
    )
    claim, _ = store.claim_review(claimed, "anna", 600, None)
    store.add_feedback(_feedback(corrected, "first"), [ModelChange("letter", {"n": 3}, 2)])
    unknown_result = store.add_result({"result": {}}, 3600)
    store.add_feedback(
        draft(unknown_result, "none", found=None, verified=None, sample=None, unknown="page"), []
    )
    [page] = store.each_unknown_page()
    store.remember_cameras(None, {"camera": [(0.1, 0.2)]})
    corrections = store.feedback_ids(corrected)
    upload = store.add_upload(10, "a.jpg", None, 3600, UPLOAD_ROOM)
    store.add_piece(upload.id, 0, UploadPiece("first", 4))
    kept, _ = store.add_kept_pages([{"answer": 0}, {"answer": 0}], 3600, None)
    return World(claimed, claim, free, corrected, corrections, page.id, sample, kept=kept, upload=upload.id)


def make_jobs(store: Store) -> World:
    """Jobs in every state."""
    done = _add_job(store, callback_url="https://example.org/")
    lease = store.claim_job(60)
    assert lease is not None
    assert store.end_job(done, lease.token, _DONE, 3600)
    running = _add_job(store)
    lease = store.claim_job(-1)  # its worker is dead
    assert lease is not None
    queued = _add_job(store, repeat_key="key", digest="digest")
    _add_job(store)
    return World(queued=queued, running=running, token=lease.token, done=done)


def _place(gain: float) -> ReviewDraft:
    return ReviewDraft(gain, 0.5, "letter", 3, "review")


def _feedback(result_id: str, request: str) -> FeedbackDraft:
    return draft(result_id, request, sample=f"page of {request}")


def _add_job(store: Store, repeat_key: str | None = None, digest: str | None = None, **more: Any) -> str:
    id = f"{_add_job.__name__}-{utc_now().timestamp():f}".encode().hex()[-32:]
    job = JobDraft(id, None, "rectify", RECTIFY, f"jobs/{id}/input", 10, repeat_key, digest, **more)
    return store.add_job(job, ROOM)[0].id


def _undo(store: Store, world: World) -> object:
    undone = [ModelUndo("letter", {"n": 2}, 3, (3,), True)]
    return bool(store.undo_feedback(world.corrected, undone, world.corrections))


def _correct_again(store: Store, world: World) -> object:
    undone = [ModelUndo("letter", {"n": 2}, 3, (3,), True)]
    feedback, change = _feedback(world.corrected, "second"), ModelChange("letter", {"n": 4}, 3)
    return store.add_feedback(feedback, [change], undone=undone, seen=world.corrections).created


def _verify(store: Store, result_id: str, request: str, expected: int = 3) -> object:
    change = ModelChange("letter", {"n": 4}, expected)
    return store.add_feedback(_feedback(result_id, request), [change], max_samples=2).created


Call = Callable[[Store, World], object]
PAGE_CALLS: dict[str, Call] = {
    "claim": lambda store, world: bool(store.claim_review(world.free, "ben", 60, None)),
    "claim a claimed page": lambda store, world: bool(store.claim_review(world.claimed, "ben", 60, None)),
    "renew a claim": lambda store, world: bool(store.claim_review(world.claimed, "anna", 60, world.claim)),
    "skip": lambda store, world: store.release_review(world.free, None, skip=True),
    "skip the claimed page": lambda store, world: store.release_review(world.claimed, world.claim, skip=True),
    "release": lambda store, world: store.release_review(world.claimed, world.claim),
    "recognize again": lambda store, world: store.replace_recognition(
        world.claimed, world.claim, {"result": {}, "again": 1}, _place(7)
    ),
    "place": lambda store, world: store.place_reviews(
        {world.free: _place(8), world.claimed: _place(9), world.corrected: _place(9)}, 3
    ),
    "verify the free page": lambda store, world: _verify(store, world.free, "free"),
    "verify the claimed page": lambda store, world: _verify(store, world.claimed, "claimed"),
    "correct again": _correct_again,
    "undo": _undo,
    "delete a result": lambda store, world: len(store.delete_result(world.claimed)),
    "delete the free result": lambda store, world: len(store.delete_result(world.free)),
    "delete the corrected result": lambda store, world: len(store.delete_result(world.corrected)),
    "purge": lambda store, world: store.purge_results(keep_newest=1),
    "add a result": lambda store, world: bool(store.add_result({"result": {}}, 60)),
    "forget an unknown page": lambda store, world: store.forget_unknown_pages([world.unknown]),
    "delete a model": lambda store, world: store.delete_model("letter"),
    "add a version": lambda store, world: store.add_version("letter", {"n": 5}, "train").version,
    "expect a version": lambda store, world: (
        store.add_version("letter", {"n": 6}, "train", expected_version=3).version
    ),
    "roll back": lambda store, world: store.rollback("letter", 1, 3).version,
    "settings": lambda store, world: store.change_settings("letter", genre="letters").genre,
    "continue": lambda store, world: store.change_settings("letter", continues="memo").continues,
    "continue the other way": lambda store, world: (
        store.change_settings("memo", continues="letter").continues
    ),
    "add a sample": lambda store, world: store.add_sample("letter", {"page": "new"}, max_samples=3).created,
    "add a sample of a key": lambda store, world: (
        store.add_sample("letter", {"page": "new"}, key="new", max_samples=3).created
    ),
    "add a class": lambda store, world: store.add_sample("fax", {"n": 1}, max_models=3).created,
    "import a class": lambda store, world: store.add_version("fax", {}, "import", max_models=3).version,
    "replace a sample": lambda store, world: store.replace_sample("letter", world.sample, {"page": "new"}),
    "delete a sample": lambda store, world: store.delete_sample("letter", world.sample),
    "delete later samples": lambda store, world: store.delete_samples_after("letter", 2),
    "remember a camera": lambda store, world: store.remember_cameras(None, {"camera": [(0.3, 0.4)]}),
    "forget a camera": lambda store, world: store.forget_camera(None, "camera"),
    "keep pages": lambda store, world: bool(store.add_kept_pages([{"answer": 1}, {"answer": 2}], 3600, None)),
    "change a kept page": lambda store, world: store.change_kept_page(world.kept, {"answer": 3}),
    "delete a kept page": lambda store, world: store.delete_kept_page(world.kept),
    "purge kept pages": lambda store, world: store.purge_kept_pages(keep_newest=1),
    "begin an upload": lambda store, world: store.add_upload(6, None, None, 60, UPLOAD_ROOM).received,
    "send a piece": lambda store, world: store.add_piece(world.upload, 4, UploadPiece("second", 3)).received,
    "send another piece": lambda store, world: (
        store.add_piece(world.upload, 4, UploadPiece("other", 6)).received
    ),
    "delete an upload": lambda store, world: store.delete_upload(world.upload),
    "purge uploads": lambda store, world: store.purge_uploads(),
}
JOB_CALLS: dict[str, Call] = {
    "accept": lambda store, world: bool(_add_job(store)),
    "accept a key again": lambda store, world: bool(_add_job(store, repeat_key="key", digest="digest")),
    "accept a new key": lambda store, world: bool(_add_job(store, repeat_key="new", digest="digest")),
    "accept a key of other work": lambda store, world: bool(
        _add_job(store, repeat_key="new", digest="other")
    ),
    "find a key": lambda store, world: bool(store.repeated_job("key", "digest")),
    "claim a job": lambda store, world: bool(store.claim_job(60)),
    "renew": lambda store, world: len(
        store.renew_leases([Progress(world.running, world.token, "text", 0.5)], 60)
    ),
    "finish": lambda store, world: store.end_job(world.running, world.token, _DONE, 3600),
    "cancel": lambda store, world: store.end_job(world.running, None, _DIED, 3600),
    "cancel what waits": lambda store, world: store.end_job(world.queued, None, _DIED, 3600),
    "hand back": lambda store, world: store.return_job(world.running, world.token, 0, is_attempt=False),
    "settle": lambda store, world: store.settle_stalled_jobs(2, lambda job: _DIED, 3600, 60),
    "delete": lambda store, world: bool(store.delete_job(world.done)),
    "purge jobs": lambda store, world: len(store.purge_jobs(0, 0)),
    "claim a callback": lambda store, world: store.claim_callback(60) is not None,
    "note a delivery": lambda store, world: store.note_delivery(
        world.done, Delivery(_THEN, 200, None, 0.1), None
    ),
}


def outcome(call: Call, store: Store, world: World) -> object:
    """What a call returns, or the name of its refusal. Raises what is no refusal: the database failed."""
    try:
        return call(store, world)
    except StoreUnavailable:
        raise
    except StoreError as error:
        return type(error).__name__


def masked_rows(store: Store) -> list[tuple[Any, ...]]:
    """All rows without what differs from one world to the next: ids, secrets and times."""
    rows: list[tuple[Any, ...]] = []
    with store._reading() as session:
        tables = {name: table for name, table in Table.metadata.tables.items() if name != "store_state"}
        names = {id: name for id, name in session.execute(select(*_columns("layout_models", "id", "name")))}
        for name, table in tables.items():
            columns = tuple(table.columns)
            for row in session.execute(select(*columns)):
                values = dict(zip((column.key for column in columns), row, strict=True))
                for column in columns:
                    if isinstance(column.type, LargeBinary) and values[column.key] is not None:
                        values[column.key] = decode_document(values[column.key], dict)
                if "model_id" in values:
                    values["model_id"] = names[values["model_id"]]
                values = {key: _masked(key, value) for key, value in values.items()}
                rows.append((name, *values.items()))
    return sorted(rows, key=repr)


def _columns(table: str, *names: str) -> list[Any]:
    return [Table.metadata.tables[table].c[name] for name in names]


def _masked(key: str, value: Any) -> Any:
    if isinstance(value, datetime):
        return "later" if value > utc_now() + timedelta(seconds=1) else "time"
    if key == "id" or (key in _SECRETS and value is not None):
        return "#"
    return value if isinstance(value, int | float | None) else _ID.sub("#", str(value))
