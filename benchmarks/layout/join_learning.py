"""Learning which pieces are put together: weights of pairs and of whole zones, from images of labelled pages.

python -m benchmarks layout_joins [--sets letters/real,memos] [--sizes 3,5,all] [--limit N]

Models of N samples label other pages from their images. A logistic regression on neighbours with one label gives the
weights of pairs, with log odds for each label of a model that follow from its samples alone. By these each page has
its tree of joins, and the weights of whole zones are those under which the true groupings of the trees are most
probable; each set and number of samples weighs the root of its number of pairs or joins. For each set the weights are
learned once more without it, and tell how many of its true zones are right before and after joins, labels not found
again.
Nothing is compared with a baseline.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from benchmarks.layout.label_trust import splits_of
from benchmarks.layout.marks import SAME_ZONE
from benchmarks.layout.part import share, table
from benchmarks.layout.protocols import make_model
from benchmarks.layout.weight_learning import Task, measure_cases, told
from benchmarks.layout.word_labels import SETS, Photo
from services.layout.grouping.joining import (
    WHOLE_FEATURES,
    WHOLE_WEIGHTS,
    choose_groups,
    describe_joins,
    whole_probabilities,
)
from services.layout.grouping.piece_pairs import PAIR_FEATURES, PAIR_WEIGHTS, joined_box
from services.layout.grouping.piece_tree import PieceTree
from services.layout.learning.label_transfer import box_areas, shared_areas
from services.layout.learning.learned_pieces import most_probable, neighbours_of, owners_of
from services.layout.model.layout_model import PieceStatistics
from services.layout.page import Page, Zone
from services.layout.pipeline import VersionedModel, content_features, recognize, regroup_pieces
from services.layout.recognition.page_recognition import RecognitionParameters
from services.layout.recognition.results import Recognition
from services.layout.segmentation import compose_page

NAME = "layout_joins"
LEARNED_SETS: Mapping[str, tuple[str, str | None]] = {**SETS, "made letters": ("letters/made", "letter")}
"""Folder and class (None: all) of each set."""
SIZES = ("1", "3", "5", "10", "all")
DRAWS = 2
ROUNDS = 3
"""Weights of pairs, then log odds of the models' labels, in turns."""
RIDGE = 1e-3
"""Weight of the squares of the weights of features, which have a standard deviation of 1 then."""

Values = NDArray[np.float64]
Pairs = tuple[Values, NDArray[np.bool_], list[str]]
"""`PAIR_FEATURES` (P, 11) of neighbours, which of them are pieces of one zone, and their labels."""
Weights = tuple[Values, Values]
"""Of `PAIR_FEATURES`, and of `WHOLE_FEATURES`."""


