"""The store's calls for feedback: people's corrections of results, and the model versions made from them."""

from collections.abc import Sequence, Set
from dataclasses import replace
from datetime import datetime

from sqlalchemy import ColumnElement, Label, case, delete, func, literal, select, update
from sqlalchemy.orm import InstrumentedAttribute, Session, defer

from models.documents import Document, decode_document, digest_document, encode_document
from models.errors import KeyReused, NotStorable
from models.feedback_records import (
    FeedbackDraft,
    FeedbackSummary,
    GivenJson,
    ModelChange,
    ModelHealth,
    ModelUndo,
    ReportJson,
    StoredFeedback,
)
from models.lesson_repository import (
    delete_samples_of_result,
    effects_of,
    require_feedback_seen,
    revise_result,
    take_back,
)
from models.queries import (
    add_unknown_page,
    append_version,
    count_samples,
    create_model,
    find_model,
    look_up_model,
    require_result_id,
    require_storable,
    require_version,
)
from models.records import MOST_INTEGER
from models.tables import FeedbackModelRow, FeedbackRow, ModelRow, ReviewRow, SampleRow, UnknownPageRow
from models.transactions import Transactions

HEALTH_WINDOW = 50
"""Number of recent feedbacks. With it an error of 5 % has a standard deviation of 3 %."""
Versions = dict[str, tuple[int | None, int]]


