"""The store's calls for taking feedback back: what a model learned since, and its versions without a lesson.

A feedback keeps its lesson: the page with the labels of all zones, and the learners of that time. A version names the
one that it was made from (`parent`), and the later one that took something back out of it (`undone_by`), so that no
later undo starts from it.
"""

from collections.abc import Collection, Mapping, Sequence, Set
from dataclasses import asdict, fields
from datetime import datetime
from typing import cast

from sqlalchemy import Row, delete, select, update
from sqlalchemy.orm import Session

from models.documents import Document, decode_document, encode_document
from models.errors import FeedbackNotFound, ModelNotFound, VersionConflict
from models.feedback_records import FeedbackUndo, Lesson, ModelPast, ModelStep, ModelUndo, NoEffect
from models.queries import (
    append_version,
    find_model,
    find_version,
    look_up_model,
    require_version,
    stored_model,
)
from models.records import RECOGNIZED, Origin, ReviewDraft, StoredModel, recognized
from models.tables import (
    FeedbackModelRow,
    FeedbackRow,
    ModelRow,
    ResultRow,
    ReviewRow,
    SampleRow,
    StateRow,
    UnknownPageRow,
    VersionRow,
)
from models.transactions import Transactions
from services.contract.layout_learning import LessonJson
from services.contract.result_json import StoredResultJson

VersionMeta = Row[int, int | None, int | None, str, str]
"""version, parent, undone_by, origin, note"""


class LessonRepository(Transactions):
    """Lessons of feedback, and taking them back."""

    def pasts(self, result_id: str) -> list[ModelPast]:
        """For every class that learned from feedback on this result, what it learned since.

        Deleted classes are left out.

        Raises `FeedbackNotFound` when there is no feedback on the result.
        """
        with self._reading() as session:
            feedback_ids = _feedback_ids(session, result_id)
            if not feedback_ids:
                raise FeedbackNotFound(f"there is no feedback on the result {result_id!r}", result_id)
            taught: dict[int, set[int]] = {}
            links = select(FeedbackModelRow.model_id, FeedbackModelRow.new_version).where(
                FeedbackModelRow.feedback_id.in_(feedback_ids), FeedbackModelRow.new_version.is_not(None)
            )
            for model_id, version in session.execute(links):
                taught.setdefault(model_id, set()).add(cast(int, version))
            sampled: dict[int, int] = {}
            samples = select(SampleRow.model_id, SampleRow.after_version).where(
                SampleRow.result_id == result_id, SampleRow.origin == "feedback"
            )
            for model_id, after_version in session.execute(samples):
                sampled[model_id] = after_version
                taught.setdefault(model_id, set())
            wanted = ModelRow.id.in_(taught) & ModelRow.deleted_at.is_(None)
            rows = session.execute(select(ModelRow).where(wanted).order_by(ModelRow.name)).scalars().all()
            return [_past(session, row, taught[row.id], sampled.get(row.id)) for row in rows]

    def feedback_ids(self, result_id: str) -> frozenset[str]:
        """Ids of all feedback on a result."""
        with self._reading() as session:
            return frozenset(_feedback_ids(session, result_id))

    def taught_models(self, result_id: str) -> list[str]:
        """Names of the classes that feedback on this result concerns."""
        with self._reading() as session:
            linked = select(FeedbackModelRow.model_id).where(
                FeedbackModelRow.feedback_id.in_(_feedback_ids(session, result_id))
            )
            names = select(ModelRow.name).where(ModelRow.id.in_(linked))
            return sorted(session.execute(names).scalars())

    def lesson(self, feedback_id: str) -> Lesson | None:
        """The lesson of a feedback; None when it is not stored."""
        with self._reading() as session:
            row = session.get(FeedbackRow, feedback_id)
            if row is None or row.lesson is None:
                return None
            links = (
                select(ModelRow.name, FeedbackModelRow.old_version, FeedbackModelRow.new_version)
                .join(ModelRow, ModelRow.id == FeedbackModelRow.model_id)
                .where(FeedbackModelRow.feedback_id == feedback_id)
            )
            versions = {name: (old, new) for name, old, new in session.execute(links) if new is not None}
            return Lesson(row.result_id, decode_document(row.lesson, LessonJson), versions)

    def any_version(self, name: str, version: int) -> StoredModel:
        """A version of a class, also of a deleted one. Raises `ModelNotFound`."""
        with self._reading() as session:
            row = session.execute(select(ModelRow).where(ModelRow.name == name)).scalar_one_or_none()
            if row is None:
                raise ModelNotFound(f"there is no model {name!r}", name)
            return stored_model(row, 0, find_version(session, row, version))

    def effects(self, versions: Mapping[str, int]) -> dict[str, NoEffect | None]:
        """For each class, why its newest version does not contain what this version of it learned; None: it does."""
        with self._reading() as session:
            made = {name: [version] for name, version in versions.items()}
            return {name: effect for (name, _), effect in effects_of(session, made).items()}

    def undo_feedback(
        self, result_id: str, undone: Sequence[ModelUndo], seen: Set[str] | None = None
    ) -> FeedbackUndo:
        """Delete the feedback on a result with its samples, and store the models without its lessons.

        This is one transaction. The result gets back the zones that were recognized. `undone` must have all models
        of `pasts`. `seen` has the ids of the feedback from which it was computed; None: they are not compared.

        Raises `FeedbackNotFound`, `ModelNotFound`, and `VersionConflict` when a model or the feedback has changed.
        """
        with self._changing() as (session, state):
            feedback_ids = _feedback_ids(session, result_id)
            if not feedback_ids:
                raise FeedbackNotFound(f"there is no feedback on the result {result_id!r}", result_id)
            require_feedback_seen(session, result_id, seen)
            now = self._clock()
            versions = take_back(session, state, result_id, undone, now)
            samples = delete_samples_of_result(session, result_id)
            session.execute(delete(UnknownPageRow).where(UnknownPageRow.result_id == result_id))
            session.execute(
                delete(FeedbackRow)
                .where(FeedbackRow.id.in_(feedback_ids))
                .execution_options(synchronize_session=False)
            )
            revise_result(session, result_id, None)
            self._list_changes(session, versions, result_id)
            return FeedbackUndo(tuple(feedback_ids), versions, samples)


