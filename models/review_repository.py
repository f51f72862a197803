"""The store's calls for the review queue (which pages a person should look at) and for the list of changes."""

import json
import secrets
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict
from datetime import datetime, timedelta
from typing import cast

from sqlalchemy import ColumnElement, Select, and_, case, or_, select
from sqlalchemy.orm import Session

from models.clocks import latest
from models.documents import Document, decode_document, encode_document
from models.errors import Claimed, ResultNotFound
from models.feedback_records import ReportJson
from models.queries import something_wrong
from models.records import Review, ReviewDraft, ReviewOrder, ReviewState, StoredAuditEntry
from models.tables import AuditRow, FeedbackRow, ResultRow, ReviewRow
from models.transactions import Transactions
from services.contract.answers.learning import Verdict
from services.contract.result_json import StoredResultJson

_IS_VERIFIED = select(FeedbackRow.id).where(FeedbackRow.result_id == ReviewRow.result_id).exists()


class ReviewRepository(Transactions):
    """Places in the review queue, claims on them, evidence for decisions, and the list of changes."""

    def reviews(
        self,
        limit: int,
        *,
        state: ReviewState | None = None,
        order: ReviewOrder = "newest",
        after: str | None = None,
        owner: str | None = None,
        ids: Collection[str] | None = None,
    ) -> list[Review]:
        """Pages of the queue in the given order, `limit` at most, those after the cursor `after` (of `cursor_of`).

        Claimed pages keep their place. `owner` selects the results of one key, `ids` these results; None: all.

        Raises
        ------
        ValueError
            When `after` is not a cursor of this order.
        """
        is_wrong = (
            select(FeedbackRow.id)
            .where(
                FeedbackRow.result_id == ReviewRow.result_id,
                something_wrong(),
            )
            .exists()
        )
        state_of_row = case(
            (is_wrong, "corrected"),
            (_IS_VERIFIED, "confirmed"),
            (ReviewRow.is_skipped, "skipped"),
            else_="open",
        )
        wanted: Select[ReviewRow, str] = select(ReviewRow, state_of_row).where(
            ReviewRow.expires_at > self._clock()
        )
        if owner is not None:
            wanted = wanted.where(ReviewRow.owner == owner)
        conditions: dict[ReviewState, ColumnElement[bool]] = {
            "open": ~_IS_VERIFIED & ~ReviewRow.is_skipped,
            "skipped": ~_IS_VERIFIED & ReviewRow.is_skipped,
            "corrected": is_wrong,
            "confirmed": _IS_VERIFIED & ~is_wrong,
        }
        if state is not None:
            wanted = wanted.where(conditions[state])
        wanted = _ordered(wanted, order, after).limit(limit)
        if ids is not None:
            wanted = wanted.where(ReviewRow.result_id.in_(ids))
        now = self._clock()
        with self._reading() as session:
            rows = session.execute(wanted).all()
        return [
            Review(
                id=row.result_id,
                state=cast(ReviewState, found),
                gain=row.gain,
                confidence=row.confidence,
                class_name=row.class_name,
                zones=row.zones,
                decision=row.decision,
                has_image=row.has_image,
                created_at=row.created_at,
                claimed_by=row.claimed_by if _is_claimed(row, now) else None,
                claimed_until=row.claimed_until if _is_claimed(row, now) else None,
            )
            for row, found in rows
        ]

    def claim_review(
        self, result_id: str, who: str | None, ttl_s: float, claim: str | None, *, reopen: bool = False
    ) -> tuple[str, datetime]:
        """Give a page to one person for `ttl_s` seconds: the secret of the claim, and its end. `claim` renews a claim.

        Raises `Claimed` when somebody else has the page, or, without `reopen`, when it is skipped or verified and the
        caller does not have it; and `ResultNotFound`.
        """
        with self._changing() as (session, _):
            now = self._clock()
            row = _own_review(session, result_id, claim, now)
            if not reopen and not _is_claimed(row, now) and _is_done(session, row):
                raise Claimed("this page is skipped or verified; take the next one, or send `reopen`: true")
            row.claim = row.claim if claim is not None and claim == row.claim else secrets.token_urlsafe(16)
            row.claimed_by, row.claimed_at = who, now
            row.claimed_until = now + timedelta(seconds=ttl_s)
            return row.claim, row.claimed_until

    def reviews_behind(
        self, class_name: str, version: int, ahead: int, most: int
    ) -> dict[str, StoredResultJson]:
        """Documents of results, by id, whose places in the queue are from an older version of their class's model.

        They are among the `ahead` pages of the class with the largest gain that are open and not claimed; `most` at
        most.
        """
        now = self._clock()
        first = (
            select(ReviewRow.result_id, ReviewRow.model_version)
            .where(
                ReviewRow.class_name == class_name,
                ReviewRow.expires_at > now,
                ReviewRow.is_skipped.is_(False),
                ReviewRow.decision == "review",
                or_(
                    ReviewRow.claimed_until.is_(None),
                    ReviewRow.claimed_until <= now,
                    ReviewRow.claimed_at > latest(now),
                ),
                ~_IS_VERIFIED,
            )
            .order_by(ReviewRow.gain.desc(), ReviewRow.result_id.desc())
            .limit(ahead)
        )
        with self._reading() as session:
            behind = [id for id, known in session.execute(first) if known is not None and known < version]
            documents = select(ResultRow.id, ResultRow.document).where(ResultRow.id.in_(behind[:most]))
            return {
                id: decode_document(document, StoredResultJson) for id, document in session.execute(documents)
            }

    def place_reviews(self, places: Mapping[str, ReviewDraft], version: int) -> None:
        """New gains and confidences of pages by id, from this version of their class's model.

        Pages that a newer version has placed or a person has verified, and those that are gone, stay as they are.
        """
        with self._changing() as (session, _):
            for result_id, place in places.items():
                row = session.get(ReviewRow, result_id)
                if row is None or _is_verified(session, result_id):
                    continue
                if (row.model_version or 0) < version:
                    row.gain, row.confidence, row.model_version = place.gain, place.confidence, version

    def replace_recognition(self, result_id: str, claim: str, document: Document, place: ReviewDraft) -> bool:
        """Store another recognition of a page that the caller has claimed; False if a person has verified it meanwhile.

        Raises `Claimed` when the claim has ended, and `ResultNotFound`.
        """
        with self._changing() as (session, _):
            row = _own_review(session, result_id, claim, self._clock())
            if row.claim != claim:
                raise Claimed("the claim on this page has ended; claim it again")
            if _is_verified(session, result_id):
                return False
            session.get_one(ResultRow, result_id).document = encode_document(document)
            for name, value in asdict(place).items():
                setattr(row, name, value)
            return True

    def release_review(self, result_id: str, claim: str | None, *, skip: bool = False) -> None:
        """End a claim; `skip` also takes the page out of the open ones.

        Raises `Claimed` when somebody else has the page or `claim` is not the claim on it, and `ResultNotFound`.
        """
        with self._changing() as (session, _):
            now = self._clock()
            row = _own_review(session, result_id, claim, now)
            if claim is not None and not _is_claimed(row, now):
                raise Claimed("the claim on this page has ended; claim it again")
            row.claim = row.claimed_by = row.claimed_at = row.claimed_until = None
            row.is_skipped |= skip

    def verdicts(self, class_name: str, newest: int) -> list[Verdict]:
        """What people said of zones of pages that were recognized as this class: of the newest feedbacks, newest first.

        Feedback that was taken back has none.
        """
        wanted = (
            select(FeedbackRow.result_id, FeedbackRow.report)
            .where(FeedbackRow.found_class == class_name)
            .order_by(FeedbackRow.id.desc())
            .limit(newest)
        )
        with self._reading() as session:
            rows = session.execute(wanted).all()
        verdicts: dict[str, list[Verdict]] = {}  # of each result those of the newest feedback
        for result_id, report in rows:
            of_result = decode_document(report, ReportJson).get("verdicts", [])
            if of_result and result_id not in verdicts:
                verdicts[result_id] = [(label, confidence, right) for label, confidence, right in of_result]
        return [verdict for of_result in verdicts.values() for verdict in of_result]

    def changes(
        self, limit: int, *, model: str | None = None, before: str | None = None
    ) -> Sequence[StoredAuditEntry]:
        """Entries of the list of changes, newest first; of one model, and older than the entry `before`."""
        wanted = select(AuditRow).order_by(AuditRow.id.desc()).limit(limit)
        if model is not None:
            wanted = wanted.where(AuditRow.model == model)
        if before is not None:
            wanted = wanted.where(AuditRow.id < before)
        with self._reading() as session:
            return [
                StoredAuditEntry(row.id, row.created_at, row.who, row.action, row.model, row.detail)
                for row in session.execute(wanted).scalars()
            ]