class FeedbackRepository(Transactions):
    """Feedback. One transaction writes a feedback together with the versions and the sample that follow from it."""

    def find_feedback(self, result_id: str, key: str | None, request: Document) -> StoredFeedback | None:
        """The earlier feedback with this key, or with this body on this result; None without one.

        Raises `KeyReused` when the key belongs to another body or another result, and `NotStorable`.
        """
        if key is not None:
            require_storable(key, "key")
        digest = digest_document(request)
        with self._reading() as session:
            row = _look_up_feedback(session, result_id, key, digest)
            if row is None or row.key is not None or key is None:
                return None if row is None else _stored_feedback(session, row, created=False)
        with self._changing() as (session, _):
            row = _look_up_feedback(session, result_id, key, digest, bind=True)
            return None if row is None else _stored_feedback(session, row, created=False)

    def add_feedback(
        self,
        draft: FeedbackDraft,
        changes: Sequence[ModelChange],
        *,
        max_samples: int | None = None,
        max_models: int | None = None,
        undone: Sequence[ModelUndo] = (),
        seen: Set[str] | None = None,
    ) -> StoredFeedback:
        """Store a feedback with its report, the new versions of the models in `changes`, and its sample.

        One transaction writes all of it. A feedback that is stored already (`find_feedback`) is returned with `created`
        False, and nothing changes. The verified page becomes a sample. It replaces the sample of an earlier feedback on
        the same result, and is deleted from the unknown pages. When the class has `max_samples` samples, the oldest
        sample from feedback is deleted first; if all samples were posted, the page does not become a sample. The result
        itself may have expired. A claim on the page ends.

        `undone` has the models without the lessons of earlier feedback on the result. They are stored first. A change
        of such a model starts from its document there; its `expected_version` is not used. `seen` has the ids of the
        feedback on the result that the caller knew; None: they are not compared. `max_models` limits the classes where
        the draft may create one.

        Raises `VersionConflict` when a model does not have the version that its change expects, or there is other
        feedback on the result, `ModelNotFound`, `KeyReused`, `StoreFull`, `NotStorable`.
        """
        _require_feedback(draft, changes)
        digest = digest_document(draft.request)
        request, report = encode_document(draft.request), encode_document(draft.report)
        lesson = None if draft.lesson is None else encode_document(draft.lesson)
        documents = {change.name: encode_document(change.document) for change in changes}
        sample = (
            None if draft.sample is None else (encode_document(draft.sample), digest_document(draft.sample))
        )
        with self._changing() as (session, state):
            earlier = _look_up_feedback(session, draft.result_id, draft.key, digest, bind=True)
            if earlier is not None:
                return _stored_feedback(session, earlier, created=False)
            require_feedback_seen(session, draft.result_id, seen)
            now = self._clock()
            [feedback_id] = self._new_ids(session, FeedbackRow.id, now)
            if draft.may_create_class and look_up_model(session, str(draft.verified_class)) is None:
                create_model(session, str(draft.verified_class), now, max_models)
                state.revision += 1
            rows = {change.name: find_model(session, change.name) for change in changes}
            fresh = {each.name for each in undone}
            for change in (each for each in changes if each.name not in fresh):
                require_version(change.name, rows[change.name].version, change.expected_version)
            taken_back = take_back(session, state, draft.result_id, undone, now)
            links = {
                row.id: FeedbackModelRow(model_id=row.id, feedback_id=feedback_id)
                for row in (*rows.values(), *_models_of_feedback(session, draft))
            }
            # The sample comes first: it is among those of the version that learned from it.
            sample_id = self._keep_sample(session, draft, sample, max_samples, now)
            for name, row in rows.items():
                old, note = row.version, f"result {draft.result_id}"
                links[row.id].old_version = old
                append_version(session, state, row, documents[name], "feedback", note, now, parent=old)
                links[row.id].new_version = row.version
            if draft.unknown_page is not None:
                [page_id] = self._new_ids(session, UnknownPageRow.id, now)
                add_unknown_page(session, page_id, draft.result_id, draft.unknown_page, now)
            elif draft.verified_class is not None:
                known = UnknownPageRow.result_id == draft.result_id
                session.execute(delete(UnknownPageRow).where(known))
            feedback = FeedbackRow(
                id=feedback_id,
                result_id=draft.result_id,
                key=draft.key,
                digest=digest,
                found_class=draft.found_class,
                verified_class=draft.verified_class,
                zones=draft.zones,
                wrong_zones=draft.wrong_zones,
                class_wrong=draft.class_wrong,
                sample_id=sample_id,
                created_at=now,
                request=request,
                report=report,
                lesson=lesson,
                owner=draft.owner,
                letters=draft.letters,
                wrong_letters=draft.wrong_letters,
                is_corrected=draft.is_corrected,
            )
            session.add(feedback)
            session.flush()
            session.add_all(links.values())
            of_page = update(ReviewRow).where(ReviewRow.result_id == draft.result_id)
            session.execute(of_page.values(claim=None, claimed_by=None, claimed_at=None, claimed_until=None))
            if draft.revised is not None:
                revise_result(session, draft.result_id, draft.revised, draft.review)
            session.flush()
            self._list_changes(session, {*rows, *taken_back}, draft.result_id)
            stored = _stored_feedback(session, feedback, created=True)
            return replace(stored, taken_back=taken_back)

    def feedbacks(
        self, name: str, newest: int = 50, before: str | None = None, owner: str | None = None
    ) -> list[FeedbackSummary]:
        """The last feedbacks whose found or verified class is this one, newest first; of those with ids below `before`.

        `owner` limits them to those of one API key; None: of all. Raises `ModelNotFound`.
        """
        with self._reading() as session:
            of_model = select(FeedbackModelRow.feedback_id).where(
                FeedbackModelRow.model_id == find_model(session, name).id
            )
            wanted = select(FeedbackRow).where(FeedbackRow.id.in_(of_model))
            wanted = wanted.options(
                defer(FeedbackRow.request), defer(FeedbackRow.report), defer(FeedbackRow.lesson)
            )
            if before is not None:
                wanted = wanted.where(FeedbackRow.id < before)
            if owner is not None:
                wanted = wanted.where(FeedbackRow.owner == owner)
            rows = session.execute(wanted.order_by(FeedbackRow.id.desc()).limit(newest)).scalars().all()
            versions = _versions_of(session, [row.id for row in rows])
            made: dict[str, set[int]] = {}
            for of_feedback in versions.values():
                for model, (_, new) in of_feedback.items():
                    made.setdefault(model, set()).add(new)
            effects = effects_of(session, made)
        return [
            FeedbackSummary(
                id=row.id,
                result_id=row.result_id,
                found_class=row.found_class,
                verified_class=row.verified_class,
                zones=row.zones,
                wrong_zones=row.wrong_zones,
                versions=versions.get(row.id, {}),
                without_effect={
                    model: effect
                    for model, (_, new) in versions.get(row.id, {}).items()
                    if (effect := effects.get((model, new))) is not None
                },
                sample_id=row.sample_id,
                created_at=row.created_at,
            )
            for row in rows
        ]

    def health(self, name: str) -> ModelHealth:
        """The error rates of a class, computed from its feedback. Raises `ModelNotFound`."""
        with self._reading() as session:
            model_id = find_model(session, name).id
            return _healths(session, [model_id])[model_id]

    def healths(self) -> dict[str, ModelHealth]:
        """The error rates of all classes, by name."""
        with self._reading() as session:
            alive = select(ModelRow.name, ModelRow.id).where(ModelRow.deleted_at.is_(None))
            names = {name: model_id for name, model_id in session.execute(alive)}
            healths = _healths(session, list(names.values()))
        return {name: healths[model_id] for name, model_id in names.items()}

    def _keep_sample(
        self,
        session: Session,
        draft: FeedbackDraft,
        sample: tuple[bytes, str] | None,
        max_samples: int | None,
        now: datetime,
    ) -> str | None:
        """The id of the sample made from the verified page; it replaces the earlier sample of the same result."""
        model, digest = None, None
        if draft.verified_class is not None and sample is not None:
            model, digest = find_model(session, draft.verified_class), sample[1]
        delete_samples_of_result(session, draft.result_id, None if model is None else (model.id, digest))
        if model is None or sample is None:
            return None
        of_model = select(SampleRow.id).where(SampleRow.model_id == model.id)
        same = session.execute(of_model.where(SampleRow.digest == digest)).scalar_one_or_none()
        if same is not None:
            return same
        count = session.execute(select(count_samples()).where(ModelRow.id == model.id)).scalar_one()
        if max_samples is not None and count >= max_samples:
            by_feedback = of_model.where(SampleRow.origin == "feedback").order_by(SampleRow.id).limit(1)
            oldest = session.execute(by_feedback).scalar_one_or_none()
            if oldest is None:
                return None
            session.execute(delete(SampleRow).where(SampleRow.id == oldest))
        row = SampleRow(
            id=self._new_ids(session, SampleRow.id, now)[0],
            model_id=model.id,
            key=None,
            digest=sample[1],
            created_at=now,
            document=sample[0],
            origin="feedback",
            result_id=draft.result_id,
            after_version=model.last_version,
        )
        model.updated_at = now
        session.add(row)
        session.flush()
        return row.id


