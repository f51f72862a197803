"""Whatever a model holds that may be stored: when it has learned it can be stored, and read, again."""

import json
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.contract.layout_learning import Learner, VerifiedPage
from services.layout.learning.feedback import adapt_models
from services.layout.learning.training import train_in_rounds
from services.layout.model.layout_model import (
    LARGEST,
    LARGEST_SUM,
    LEAST_VARIANCE,
    MOST_BIAS,
    MOST_WEIGHT,
    LayoutModel,
)
from services.layout.model.model_document import model_from_document, model_to_document
from services.layout.pipeline import VersionedModel, content_features
from services.layout.recognition.page_recognition import recognize_page
from tests.counts import repeats
from tests.services.layout.learning.learning_models import NAMES
from tests.services.layout.samples import FIRST_UNSEEN, labelled_page, model_of

pytestmark = pytest.mark.pipeline

Document = dict[str, Any]
Pick = Callable[[Sequence[float]], float]

LEARNERS: tuple[Learner, ...] = ("passive-aggressive", "counting", "error-correction")
learners = st.sampled_from(LEARNERS)
COSTS = (-LARGEST, -800.0, 0.0, 800.0, LARGEST)
SUMS = (0.0, 1e-300, 1e-7, 0.5, 3.0, 1e9, LARGEST_SUM)
WEIGHTS = (0.0, 1.0, MOST_WEIGHT)


def odd_values(model: Document, pick: Pick) -> None:
    for node in model["nodes"]:
        for expected in node["numeric"].values():
            expected["value"] = pick(COSTS)
            expected["variance"] = pick((LEAST_VARIANCE, 1.0, LARGEST))


def odd_weights(model: Document, pick: Pick) -> None:
    model["scales"] = {name: pick(WEIGHTS) for name in model["scales"]}
    for node in model["nodes"]:
        node["content_weights"] = {name: pick(WEIGHTS) for name in node["content"]}
        for expected in node["numeric"].values():
            expected["weight"] = pick(WEIGHTS)


def odd_costs(model: Document, pick: Pick) -> None:
    for node in model["nodes"]:
        node["cost"], node["count_costs"] = pick(COSTS), [pick(COSTS) for _ in range(3)]
    for edge in model["edges"]:
        edge["costs"] = {name: [pick(COSTS) for _ in each] for name, each in edge["costs"].items()}


def odd_sums(model: Document, pick: Pick) -> None:
    memory = model["memory"]
    memory["pages"], memory["certainty"] = pick(SUMS), {name: LARGEST for name in memory["certainty"]}
    for node in memory["nodes"]:
        node["zones"], node["counts"] = pick(SUMS), [pick(SUMS) for _ in range(20)]
        node["numeric"] = {name: [pick(SUMS), -pick(SUMS), pick(SUMS)] for name in node["numeric"]}
        node["content"] = {name: [pick(SUMS), 0.0] for name in node["content"]}
    for edge in memory["edges"]:
        edge["seen"] = [pick(SUMS) for _ in edge["seen"]]


def no_memory(model: Document, pick: Pick) -> None:
    model["memory"] = None
    model["samples"] = int(pick((0.0, 1.0, LARGEST)))
    for node in model["nodes"]:
        node["zones"] = pick((0.0, 1.0, LARGEST))


def odd_calibration(model: Document, pick: Pick) -> None:
    model["calibration"] = {
        "mean": pick(COSTS),
        "deviation": pick((1e-6, LARGEST)),
        "pages": int(pick((0.0, LARGEST))),
        "bias": pick((-MOST_BIAS, MOST_BIAS)),
    }


def one_node(model: Document, pick: Pick) -> None:
    model["nodes"], model["edges"] = model["nodes"][:1], []
    if model["memory"] is not None:
        model["memory"]["nodes"], model["memory"]["edges"] = model["memory"]["nodes"][:1], []


