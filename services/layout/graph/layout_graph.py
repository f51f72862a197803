"""Layout graph instances (5.3): a page's zones as a fully connected attributed graph."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.layout.graph.amount_features import AMOUNT_FEATURES, measure_amounts
from services.layout.graph.edge_attributes import RELATIONS, measure_pairs, pair_zones
from services.layout.graph.node_attributes import NUMERIC_ATTRIBUTES, describe_zones
from services.layout.graph.section_features import SECTION_FEATURES, measure_sections
from services.layout.graph.zone_words import NO_TOKENS, PageTokens, page_tokens
from services.layout.page import Page

MOST_NEIGHBOURS = 40
"""Pages of more than twice as many zones are joined to their nearest only: 500 zones have 12 000 pairs, not 125 000."""

KIND_FEATURES = {"kind:rule": "rule", "kind:noise": "noise"}
"""Content features from the kind of a zone: rules and noise, which mostly have no label."""

DERIVED_FEATURES = (*SECTION_FEATURES, *AMOUNT_FEATURES, *KIND_FEATURES)
"""Features that every graph has after those of its zones' content; a model made without one gives it no cost."""

RELATION_OFFSETS = np.concatenate([[0], np.cumsum([len(relation.descriptors) for relation in RELATIONS])])
"""Index of the first descriptor of each relation in an array of the descriptors of all relations."""


@dataclass(frozen=True, slots=True, eq=False)
class LayoutGraph:
    """The graph of a page with N zones.

    `numeric` (N, A) in the order of `NUMERIC_ATTRIBUTES`, NaN where unknown; `content` (N, C) confidences of the
    features `content_names`, the last ones being `DERIVED_FEATURES`, all but the kinds NaN on a page that was not read;
    `pairs` (E, 2) of (upper, lower) zones; `relations` (E, R) descriptors in the order of `RELATIONS`; `tokens` what
    its zones say (`zone_words`), none where that is not known.
    """

    numeric: NDArray[np.float64]
    content: NDArray[np.float64]
    content_names: tuple[str, ...]
    pairs: NDArray[np.intp]
    relations: NDArray[np.intp]
    tokens: PageTokens = NO_TOKENS

    @property
    def zones(self) -> int:
        return len(self.numeric)

    @property
    def is_read(self) -> bool:
        """Whether the page's text was read, so that the content of its zones is known."""
        return not np.isnan(self.content).any()

    def descriptor_indicators(self) -> NDArray[np.float64]:
        """(E, D) with a one for each relation's descriptor, D of all relations side by side."""
        indicators = np.zeros((len(self.pairs), RELATION_OFFSETS[-1]))
        np.put_along_axis(indicators, self.relations + RELATION_OFFSETS[:-1], 1.0, axis=1)
        return indicators


def build_graph(
    page: Page,
    content_names: Sequence[str],
    most_neighbours: int = MOST_NEIGHBOURS,
    printed: Page | None = None,
) -> LayoutGraph:
    """Layout graph of `page`, whose zones already carry their content features.

    On a page of more than twice `most_neighbours` zones only the nearest are joined. `printed` is the page with all of
    its print, where its zones are those that a person drew (`zone_words.page_tokens`).
    """
    measures = describe_zones(page)
    with np.errstate(all="ignore"):
        columns = [attribute.measure(measures) for attribute in NUMERIC_ATTRIBUTES]
    numeric = np.stack(columns, axis=1)
    content = np.array(
        [[zone.content.get(name, 0.0) for name in content_names] for zone in page.zones], dtype=np.float64
    ).reshape(len(page.zones), len(content_names))
    amounts = measure_amounts(page, page if printed is None else printed)
    content = np.hstack([content, measure_sections(page, measures.boxes), amounts])
    if not any(zone.content or zone.text for zone in page.zones):
        content[:] = np.nan
    kinds = np.array(
        [[zone.kind == kind for kind in KIND_FEATURES.values()] for zone in page.zones], dtype=np.float64
    ).reshape(len(page.zones), len(KIND_FEATURES))
    pairs = pair_zones(measures, most_neighbours)
    pair_measures = measure_pairs(measures, pairs)
    relations = np.stack([relation.measure(pair_measures) for relation in RELATIONS], axis=1)
    return LayoutGraph(
        numeric,
        np.hstack([content, kinds]),
        (*content_names, *DERIVED_FEATURES),
        pairs,
        relations,
        page_tokens(page, printed),
    )
