"""Learning from errors by a margin: the passive-aggressive algorithm (PA-I) over the costs of labellings.

The cost of a labelling is linear in the parameters of `slopes`. The update searches the nearest model under which the
true labelling costs less than any other by the number of different zones (Hamming distance). The length of a step is
bounded, so that one page with wrong labels does little damage. If some model violates the margin on few pages only, the
number of errors on any sequence of pages is bounded.

Source: Crammer, Dekel, Keshet, Shalev-Shwartz, Singer: Online passive-aggressive algorithms, JMLR 7 (2006), section 8.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from services.layout.graph.layout_graph import LayoutGraph
from services.layout.learning.slopes import SlopeRates, cost_slopes, step_along
from services.layout.matching import MatchingParameters, match_directly
from services.layout.matching.cost_tables import CostTables
from services.layout.model.compiled_model import CompiledModel
from services.layout.model.cost import build_cost_tables


@dataclass(frozen=True, slots=True)
class MarginParameters:
    """Measured on streams of title pages and letters, where bounds of 0.03 to 1 did about equally well."""

    margin: float = 1.0
    """Required additional cost of a labelling for each zone with a wrong label."""
    aggressiveness: float = 0.1
    """Largest step of one page, the C of PA-I."""
    rates: SlopeRates = field(default_factory=SlopeRates)
    matching: MatchingParameters = field(
        default_factory=lambda: MatchingParameters(max_nodes=0, max_sweeps=0)
    )
    """Local search only: every labelling that violates the margin is a reason for a step, not only the worst one."""


def learn_by_margin(
    model: CompiledModel,
    graph: LayoutGraph,
    truth: NDArray[np.intp],
    parameters: MarginParameters = MarginParameters(),
) -> tuple[CompiledModel, bool]:
    """The model after one step for a page with true labels `truth` (N,), and whether a step was needed.

    With h the labelling of least cost less the margin and h* the true one, the loss is C(h*) - C(h) + margin of h;
    the step is that of least length which takes it away, or the largest allowed.
    """
    tables = build_cost_tables(graph, model)
    found = match_directly(less_margin(tables, truth, parameters.margin), parameters.matching).labels
    wrong = np.count_nonzero(found != truth)
    loss = tables.cost(truth) - tables.cost(found) + parameters.margin * wrong
    if not wrong or loss <= 0:
        return model, False
    slopes = cost_slopes(graph, model, truth) - cost_slopes(graph, model, found)
    length = slopes.squared(parameters.rates)
    if length <= 0:
        return model, False
    return step_along(model, slopes, parameters.rates, min(parameters.aggressiveness, loss / length)), True


def less_margin(tables: CostTables, truth: NDArray[np.intp], margin: float) -> CostTables:
    """Tables in which a labelling costs `margin` less for each zone that differs from `truth` (N,)."""
    node = tables.node - margin
    node[np.arange(tables.zones), truth] += margin
    return replace(tables, node=node)
