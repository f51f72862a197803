"""Training of a model in rounds over all its samples (5.6.1).

Parts of the samples are held out in turn. The round with fewest errors on these is kept; round 0 is initialization, so
training makes no model worse there. A model that has seen more than its samples, as an imported one, is trained further
from its present state.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

from services.contract.layout_learning import Learner, TrainingReport
from services.layout.content.content_features import ContentFeatures
from services.layout.graph.layout_graph import DERIVED_FEATURES
from services.layout.learning.initialization import begin_calibrated, begin_model, labels_of, make_views
from services.layout.learning.rounds import run_rounds
from services.layout.model.layout_model import LayoutModel
from services.layout.model.learning_model import LearningModel, begin_learning, end_learning
from services.layout.page import Page


def train_in_rounds(
    model: LayoutModel,
    samples: Sequence[Page],
    found: Sequence[Page | None],
    rounds: int,
    learner: Learner,
    content: ContentFeatures,
    report: Callable[[float], None] = lambda share: None,
) -> tuple[LayoutModel, TrainingReport]:
    """The model after the best of at most `rounds` rounds, and the errors of all rounds.

    Round 0 is initialization from the samples (5.6.1), if these are at least as many pages as the model has seen:
    then parts of them can be held out. A model that has seen more pages, for example an imported one, is trained as
    it is, and the errors on its samples decide.

    Parameters
    ----------
    model
        The model to train.
    samples
        Verified pages, whose zones carry labels.
    found
        For each sample its page in the zones that segmentation finds, or None (`initialization.initialize_model`).
    rounds
        Number of rounds at most.
    learner
        How the model learns from a page.
    content
        The content features.
    report
        Called with the share of the work that is done, 0 to 1.

    Raises
    ------
    ValueError
        When there is no sample with a zone.
    """
    seen = make_views(samples, found, content)
    if not seen:
        raise ValueError("training needs at least one page with zones")
    labels = labels_of(seen)
    has_all = model.statistics is None or len(seen) >= round(model.statistics.pages)
    has_all = has_all and len(seen) >= model.samples

    def begin(indices: Sequence[int]) -> LearningModel:
        if has_all:
            return begin_model(model.name, [seen[index] for index in indices], labels)
        return begin_learning(model, (*content.names, *DERIVED_FEATURES))

    pages = [[view.labelled for view in views] for views in seen]
    trained, training = run_rounds(begin, pages, rounds, learner, report=report, hold_out=has_all)
    calibration = model.calibration
    if has_all:
        calibrated = begin_calibrated(model.name, seen, labels).calibration
        calibration = replace(calibrated, bias=calibration.bias)
    return end_learning(replace(trained, calibration=calibration)), training
