"""Any history of feedback, samples and deletions, beside the plainest store there can be: lists in memory."""

import itertools
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hypothesis import Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from models.errors import KeyReused, ModelNotFound, SampleNotFound, StoreFull, VersionConflict
from models.feedback_records import FeedbackDraft, ModelChange
from models.repository import Store, utc_now
from models.ulid import UlidFactory
from tests.models.conftest import Clock
from tests.models.databases import make_file

CLASSES = st.sampled_from(["letter", "memo", "fax"])
RESULTS = [UlidFactory().make(utc_now()) for _ in range(4)]
MOST_SAMPLES = 4


@dataclass
class PlainSample:
    page: str
    by_feedback: bool
    result: str | None
    id: str = ""


@dataclass
class PlainClass:
    documents: dict[int, Any] = field(default_factory=dict)
    version: int | None = None
    last: int = 0
    samples: list[PlainSample] = field(default_factory=list)
    alive: bool = True

    def append(self, document: Any) -> tuple[int | None, int]:
        old, new = self.version, self.last + 1
        self.documents[new] = document
        self.version = self.last = new
        return old, new


@dataclass
class PlainFeedback:
    id: str
    result: str
    body: str
    key: str | None
    verified: str | None
    about: set[str]
    versions: dict[str, tuple[int | None, int]]
    sample: PlainSample | None


