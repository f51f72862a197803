"""Rounds of training for a model from its verified pages, which initialization has seen as well."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from services.contract.layout_learning import Learner
from services.layout.content.content_features import ContentFeatures
from services.layout.graph.layout_graph import KIND_FEATURES
from services.layout.learning.initialization import begin_model, calibrate_model, labels_of, see_samples
from services.layout.learning.rounds import Round, Stop, train
from services.layout.model.layout_model import LayoutModel
from services.layout.model.learning_model import LearningModel, begin_learning, end_learning
from services.layout.page import Page


@dataclass(frozen=True, slots=True)
class TrainedModel:
    """The model after round `kept` of `rounds`, and why there were no more."""

    model: LayoutModel
    rounds: tuple[Round, ...]
    kept: int
    stopped: Stop


def train_on_samples(
    model: LayoutModel,
    samples: Sequence[Page],
    found: Sequence[Page | None],
    rounds: int,
    learner: Learner,
    content: ContentFeatures,
    report: Callable[[float], None],
) -> TrainedModel:
    """The model after at most `rounds` rounds; its pages carry labels and content features.

    Round 0 is initialization from the samples (5.6.1), when they are at least as many pages as the model has seen:
    then parts of them can be held out. A model that has seen more, as one that was imported, goes on from where it
    stands, and the errors on its samples decide.

    Raises
    ------
    ValueError
        When there is no sample with a zone.
    """
    seen = see_samples(samples, found, content)
    if not seen:
        raise ValueError("training needs at least one page with zones")
    labels = labels_of(seen)
    has_all = model.statistics is None or len(seen) >= round(model.statistics.pages)
    has_all = has_all and len(seen) >= model.samples

    def begin(indices: Sequence[int]) -> LearningModel:
        if has_all:
            return begin_model(model.name, [seen[index] for index in indices], labels)
        return begin_learning(model, (*content.names, *KIND_FEATURES))

    pages = [[view.labelled for view in views] for views in seen]
    trained = train(begin, pages, rounds, learner, report=report, hold_out=has_all)
    calibration = model.calibration
    if has_all:
        calibration = replace(calibrate_model(begin(range(len(seen))), seen), bias=calibration.bias)
    return TrainedModel(
        end_learning(replace(trained.model, calibration=calibration)),
        trained.rounds,
        trained.kept,
        trained.stopped,
    )
