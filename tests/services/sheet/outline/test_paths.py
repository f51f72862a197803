"""Best paths across grids."""

import itertools

import numpy as np

from services.sheet.outline.paths import find_closed_paths, find_open_paths


def test_open_paths_are_as_good_as_the_best_of_all() -> None:
    rng = np.random.default_rng(3)
    for _ in range(5):
        score = rng.random((5, 6))
        path = find_open_paths(score[None], 1, 0.1)[0]
        best = -np.inf
        for tried in itertools.product(range(6), repeat=5):
            steps = np.abs(np.diff(tried))
            if steps.max() <= 1:
                best = max(best, score[np.arange(5), tried].sum() - 0.1 * steps.sum())
        assert np.isclose(score[np.arange(5), path].sum() - 0.1 * np.abs(np.diff(path)).sum(), best)


def test_closed_paths_close() -> None:
    rays, samples = 90, 40
    radius = 18 + 6 * np.sin(2 * np.pi * np.arange(rays) / rays * 3)
    score = np.exp(-0.5 * (np.arange(samples) - radius[:, None]) ** 2)
    score += 0.2 * np.random.default_rng(1).random(score.shape)
    path = find_closed_paths(score[None], 3, 0.02)[0]
    assert np.abs(path - radius).max() <= 1.5
    assert abs(int(path[0]) - int(path[-1])) <= 3


def test_barred_samples_are_never_used() -> None:
    score = np.zeros((20, 10))
    score[:, 4] = 5.0
    score[:, :7] = -np.inf
    assert (find_closed_paths(score[None], 2, 0.1) >= 7).all()


def test_grids_that_are_searched_together_have_the_paths_that_each_has_alone() -> None:
    scores = np.random.default_rng(5).random((4, 30, 17))
    scores[2, :, :5] = -np.inf
    together = find_closed_paths(scores, 3, 0.05)
    alone = [find_closed_paths(score[None], 3, 0.05)[0] for score in scores]
    assert np.array_equal(together, alone)