def _require_feedback(draft: FeedbackDraft, changes: Sequence[ModelChange]) -> None:
    require_result_id(draft.result_id)
    if draft.key is not None:
        require_storable(draft.key, "key")
    for name in (draft.found_class, draft.verified_class):
        if name is not None:
            require_storable(name, "name")
    if not 0 <= draft.wrong_zones <= draft.zones <= MOST_INTEGER:
        raise NotStorable(f"of {draft.zones} zones {draft.wrong_zones} cannot be wrong")
    if len({change.name for change in changes}) != len(changes):
        raise NotStorable("a model can change once in a feedback")


def _models_of_feedback(session: Session, draft: FeedbackDraft) -> list[ModelRow]:
    """The found and the verified class of a feedback. The found class may be deleted; the verified class must exist."""
    rows = []
    if draft.verified_class is not None:
        rows.append(find_model(session, draft.verified_class))
    if draft.found_class is not None:
        found = look_up_model(session, draft.found_class)
        rows += [] if found is None else [found]
    return rows


def _look_up_feedback(
    session: Session, result_id: str, key: str | None, digest: str, *, bind: bool = False
) -> FeedbackRow | None:
    """The feedback with this key, or with this body on this result. `bind` stores the key in it if it has none."""
    if key is not None:
        row = session.execute(select(FeedbackRow).where(FeedbackRow.key == key)).scalar_one_or_none()
        if row is not None:
            if (row.result_id, row.digest) != (result_id, digest):
                raise KeyReused("this Idempotency-Key came before, with another feedback; send a new one")
            return row
    same = select(FeedbackRow).where(FeedbackRow.result_id == result_id, FeedbackRow.digest == digest)
    row = session.execute(same).scalar_one_or_none()
    if bind and row is not None and row.key is None:
        row.key = key
    return row