@dataclass(frozen=True, slots=True, eq=False)
class Labelled:
    """A page that a model of the samples at `learned` has labelled, before pieces are put together."""

    seen: Recognition
    true: Page
    pairs: Pairs
    learned: tuple[int, ...]
    pieces: Mapping[str, PieceStatistics]


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """Pages of a set by models of one number of samples; `sample_pairs` are those of all pages as samples."""

    name: str
    size: str
    pages: tuple[Labelled, ...]
    sample_pairs: tuple[Pairs, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """The tree of joins of a page, `WHOLE_FEATURES` (M, 9) of its nodes, and which are those of the true grouping."""

    tree: PieceTree
    features: Values
    is_true: NDArray[np.bool_]


def label_pages(name: str, size: str, photos: Sequence[Photo]) -> Case:
    """The pages of one case."""
    pages = []
    for learned, tested in splits_of(len(photos), size, DRAWS):
        model = make_model("class", [(photos[at].true, photos[at].own) for at in learned])
        versions = [VersionedModel(model, 1)]
        pieces = {node.label: node.pieces for node in model.nodes if node.label is not None}
        for at in tested:
            fine, true = photos[at].fine, photos[at].true
            seen = recognize(compose_page(fine), versions)
            if seen.chosen is not None:
                seen, _ = regroup_pieces(fine, seen, versions, RecognitionParameters(), content_features())
                pages.append(Labelled(seen, true, _pairs(true, _found(seen)), tuple(learned), pieces))
    return Case(name, size, tuple(pages), tuple(_pairs(photo.true, photo.own) for photo in photos))


def _found(seen: Recognition) -> Page:
    """The page with its found labels."""
    return replace(seen.page, zones=tuple(replace(each.zone, label=each.label) for each in seen.zones))


def _pairs(true: Page, found: Page) -> Pairs:
    return neighbours_of(found, owners_of(true, found))


def joining_of_samples(case: Case, learned: Sequence[int], weights: Values) -> dict[str, float]:
    """Log odds of each label by the samples of a model."""
    odds: dict[str, list[float]] = {}
    joined: dict[str, list[bool]] = {}
    for at in learned:
        features, same, labels = case.sample_pairs[at]
        for label, each, is_same in zip(labels, (features @ weights).tolist(), same.tolist(), strict=True):
            odds.setdefault(label, []).append(each)
            joined.setdefault(label, []).append(is_same)
    return {label: most_probable(np.array(odds[label]), np.array(joined[label])) for label in odds}


def _joinings(cases: Sequence[Case], weights: Values) -> list[list[dict[str, float]]]:
    """`joining_of_samples` for each page of each case."""
    found = []
    for case in cases:
        models = {page.learned: page for page in case.pages}
        known = {learned: joining_of_samples(case, learned, weights) for learned in models}
        found.append([known[page.learned] for page in case.pages])
    return found


def fit_pairs(cases: Sequence[Case]) -> Values:
    """Weights of `PAIR_FEATURES`."""
    features = np.concatenate([page.pairs[0] for case in cases for page in case.pages])
    same = np.concatenate([page.pairs[1] for case in cases for page in case.pages])
    counts = [sum(len(page.pairs[1]) for page in case.pages) for case in cases]
    weight = np.concatenate([np.full(count, max(count, 1) ** -0.5) for count in counts])
    added = np.zeros(len(same))
    for _ in range(ROUNDS):
        weights = _fit(features, partial(_logistic, added=added, same=same, weight=weight))
        added = np.array(
            [
                joining.get(label, 0.0)
                for case, joinings in zip(cases, _joinings(cases, weights), strict=True)
                for page, joining in zip(case.pages, joinings, strict=True)
                for label in page.pairs[2]
            ]
        )
    return weights


def _logistic(odds: Values, added: Values, same: NDArray[np.bool_], weight: Values) -> tuple[float, Values]:
    weight, odds = weight / weight.sum(), odds + added
    return float(weight @ (np.logaddexp(0.0, odds) - same * odds)), weight * (expit(odds) - same)


def _fit(features: Values, cost: Callable[[Values], tuple[float, Values]]) -> Values:
    """Weights of least `cost` of their products with features, and of their squares; the last feature is constant."""
    mean, deviation = features.mean(axis=0), features.std(axis=0)
    mean[-1], deviation[-1] = 0.0, 1.0
    deviation[deviation < 1e-9] = 1.0
    scaled = (features - mean) / deviation
    is_free = np.append(np.ones(features.shape[1] - 1), 0.0)

    def total(weights: Values) -> tuple[float, Values]:
        value, slope = cost(scaled @ weights)
        return value + RIDGE * float(
            (is_free * weights**2).sum()
        ), slope @ scaled + 2 * RIDGE * is_free * weights

    found = minimize(total, np.zeros(features.shape[1]), jac=True, method="L-BFGS-B").x / deviation
    found[-1] -= found[:-1] @ mean[:-1]
    return np.asarray(found, np.float64)


def judge_joins(cases: Sequence[Case], pair_weights: Values) -> list[list[Judged]]:
    """The trees of all pages of each case."""
    judged = []
    for case, joinings in zip(cases, _joinings(cases, pair_weights), strict=True):
        judged.append(
            [_judge(page, joining, pair_weights) for page, joining in zip(case.pages, joinings, strict=True)]
        )
    return judged


def _judge(page: Labelled, joining: Mapping[str, float], pair_weights: Values) -> Judged:
    learned = {label: replace(each, joining=joining.get(label, 0.0)) for label, each in page.pieces.items()}
    tree, features = describe_joins(page.seen.zones, page.seen.page, learned, pair_weights.tolist())
    return Judged(tree, features, _true_nodes(tree, page))


def _true_nodes(tree: PieceTree, page: Labelled) -> NDArray[np.bool_]:
    """Which nodes (M,) the grouping has that has most true zones; where equal, all pieces of one in one node."""
    found = _found(page.seen)
    owner = owners_of(page.true, found).tolist()
    own = [
        place if place >= 0 and page.true.zones[place].label == zone.label else -1 - row
        for row, (place, zone) in enumerate(zip(owner, found.zones, strict=True))
    ]
    is_one = np.array([len({own[each] for each in node}) == 1 for node in tree.members])
    is_whole = is_one.copy()
    for node in range(tree.zones, len(is_one)):
        is_whole[tree.children[node]] &= not is_one[node]
    worth = 0.1 * is_whole + _are_right(tree.members, page)
    chosen = set(choose_groups(tree, worth))
    return np.array([tuple(sorted(node)) in chosen for node in tree.members])


def _are_right(groups: Sequence[Sequence[int]], page: Labelled) -> NDArray[np.bool_]:
    """Which groups of zones are a true zone with its label."""
    zones = [_box_of(group, page.seen) for group in groups]
    true = page.true.zones
    if not zones or not true:
        return np.zeros(len(zones), bool)
    shared = shared_areas(zones, true)
    union = box_areas(zones)[:, None] + box_areas(true) - shared
    same = np.array([[zone.label == other.label for other in true] for zone in zones])
    return np.asarray(((shared / union >= SAME_ZONE) & same).any(axis=1))


def _box_of(group: Sequence[int], seen: Recognition) -> Zone:
    box = seen.zones[group[0]].zone.box
    for place in group[1:]:
        box = joined_box(box, seen.zones[place].zone.box)
    return Zone("", box, label=seen.zones[group[0]].label)


def fit_wholes(judged: Sequence[Sequence[Judged]]) -> Values:
    """Weights of `WHOLE_FEATURES` under which the true groupings are most probable."""
    counts = [sum(len(each.features) - each.tree.zones for each in case) for case in judged]
    flat = [
        (each, max(count, 1) ** -0.5) for case, count in zip(judged, counts, strict=True) for each in case
    ]
    starts = np.cumsum([0, *(len(each.features) for each, _ in flat)])
    features = np.concatenate([each.features for each, _ in flat])
    children = np.concatenate(
        [
            np.where(each.tree.children >= 0, each.tree.children + start, -1)
            for (each, _), start in zip(flat, starts[:-1], strict=True)
        ]
    )
    is_join = children[:, 0] >= 0
    true = np.concatenate([each.is_true for each, _ in flat]) & is_join
    roots = np.flatnonzero(np.concatenate([each.tree.is_root for each, _ in flat]))
    weight = np.concatenate([np.full(len(each.features), one) for each, one in flat])
    weight /= weight[is_join].sum()
    heights = np.zeros(len(children), int)
    for node in np.flatnonzero(is_join):
        heights[node] = 1 + heights[children[node]].max()
    levels = [np.flatnonzero(heights == height) for height in range(1, heights.max(initial=0) + 1)]

    def cost(scores: Values) -> tuple[float, Values]:
        """Negative log likelihood of the true groupings, and its slope by the scores of joins."""
        all_scores = np.zeros(len(children))
        all_scores[is_join] = scores
        sums, reached, taken = np.zeros((3, len(children)))
        for level in levels:
            sums[level] = np.logaddexp(all_scores[level], sums[children[level]].sum(axis=1))
        reached[roots] = 1.0
        for level in reversed(levels):
            taken[level] = reached[level] * np.exp(all_scores[level] - sums[level])
            reached[children[level]] = (reached[level] - taken[level])[:, None]
        value = weight[roots] @ sums[roots] - weight[true] @ all_scores[true]
        return float(value), (weight * (taken - true))[is_join]

    return _fit(features[is_join], cost)


def learn(cases: Sequence[Case]) -> Weights:
    """Weights of pairs, and by their trees those of whole zones."""
    pairs = fit_pairs(cases)
    return pairs, fit_wholes(judge_joins(cases, pairs))


def count_right(case: Case, weights: Weights) -> tuple[int, int, int]:
    """True zones of a case that are right before and after joins, and all of them."""
    [judged] = judge_joins([case], weights[0])
    before = after = 0
    for page, each in zip(case.pages, judged, strict=True):
        groups = choose_groups(each.tree, whole_probabilities(each.tree, each.features @ weights[1]))
        before += int(_are_right([(place,) for place in range(each.tree.zones)], page).sum())
        after += int(_are_right(groups, page).sum())
    return before, after, sum(len(page.true.zones) for page in case.pages)


def report(cases: Sequence[Case]) -> str:
    """The weights, and the zones of each set that are right by weights which were learned without it."""
    learned = learn(cases)
    rows: list[list[object]] = []
    others: list[Weights] = []
    for name in dict.fromkeys(case.name for case in cases):
        rest = [case for case in cases if case.name != name]
        if rest:
            others.append(learn(rest))
            for case in cases:
                if case.name == name:
                    before, after, zones = count_right(case, others[-1])
                    all_sets = count_right(case, learned)[1]
                    counted = [share(each, zones) for each in (before, after, all_sets)]
                    rows.append([f"{name}, {case.size} samples", *counted, zones])
    parts = []
    shipped = (PAIR_WEIGHTS, WHOLE_WEIGHTS)
    for place, (title, head) in enumerate((("Pairs", PAIR_FEATURES), ("Whole zones", WHOLE_FEATURES))):
        lines = [["learned", *told(learned[place])], ["shipped", *told(np.array(shipped[place]))]]
        if others:
            away = np.abs(np.array([each[place] for each in others]) - learned[place]).max(axis=0)
            lines.append(["most change without a set", *told(away)])
        parts.append(table(title, ("log odds for", *head), lines))
    if rows:
        head = ("set, samples", "pieces", "joined", "by_all_sets", "zones")
        parts.append(table("True zones right, percent, by weights learned without the set", head, rows))
    return "\n\n".join(parts)


def main(arguments: Sequence[str] | None = None) -> int:
    """Learn and print."""
    cases = measure_cases(NAME, __doc__, arguments, LEARNED_SETS, SIZES, _label)
    if cases:
        print(report(list(cases.values())), flush=True)
    return 0


def _label(task: Task) -> tuple[tuple[str, str], Case]:
    return task[:2], label_pages(*task)