ODDITIES = (odd_values, odd_weights, odd_costs, odd_sums, no_memory, odd_calibration, one_node)
oddities = st.lists(st.sampled_from(ODDITIES), min_size=1, max_size=3, unique=True).map(
    lambda chosen: sorted(chosen, key=ODDITIES.index)
)


def odd_model(chosen: list[Callable[[Document, Pick], None]], seed: int) -> LayoutModel:
    """A model of letters with numbers that it may have, but hardly has; a seed is drawn faster than they."""
    rng = np.random.default_rng(seed)
    document = json.loads(json.dumps(model_to_document(model_of("letter", 3))))
    for each in chosen:
        each(document, lambda numbers: float(rng.choice(numbers)))
    return model_from_document(document)


def stored(model: LayoutModel) -> LayoutModel:
    """As it is read when it has been kept; fails where it cannot be."""
    return model_from_document(json.loads(json.dumps(model_to_document(model), allow_nan=False)))


@pytest.mark.long
@pytest.mark.filterwarnings("error::RuntimeWarning")
@settings(max_examples=repeats(6, 60), deadline=None)
@given(oddities, st.integers(0, 2**32), learners, st.booleans())
def test_a_model_that_learned_can_be_read_again(
    chosen: list[Callable[[Document, Pick], None]], seed: int, learner: Learner, is_right: bool
) -> None:
    models = {"letter": odd_model(chosen, seed), "memo": model_of("memo", 3)}
    page = labelled_page("letter", FIRST_UNSEEN)
    found = {zone.id: models["letter"].labels[-1] for zone in page.zones}
    labels = {zone.id: zone.label for zone in page.zones[::2]}
    for verified in ("letter", "letter" if is_right else "memo", None):
        said = VerifiedPage(page, "letter", found, verified, labels if verified == "letter" else {})
        _, learned = adapt_models(said, models, {"letter": learner, "memo": learner}, NAMES)
        assert learned.keys() == {"letter", verified} - {None}
        models |= {name: stored(each.model) for name, each in learned.items()}
    recognition = recognize_page(page, [VersionedModel(model, 1) for model in models.values()], NAMES)
    assert np.isfinite([each.probability for each in recognition.classes]).all()
    assert len(recognition.zones) == len(page.zones)


@pytest.mark.long
@pytest.mark.filterwarnings("error::RuntimeWarning")
@settings(max_examples=repeats(4, 40), deadline=None)
@given(oddities, st.integers(0, 2**32), learners)
def test_a_model_that_was_trained_can_be_read_again(
    chosen: list[Callable[[Document, Pick], None]], seed: int, learner: Learner
) -> None:
    model = odd_model(chosen, seed)
    samples = [labelled_page("letter", FIRST_UNSEEN + number) for number in range(2)]
    trained, _ = train_in_rounds(model, samples, [None, None], 2, learner, content_features())
    assert stored(trained).labels[0] is None


@pytest.mark.parametrize("learner", LEARNERS)
def test_contradictions_over_and_over_leave_a_model_that_recognizes(learner: Learner) -> None:
    page = labelled_page("memo", FIRST_UNSEEN)
    models = {"memo": model_of("memo", 3), "letter": model_of("letter", 3)}
    labels = [label for label in models["memo"].labels if label is not None]
    for turn in range(40):
        said = {zone.id: labels[(turn + place) % 2] for place, zone in enumerate(page.zones)}
        found = {zone.id: labels[(turn + place + 1) % 2] for place, zone in enumerate(page.zones)}
        _, learned = adapt_models(
            VerifiedPage(page, "memo", found, "memo", said), models, {"memo": learner}, NAMES
        )
        models["memo"] = learned["memo"].model
    memo = stored(models["memo"])
    largest = max(abs(cost) for edge in memo.edges for row in edge.costs.values() for cost in row)
    assert largest <= 100.0
    letter = labelled_page("letter", FIRST_UNSEEN)
    recognition = recognize_page(
        letter, [VersionedModel(model, 1) for model in (memo, models["letter"])], NAMES
    )
    assert recognition.classes[0].name == "letter"
