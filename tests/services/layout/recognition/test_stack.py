"""Where the documents of a stack begin: chains by hand against all that there are, then simulated stacks."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from math import exp, log
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.layout.model.layout_model import PieceStatistics
from services.layout.page import Page
from services.layout.pipeline import VersionedModel, content_features, initialize_model
from services.layout.recognition.documents import recognize_document
from services.layout.recognition.page_recognition import RecognitionParameters
from services.layout.recognition.stack import Likelihoods, StackParts, most_probable_parts, part_stack
from simulation.labelled_pages import DocumentKind, document_pages
from tests.services.layout.samples import page_from

pytestmark = pytest.mark.pipeline

KINDS: tuple[DocumentKind, ...] = get_args(DocumentKind)
SAMPLES = 5
BEGINNING = 0.35


def chains(pages: Sequence[Likelihoods]) -> Iterator[tuple[float, tuple[int, ...]]]:
    """The log probability of every chain and its beginnings, one by one."""
    classes = len(pages[0][0])
    for states in product(range(classes), repeat=len(pages)):
        for begins in product((False, True), repeat=len(pages) - 1):
            total, before = pages[0][0][states[0]], states[0]
            for place, fresh in enumerate(begins, 1):
                state = states[place]
                if fresh:
                    total += log(BEGINNING / classes) + pages[place][0][state]
                elif state == before:
                    total += log(1 - BEGINNING) + pages[place][1][state]
                else:
                    total = -np.inf
                before = state
            yield float(total), (0, *(place for place, fresh in enumerate(begins, 1) if fresh))


@given(st.lists(st.tuples(*[st.floats(-6, 6)] * 4), min_size=1, max_size=4))
def test_the_search_finds_the_most_probable_of_all_chains(costs: list[tuple[float, ...]]) -> None:
    pages = [(np.array(each[:2]), np.array(each[2:])) for each in costs]
    every = list(chains(pages))
    found = most_probable_parts(pages, BEGINNING)
    assert max(total for total, begins in every if begins == found.beginnings) == pytest.approx(
        max(total for total, _ in every)
    )
    whole = sum(exp(total) for total, _ in every)
    for place, probability in enumerate(found.probabilities):
        assert probability == pytest.approx(
            sum(exp(total) for total, begins in every if place in begins) / whole
        )


def document(seed: int, kind: DocumentKind, pages: int) -> list[Page]:
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    features = content_features()
    return [features.measure_page(page_from(page)) for page in document_pages(rng, kind, pages, draw=False)]


def model(name: str, samples: Sequence[Page], continues: str | None = None) -> VersionedModel:
    """A model as workers get it: without what only learning needs."""
    return VersionedModel(replace(initialize_model(name, samples), statistics=None), 1, continues=continues)


@pytest.fixture(scope="module")
def models() -> list[VersionedModel]:
    """Of each kind a model of first pages and one of all later ones, from documents of one to four pages."""
    found = []
    for kind in KINDS:
        samples = [document(9000 + seed, kind, 1 + seed % 4) for seed in range(SAMPLES)]
        later = [page for pages in samples for page in pages[1:]]
        found.append(model(kind, [pages[0] for pages in samples]))
        found.append(model(f"{kind}-later", later, continues=kind))
    return found


def part(pages: Sequence[Page], models: Sequence[VersionedModel]) -> StackParts:
    return part_stack(pages, models, content_features().names, RecognitionParameters())


STACK: tuple[tuple[DocumentKind, int], ...] = (
    ("letter", 1),
    ("letter", 3),
    ("memo", 1),
    ("two-column", 2),
    ("plain", 4),
    ("memo", 2),
    ("letter", 1),
)
BEGINNINGS = (0, 1, 4, 5, 7, 11, 13)


def stack() -> list[Page]:
    return [page for seed, (kind, pages) in enumerate(STACK) for page in document(seed, kind, pages)]


def test_documents_of_a_stack_begin_where_they_do(models: list[VersionedModel]) -> None:
    found = part(stack(), models)
    assert found.beginnings == BEGINNINGS
    for place, probability in enumerate(found.probabilities):
        assert (probability > 0.9) if place in BEGINNINGS else (probability < 0.1)


def test_first_pages_alone_tell_where_a_document_begins(models: list[VersionedModel]) -> None:
    """Later pages look like the class too; what they lack of its samples' labels says that they begin nothing."""
    firsts = [model for model in models if model.continues is None]
    found = part(stack(), firsts)
    assert set(found.beginnings) <= set(BEGINNINGS)
    assert len(found.beginnings) >= len(BEGINNINGS) - 1


