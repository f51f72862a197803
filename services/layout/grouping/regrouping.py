"""Zones cut and joined where the class explains another grouping of their lines better: 5.4 in both directions.

Segmentation groups lines by print alone: it keeps together what is set alike, as a subject and the body below it,
and apart what is set in two ways. A few other groupings are matched: a zone cut at a space, neighbours with different
labels joined. The most probable one is taken, as long as it is probable enough (`regrouping_odds`). Neighbours with one
label are left to `joining`, since no label changes with them.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import permutations, zip_longest

import numpy as np
from numpy.typing import NDArray

from services.layout.content.content_features import ContentFeatures
from services.layout.graph.layout_graph import build_graph
from services.layout.grouping.joined_page import number_zones
from services.layout.grouping.piece_pairs import print_size
from services.layout.grouping.regrouping_odds import (
    cut_log_odds,
    join_log_odds,
    measure_space,
)
from services.layout.matching import MatchingParameters, conditional_costs, match_directly
from services.layout.model.compiled_model import compile_model
from services.layout.model.cost import build_cost_tables
from services.layout.model.layout_model import LayoutModel
from services.layout.page import Page
from services.layout.segmentation import FinePage, text_zone, with_appearance
from services.layout.segmentation.measures import SAME_ROW

Lines = tuple[tuple[int, ...], ...]
"""Indices of the lines of every zone of a page, from the top down; none for a zone that is no text."""

_LOCAL = MatchingParameters(max_nodes=0, max_sweeps=0)
"""Hypotheses are compared by local search; the page that is kept is then searched in full."""


@dataclass(frozen=True, slots=True)
class RegroupingParameters:
    """How many other groupings are tried, and how probable they must be."""

    least_cut_odds: float = 4.0
    """Log odds among spaces of which as many are cuts as not. Few zones are wrongly whole: one space in a hundred."""
    least_join_odds: float = 2.0
    """Log odds of a join: a wrong one hides two right zones, a missing one leaves two pieces."""
    most_gap: float = 2.5
    """Largest gap of neighbours that may be one zone, in ems of the page's print."""
    most_hypotheses: int = 8
    """Of a page, cuts and joins in turns."""
    most_pairs: float = 3500
    """Pairs of zones in all hypotheses together, which take the time: four hypotheses of a page of 40 zones."""
    most_changes: int = 4
    """Of a page."""


@dataclass(frozen=True, slots=True, eq=False)
class _Matched:
    """A grouping of the page with its labels of least cost.

    `own` (N,) are the zones' own costs, without pairs; `conditional` (N, L) is the page's cost where one zone has
    another label.
    """

    page: Page
    lines: Lines
    labels: NDArray[np.intp]
    cost: float
    own: NDArray[np.float64]
    conditional: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class _Change:
    """The `lines` of the zones `old` in another grouping: in one zone, or in two, cut before line `at`."""

    old: Lines
    lines: tuple[int, ...]
    space: NDArray[np.float64]
    at: int | None = None


def regroup_page(
    fine: FinePage,
    page: Page,
    lines: Lines,
    model: LayoutModel,
    features: ContentFeatures,
    parameters: RegroupingParameters = RegroupingParameters(),
) -> tuple[Page, Lines]:
    """The page with the grouping of its lines that `model` explains best of a few, and the lines of its zones.

    Parameters
    ----------
    fine
        The lines of the page.
    page
        The page in the zones of segmentation, with content features.
    lines
        For each zone of `page` its lines.
    model
        Of the page's class.

    Returns
    -------
    The same page and lines where nothing changes; else zones in reading order, ids "z1", "z2" ...
    """
    most = min(parameters.most_hypotheses, int(parameters.most_pairs / max(1, len(page.zones) ** 2 / 2)))
    if most < 1 or not page.zones:
        return page, lines
    features = features.in_language_of(page)
    current = _match(page, lines, model, features.names)
    hypotheses = _likely(fine, current, parameters)[:most]
    for _ in range(parameters.most_changes):
        tried = [(*_try(fine, current, each, model, features, parameters), each) for each in hypotheses]
        better = [each for each in tried if each[0] > 0]
        if not better:
            break
        _, current, taken = max(better, key=lambda each: each[0])
        hypotheses = [each for _, _, each in better if not set(each.old).intersection(taken.old)]
    if current.page is page:
        return page, lines
    numbered, order = number_zones(current.page)
    return numbered, tuple(current.lines[place] for place in order)


