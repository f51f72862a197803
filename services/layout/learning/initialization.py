"""Model initialization (5.5, 5.6.1): a layout graph model from a few labelled pages.

Sums over the pages become means, variances and frequencies, each drawn to what is usual, so that one sample is enough
to begin. From two samples on the factors of the attributes are those under which true labels are most probable on pages
that had no part in the model (`scale_fitting`), and so is the usual cost of a page. A sample with its image counts as
two views of one page: the zones that a person drew, and those that segmentation finds. Both together teach which zones
segmentation divides and merges (`learned_pieces`).
"""

import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from services.layout.content.content_features import ContentFeatures, content_features
from services.layout.graph.layout_graph import LayoutGraph, build_graph
from services.layout.learning.label_transfer import come_apart
from services.layout.learning.learned_pieces import learn_pieces
from services.layout.learning.over_segmentation import over_segment
from services.layout.matching import NO_PROOF, match_directly
from services.layout.model.compiled_model import CompiledModel
from services.layout.model.cost import build_cost_tables
from services.layout.model.estimation import estimate_model
from services.layout.model.held_out import choose_evenly
from services.layout.model.layout_model import Calibration, LayoutModel
from services.layout.model.learning_model import LearningModel, end_learning
from services.layout.model.scale_fitting import HeldOutTerms, fit_scales, fit_scales_without, hold_out_terms
from services.layout.model.statistics import (
    LabelledGraph,
    label_indices,
    sample_statistics,
    total_statistics,
)
from services.layout.page import Page
from services.layout.recognition.classification import calibrate
from services.layout.recognition.label_calibration import calibrate_labels, judge_labels
from services.layout.recognition.page_recognition import comparable_cost

MOST_HELD_OUT = 40
"""Largest number of held-out samples for the measurement of the class's costs."""
MOST_MATCHED = 2e8
"""Largest number of table entries of pairs for all held-out samples: 40 pages of 200 zones with 15 labels. Larger pages
take seconds each, so that fewer are held out."""


@dataclass(frozen=True, slots=True)
class View:
    """A page and its graph with the labels; where segmentation found its zones in an image, these as found.

    `whole` is the graph before parts of zones were taken out: recognition compares classes by it. None: there are none.
    """

    page: Page
    labelled: LabelledGraph
    found: Page | None = None
    whole: LayoutGraph | None = None


Views = Sequence[View]
"""The views of one sample: in its verified zones, and in the zones of segmentation."""


def initialize_model(
    name: str,
    samples: Sequence[Page],
    content: ContentFeatures | None = None,
    found: Sequence[Page | None] | None = None,
) -> LayoutModel:
    """Layout graph model of a class from verified pages.

    Typical values are means, weights are inverse variances, relations have look-up tables of frequencies, and content
    features have frequencies. All estimates have a prior, so that one sample is enough. From two samples on, held-out
    pages serve to fit the attributes' weights and to measure the cost of a page of the class.

    Every sample has two views, which count as one page: in its verified zones, and in the zones of segmentation.

    Parameters
    ----------
    name
        Of the class.
    samples
        Verified pages, whose zones carry labels.
    content
        The content features; None: those that come with the code.
    found
        For each sample its page in the zones that segmentation finds (`pipeline.complete_sample`), or None: then
        `over_segmentation` makes such a page from the sample.

    Raises
    ------
    ValueError
        When there is no sample with a zone.
    """
    seen = make_views(samples, found or [None] * len(samples), content or content_features())
    if not seen:
        raise ValueError("a model needs at least one page with zones")
    return end_learning(begin_calibrated(name, seen))


def make_views(
    samples: Sequence[Page], found: Sequence[Page | None], content: ContentFeatures
) -> list[Views]:
    """Both views, with their content features, of every sample that has zones."""
    return [
        _see(sample, other, content) for sample, other in zip(samples, found, strict=True) if sample.zones
    ]


def begin_model(
    name: str, seen: Sequence[Views], labels: Sequence[str | None] | None = None
) -> LearningModel:
    """The model of the samples in `seen` (one or more), with a default calibration.

    `labels` are those of its nodes, None first (None: those of the samples).
    """
    return _begin(name, seen, labels_of(seen) if labels is None else labels)[0]


