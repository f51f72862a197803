"""Choice of the models to search (5.7): coarse to fine, from genres to publications."""

from collections import OrderedDict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from weakref import ReferenceType, WeakKeyDictionary, ref

import numpy as np
from numpy.typing import NDArray

from services.layout.graph.layout_graph import LayoutGraph
from services.layout.model.compiled_model import CompiledModel
from services.layout.model.layout_model import LayoutModel
from services.layout.recognition.classification import SHARE_OF_MEAN, excess_costs
from services.layout.recognition.hierarchy.bank import ModelBank
from services.layout.recognition.hierarchy.likeness import describe_likeness, group_alike
from services.layout.recognition.hierarchy.pooling import pool_models

MOST_CANDIDATES = 16
"""Models that are matched by search. Of 200 models the one that won when all were searched for had the best unary
score too when the page was of its class, and among the best eight on pages of no class."""

MOST_GENRES = 6
"""Genres whose models get unary scores. Of fourteen the winner's was among the best three, and among the best four on
pages of no class."""

MOST_KEPT = 4
"""Hierarchies that a process keeps: those of all models, and of the choices that requests name."""


@dataclass(frozen=True, slots=True, eq=False)
class Competitor:
    """A model, its arrays, and its genre (None: not set)."""

    model: LayoutModel
    compiled: CompiledModel
    genre: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ModelRanking:
    """Ranking of M models before any is matched.

    `candidates` are the indices of the models to match, the best first. `costs` and `comparable` (M,) are costs of a
    labelling by each model's own weights and by the usual ones: unary scores for the models of likely genres, the
    unary score of the genre for the others. The latter rank no better than any model with a score of its own.
    """

    candidates: tuple[int, ...]
    costs: NDArray[np.float64]
    comparable: NDArray[np.float64]


_Key = tuple[ReferenceType[LayoutModel], ...]
"""Identities of models, by weak references."""


@dataclass(frozen=True, slots=True, eq=False)
class _Genre:
    """Models of one genre and the one that is pooled of them; `mean` is that of their calibrations' means."""

    models: _Key
    bank: ModelBank
    pooled: CompiledModel
    mean: float


class Hierarchy:
    """The models of a base by genre.

    Models with the same named genre form a genre. The other models are grouped by similarity.
    """

    def __init__(
        self,
        competitors: Sequence[Competitor],
        content_names: tuple[str, ...],
        before: Sequence["Hierarchy"] = (),
    ) -> None:
        """Of M >= 1 models; genres are taken over from hierarchies `before` where they have the same models."""
        self._means = np.array([each.model.calibration.mean for each in competitors])
        self._biases = np.array([each.model.calibration.bias for each in competitors])
        self._members = list(_group(competitors, content_names))
        known = {genre.models: genre for each in before for genre in each._genres}
        self._genres: list[_Genre] = []
        for members in self._members:
            chosen = [competitors[index] for index in members]
            models = tuple(ref(each.model) for each in chosen)
            self._genres.append(known.get(models) or _make_genre(models, chosen, content_names))
        self._coarse = ModelBank([genre.pooled for genre in self._genres], content_names)
        self._coarse_means = np.array([genre.mean for genre in self._genres])

    def rank(self, graph: LayoutGraph, most_candidates: int = MOST_CANDIDATES) -> ModelRanking:
        """Ranking of all models on a page of N >= 1 zones."""
        zones = graph.zones
        coarse = self._coarse.unary_scores(graph)
        coarse_excess = excess_costs(coarse.comparable / zones, self._coarse_means)
        order = np.argsort(coarse_excess, kind="stable")
        kept, left = _split(order.tolist(), [len(each) for each in self._members], most_candidates)
        costs, comparable = np.empty((2, len(self._means)))
        for number in kept:
            scores = self._genres[number].bank.unary_scores(graph)
            costs[self._members[number]], comparable[self._members[number]] = scores.costs, scores.comparable
        scored = np.sort(np.concatenate([self._members[number] for number in kept]))
        of_scored = comparable[scored] / zones + self._biases[scored]
        excess = excess_costs(of_scored, self._means[scored])
        for number in left:
            members = self._members[number]
            costs[members] = coarse.costs[number]
            least = max(float(excess.max()), float(coarse_excess[number]))
            usual = SHARE_OF_MEAN * self._means[members] - self._biases[members]
            comparable[members] = zones * (least + usual)
        best = scored[np.argsort(excess, kind="stable")][:most_candidates]
        return ModelRanking(tuple(best.tolist()), costs, comparable)


