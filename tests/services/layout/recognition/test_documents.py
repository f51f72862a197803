"""Documents of several pages: one class from all pages, each page labelled by a model of it, strays and blanks."""

from dataclasses import replace
from functools import lru_cache
from typing import get_args

import numpy as np
import pytest

from services.layout.model.layout_model import LayoutModel
from services.layout.page import Page
from services.layout.pipeline import VersionedModel, content_features, initialize_model, recognize
from services.layout.recognition.documents import (
    DocumentRecognition,
    class_of,
    place_again,
    place_page,
    recognize_document,
)
from services.layout.recognition.page_recognition import RecognitionParameters
from simulation.labelled_pages import DocumentKind, document_pages
from tests.services.layout.samples import labelled_page, model_of, page_from

pytestmark = pytest.mark.pipeline

NAMES = content_features().names
KINDS: tuple[DocumentKind, ...] = get_args(DocumentKind)
SAMPLES = 5
BLANK = Page(1240.0, 1754.0, ())


@lru_cache(maxsize=64)
def pages_of(kind: DocumentKind, seed: int, pages: int) -> tuple[Page, ...]:
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    return tuple(page_from(page) for page in document_pages(rng, kind, pages, draw=False))


@lru_cache(maxsize=16)
def model(kind: DocumentKind, place: int) -> LayoutModel:
    samples = [pages_of(kind, 9000 + seed, 3 - seed % 2)[-1 if place else 0] for seed in range(SAMPLES)]
    return initialize_model(f"{kind}-continuation" if place else kind, samples)


def firsts() -> list[VersionedModel]:
    return [VersionedModel(model(kind, 0), 1) for kind in KINDS]


def later(*kinds: DocumentKind) -> list[VersionedModel]:
    return [VersionedModel(model(kind, 1), 2, continues=kind) for kind in kinds or KINDS]


def found(pages: tuple[Page, ...], models: list[VersionedModel]) -> DocumentRecognition:
    return recognize_document(pages, models, NAMES)


def wrong(document: DocumentRecognition) -> int:
    return sum(zone.label != zone.zone.label for page in document.pages for zone in page.recognition.zones)


@pytest.mark.parametrize("kind", KINDS)
def test_documents_have_a_class_and_their_pages_parts(kind: DocumentKind) -> None:
    for seed in range(3):
        document = found(pages_of(kind, seed, 3), firsts() + later())
        assert document.classes[0].name == kind
        assert [page.part for page in document.pages] == ["first", "continuation", "continuation"]
        assert [page.document_class for page in document.pages] == [kind] * 3
        assert document.chosen is not None
        names = [page.recognition.chosen and page.recognition.chosen.name for page in document.pages]
        assert names[0] == kind
        assert set(names[1:]) <= {f"{kind}-continuation", None}
        shares = [match.probability for match in document.classes]
        assert shares == sorted(shares, reverse=True)
        assert sum(shares) + document.unknown_probability == pytest.approx(1)
        assert {match.name for match in document.classes} == set(KINDS)


def test_continuation_models_halve_the_errors_of_later_pages() -> None:
    documents = [pages_of(kind, seed, 3) for kind in KINDS for seed in range(3)]
    with_them = sum(wrong(found(pages, firsts() + later())) for pages in documents)
    without = sum(wrong(found(pages, firsts())) for pages in documents)
    assert without > 2 * with_them


def test_later_pages_decide_where_the_first_one_leaves_it_open() -> None:
    """Twins whose first pages are described alike, and whose later pages are not."""
    twins = [
        *(VersionedModel(replace(model("letter", 0), name=name), 1) for name in ("one", "two")),
        VersionedModel(model("plain", 1), 1, continues="one"),
        VersionedModel(model("letter", 1), 1, continues="two"),
    ]
    for seed in range(3):
        pages = pages_of("letter", seed, 2)
        alone, both = found(pages[:1], twins), found(pages, twins)
        assert [match.probability for match in alone.classes] == pytest.approx([0.5, 0.5], abs=0.01)
        assert both.classes[0].name == "two"
        assert both.classes[0].probability > 0.75


def test_a_class_without_continuation_models_has_neither_advantage_nor_disadvantage() -> None:
    twins = [VersionedModel(replace(model("letter", 0), name=name), 1) for name in ("one", "two")]
    shares = []
    for seed in range(5):
        document = found(
            pages_of("letter", seed, 2), [*twins, VersionedModel(model("letter", 1), 1, continues="two")]
        )
        share = {match.name: match.probability for match in document.classes}
        shares.append(share["one"] / (share["one"] + share["two"]))
    assert np.median(shares) == pytest.approx(0.5, abs=0.05)
    # A later page that is more like a first one speaks against the class that has a model of later pages.
    assert max(shares) < 0.9