def begin_calibrated(
    name: str, seen: Sequence[Views], labels: Sequence[str | None] | None = None
) -> LearningModel:
    """`begin_model` with the cost of pages of the class and the trust in labels, by cross-validation on `seen`.

    A held-out sample has a part neither in the statistics nor in the attributes' weights of the model that labels it.
    """
    begun, held_out = _begin(name, seen, labels_of(seen) if labels is None else labels)
    return replace(begun, calibration=_calibrate(begun, seen, held_out))


def _begin(
    name: str, seen: Sequence[Views], labels: Sequence[str | None]
) -> tuple[LearningModel, HeldOutTerms]:
    """The model, and what its weights were fitted to."""
    graphs = [[view.labelled for view in views] for views in seen]
    total = total_statistics(sample_statistics(views, labels) for views in graphs)
    held_out = hold_out_terms(graphs, total, labels)
    fitted = fit_scales(held_out)
    verified = Counter(zone.label for views in seen for zone in views[0].page.zones)
    begun = LearningModel(
        name=name,
        model=estimate_model(total, labels, fitted.scales),
        statistics=total,
        certainty=fitted.certainty,
        zones=np.array([verified[label] for label in labels], dtype=np.float64),
        samples=len(seen),
        calibration=calibrate([]),
        content_names=graphs[0][0].graph.content_names,
        pieces=learn_pieces((views[0].page, views[1].found) for views in seen if views[1].found is not None),
    )
    return begun, held_out


def labels_of(seen: Sequence[Views]) -> tuple[str | None, ...]:
    """Labels of the nodes of a model of these samples, None first."""
    known = {label for views in seen for view in views for label in view.labelled.labels}
    return (None, *sorted(label for label in known if label is not None))


def _calibrate(begun: LearningModel, seen: Sequence[Views], held_out: HeldOutTerms) -> Calibration:
    if len(seen) < 2:
        return begun.calibration
    labels = begun.labels
    work = [sum(len(view.labelled.graph.pairs) for view in views) * len(labels) ** 2 for views in seen]
    scales = fit_scales_without(held_out, begun.model.scales)
    costs = []
    judged = []
    with_images = any(view.found is not None for views in seen for view in views)
    for index in choose_evenly(work, MOST_HELD_OUT, MOST_MATCHED):
        own = sample_statistics([view.labelled for view in seen[index]], labels)
        model = estimate_model(begun.statistics - own, labels, scales[index])
        for view in seen[index]:
            # Pages come in the zones of segmentation; a person may have drawn a few of them only, which cost far less.
            if view.found is None and with_images:
                continue
            graph = view.labelled.graph
            tables = build_cost_tables(graph, model)
            found = match_directly(tables, NO_PROOF).labels
            costs.append(_cost_a_zone(model, view.whole) if view.whole else _cost_a_zone(model, graph, found))
            true = label_indices(view.labelled.labels, labels)
            judged.append(judge_labels(tables, found, true, len(seen) - 1, is_read=graph.is_read))
    return calibrate_labels(calibrate(costs), judged)


def _cost_a_zone(model: CompiledModel, graph: LayoutGraph, labels: NDArray[np.intp] | None = None) -> float:
    """The comparable cost a zone, with the labels of least cost if none are given."""
    if labels is None:
        labels = match_directly(build_cost_tables(graph, model), NO_PROOF).labels
    return comparable_cost(graph, model, labels) / graph.zones


def _see(sample: Page, found: Page | None, content: ContentFeatures) -> Views:
    is_found = found is not None and bool(found.zones)
    if found is None or not found.zones:
        # The seed depends on the page only, so that the model does not depend on the order of samples.
        seed = zlib.crc32(repr([zone.box for zone in sample.zones]).encode())
        found = over_segment(content.measure_page(sample), np.random.default_rng(seed))
    other = come_apart(sample, found) if is_found else found
    whole = None if other is found else build_graph(content.measure_page(found), content.names)
    return [
        View(
            page,
            LabelledGraph(
                build_graph(page, content.names, printed=found if is_found else None),
                tuple(zone.label for zone in page.zones),
            ),
            found if is_found and place == 1 else None,
            whole if place == 1 else None,
        )
        for place, page in enumerate(map(content.measure_page, (sample, other)))
    ]