def _match(page: Page, lines: Lines, model: LayoutModel, names: tuple[str, ...]) -> _Matched:
    graph = build_graph(page, names)
    tables = build_cost_tables(graph, compile_model(model, graph.content_names))
    found = match_directly(tables, _LOCAL)
    own = tables.node[np.arange(tables.zones), found.labels]
    return _Matched(page, lines, found.labels, found.cost, own, conditional_costs(tables, found.labels))


def _try(
    fine: FinePage,
    current: _Matched,
    change: _Change,
    model: LayoutModel,
    features: ContentFeatures,
    parameters: RegroupingParameters,
) -> tuple[float, _Matched]:
    """The page with a change, and its log odds beyond those that it needs; the new zones come last."""
    kept = [place for place, own in enumerate(current.lines) if not own or own not in change.old]
    parts = (change.lines,) if change.at is None else (change.lines[: change.at], change.lines[change.at :])
    zones = [current.page.zones[place] for place in kept]
    for zone in with_appearance(fine.ink, [text_zone(fine, part) for part in parts]):
        zones.append(replace(zone, content=features.measure(zone.text)) if zone.text else zone)
    page = replace(current.page, zones=tuple(zones))
    changed = _match(page, (*(current.lines[place] for place in kept), *parts), model, features.names)
    gain = current.cost - changed.cost
    if change.at is None:
        return join_log_odds(gain, change.space) - parameters.least_join_odds, changed
    upper, lower = changed.labels[-2:]
    apart = min(changed.conditional[-2, lower], changed.conditional[-1, upper]) - changed.cost
    if upper == lower:
        return -np.inf, changed
    mean = current.cost / len(current.lines)
    return cut_log_odds(gain, mean, apart, change.space) - parameters.least_cut_odds, changed


def _likely(fine: FinePage, current: _Matched, parameters: RegroupingParameters) -> list[_Change]:
    """Joins and cuts in turns, each kind by its log odds if the new zones cost nothing, the most probable first."""
    own = dict(zip(current.lines, current.own.tolist(), strict=True))

    def odds(change: _Change) -> float:
        given_up = sum(own[lines] for lines in change.old)
        if change.at is None:
            return join_log_odds(given_up, change.space)
        return cut_log_odds(given_up, 0.0, 0.0, change.space)

    joins = sorted(_joins(fine, current, parameters), key=odds, reverse=True)
    cuts = sorted(_cuts(fine, current), key=odds, reverse=True)
    return [each for turn in zip_longest(cuts, joins) for each in turn if each is not None]


def _joins(fine: FinePage, current: _Matched, parameters: RegroupingParameters) -> Iterator[_Change]:
    """Neighbours, one above the other, with different labels."""
    em = print_size(current.page)
    text = [place for place, own in enumerate(current.lines) if own]
    boxes = [current.page.zones[place].box for place in text]
    for (upper, a), (lower, b) in permutations(zip(text, boxes, strict=True), 2):
        if (
            current.labels[upper] != current.labels[lower]
            and a[1] <= b[1]
            and -em < b[1] - a[3] < parameters.most_gap * em
            and min(a[2], b[2]) > max(a[0], b[0])
        ):
            old = current.lines[upper], current.lines[lower]
            lines = tuple(
                sorted(old[0] + old[1], key=lambda each: (fine.lines[each].baseline, fine.boxes[each, 0]))
            )
            yield _Change(old, lines, measure_space([fine.lines[each] for each in lines], len(old[0])))


def _cuts(fine: FinePage, current: _Matched) -> Iterator[_Change]:
    """Spaces between the rows of zones."""
    for own in current.lines:
        lines = [fine.lines[each] for each in own]
        for at in range(1, len(own)):
            above, below = lines[at - 1], lines[at]
            if below.baseline - above.baseline > SAME_ROW * min(above.em, below.em):
                yield _Change((own,), own, measure_space(lines, at), at)