def require_feedback_seen(session: Session, result_id: str, seen: Set[str] | None) -> None:
    """Raises `VersionConflict` when the feedback on a result is not that of these ids; None: any."""
    if seen is not None and seen != set(_feedback_ids(session, result_id)):
        raise VersionConflict(
            f"other feedback on the result {result_id!r} came or was deleted meanwhile", None
        )


def effects_of(
    session: Session, versions: Mapping[str, Collection[int]]
) -> dict[tuple[str, int], NoEffect | None]:
    """For versions of classes, why the newest version does not contain what they learned; None: it does.

    Classes that do not exist any more are left out.
    """
    effects: dict[tuple[str, int], NoEffect | None] = {}
    for name, made in versions.items():
        row = look_up_model(session, name)
        if row is None:
            continue
        path = {each.version: each for each in _path(session, row)}
        for version in made:
            if version not in path:
                effects[name, version] = "rolled-back"
            else:
                effects[name, version] = None if path[version].undone_by is None else "replaced"
    return effects


def take_back(
    session: Session, state: StateRow, result_id: str, undone: Sequence[ModelUndo], now: datetime
) -> dict[str, tuple[int | None, int | None]]:
    """Store the models without the lessons on a result; the version before and after of those that changed.

    Raises `ModelNotFound`, `VersionConflict`.
    """
    rows = {each.name: find_model(session, each.name) for each in undone}
    for each in undone:
        require_version(each.name, rows[each.name].version, each.expected_version)
    versions: dict[str, tuple[int | None, int | None]] = {}
    if undone:
        of_result = FeedbackRow.result_id == result_id
        session.execute(update(FeedbackRow).where(of_result).values(lesson=None))
    for each in undone:
        row, old = rows[each.name], rows[each.name].version
        if each.changes and each.document is None:
            row.version, row.updated_at = None, now
            state.revision += 1
        elif each.changes and each.document is not None:
            packed, note = encode_document(each.document), f"without the feedback on result {result_id}"
            append_version(session, state, row, packed, "undo", note, now, parent=old)
        if each.changes:
            versions[each.name] = (old, row.version)
        session.execute(
            update(VersionRow)
            .where(VersionRow.model_id == row.id, VersionRow.version.in_(each.superseded))
            .values(undone_by=row.last_version)
        )
    return versions


