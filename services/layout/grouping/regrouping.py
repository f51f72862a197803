"""Zones cut and joined where the class explains another grouping of their lines better: 5.4 in both directions.

Segmentation groups lines by print alone: it keeps together what is set alike, as a subject and the body below it,
and apart what is set in two ways. A few other groupings are matched: a zone cut at a space, neighbours with different
labels joined. The most probable one is taken, as long as it is probable enough (`regrouping_odds`). Neighbours with one
label are left to `joining`, since no label changes with them.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice, permutations, zip_longest

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from services.layout.content.content_features import ContentFeatures
from services.layout.graph.layout_graph import build_graph
from services.layout.grouping.joined_page import number_zones
from services.layout.grouping.piece_pairs import REACH_ALONG, print_size
from services.layout.grouping.regrouping_odds import (
    cut_log_odds,
    join_log_odds,
    measure_space,
    merged_log_odds,
)
from services.layout.matching import NO_PROOF, conditional_costs, match_directly
from services.layout.model.compiled_model import compile_model
from services.layout.model.cost import build_cost_tables
from services.layout.model.layout_model import LayoutModel
from services.layout.page import Page
from services.layout.segmentation import FinePage, text_zone, with_appearance
from services.layout.segmentation.measures import SAME_ROW

_MOST_HYPOTHESES = 8
"""Of a page, cuts and joins in turns; no more are made, either."""
_MOST_PAIRS = 3500
"""Pairs of zones in all hypotheses together, which take the time: four hypotheses of a page of 40 zones."""


Lines = tuple[tuple[int, ...], ...]
"""Indices of the lines of every zone of a page, from the top down; none for a zone that is no text."""


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
) -> tuple[Page, Lines, tuple[float | None, ...]]:
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
    The same page and lines where nothing changes; else zones in reading order, ids "z1", "z2" ... For each zone the
    probability, 0-1, that it should have been cut, where the samples have its label merged with others; else None.
    """
    most = min(_MOST_HYPOTHESES, int(_MOST_PAIRS / max(1, len(page.zones) ** 2 / 2)))
    if most < 1 or not page.zones:
        return page, lines, (None,) * len(page.zones)
    class_ = _Class(fine, model, features.in_language_of(page))
    current = class_.match(page, lines)
    hypotheses = class_.likely_changes(current)[:most]
    doubts: dict[tuple[int, ...], float] = {}
    for _ in range(_MOST_HYPOTHESES):
        tried = [(*class_.judge(current, each), each) for each in hypotheses]
        for odds, _, each in tried:
            if each.at is not None and class_.log_odds_of_merging(current, each.lines):
                doubts[each.lines] = max(float(expit(odds)), doubts.get(each.lines, 0.0))
        better = [each for each in tried if each[0] > 0 and not class_.has_rival(current, *each[1:])]
        if not better:
            break
        _, current, taken = max(better, key=lambda each: each[0])
        hypotheses = [each for _, _, each in better if not set(each.old).intersection(taken.old)]
        if taken.at is not None:  # where two were merged, a third may be
            parts = (each for each in _cuts(fine, current) if set(each.lines) < set(taken.lines))
            hypotheses += islice(parts, most)
    told = tuple(doubts.get(own) for own in current.lines)
    if current.page is page:
        return page, lines, told
    numbered, order = number_zones(current.page)
    return numbered, tuple(current.lines[place] for place in order), tuple(told[place] for place in order)