def _own_review(session: Session, result_id: str, claim: str | None, now: datetime) -> ReviewRow:
    """The place of a page in the queue, if nobody else has claimed it. Raises `Claimed`, `ResultNotFound`."""
    row = session.get(ReviewRow, result_id)
    if row is None or row.expires_at <= now:
        raise ResultNotFound(f"there is no result {result_id!r} in the queue", result_id)
    if _is_claimed(row, now) and row.claim != claim:
        raise Claimed("another person works on this page; take the next one, or send `claim` of your claim")
    return row


def _is_done(session: Session, row: ReviewRow) -> bool:
    """Whether the page is no longer among the open ones."""
    return row.is_skipped or _is_verified(session, row.result_id)


def _is_verified(session: Session, result_id: str) -> bool:
    return session.execute(select(_IS_VERIFIED).where(ReviewRow.result_id == result_id)).scalar_one()


def _is_claimed(row: ReviewRow, now: datetime) -> bool:
    """Whether somebody has the page. A claim that begins in the future is one of a clock that was wrong."""
    if row.claimed_until is None or row.claimed_at is None:
        return False
    return row.claimed_at <= latest(now) and row.claimed_until > now


def cursor_of(review: Review, order: ReviewOrder) -> str:
    """Place of a page in the list, from which the list goes on."""
    if order == "newest":
        return review.id
    return f"{json.dumps(review.gain if order == 'gain' else review.confidence)}_{review.id}"


def _ordered(wanted: Select[ReviewRow, str], order: ReviewOrder, after: str | None) -> Select[ReviewRow, str]:
    """Sorted by the order and then by id, newest first, beginning after the cursor."""
    key_text, _, id = (after or "").rpartition("_")
    key = float(key_text or 0.0)
    older = ReviewRow.result_id < id
    if order == "newest":
        wanted = wanted.order_by(ReviewRow.result_id.desc())
        return wanted if after is None else wanted.where(older)
    if order == "gain":
        wanted = wanted.order_by(ReviewRow.gain.desc(), ReviewRow.result_id.desc())
        following = or_(ReviewRow.gain < key, and_(ReviewRow.gain == key, older))
    else:
        wanted = wanted.order_by(ReviewRow.confidence, ReviewRow.result_id.desc())
        following = or_(ReviewRow.confidence > key, and_(ReviewRow.confidence == key, older))
    return wanted if after is None else wanted.where(following)