def revise_result(
    session: Session, result_id: str, revised: Document | None, review: ReviewDraft | None = None
) -> None:
    """Make a result that is still kept what a person has verified, or (None) what was recognized again.

    `review` is its place in the review queue; it gets the earlier one back.
    """
    row, place = session.get(ResultRow, result_id), session.get(ReviewRow, result_id)
    if row is None:
        return
    document = decode_document(row.document, StoredResultJson)
    found = recognized(document)
    if revised is not None:
        if RECOGNIZED not in document and place is not None:
            found = {
                **found,
                "review": {each.name: getattr(place, each.name) for each in fields(ReviewDraft)},
            }
        row.document = encode_document({**document, **revised, RECOGNIZED: found})
        earlier = None if review is None else asdict(review)
    elif RECOGNIZED in document:
        kept = {key: value for key, value in document.items() if key != RECOGNIZED}
        earlier = found.pop("review", None)
        row.document = encode_document({**kept, **found})
    else:
        return
    if place is not None and earlier is not None:
        for name, value in earlier.items():
            setattr(place, name, value)


def delete_samples_of_result(
    session: Session, result_id: str, kept: tuple[int, str | None] | None = None
) -> int:
    """Delete the samples made from feedback on this result; return their number.

    The one of the class and with the digest `kept` stays. A sample that feedback on another result verified too is
    assigned to that result.
    """
    deleted = 0
    session.execute(update(FeedbackRow).where(FeedbackRow.result_id == result_id).values(sample_id=None))
    made = select(SampleRow).where(SampleRow.result_id == result_id, SampleRow.origin == "feedback")
    for row in session.execute(made).scalars().all():
        if (row.model_id, row.digest) == kept:
            continue
        others = select(FeedbackRow.result_id).where(FeedbackRow.sample_id == row.id).limit(1)
        other = session.execute(others).scalar_one_or_none()
        if other is None:
            session.delete(row)
            deleted += 1
        else:
            row.result_id = other
    session.flush()
    return deleted


def _feedback_ids(session: Session, result_id: str) -> list[str]:
    wanted = select(FeedbackRow.id).where(FeedbackRow.result_id == result_id).order_by(FeedbackRow.id)
    return list(session.execute(wanted).scalars())


def _path(session: Session, row: ModelRow) -> list[VersionMeta]:
    """The versions from which the newest one was made, newest first; documents are not read."""
    columns = (
        VersionRow.version,
        VersionRow.parent,
        VersionRow.undone_by,
        VersionRow.origin,
        VersionRow.note,
    )
    wanted = select(*columns).where(VersionRow.model_id == row.id)
    versions: dict[int, VersionMeta] = {each.version: each for each in session.execute(wanted)}
    path: list[VersionMeta] = []
    at = row.version
    while at is not None and at in versions:
        path.append(versions[at])
        at = versions[at].parent
        if at is not None and at >= path[-1].version:  # a parent is always older
            break
    return path


def _past(session: Session, row: ModelRow, taught: set[int], sampled: int | None) -> ModelPast:
    """What a class learned since the first lesson; after version `sampled` came the sample from the same feedback."""
    path = _path(session, row)[::-1]
    first = next((place for place, each in enumerate(path) if each.version in taught), None)
    superseded = set(taught)
    if (
        path
        and path[0].origin in ("initialize", "feedback")
        and path[0].parent is None
        and sampled is not None
        and path[0].version > sampled  # the sample was among those of this version
    ):
        first = 0
    if first is None:
        return ModelPast(row.name, row.version, None, None, tuple(sorted(superseded)))
    first = _first_clean(path, first)
    if first == 0 and path[0].origin == "initialize":
        superseded.add(path[0].version)
    of_version = {
        link.new_version: link.feedback_id
        for link in session.execute(
            select(FeedbackModelRow).where(FeedbackModelRow.model_id == row.id)
        ).scalars()
    }
    steps = tuple(
        ModelStep(
            each.version,
            cast(Origin, each.origin),
            each.note,
            of_version.get(each.version),
        )
        for each in path[first:]
        if each.origin not in ("undo", "rollback", "import")
        and not (each.origin == "feedback" and (each.undone_by is not None or each.version in taught))
    )
    return ModelPast(
        row.name, row.version, path[first - 1].version if first else None, steps, tuple(sorted(superseded))
    )


def _first_clean(path: Sequence[VersionMeta], first: int) -> int:
    """The place of the first step to be done again, so that the version before it contains nothing that was taken back.

    A version from which a later one took something back may precede `first`; the version before `first` is clean
    only if it was made after that.
    """
    moved = True
    while moved:
        moved = False
        made = {each.version for each in path[:first]}
        for place, each in enumerate(path[:first]):
            if each.undone_by is not None and each.undone_by not in made:
                first, moved = place, True
                break
    return first
