"""From all models to the candidates: none is lost, their order does not matter, nothing is kept alive."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest

from services.layout.recognition.classification import SHARE_OF_MEAN
from services.layout.recognition.hierarchy import Competitor, Hierarchy, descent, rank_models
from services.layout.recognition.page_recognition import VersionedModel
from tests.services.layout.recognition.hierarchy.bases import NAMES, base, competitors, compiled, graph_of
from tests.services.layout.samples import MAKERS, model_of

MANY = 9
"""Publications of each class: 54 models, seven or eight genres."""


def genres_of(hierarchy: Hierarchy) -> list[tuple[int, ...]]:
    """Indices of the models of each genre."""
    return [tuple(members.tolist()) for members in hierarchy._members]


def test_every_model_is_in_one_genre() -> None:
    hierarchy = Hierarchy(competitors(base(MANY)), NAMES)
    members = sorted(index for genre in genres_of(hierarchy) for index in genre)
    assert members == list(range(len(base(MANY))))
    assert descent.MOST_GENRES < len(genres_of(hierarchy)) <= 8


@pytest.mark.parametrize("name", MAKERS)
def test_the_class_of_a_page_is_the_first_candidate(name: str) -> None:
    models = competitors(base(MANY))
    for seed in (1000, 1001):
        ranking = rank_models(graph_of(name, seed), models)
        assert models[ranking.candidates[0]].model.name == name
        assert len(set(ranking.candidates)) == len(ranking.candidates) == descent.MOST_CANDIDATES


def test_what_is_ruled_out_stands_behind_what_was_looked_at() -> None:
    models = competitors(base(MANY))
    hierarchy, graph = Hierarchy(models, NAMES), graph_of("margin", 1002)
    ranking = hierarchy.rank(graph)
    means = np.array([each.model.calibration.mean for each in models])
    excess = ranking.comparable / graph.zones - SHARE_OF_MEAN * means
    by_genre = [excess[list(genre)] for genre in genres_of(hierarchy)]
    ruled_out = [values for values in by_genre if np.ptp(values) < 1e-9]
    looked = np.concatenate([values for values in by_genre if np.ptp(values) >= 1e-9])
    assert 1 <= len(ruled_out) <= len(by_genre) - descent.MOST_GENRES
    assert min(values.min() for values in ruled_out) >= looked.max() - 1e-9
    chosen = [excess[index] for index in ranking.candidates]
    assert chosen == sorted(chosen)
    assert chosen[-1] <= np.delete(excess, ranking.candidates).min()


def test_the_order_of_models_does_not_matter() -> None:
    models, graph = competitors(base(MANY)), graph_of("memo", 1003)
    order = np.random.default_rng(0).permutation(len(models))
    one = rank_models(graph, models)
    other = rank_models(graph, [models[k] for k in order])
    assert [int(order[k]) for k in other.candidates] == list(one.candidates)
    np.testing.assert_array_equal(other.costs, one.costs[order])
    np.testing.assert_array_equal(other.comparable, one.comparable[order])


def test_named_genres_are_the_users() -> None:
    models = [
        replace(each, genre=None if k % 3 == 0 else f"genre {k % 3}")
        for k, each in enumerate(competitors(base(MANY)))
    ]
    genres = genres_of(Hierarchy(models, NAMES))
    for name in ("genre 1", "genre 2"):
        assert tuple(k for k, each in enumerate(models) if each.genre == name) in genres
    ranking = rank_models(graph_of("fax", 1004), models)
    assert models[ranking.candidates[0]].model.name == "fax"


def test_genres_of_few_models_still_give_all_candidates() -> None:
    models = [replace(each, genre=each.model.name) for each in competitors(base(MANY))]
    ranking = rank_models(graph_of("letter", 1005), models)
    assert len(ranking.candidates) == descent.MOST_CANDIDATES
    assert models[ranking.candidates[0]].model.name == "letter"


@pytest.mark.parametrize("genre", [None, "all"])
def test_one_genre_and_one_model(genre: str | None) -> None:
    graph = graph_of("memo", 1006)
    alone = [Competitor(model_of("memo", 3), compiled(model_of("memo", 3)), genre)]
    assert rank_models(graph, alone).candidates == (0,)
    # The same model many times over: every order of them is as good.
    equal = rank_models(graph, alone * 40)
    assert len(set(equal.candidates)) == descent.MOST_CANDIDATES
    assert np.ptp(equal.comparable) < 1e-3


def test_one_model_in_two_genres() -> None:
    twice = [Competitor(each.model, each.compiled, name) for name in "ab" for each in competitors(base(1))]
    ranking = rank_models(graph_of("memo", 1006), twice, 2)
    assert sorted(ranking.candidates) == [1, 7]


def test_a_changed_model_changes_its_genre_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []
    make = descent._make_genre

    def counting(models: descent._Key, *rest: object) -> object:
        made.append(len(models))
        return make(models, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(descent, "_make_genre", counting)
    monkeypatch.setattr(descent, "_KEPT", type(descent._KEPT)())
    models, graph = competitors(base(MANY)), graph_of("fax", 1007)
    rank_models(graph, models)
    genres = len(made)
    assert sum(made) == len(models)
    rank_models(graph, models)
    assert sum(made) == len(models)
    worse = replace(models[0].model, calibration=replace(models[0].model.calibration, mean=-9.0))
    models[0] = Competitor(worse, compiled(worse))
    rank_models(graph, models)
    assert len(made) == genres + 1
    assert made[-1] < len(models) / 2


def test_hierarchies_are_few_and_keep_no_model_alive() -> None:
    graph = graph_of("memo", 1008)
    for count in range(2, 2 + 2 * descent.MOST_KEPT):
        rank_models(graph, competitors(base(2)[:count]))
    assert len(descent._KEPT) == descent.MOST_KEPT
    models = [VersionedModel(replace(each.model), 1) for each in base(2)]
    rank_models(graph, competitors(tuple(models)))
    kept = [weakref.ref(each.model) for each in models]
    del models
    gc.collect()
    assert [each() for each in kept] == [None] * len(kept)