def _make_genre(models: _Key, chosen: Sequence[Competitor], content_names: tuple[str, ...]) -> _Genre:
    compiled = [each.compiled for each in chosen]
    return _Genre(
        models=models,
        bank=ModelBank(compiled, content_names),
        pooled=pool_models([each.model for each in chosen], compiled),
        mean=float(np.mean([each.model.calibration.mean for each in chosen])),
    )


def _split(ranked: list[int], sizes: Sequence[int], most_candidates: int) -> tuple[list[int], list[int]]:
    """The genres whose members get unary scores, and the others: more than `MOST_GENRES` only where those are small."""
    count, members = 0, 0
    while count < len(ranked) and (count < MOST_GENRES or members < most_candidates):
        members += sizes[ranked[count]]
        count += 1
    return ranked[:count], ranked[count:]


def _group(competitors: Sequence[Competitor], content_names: tuple[str, ...]) -> Iterator[NDArray[np.intp]]:
    """Indices of each genre's members: the named genres by name, then those by likeness."""
    named: dict[str, list[int]] = {}
    others = []
    for index, each in enumerate(competitors):
        if each.genre is None:
            others.append(index)
        else:
            named.setdefault(each.genre, []).append(index)
    for name in sorted(named):
        yield np.array(named[name], np.intp)
    if others:
        alike = group_alike([_likeness(competitors[index], content_names) for index in others])
        for group in range(alike.max() + 1):
            yield np.array(others, np.intp)[alike == group]


_Base = tuple[tuple[str, ...], _Key, tuple[str | None, ...]]

_KEPT: OrderedDict[_Base, Hierarchy] = OrderedDict()
"""The hierarchies that were last used. They hold arrays and no model: a model that nobody keeps is free to go."""

_LIKENESSES: WeakKeyDictionary[LayoutModel, tuple[tuple[str, ...], NDArray[np.float64]]] = WeakKeyDictionary()


def rank_models(
    graph: LayoutGraph, competitors: Sequence[Competitor], most_candidates: int = MOST_CANDIDATES
) -> ModelRanking:
    """Ranking of all models on a page of N >= 1 zones, independent of their order.

    Their hierarchy is made when they compete for the first time. When one model has changed, its genre is made anew.
    """
    order = sorted(range(len(competitors)), key=lambda index: competitors[index].model.name)
    hierarchy = _hierarchy([competitors[index] for index in order], graph.content_names)
    found = hierarchy.rank(graph, most_candidates)
    costs, comparable = np.empty((2, len(order)))
    costs[order], comparable[order] = found.costs, found.comparable
    return ModelRanking(tuple(order[index] for index in found.candidates), costs, comparable)


def _hierarchy(competitors: Sequence[Competitor], content_names: tuple[str, ...]) -> Hierarchy:
    models = tuple(ref(each.model) for each in competitors)
    base = content_names, models, tuple(each.genre for each in competitors)
    if base not in _KEPT:
        before = [kept for (names, *_), kept in _KEPT.items() if names == content_names]
        _KEPT[base] = Hierarchy(competitors, content_names, before)
    _KEPT.move_to_end(base)
    while len(_KEPT) > MOST_KEPT:
        _KEPT.popitem(last=False)
    return _KEPT[base]


def _likeness(competitor: Competitor, content_names: tuple[str, ...]) -> NDArray[np.float64]:
    kept = _LIKENESSES.get(competitor.model)
    if kept is None or kept[0] != content_names:
        described = describe_likeness(competitor.model, competitor.compiled)
        kept = _LIKENESSES[competitor.model] = content_names, described
    return kept[1]
