"""The store's calls for what migrations of the tables cannot do: rows of an older release are caught up with."""

from collections.abc import Callable

from sqlalchemy import func, select

from models.documents import decode_document
from models.queries import READ_AT_ONCE, review_of
from models.records import ReviewDraft
from models.tables import FeedbackModelRow, FeedbackRow, ResultRow, ReviewRow
from models.transactions import Transactions
from services.contract.result_json import ResultJson, StoredResultJson


class UpgradeRepository(Transactions):
    """What an older release stored without the things that this one needs."""

    def queue_results(self, place: Callable[[ResultJson], ReviewDraft]) -> int:
        """Put kept results of pages that are not in the review queue into it; their number.

        Releases before schema 0006 had no queue. `place` returns a result's place in it.
        """
        count = 0
        with self._changing() as (session, _):
            queued = select(ReviewRow.result_id).where(ReviewRow.result_id == ResultRow.id).exists()
            wanted = select(ResultRow).where(~queued, ResultRow.expires_at > self._clock())
            ids = session.execute(wanted.with_only_columns(ResultRow.id)).scalars().all()
            for at in range(0, len(ids), READ_AT_ONCE):
                rows = select(ResultRow).where(ResultRow.id.in_(ids[at : at + READ_AT_ONCE]))
                for row in session.execute(rows).scalars():
                    result = decode_document(row.document, StoredResultJson).get("result")
                    if result is None:  # a document is reviewed by its pages
                        continue
                    count += 1
                    session.add(review_of(row, place(result)))
                session.flush()
                session.expunge_all()
        return count

    def count_feedback_without_lessons(self) -> int:
        """Number of feedbacks that made versions of models and cannot be done again: schema 0002 kept no lessons."""
        taught = select(FeedbackModelRow.feedback_id).where(FeedbackModelRow.new_version.is_not(None))
        wanted = select(func.count()).where(FeedbackRow.lesson.is_(None), FeedbackRow.id.in_(taught))
        with self._reading() as session:
            return session.execute(wanted).scalar_one()
