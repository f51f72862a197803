"""Sections: which title a zone belongs to, from its own words and the titles above it."""

from dataclasses import replace

import numpy as np
import pytest

from services.layout.graph.layout_graph import DERIVED_FEATURES, build_graph
from services.layout.graph.section_features import SECTION_FEATURES, measure_sections
from services.layout.learning.statistics_update import update_statistics
from services.layout.model.compiled_model import content_scale_name
from services.layout.model.layout_model import LayoutModel, ModelNode
from services.layout.model.learning_model import begin_learning
from services.layout.model.statistics import LabelledGraph
from services.layout.page import Box, Page, Zone
from services.layout.pipeline import VersionedModel, content_features, initialize_model, recognize

ABSTRACT, TEXT, NEITHER = [1.0, 0.0], [0.0, 1.0], [0.0, 0.0]
LEFT, WIDE = (300.0, 500.0), (300.0, 900.0)
PROSE = "Many systems of this kind have been described, and most of them need more samples than a user has."


def zone(text: str, top: float, across: tuple[float, float] = WIDE, height: float = 40.0) -> Zone:
    box: Box = (across[0], top, across[1], top + height)
    return Zone(f"{text[:12]} {top:g}", box, text=text)


def page(*zones: Zone) -> Page:
    return content_features().measure_page(Page(1000, 1400, zones))


def sections(*zones: Zone) -> list[list[float]]:
    """`SECTION_FEATURES` of every zone."""
    seen = page(*zones)
    return measure_sections(seen, np.array([each.box for each in seen.zones])).tolist()


@pytest.mark.parametrize("title", ["Abstract", "1 Abstract", "ABSTRACT"])
def test_the_title_above_names_the_section(title: str) -> None:
    found = sections(
        zone("Layout of Pages by Few Samples", 100),
        zone(title, 200, LEFT),
        zone(PROSE, 250),
        zone("1 Introduction", 300, LEFT),
        zone(PROSE, 350),
        zone(PROSE, 400),
    )
    assert found == [NEITHER, ABSTRACT, ABSTRACT, TEXT, TEXT, TEXT]


def test_a_zone_may_begin_with_its_own_title() -> None:
    assert sections(zone(f"Abstract — {PROSE}", 100), zone(PROSE, 200)) == [ABSTRACT, ABSTRACT]


@pytest.mark.parametrize("title", ["Keywords: layout, labels, few samples", "References"])
def test_other_titles_end_a_section(title: str) -> None:
    found = sections(zone("Abstract", 100), zone(title, 200), zone(PROSE, 300))
    assert found == [ABSTRACT, NEITHER, NEITHER]


def test_titles_of_another_column_name_nothing() -> None:
    found = sections(
        zone("1 Introduction", 100, (600.0, 950.0)),
        zone(PROSE, 200, (50.0, 400.0)),
        zone(PROSE, 200, (600.0, 950.0)),
    )
    assert found == [TEXT, NEITHER, TEXT]


def test_a_summary_is_a_section_like_others() -> None:
    """The word is a weak cue of an abstract, and a sure title."""
    assert sections(zone("Summary", 100), zone(PROSE, 200)) == [TEXT, TEXT]


def test_titles_in_other_languages() -> None:
    german = (
        "Die Verfahren, die wir hier beschreiben, sind nicht neu, aber sie werden von den meisten "
        "Diensten nicht angeboten, und das ist für den Leser ein Nachteil."
    )
    found = sections(
        zone("Zusammenfassung", 100), zone(german, 200), zone("1 Einleitung", 300), zone(german, 400)
    )
    assert found[3] == TEXT
    assert found[1][0] > found[1][1]


def test_an_unsure_title_leaves_the_rest_to_the_one_above() -> None:
    """Of a title that is as likely none, half is decided by the next one."""
    zones = [
        replace(zone("", top), content=content)
        for top, content in ((0, {"abstract": 1.0}), (100, {"heading": 0.6}), (200, {"prose": 1.0}))
    ]
    boxes = np.array([each.box for each in zones])
    np.testing.assert_allclose(measure_sections(Page(1000, 1400, tuple(zones)), boxes)[2], [0.4, 0.6])


def test_pieces_of_a_zone_belong_where_the_zone_does() -> None:
    """Segmentation may cut what a person draws as one zone, in any order of the zones."""
    whole = [zone("1 Introduction", 100), zone(PROSE, 200, height=200)]
    pieces = [zone(PROSE, 200 + 50 * at) for at in range(4)]
    found = sections(*pieces[::-1], whole[0])
    assert found[:4] == [sections(*whole)[1]] * 4