@dataclass(frozen=True, slots=True, eq=False)
class _Class:
    """The lines of a page and the model of its class, which judges groupings of them."""

    fine: FinePage
    model: LayoutModel
    features: ContentFeatures

    def match(self, page: Page, lines: Lines) -> _Matched:
        """The page with its labels of least cost."""
        graph = build_graph(page, self.features.names)
        tables = build_cost_tables(graph, compile_model(self.model, graph.content_names))
        found = match_directly(tables, NO_PROOF)
        own = tables.node[np.arange(tables.zones), found.labels]
        return _Matched(page, lines, found.labels, found.cost, own, conditional_costs(tables, found.labels))

    def changed(self, current: _Matched, change: _Change) -> _Matched:
        """The page with a change; the new zones come last."""
        kept = [place for place, own in enumerate(current.lines) if not own or own not in change.old]
        cut = change.at
        parts = (change.lines,) if cut is None else (change.lines[:cut], change.lines[cut:])
        zones = [current.page.zones[place] for place in kept]
        for zone in with_appearance(self.fine.ink, [text_zone(self.fine, part) for part in parts]):
            zones.append(replace(zone, content=self.features.measure(zone.text)) if zone.text else zone)
        page = replace(current.page, zones=tuple(zones))
        return self.match(page, (*(current.lines[place] for place in kept), *parts))

    def judge(self, current: _Matched, change: _Change) -> tuple[float, _Matched]:
        """Log odds of a change beyond those that it needs, and the page with it."""
        changed = self.changed(current, change)
        gain = current.cost - changed.cost
        if change.at is None:
            return join_log_odds(gain, change.space), changed
        upper, lower = changed.labels[-2:]
        apart = min(changed.conditional[-2, lower], changed.conditional[-1, upper]) - changed.cost
        if upper == lower:
            return -np.inf, changed
        mean = current.cost / len(current.lines)
        odds = cut_log_odds(gain, mean, apart, change.space) + self._learned(int(upper), int(lower))
        return odds, changed

    def has_rival(self, current: _Matched, changed: _Matched, change: _Change) -> bool:
        """Whether one of two zones to be joined rather belongs to a neighbour of its own label: that costs less.

        Pieces of one zone are put together later (`joining`); until then each of them costs as a zone of its label.
        """
        if change.at is not None:
            return False
        joins = _joins(self.fine, current, same_label=True)
        rivals = (each for each in joins if set(each.old).intersection(change.old))
        return any(self.changed(current, each).cost < changed.cost for each in rivals)

    def likely_changes(self, current: _Matched) -> list[_Change]:
        """Joins and cuts in turns, each kind by its log odds if the new zones cost nothing, the most probable first."""
        own = dict(zip(current.lines, current.own.tolist(), strict=True))

        def odds(change: _Change) -> float:
            given_up = sum(own[lines] for lines in change.old)
            if change.at is None:
                return join_log_odds(given_up, change.space)
            learned = self.log_odds_of_merging(current, change.lines)
            return cut_log_odds(given_up, 0.0, 0.0, change.space) + learned

        joins = sorted(_joins(self.fine, current), key=odds, reverse=True)
        cuts = sorted(_cuts(self.fine, current), key=odds, reverse=True)
        return [each for turn in zip_longest(cuts, joins) for each in turn if each is not None]

    def log_odds_of_merging(self, current: _Matched, lines: tuple[int, ...]) -> float:
        """Log odds, beyond the usual ones, that the zone of these lines is several, by its label."""
        return self._learned(int(current.labels[current.lines.index(lines)]))

    def _learned(self, *labels: int) -> float:
        nodes = [self.model.nodes[label] for label in labels]
        return merged_log_odds([node.pieces for node in nodes if node.label is not None])


def _joins(fine: FinePage, current: _Matched, *, same_label: bool = False) -> Iterator[_Change]:
    """Neighbours, one above the other, with different labels; with `same_label`, with one."""
    em = print_size(current.page)
    text = [place for place, own in enumerate(current.lines) if own]
    boxes = [current.page.zones[place].box for place in text]
    for (upper, a), (lower, b) in permutations(zip(text, boxes, strict=True), 2):
        if (
            (current.labels[upper] == current.labels[lower]) == same_label
            and a[1] <= b[1]
            and -em < b[1] - a[3] < REACH_ALONG * em
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
