"""What feedback tells of a model's health, and the way back to an earlier version."""

import random
from dataclasses import replace

import pytest
from sqlalchemy import event

from models.errors import ModelNotFound, VersionConflict
from models.feedback_records import ModelHealth
from models.feedback_repository import HEALTH_WINDOW
from models.repository import Store
from tests.models.conftest import Clock
from tests.models.feedback_drafts import draft
from tests.models.whole_database import everything


def test_feedbacks_are_told_newest_first(letters: Store) -> None:
    ids = [letters.add_feedback(draft(letters.add_result({}, ttl_s=1), n), []).id for n in range(5)]
    assert [feedback.id for feedback in letters.feedbacks("letter")] == ids[::-1]
    assert [feedback.id for feedback in letters.feedbacks("letter", newest=2)] == [ids[4], ids[3]]


def test_health_is_told_from_recent_feedback(letters: Store, clock: Clock) -> None:
    none = ModelHealth(0, 0, None, None, None, None)
    assert letters.healths() == {"letter": none, "memo": none, "fax": none}
    for n in range(HEALTH_WINDOW + 10):
        # The first ten are wrong in half of their zones, the others in a tenth; every fifth was found as a memo.
        said = draft(
            letters.add_result({}, ttl_s=1),
            n,
            found="letter" if n % 5 else "memo",
            wrong=5 if n < 10 else 1,
            sample=None,
        )
        letters.add_feedback(said, [])
    health = letters.health("letter")
    assert (health.feedbacks, health.recent) == (60, 50)
    assert health.recent_zone_error == pytest.approx(0.1)
    assert health.recent_class_error == pytest.approx(0.2)
    assert health.earlier_zone_error == pytest.approx(0.5)
    assert health.last_feedback_at == letters.feedbacks("letter")[0].created_at <= clock.now
    memo = letters.health("memo")
    assert (memo.feedbacks, memo.recent, memo.recent_class_error) == (12, 12, 1.0)
    assert memo.earlier_zone_error is None
    assert letters.healths() == {"letter": health, "memo": memo, "fax": none}
    assert health.recent_text_error is None
    for texts in ((90, 9), (10, 0)):
        said = replace(
            draft(letters.add_result({}, ttl_s=1), texts), letters=texts[0], wrong_letters=texts[1]
        )
        letters.add_feedback(said, [])
    assert letters.health("letter").recent_text_error == pytest.approx(0.09)
    letters.add_feedback(draft(letters.add_result({}, ttl_s=1), verified="fax", zones=0, wrong=0), [])
    assert letters.health("fax").recent_zone_error is None


def test_healths_of_many_models_take_as_few_queries_as_of_one(
    letters: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every class is told as it is alone, also one without feedback and one with more than both windows hold."""
    window = 3
    monkeypatch.setattr("models.feedback_repository.HEALTH_WINDOW", window)
    rng = random.Random(3)
    for n in range(3 * window):
        found, verified = rng.choice(["letter", "memo"]), rng.choice(["letter", "memo", "letter", None])
        result = letters.add_result({}, ttl_s=1)
        letters.add_feedback(draft(result, n, found=found, verified=verified, wrong=rng.randrange(9)), [])
    assert letters.healths() == {name: letters.health(name) for name in ("fax", "letter", "memo")}
    assert letters.health("letter").feedbacks > 2 * window

    def queries() -> int:
        count = 0

        def count_one(*_: object) -> None:
            nonlocal count
            count += 1

        event.listen(letters._readers, "before_cursor_execute", count_one)
        letters.healths()
        event.remove(letters._readers, "before_cursor_execute", count_one)
        return count

    before = queries()
    for n in range(5):
        letters.add_version(f"more-{n}", {}, "import")
    assert queries() == before


def test_rollback_makes_a_new_version(letters: Store) -> None:
    letters.add_version("letter", {"n": 2}, "train")
    letters.add_version("letter", {"n": 3}, "feedback")
    revision = letters.revision()
    model = letters.rollback("letter", 1, expected_version=3)
    assert (model.version, model.document, model.origin) == (4, {"n": 1}, "rollback")
    assert letters.model_versions("letter")[-1].note == "version 1"
    assert letters.model("letter", 3).document == {"n": 3}
    assert letters.revision() > revision
    before = everything(letters)
    with pytest.raises(VersionConflict):
        letters.rollback("letter", 2, expected_version=3)
    for name, version in (("letter", 5), ("letter", 0), ("letter", 2**31), ("fax", 1), ("novel", 1)):
        with pytest.raises(ModelNotFound):
            letters.rollback(name, version)
    assert everything(letters) == before
    assert letters.rollback("letter", 2).version == 5