def test_a_stray_page_costs_a_class_no_more_than_its_bound() -> None:
    letter = pages_of("letter", 3, 2)
    models = firsts() + later("letter")
    stray = (*letter, pages_of("plain", 1, 1)[0], labelled_page("margin", 1000))
    document = found(stray, models)
    assert document.chosen is not None
    assert document.chosen.name == "letter"
    assert [page.recognition.chosen is None for page in document.pages[2:]] == [True, True]
    assert all(page.document_class == "letter" for page in document.pages)
    assert all(page.recognition.match is not None for page in document.pages)


def test_continuation_models_never_win_the_first_page() -> None:
    document = found(pages_of("letter", 4, 2)[1:] * 2, firsts() + later())
    assert {match.name for match in document.pages[0].recognition.classes} == set(KINDS)
    assert {match.name for match in document.pages[1].recognition.classes} > set(KINDS)


def test_blank_pages_have_no_part_and_do_not_come_first() -> None:
    letter = pages_of("letter", 5, 2)
    plain, blank = (
        found(letter, firsts() + later()),
        found((BLANK, letter[0], BLANK, letter[1]), firsts() + later()),
    )
    assert [page.part for page in blank.pages] == [None, "first", None, "continuation"]
    assert blank.classes == plain.classes
    nothing = found((BLANK, BLANK), firsts())
    assert (nothing.chosen, nothing.classes) == (None, ())
    assert all(page.recognition.zones == () for page in nothing.pages)


def test_without_models_nothing_is_labelled() -> None:
    document = found(pages_of("letter", 5, 2), [])
    assert (document.chosen, document.classes, document.unknown_probability) == (None, (), 0.0)
    assert all(zone.label is None for page in document.pages for zone in page.recognition.zones)


def test_documents_of_no_class_are_unknown_and_labelled_all_the_same() -> None:
    models = [each for each in firsts() + later() if "plain" not in each.model.name]
    document = found(pages_of("plain", 1, 3), models)
    assert document.chosen is None
    assert document.unknown_probability > document.classes[0].probability
    assert [(page.part, page.document_class) for page in document.pages] == [(None, None)] * 3
    assert all(page.recognition.chosen is None and page.recognition.match for page in document.pages)


def test_where_there_are_only_continuation_models_they_stand_for_all_pages() -> None:
    document = found(pages_of("letter", 6, 3)[1:], later("letter", "plain"))
    assert document.classes[0].name == "letter-continuation"


def test_the_order_of_models_changes_nothing() -> None:
    pages, models = pages_of("memo", 7, 3), firsts() + later()
    one, two = found(pages, models), found(pages, models[::-1])
    assert [match.name for match in one.classes] == [match.name for match in two.classes]
    for a, b in zip(one.pages, two.pages, strict=True):
        assert [zone.label for zone in a.recognition.zones] == [zone.label for zone in b.recognition.zones]


def test_every_page_is_told_of() -> None:
    told: list[int] = []
    recognize_document(pages_of("memo", 7, 3), firsts(), NAMES, RecognitionParameters(), told.append)
    assert told == [0, 1, 2]


def test_chains_of_continuations_lead_to_their_class_and_rings_end() -> None:
    other = model_of("fax", 1)

    def named(name: str, continues: str | None) -> VersionedModel:
        return VersionedModel(replace(other, name=name), 1, continues=continues)

    chain = [named("a", None), named("b", "a"), named("c", "b"), named("d", "gone"), named("e", "e")]
    assert [class_of(name, chain) for name in "abcde"] == ["a", "a", "a", "gone", "e"]
    ring = [named("a", "b"), named("b", "a")]
    assert class_of("a", ring) in {"a", "b"}
    assert found(pages_of("letter", 5, 2), ring).classes


def test_a_page_that_came_alone_may_be_a_later_one() -> None:
    models = firsts() + later()
    first, second = (place_page(recognize(page, models), models) for page in pages_of("letter", 5, 2))
    assert (first.part, first.document_class) == ("first", "letter")
    assert (second.part, second.document_class) == ("continuation", "letter")
    assert second.recognition.chosen is not None
    assert second.recognition.chosen.name == "letter-continuation"
    nothing = place_page(recognize(BLANK, models), models)
    assert (nothing.part, nothing.document_class) == (None, None)


def test_a_page_of_a_document_that_is_recognized_again_keeps_the_documents_class() -> None:
    models = firsts() + later()
    pages = pages_of("letter", 3, 3)
    document = found(pages, models)
    for page, placed in zip(pages, document.pages, strict=True):
        again = place_again(recognize(page, models), "letter", placed.part, models, NAMES)
        assert (again.part, again.document_class) == (placed.part, "letter")
        assert again.recognition.zones == placed.recognition.zones
        assert (again.recognition.chosen is None) == (placed.recognition.chosen is None)
    stray = recognize(pages_of("memo", 1, 1)[0], models)
    assert stray.chosen is not None
    assert stray.chosen.name == "memo"
    assert place_again(stray, "letter", "continuation", models, NAMES).document_class == "letter"
    assert place_again(stray, "a class that is gone", "first", models, NAMES).document_class == "memo"
