"""A model during learning: its arrays, the sums of their estimation, and conversion from and to a stored model."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from services.layout.model.compiled_model import CompiledModel, compile_model
from services.layout.model.estimation import estimate_model, name_parts
from services.layout.model.layout_model import Calibration, LayoutModel, PieceStatistics
from services.layout.model.statistics import MOST_COUNTED, LabelStatistics
from services.layout.model.stored_statistics import restore_statistics, store_statistics, with_nodes


@dataclass(frozen=True, slots=True, eq=False)
class LearningModel:
    """A layout graph model as it learns.

    `model` is what matching sees, `statistics` the sums over the pages that were counted, `certainty` (K,) how sure
    the scales are. Differences between `model` and the estimate of `statistics` were learned from errors or set by
    hand; they remain when a page is counted. `zones` are the verified zones of each node, `samples` the verified pages;
    `pieces` has `ModelNode.pieces` by label.
    """

    name: str
    model: CompiledModel
    statistics: LabelStatistics
    certainty: NDArray[np.float64]
    zones: NDArray[np.float64]
    samples: int
    calibration: Calibration
    content_names: tuple[str, ...]
    pieces: Mapping[str, PieceStatistics] = field(default_factory=dict)

    @property
    def labels(self) -> tuple[str | None, ...]:
        return self.model.labels

    def with_model(self, model: CompiledModel) -> "LearningModel":
        """This model with other costs for the same nodes."""
        return replace(self, model=model)


def begin_learning(model: LayoutModel, content_names: Sequence[str]) -> LearningModel:
    """`model` ready to learn; `content_names` are those of its graphs, kinds of zones among them."""
    compiled = compile_model(model, content_names)
    compiled = replace(compiled, counts=_widened(compiled.counts, MOST_COUNTED + 1))
    statistics, certainty = restore_statistics(model, compiled, content_names)
    return LearningModel(
        name=model.name,
        model=compiled,
        statistics=statistics,
        certainty=certainty,
        zones=np.array([node.zones for node in model.nodes]),
        samples=model.samples,
        calibration=model.calibration,
        content_names=tuple(content_names),
        pieces={node.label: node.pieces for node in model.nodes if node.label is not None},
    )


def end_learning(learned: LearningModel) -> LayoutModel:
    """The model as it is stored."""
    return name_parts(
        learned.model,
        learned.name,
        learned.samples,
        learned.zones.tolist(),
        learned.content_names,
        learned.calibration,
        store_statistics(learned.statistics, learned.labels, learned.content_names, learned.certainty),
        learned.pieces,
    )


def with_labels(learned: LearningModel, labels: Sequence[str | None]) -> LearningModel:
    """The model with nodes for all `labels`; new nodes have default costs until a zone is counted."""
    new = sorted({label for label in labels if label is not None} - set(learned.labels))
    if not new:
        return learned
    all_labels = (*learned.labels, *new)
    statistics = with_nodes(learned.statistics, len(all_labels))
    old = len(learned.labels)
    model = learned.model
    estimate = estimate_model(statistics, all_labels, model.scales)
    before = estimate_model(learned.statistics, learned.labels, model.scales)
    label_costs = model.label_costs + estimate.label_costs[:old] - before.label_costs
    relations = estimate.relations.copy()
    relations[:old, :old] = model.relations
    return replace(
        learned,
        model=replace(
            estimate,
            values=np.vstack([model.values, estimate.values[old:]]),
            variances=np.vstack([model.variances, estimate.variances[old:]]),
            content=np.vstack([model.content, estimate.content[old:]]),
            weights=np.vstack([model.weights, estimate.weights[old:]]),
            label_costs=np.concatenate([label_costs, estimate.label_costs[old:]]),
            relations=relations,
            counts=np.vstack([model.counts, estimate.counts[old:]]),
        ),
        statistics=statistics,
        zones=np.concatenate([learned.zones, np.zeros(len(new))]),
    )


def _widened(counts: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Count costs for more zones; they repeat the last cost."""
    return np.pad(counts, ((0, 0), (0, max(0, width - counts.shape[1]))), mode="edge")[:, :width]