def _stored_feedback(session: Session, row: FeedbackRow, *, created: bool) -> StoredFeedback:
    return StoredFeedback(
        id=row.id,
        result_id=row.result_id,
        request=decode_document(row.request, GivenJson),
        report=decode_document(row.report, ReportJson),
        versions=_versions_of(session, [row.id]).get(row.id, {}),
        sample_id=row.sample_id,
        created_at=row.created_at,
        created=created,
    )


def _versions_of(session: Session, feedback_ids: list[str]) -> dict[str, Versions]:
    """For every feedback, the version before and after it of each model that it changed, by name."""
    wanted = (
        select(
            ModelRow.name,
            FeedbackModelRow.feedback_id,
            FeedbackModelRow.old_version,
            FeedbackModelRow.new_version,
        )
        .join(ModelRow, ModelRow.id == FeedbackModelRow.model_id)
        .where(FeedbackModelRow.feedback_id.in_(feedback_ids))
        .order_by(ModelRow.name)
    )
    versions: dict[str, Versions] = {}
    for name, feedback_id, old, new in session.execute(wanted):
        if new is not None:
            versions.setdefault(feedback_id, {})[name] = (old, new)
    return versions


def _healths(session: Session, model_ids: Sequence[int]) -> dict[int, ModelHealth]:
    """Health of every class, by its id, in one query: at most two windows of feedback are read of each."""
    of_model, newest_first = FeedbackModelRow.model_id, FeedbackModelRow.feedback_id.desc()
    ranked = (
        select(
            FeedbackModelRow.model_id,
            FeedbackModelRow.feedback_id,
            func.row_number().over(partition_by=of_model, order_by=newest_first).label("place"),
            func.count().over(partition_by=of_model).label("feedbacks"),
        )
        .where(FeedbackModelRow.model_id.in_(model_ids))
        .subquery()
    )
    is_recent = ranked.c.place <= HEALTH_WINDOW

    def total(
        what: ColumnElement[int] | InstrumentedAttribute[int], where: ColumnElement[bool]
    ) -> Label[int]:
        return func.sum(case((where, what), else_=0)).label(None)

    wanted = (
        select(
            ranked.c.model_id,
            func.max(ranked.c.feedbacks),
            total(literal(1), is_recent),
            total(FeedbackRow.wrong_zones, is_recent),
            total(FeedbackRow.zones, is_recent),
            total(literal(1), is_recent & FeedbackRow.class_wrong),
            total(FeedbackRow.wrong_zones, ~is_recent),
            total(FeedbackRow.zones, ~is_recent),
            func.max(FeedbackRow.created_at),
            total(func.coalesce(FeedbackRow.letters, 0), is_recent),
            total(func.coalesce(FeedbackRow.wrong_letters, 0), is_recent),
        )
        .join(FeedbackRow, FeedbackRow.id == ranked.c.feedback_id)
        .where(ranked.c.place <= 2 * HEALTH_WINDOW)
        .group_by(ranked.c.model_id)
    )
    healths = dict.fromkeys(model_ids, ModelHealth(0, 0, None, None, None, None))
    for row in session.execute(wanted):
        id, count, recent, wrong, zones, class_wrong, earlier_wrong, earlier_zones, last, letters, edits = row
        healths[id] = ModelHealth(
            feedbacks=count,
            recent=recent,
            recent_zone_error=_share(wrong, zones),
            recent_class_error=_share(class_wrong, recent),
            earlier_zone_error=_share(earlier_wrong, earlier_zones),
            last_feedback_at=last,
            recent_text_error=_share(edits, letters),
        )
    return healths


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None
