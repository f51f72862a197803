"""The store's calls for samples: labelled pages of document classes."""

from collections.abc import Collection, Iterator, Sequence

from sqlalchemy import delete, select, update
from sqlalchemy.orm import Session

from models.documents import Document, digest_document, encode_document
from models.errors import KeyReused, StoreFull
from models.queries import (
    READ_AT_ONCE,
    count_samples,
    create_model,
    find_model,
    find_sample,
    find_version,
    look_up_model,
    present_ids,
    require_storable,
    stored_sample,
)
from models.records import StoredSample
from models.tables import FeedbackRow, ModelRow, SampleRow
from models.transactions import Transactions


class SampleRepository(Transactions):
    """Samples of models, posted by a client or made from feedback."""

    def add_sample(
        self,
        name: str,
        document: Document,
        *,
        key: str | None = None,
        max_samples: int | None = None,
        max_models: int | None = None,
    ) -> StoredSample:
        """Add a labelled page to a class. The first sample creates the class.

        A key or a content that is stored already adds nothing: the stored sample is returned with `created` False.
        Raises `KeyReused` when the key belongs to another content, `StoreFull` when `max_samples` or `max_models` is
        reached, `NotStorable`.
        """
        require_storable(name, "name")
        if key is not None:
            require_storable(key, "key")
        packed, digest = encode_document(document), digest_document(document)
        with self._changing() as (session, state):
            now = self._clock()
            row = look_up_model(session, name)
            if row is None:
                row = create_model(session, name, now, max_models)
                state.revision += 1
            of_model = select(SampleRow).where(SampleRow.model_id == row.id)
            if key is not None:
                earlier = session.execute(of_model.where(SampleRow.key == key)).scalar_one_or_none()
                if earlier is not None and earlier.digest != digest:
                    raise KeyReused("this Idempotency-Key came before, with another sample; send a new one")
            same = session.execute(of_model.where(SampleRow.digest == digest)).scalar_one_or_none()
            if same is not None:
                same.origin = "posted"  # feedback deletes samples of its own only
                same.key = same.key or key
                return stored_sample(same, created=False)
            count = session.execute(select(count_samples()).where(ModelRow.id == row.id)).scalar_one()
            if max_samples is not None and count >= max_samples:
                raise StoreFull(f"the model {name!r} has {count} samples, {max_samples} are allowed")
            row.updated_at = now
            sample = SampleRow(
                id=self._new_ids(session, SampleRow.id, now)[0],
                model_id=row.id,
                key=key,
                digest=digest,
                created_at=now,
                document=packed,
                after_version=row.last_version,
            )
            session.add(sample)
            session.flush()
            self._list_change(session, name, sample.id)
            return stored_sample(sample, created=True)

    def samples(self, name: str) -> list[StoredSample]:
        """All samples of a class with their documents, oldest first. Raises `ModelNotFound`."""
        with self._reading() as session:
            row = find_model(session, name)
            of_model = select(SampleRow).where(SampleRow.model_id == row.id).order_by(SampleRow.id)
            rows = session.execute(of_model).scalars().all()
        return [stored_sample(sample, created=False) for sample in rows]

    def each_sample(
        self, name: str, *, newest_first: bool = False, after: str = ""
    ) -> Iterator[StoredSample]:
        """Iterates over the samples of a class, few in memory at a time; with `after`, over those of larger ids.

        Raises `ModelNotFound` at the first step.
        """
        with self._reading() as session:
            row = find_model(session, name)
            order = SampleRow.id.desc() if newest_first else SampleRow.id
            wanted = select(SampleRow).where(SampleRow.model_id == row.id, SampleRow.id > after)
            wanted = wanted.order_by(order)
            for sample in session.execute(wanted.execution_options(yield_per=READ_AT_ONCE)).scalars():
                yield stored_sample(sample, created=False)
                session.expunge(sample)

    def sample(self, name: str, sample_id: str) -> StoredSample:
        """One sample of a class. Raises `ModelNotFound`, `SampleNotFound`."""
        with self._reading() as session:
            return stored_sample(find_sample(session, name, sample_id), created=False)

    def sample_count(self, name: str) -> int:
        """The number of samples of a class. Raises `ModelNotFound`."""
        with self._reading() as session:
            wanted = select(count_samples()).where(ModelRow.id == find_model(session, name).id)
            return session.execute(wanted).scalar_one()

    def replace_sample(self, name: str, sample_id: str, document: Document) -> None:
        """Give a sample another document; its id and its key stay. Raises `ModelNotFound`, `SampleNotFound`."""
        packed, digest = encode_document(document), digest_document(document)
        with self._changing() as (session, _):
            row = find_sample(session, name, sample_id)
            of_digest = select(SampleRow.id).where(
                SampleRow.model_id == row.model_id, SampleRow.digest == digest
            )
            row.document = packed
            if session.execute(of_digest).first() is None:  # else another sample has come to the same content
                row.digest = digest
            find_model(session, name).updated_at = self._clock()

    def kept_samples(self, sample_ids: Collection[str]) -> set[str]:
        """Those of the ids under which a sample is stored."""
        with self._reading() as session:
            return present_ids(session, SampleRow.id, sample_ids)

    def delete_sample(self, name: str, sample_id: str) -> None:
        """Delete a sample; the class remains. Raises `ModelNotFound`, `SampleNotFound`."""
        with self._changing() as (session, _):
            find_sample(session, name, sample_id)
            _delete_samples(session, [sample_id])
            find_model(session, name).updated_at = self._clock()
            self._list_change(session, name, sample_id)

    def samples_after(self, name: str, version: int) -> list[str]:
        """Ids of the samples that came after a version was made, oldest first. Raises `ModelNotFound`."""
        with self._reading() as session:
            row = find_model(session, name)
            return _samples_after(session, row, version)

    def delete_samples_after(self, name: str, version: int) -> int:
        """Delete the samples that came after a version was made; return their number. Raises `ModelNotFound`."""
        with self._changing() as (session, _):
            row = find_model(session, name)
            ids = _samples_after(session, row, version)
            _delete_samples(session, ids)
            if ids:
                row.updated_at = self._clock()
                self._list_change(session, name, f"{len(ids)} later samples deleted")
            return len(ids)


def _samples_after(session: Session, row: ModelRow, version: int) -> list[str]:
    find_version(session, row, version)
    wanted = select(SampleRow.id).where(SampleRow.model_id == row.id, SampleRow.after_version >= version)
    return list(session.execute(wanted.order_by(SampleRow.id)).scalars())


def _delete_samples(session: Session, ids: Sequence[str]) -> None:
    """Delete samples, and the pages in the lessons of the feedback that they are from."""
    session.execute(update(FeedbackRow).where(FeedbackRow.sample_id.in_(ids)).values(lesson=None))
    session.execute(delete(SampleRow).where(SampleRow.id.in_(ids)))
