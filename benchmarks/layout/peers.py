"""The peer of layout recognition: a random forest that labels zone by zone from the very same attributes."""

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import RandomForestClassifier

from services.layout.graph.layout_graph import build_graph
from services.layout.page import Page
from services.layout.pipeline import content_features

TREES = 300
UNKNOWN = -100.0
"""Stands for what is not known of a zone (NaN): far from every value, so that one split parts it."""
UNLABELLED = "\0unlabelled"
"""Class of zones without a label."""


def zone_features(page: Page) -> NDArray[np.float64]:
    """Attributes and content features (N, A + C) of a page's zones, exactly those of its layout graph's nodes."""
    graph = build_graph(page, content_features().names)
    return np.asarray(np.nan_to_num(np.hstack([graph.numeric, graph.content]), nan=UNKNOWN))


class ForestLabels:
    """Labels of zones by a random forest of `TREES` trees, each zone by itself."""

    def __init__(self, samples: Sequence[Page], seed: int = 0) -> None:
        features = np.vstack([zone_features(page) for page in samples if page.zones])
        labels = [zone.label or UNLABELLED for page in samples for zone in page.zones]
        with warnings.catch_warnings():
            # Many labels for few zones: that is how it is with one sample.
            warnings.filterwarnings("ignore", message="The number of unique classes")
            self._forest = RandomForestClassifier(TREES, random_state=seed, n_jobs=1).fit(features, labels)

    def label(self, pages: Sequence[Page]) -> list[tuple[str | None, ...]]:
        """Labels of the zones of each page, in their order."""
        sizes = [len(page.zones) for page in pages]
        if not sum(sizes):
            return [() for _ in pages]
        features = np.vstack([zone_features(page) for page in pages if page.zones])
        found = [None if label == UNLABELLED else str(label) for label in self._forest.predict(features)]
        ends = np.cumsum(sizes)
        return [tuple(found[end - size : end]) for size, end in zip(sizes, ends.tolist(), strict=True)]