class FeedbackHistory(RuleBasedStateMachine):
    """What the store says after every step is what the lists say."""

    template: Path

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp())
        shutil.copy(self.template, self.folder / "store.sqlite3")
        self.store = Store.open(self.folder / "store.sqlite3", clock=Clock())
        self.numbers = itertools.count()
        self.classes: dict[str, PlainClass] = {}
        self.feedbacks: list[PlainFeedback] = []

    def teardown(self) -> None:
        self.store.close()
        shutil.rmtree(self.folder)

    def alive(self) -> dict[str, PlainClass]:
        return {name: each for name, each in self.classes.items() if each.alive}

    def revived(self, name: str) -> PlainClass:
        each = self.classes.setdefault(name, PlainClass())
        each.alive = True
        return each

    @rule(name=CLASSES)
    def import_model(self, name: str) -> None:
        document = {"n": next(self.numbers)}
        _, version = self.revived(name).append(document)
        assert self.store.add_version(name, document, "import").version == version

    @rule(name=CLASSES, page=st.sampled_from("abc"))
    def post_sample(self, name: str, page: str) -> None:
        known = self.alive().get(name, PlainClass()).samples
        same = [sample for sample in known if sample.page == page]
        if not same and len(known) >= MOST_SAMPLES:
            with_error(
                StoreFull, lambda: self.store.add_sample(name, {"page": page}, max_samples=MOST_SAMPLES)
            )
            return
        stored = self.store.add_sample(name, {"page": page}, max_samples=MOST_SAMPLES)
        assert stored.created == (not same)
        if same:
            same[0].by_feedback = False
        else:
            self.revived(name).samples.append(PlainSample(page, False, None, stored.id))

    @precondition(lambda self: any(each.samples for each in self.alive().values()))
    @rule(data=st.data())
    def delete_sample(self, data: st.DataObject) -> None:
        name = data.draw(st.sampled_from(sorted(n for n, each in self.alive().items() if each.samples)))
        sample = data.draw(st.sampled_from(self.classes[name].samples))
        self.store.delete_sample(name, sample.id)
        self.drop(sample)
        with_error(SampleNotFound, lambda: self.store.sample(name, sample.id))

    def drop(self, sample: PlainSample) -> None:
        for each in self.classes.values():
            each.samples = [other for other in each.samples if other is not sample]
        for feedback in self.feedbacks:
            feedback.sample = None if feedback.sample is sample else feedback.sample

    @precondition(lambda self: self.alive())
    @rule(data=st.data())
    def delete_model(self, data: st.DataObject) -> None:
        name = data.draw(st.sampled_from(sorted(self.alive())))
        self.store.delete_model(name)
        for sample in list(self.classes[name].samples):
            self.drop(sample)
        self.classes[name].alive, self.classes[name].version = False, None
        self.classes[name].documents.clear()
        left = []
        for feedback in self.feedbacks:
            was_about = name in feedback.about
            feedback.about.discard(name)
            feedback.versions.pop(name, None)
            if not was_about or (feedback.about and feedback.verified != name):
                left.append(feedback)
        self.feedbacks = left

    @precondition(lambda self: any(each.documents for each in self.alive().values()))
    @rule(data=st.data())
    def roll_back(self, data: st.DataObject) -> None:
        name = data.draw(st.sampled_from(sorted(n for n, each in self.alive().items() if each.documents)))
        plain = self.classes[name]
        wanted = data.draw(st.sampled_from(sorted(plain.documents)))  # numbers go on after a deletion
        document = plain.documents[wanted]
        made = self.store.rollback(name, wanted, expected_version=plain.version)
        assert (made.version, made.document) == (plain.append(document)[1], document)

    @rule(
        result=st.sampled_from(RESULTS),
        body=st.sampled_from("abcd"),
        key=st.none() | st.sampled_from("xy"),
        found=st.none() | CLASSES,
        verified=st.none() | CLASSES,
        changed=st.sets(CLASSES),
        is_late=st.integers(0, 9).map(lambda number: number == 0),
    )
    def add_feedback(
        self,
        result: str,
        body: str,
        key: str | None,
        found: str | None,
        verified: str | None,
        changed: set[str],
        is_late: bool,
    ) -> None:
        draft = FeedbackDraft(
            result_id=result,
            key=key,
            request={"body": body},
            report={"of": body},
            found_class=found,
            verified_class=verified,
            zones=2,
            wrong_zones=1,
            class_wrong=found != verified,
            sample={"page": body},
        )
        alive = self.alive()
        names = sorted(changed & alive.keys())
        documents = {name: {"n": next(self.numbers)} for name in names}
        expected = {name: alive[name].version for name in names}
        if is_late and names:
            expected[names[-1]] = alive[names[-1]].last + 7
        changes = [ModelChange(name, documents[name], expected[name]) for name in names]

        by_key = [each for each in self.feedbacks if key is not None and each.key == key]
        same = by_key or [each for each in self.feedbacks if (each.result, each.body) == (result, body)]
        if by_key and (by_key[0].result, by_key[0].body) != (result, body):
            with_error(KeyReused, lambda: self.store.add_feedback(draft, changes))
        elif same:
            repeated = self.store.add_feedback(draft, changes)
            assert not repeated.created
            assert (repeated.id, dict(repeated.versions)) == (same[0].id, same[0].versions)
            same[0].key = same[0].key or key  # a key is bound to the feedback that it came with first
        elif is_late and names:
            with_error(VersionConflict, lambda: self.store.add_feedback(draft, changes))
        elif verified is not None and verified not in alive:
            with_error(ModelNotFound, lambda: self.store.add_feedback(draft, changes))
        else:
            stored = self.store.add_feedback(draft, changes, max_samples=MOST_SAMPLES)
            assert stored.created
            versions = {name: alive[name].append(documents[name]) for name in names}
            sample = self.take_sample(result, verified, body)
            if sample is not None and not sample.id:
                sample.id = str(stored.sample_id)
            about = {name for name in (found, verified, *names) if name in alive}
            kept = PlainFeedback(stored.id, result, body, key, verified, about, versions, sample)
            self.feedbacks.append(kept)
            assert dict(stored.versions) == versions

    def take_sample(self, result: str, verified: str | None, page: str) -> PlainSample | None:
        """Replace the sample of an earlier feedback on the result by this page."""
        for feedback in self.feedbacks:
            feedback.sample = None if feedback.result == result else feedback.sample
        for name, plain in self.alive().items():
            for sample in list(plain.samples):
                is_it = (name, sample.page) == (verified, page)
                if sample.by_feedback and sample.result == result and not is_it:
                    heirs = [each.result for each in self.feedbacks if each.sample is sample]
                    if heirs:
                        # Which one inherits does not show, as long as it is one of them.
                        sample.result = self.store.sample(name, sample.id).result_id
                        assert sample.result in heirs
                    else:
                        self.drop(sample)
        if verified is None:
            return None
        samples = self.classes[verified].samples
        same = [sample for sample in samples if sample.page == page]
        if same:
            return same[0]
        if len(samples) >= MOST_SAMPLES:
            by_feedback = [sample for sample in samples if sample.by_feedback]
            if not by_feedback:
                return None
            self.drop(by_feedback[0])
        self.classes[verified].samples.append(PlainSample(page, True, result))
        return self.classes[verified].samples[-1]

    @invariant()
    def tells_the_same(self) -> None:
        alive = self.alive()
        assert {model.name: model.version for model in self.store.models()} == {
            name: plain.version for name, plain in alive.items()
        }
        for name, plain in alive.items():
            if plain.version is not None:
                assert self.store.model(name).document == plain.documents[plain.version]
            assert len(self.store.model_versions(name)) == len(plain.documents)
            assert [(each.id, each.document["page"], each.origin) for each in self.store.samples(name)] == [
                (each.id, each.page, "feedback" if each.by_feedback else "posted") for each in plain.samples
            ]
            assert [as_told(each) for each in self.store.feedbacks(name)][::-1] == [
                (each.id, each.result, each.versions, None if each.sample is None else each.sample.id)
                for each in self.feedbacks
                if name in each.about
            ]


def as_told(feedback: Any) -> tuple[str, str, Mapping[str, Any], str | None]:
    return feedback.id, feedback.result_id, dict(feedback.versions), feedback.sample_id


def with_error(kind: type[Exception], ask: Any) -> None:
    try:
        ask()
    except kind:
        return
    raise AssertionError(f"{kind.__name__} was expected")


def test_any_history_of_feedback(tmp_path: Path) -> None:
    FeedbackHistory.template = make_file(tmp_path / "template.sqlite3")
    case = FeedbackHistory.TestCase
    case.settings = settings(
        max_examples=10,
        stateful_step_count=20,
        phases=[
            Phase.generate
        ],  # every step is of many transactions: to find the shortest history takes minutes
        deadline=None,
        derandomize=True,
    )
    case().runTest()