@pytest.mark.parametrize("count", [0, 1])
def test_pages_of_no_and_one_zone(count: int) -> None:
    seen = Page(1000, 1400, tuple(zone("", 100.0) for _ in range(count)))
    assert measure_sections(seen, np.zeros((count, 4))).shape == (count, len(SECTION_FEATURES))


def test_sections_are_unknown_on_a_page_that_was_not_read() -> None:
    graph = build_graph(Page(1000, 1400, (zone("", 100), zone("", 200))), content_features().names)
    columns = [graph.content_names.index(name) for name in SECTION_FEATURES]
    assert np.isnan(graph.content[:, columns]).all()


def sample(top: float, titles: tuple[str, str]) -> Page:
    """Two paragraphs alike under two titles; only the titles tell which is the abstract."""
    rows = [
        (titles[0], 0.0, "section-title"),
        (PROSE, 50.0, ""),
        (titles[1], 100.0, "section-title"),
        (PROSE, 150.0, ""),
    ]
    label = {"Abstract": "abstract", "1 Introduction": "body"}
    zones = [
        replace(zone(text, top + down), label=given or label[titles[place // 2]])
        for place, (text, down, given) in enumerate(rows)
    ]
    return page(*zones)


def test_only_the_title_above_tells_the_abstract_from_the_text() -> None:
    """Where both come first as often, no place and no neighbour's label tells them."""
    both = ("Abstract", "1 Introduction")
    model = initialize_model("class", [sample(100 + 10 * n, both if n % 2 else both[::-1]) for n in range(6)])
    for asked in (both, both[::-1]):
        true = sample(125, asked)
        seen = recognize(unlabelled(true), [VersionedModel(model, 1)])
        assert [each.label for each in seen.zones] == [each.label for each in true.zones]


def unlabelled(labelled: Page) -> Page:
    return replace(labelled, zones=tuple(replace(each, label=None) for each in labelled.zones))


def without(model: LayoutModel, cues: tuple[str, ...] = ()) -> LayoutModel:
    """The model as it was stored before graphs had sections; without the content features `cues`, too."""
    left_out = {*SECTION_FEATURES, *cues}
    scales = {content_scale_name(name) for name in left_out}

    def kept(node: ModelNode) -> ModelNode:
        return replace(
            node, content={name: each for name, each in node.content.items() if name not in left_out}
        )

    stored = model.statistics
    assert stored is not None
    sums = tuple(
        replace(node, content={name: each for name, each in node.content.items() if name not in left_out})
        for node in stored.nodes
    )
    return replace(
        model,
        nodes=tuple(map(kept, model.nodes)),
        scales={name: each for name, each in model.scales.items() if name not in scales},
        statistics=replace(stored, nodes=sums),
    )


def test_a_model_without_sections_gives_them_no_cost() -> None:
    """The cost of a page is the same whatever the titles are, where the model knows neither them nor sections."""
    asked = unlabelled(sample(100, ("Abstract", "1 Introduction")))
    cues = ("abstract", "heading")
    old = without(initialize_model("class", [sample(100, ("Abstract", "1 Introduction"))]), cues)
    blank = replace(
        asked,
        zones=tuple(
            replace(each, content={**each.content, **dict.fromkeys(cues, 0.0)}) for each in asked.zones
        ),
    )
    found = [recognize(each, [VersionedModel(old, 1)]).match for each in (asked, blank)]
    assert found[0] is not None
    assert found[1] is not None
    assert found[0].cost == pytest.approx(found[1].cost)


def test_a_model_without_sections_learns_them() -> None:
    """From the next page that it is taught, without the pages before."""
    titles = ("Abstract", "1 Introduction")
    names = (*content_features().names, *DERIVED_FEATURES)
    old = begin_learning(without(initialize_model("class", [sample(100, titles)])), names)
    column = names.index("section:abstract")
    assert np.isnan(old.model.content[:, column]).all()
    taught = sample(110, titles)
    graph = build_graph(taught, content_features().names)
    learned = update_statistics(old, LabelledGraph(graph, tuple(each.label for each in taught.zones)))
    expected = dict(zip(learned.labels, learned.model.content[:, column].tolist(), strict=True))
    assert expected["abstract"] > 2 * expected["body"]
    assert np.isnan(expected[None]), "no zone of the page was null"