def test_middle_pages_begin_nothing_where_all_samples_were_last_ones() -> None:
    samples = [document(9000 + seed, "letter", 2) for seed in range(SAMPLES)]
    models = [
        model("letter", [first for first, _ in samples]),
        model("letter-later", [last for _, last in samples], continues="letter"),
    ]
    letters = [document(seed, "letter", 3) for seed in range(4)]
    found = part([page for letter in letters for page in letter], models)
    assert found.beginnings == (0, 3, 6, 9)


def test_labels_within_larger_zones_are_not_missed_on_first_pages() -> None:
    """A date in the line of a letterhead is no zone before parts of lines are taken out."""
    samples = [document(9000 + seed, "letter", 2) for seed in range(SAMPLES)]
    first = model("letter", [page for page, _ in samples])
    later = model("letter-later", [page for _, page in samples], continues="letter")
    within = {"date", "letterhead"}
    nodes = (
        replace(node, pieces=PieceStatistics(within=9.0)) if node.label in within else node
        for node in first.model.nodes
    )
    in_lines = replace(first, model=replace(first.model, nodes=tuple(nodes)))
    letters = [document(seed, "letter", 2) for seed in range(4)]
    pages = [
        replace(page, zones=tuple(zone for zone in page.zones if zone.label not in within))
        for letter in letters
        for page in letter
    ]
    assert part(pages, [in_lines, later]).beginnings == (0, 2, 4, 6)
    assert len(part(pages, [first, later]).beginnings) < 4


@pytest.mark.parametrize("with_later", [True, False], ids=["later models", "first models alone"])
def test_a_document_of_a_stack_is_recognized_as_if_it_came_alone(
    models: list[VersionedModel], with_later: bool
) -> None:
    """What was matched for the beginnings is not matched again, where the same models compete."""
    known = models if with_later else [model for model in models if model.continues is None]
    pages, names = stack()[:5], content_features().names
    parts = part(pages, known)
    assert parts.beginnings == (0, 1, 4)
    again = recognize_document(pages[1:4], known, names, matched=parts.matched[1:4])
    alone = recognize_document(pages[1:4], known, names)
    assert again.classes == alone.classes
    for seen, other in zip(again.pages, alone.pages, strict=True):
        assert seen.recognition.zones == other.recognition.zones
        assert seen.recognition.chosen == other.recognition.chosen
    marked = [replace(each, unknown_probability=0.5) for each in parts.matched[1:4]]
    found = recognize_document(pages[1:4], known, names, matched=marked).pages
    assert [page.recognition.unknown_probability == 0.5 for page in found] == [not with_later, True, True]


def test_blank_pages_begin_nothing(models: list[VersionedModel]) -> None:
    blank = Page(850.0, 1100.0, ())
    letter, memo = document(1, "letter", 2), document(2, "memo", 1)
    assert part([blank, *letter, blank, *memo, blank], models).beginnings == (0, 4)
    assert part([blank, blank], models) == StackParts((0,), (1.0, 0.0))


def test_without_a_model_a_stack_is_one_document() -> None:
    assert part(stack()[:3], []) == StackParts((0,), (1.0, 0.0, 0.0))
