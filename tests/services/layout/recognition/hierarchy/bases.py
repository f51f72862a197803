"""Bases of many models: those of simulated classes, and publications that differ from them."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from services.layout.graph.layout_graph import DERIVED_FEATURES, LayoutGraph, build_graph
from services.layout.model.compiled_model import CompiledModel, compile_model
from services.layout.model.layout_model import LayoutModel, ModelNode, NumericExpectation
from services.layout.pipeline import content_features
from services.layout.recognition.hierarchy import Competitor
from services.layout.recognition.page_recognition import VersionedModel
from tests.services.layout.samples import MAKERS, labelled_page, model_of

NAMES = (*content_features().names, *DERIVED_FEATURES)


def publication(model: LayoutModel, seed: int, deviations: float = 2.0) -> LayoutModel:
    """A model like `model` whose zones lie elsewhere, in other sizes; seed 0 is the model itself."""
    if seed == 0:
        return model
    rng = np.random.default_rng(seed)

    def moved(node: ModelNode) -> ModelNode:
        numeric = {
            name: NumericExpectation(
                each.value + deviations * float(np.sqrt(each.variance)) * float(rng.normal()), each.variance
            )
            for name, each in node.numeric.items()
        }
        return replace(node, numeric=numeric)

    return replace(model, name=f"{model.name}-{seed}", nodes=tuple(map(moved, model.nodes)))


@lru_cache(maxsize=4)
def base(publications: int, deviations: float = 2.0) -> tuple[VersionedModel, ...]:
    """So many publications of each of the simulated classes."""
    return tuple(
        VersionedModel(publication(model_of(name, 3), seed, deviations), 1)
        for name in MAKERS
        for seed in range(publications)
    )


def compiled(model: LayoutModel) -> CompiledModel:
    return compile_model(model, NAMES)


def competitors(models: tuple[VersionedModel, ...]) -> list[Competitor]:
    return [Competitor(each.model, compiled(each.model), each.genre) for each in models]


def graph_of(document_class: str, seed: int) -> LayoutGraph:
    return build_graph(labelled_page(document_class, seed), content_features().names)
