"""The store's calls for document classes: versions and settings."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, fields, replace
from typing import Any, cast

from sqlalchemy import delete, select, update
from sqlalchemy.orm import Session

from models.documents import Document, encode_document
from models.errors import ModelNotFound, NotStorable
from models.queries import (
    append_version,
    count_samples,
    create_model,
    find_model,
    find_version,
    is_storable,
    is_text,
    look_up_model,
    model_summary,
    require_settings,
    require_storable,
    require_version,
    settings_of,
    stored_model,
)
from models.records import (
    ANY,
    MAX_NAME,
    ClassSummary,
    ExpectedVersion,
    ModelSettings,
    Origin,
    StoredModel,
    VersionSummary,
)
from models.tables import (
    FeedbackModelRow,
    FeedbackRow,
    ModelRow,
    SampleRow,
    StateRow,
    VersionRow,
)
from models.transactions import Transactions
from services.contract.fields import FieldSetting
from services.contract.layout_learning import DEFAULT_LEARNER

_BY_LABEL = {"fields", "elements"}
"""Settings that are a document with an entry for each label."""


class ModelRepository(Transactions):
    """Models with all their versions, and their settings."""

    def revision(self) -> int:
        """A number that grows with every new version, new class and deletion."""
        with self._reading() as session:
            return session.execute(select(StateRow.revision)).scalar_one()

    def models(self) -> list[ClassSummary]:
        """All document classes, by name."""
        with self._reading() as session:
            rows = session.execute(select(ModelRow, count_samples()).where(ModelRow.deleted_at.is_(None)))
            return sorted(
                (model_summary(row, samples) for row, samples in rows),
                key=lambda summary: summary.name,
            )

    def model(self, name: str, version: int | None = None) -> StoredModel:
        """A class with its newest version, or with version `version`. Raises `ModelNotFound`."""
        with self._reading() as session:
            row = find_model(session, name)
            version = row.version if version is None else version
            samples = session.execute(select(count_samples()).where(ModelRow.id == row.id)).scalar_one()
            if version is None:
                return stored_model(row, samples, None)
            return stored_model(row, samples, find_version(session, row, version))

    def model_summary(self, name: str) -> ClassSummary:
        """A class without its document. Raises `ModelNotFound`."""
        with self._reading() as session:
            row = find_model(session, name)
            samples = session.execute(select(count_samples()).where(ModelRow.id == row.id)).scalar_one()
            return model_summary(row, samples)

    def ready_models(self, names: Sequence[str] | None = None) -> list[StoredModel]:
        """The newest version of every class, or of the classes in `names`, by name.

        Classes without a version are left out.

        Raises `ModelNotFound` when a named class does not exist.
        """
        return list(self.each_ready_model(names))

    def each_ready_model(self, names: Sequence[str] | None = None) -> Iterator[StoredModel]:
        """Iterates over `ready_models`. Only one document is unpacked at a time."""
        if names is not None and not names:
            return
        wanted = select(ModelRow, count_samples(), VersionRow).where(ModelRow.deleted_at.is_(None))
        wanted = wanted.outerjoin(
            VersionRow, (VersionRow.model_id == ModelRow.id) & (VersionRow.version == ModelRow.version)
        )
        if names is not None:
            wanted = wanted.where(ModelRow.name.in_({name for name in names if is_storable(name)}))
        with self._reading() as session:
            rows = session.execute(wanted).all()
        missing = [name for name in names or () if name not in {row.name for row, _, _ in rows}]
        if missing:
            raise ModelNotFound(f"there is no model {missing[0]!r}", missing[0])
        for row, samples, found in sorted(rows, key=lambda each: each[0].name):
            if found is not None:
                yield stored_model(row, samples, found)

    def model_versions(
        self, name: str, newest: int | None = None, before: int | None = None
    ) -> list[VersionSummary]:
        """The versions of a class, oldest first: the `newest` ones, or all, of those before version `before`.

        Raises `ModelNotFound`.
        """
        with self._reading() as session:
            row = find_model(session, name)
            wanted = select(VersionRow.version, VersionRow.origin, VersionRow.created_at, VersionRow.note)
            wanted = wanted.where(VersionRow.model_id == row.id).order_by(VersionRow.version.desc())
            if before is not None:
                wanted = wanted.where(VersionRow.version < before)
            rows = session.execute(wanted.limit(newest)).all()
        return [
            VersionSummary(version, cast(Origin, origin), created_at, note)
            for version, origin, created_at, note in reversed(rows)
        ]

    def add_version(
        self,
        name: str,
        document: Document,
        origin: Origin,
        *,
        expected_version: ExpectedVersion = ANY,
        note: str = "",
        max_models: int | None = None,
    ) -> StoredModel:
        """Make `document` the newest version of a class. An import creates the class if it does not exist.

        Raises `VersionConflict` when the class does not have the expected version, `StoreFull` when there are
        `max_models` classes, `ModelNotFound`, `NotStorable`.
        """
        require_storable(name, "name")
        packed = encode_document(document)
        if len(note) > 10 * MAX_NAME or not is_text(note):
            raise NotStorable("the note is too long, or has characters that cannot be kept")
        with self._changing() as (session, state):
            row = look_up_model(session, name)
            if row is None and origin != "import":
                raise ModelNotFound(f"there is no model {name!r}", name)
            require_version(name, None if row is None else row.version, expected_version)
            now = self._clock()
            if row is None:
                row = create_model(session, name, now, max_models)
            parent = row.version if origin == "train" else None
            version = append_version(session, state, row, packed, origin, note, now, parent=parent)
            self._list_change(session, name, f"version {version.version}")
            samples = session.execute(select(count_samples()).where(ModelRow.id == row.id)).scalar_one()
        return stored_model(row, samples, version)

    def rollback(self, name: str, version: int, expected_version: ExpectedVersion = ANY) -> StoredModel:
        """Make the document of an earlier version the newest version. The versions in between are kept.

        Raises `VersionConflict` when the class does not have the expected version, and `ModelNotFound` when it has no
        version `version`.
        """
        with self._changing() as (session, state):
            row = find_model(session, name)
            require_version(name, row.version, expected_version)
            packed, note = find_version(session, row, version).document, f"version {version}"
            made = append_version(
                session, state, row, packed, "rollback", note, self._clock(), parent=version
            )
            self._list_change(session, name, f"version {made.version}")
            samples = session.execute(select(count_samples()).where(ModelRow.id == row.id)).scalar_one()
        return stored_model(row, samples, made)

    def settings(self, name: str) -> ModelSettings:
        """The settings of a class. Raises `ModelNotFound`."""
        with self._reading() as session:
            return settings_of(find_model(session, name))

    def change_settings(self, name: str, **changes: Any) -> ModelSettings:
        """Change the named fields of `ModelSettings` (None resets a field) and return all settings.

        Of `fields` and `elements` the given labels change (None removes one), and the others stay.

        A class that another class continues cannot continue a class itself. Raises `ModelNotFound`, also when the class
        in `continues` does not exist, and `NotStorable` when a value is not allowed.
        """
        unknown = changes.keys() - {field.name for field in fields(ModelSettings)}
        if unknown:
            raise NotStorable(f"a model has no setting {min(unknown)!r}")
        with self._changing() as (session, state):
            row = find_model(session, name)
            before = settings_of(row)
            given = {**changes, "learner": changes.get("learner", before.learner)}
            if given["learner"] is None:
                given["learner"] = DEFAULT_LEARNER
            if "items" in changes:
                given["items"] = tuple(changes["items"] or ())
            given |= {key: _merged(getattr(before, key), changes[key]) for key in _BY_LABEL & changes.keys()}
            after = replace(before, **given)
            require_settings(name, after)
            if after.continues is not None and after.continues != before.continues:
                first = find_model(session, after.continues)
                others = select(ModelRow.id).where(ModelRow.continues == name).limit(1)
                if first.continues is not None or session.execute(others).first() is not None:
                    raise NotStorable("continues: a class that continues another cannot be continued itself")
            for key, value in changes.items():
                setattr(row, key, _stored(key, getattr(after, key), value))
            if after != before:
                state.revision += 1
                self._list_change(session, name, ", ".join(sorted(changes)))
        return after

    def delete_model(self, name: str, *, expected_version: ExpectedVersion = ANY) -> None:
        """Delete a class with its versions, its samples and the feedback on its pages.

        A later class of this name continues its version numbers. Raises `ModelNotFound`, `VersionConflict`.
        """
        with self._changing() as (session, state):
            row = find_model(session, name)
            require_version(name, row.version, expected_version)
            session.execute(delete(SampleRow).where(SampleRow.model_id == row.id))
            _delete_feedback(session, row)
            session.execute(delete(VersionRow).where(VersionRow.model_id == row.id))
            session.execute(update(ModelRow).where(ModelRow.continues == name).values(continues=None))
            row.deleted_at = row.updated_at = self._clock()
            row.version = None
            state.revision += 1
            self._list_change(session, name)


def _merged(before: Mapping[str, Any], changes: Mapping[str, Any] | None) -> dict[str, Any]:
    merged = {} if changes is None else {**before, **changes}
    return {label: value for label, value in merged.items() if value is not None}


def _stored(key: str, setting: Any, given: Any) -> Any:
    """A setting as its column has it; a learner that is reset has none, so that it follows the release."""
    if key == "items":
        return encode_document({"labels": list(setting)}) if setting else None
    return _packed(setting) if key in _BY_LABEL else given


def _packed(by_label: Mapping[str, Any]) -> bytes | None:
    plain = {
        label: asdict(each) if isinstance(each, FieldSetting) else each for label, each in by_label.items()
    }
    return encode_document(plain) if plain else None


def _delete_feedback(session: Session, row: ModelRow) -> None:
    """Delete the feedback on pages of a class, and other feedback that concerns no class but this one."""
    of_class = select(FeedbackModelRow.feedback_id).where(FeedbackModelRow.model_id == row.id)
    of_others = select(FeedbackModelRow.feedback_id).where(FeedbackModelRow.model_id != row.id)
    session.execute(
        delete(FeedbackRow)
        .where(FeedbackRow.id.in_(of_class))
        .where((FeedbackRow.verified_class == row.name) | FeedbackRow.id.not_in(of_others))
        .execution_options(synchronize_session=False)
    )
    session.execute(delete(FeedbackModelRow).where(FeedbackModelRow.model_id == row.id))
