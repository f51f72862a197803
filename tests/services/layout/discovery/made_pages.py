"""Pages of the sample classes, as graphs."""

from functools import cache

from services.layout.discovery.class_samples import ClassSamples, gather_samples
from services.layout.graph.layout_graph import LayoutGraph, build_graph
from services.layout.pipeline import content_features
from tests.services.layout.samples import labelled_page

NAMES = content_features().names


@cache
def graph_of(name: str, seed: int) -> LayoutGraph:
    return build_graph(content_features().measure_page(labelled_page(name, seed)), NAMES)


@cache
def samples_of(name: str, seeds: tuple[int, ...]) -> ClassSamples:
    pages = [content_features().measure_page(labelled_page(name, seed)) for seed in seeds]
    return gather_samples(name, [(page, None) for page in pages], NAMES)[0]
