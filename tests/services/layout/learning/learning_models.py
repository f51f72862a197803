"""Models that learn, and pages to learn from, for the tests of learning."""

from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from services.layout.graph.layout_graph import DERIVED_FEATURES, build_graph
from services.layout.model.learning_model import LearningModel, begin_learning
from services.layout.model.statistics import LabelledGraph, label_indices
from services.layout.pipeline import content_features
from tests.services.layout.samples import FIRST_UNSEEN, MAKERS, labelled_page, model_of

NAMES = content_features().names
ALL_NAMES = (*NAMES, *DERIVED_FEATURES)


def learning_model(document_class: str, samples: int = 2) -> LearningModel:
    return begin_learning(model_of(document_class, samples), ALL_NAMES)


def lesson(document_class: str, seed: int) -> LabelledGraph:
    """An unseen page with its true labels."""
    page = labelled_page(document_class, FIRST_UNSEEN + seed)
    return LabelledGraph(build_graph(page, NAMES), tuple(zone.label for zone in page.zones))


def known_lesson(learned: LearningModel, document_class: str, seed: int) -> LabelledGraph:
    """The same, labels that the model has not being null."""
    page = lesson(document_class, seed)
    labels = tuple(label if label in learned.labels else None for label in page.labels)
    return replace(page, labels=labels)


def mislabelled(learned: LearningModel, page: LabelledGraph, seed: int, share: float) -> np.ndarray:
    """A labelling (N,) that differs from the true one in about `share` of the zones, in one at least."""
    rng = np.random.default_rng(seed)
    truth = label_indices(page.labels, learned.labels)
    wrong = rng.random(len(truth)) < share
    wrong[rng.integers(len(truth))] = True
    other = (truth + rng.integers(1, len(learned.labels), len(truth))) % len(learned.labels)
    return np.where(wrong, other, truth)


classes = st.sampled_from(sorted(MAKERS))
seeds = st.integers(0, 40)
