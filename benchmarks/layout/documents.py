"""Documents of several pages: their class by all pages beside that of every page alone, labels of later pages, stacks.

python -m benchmarks layout_documents [--documents 12] [--samples 2 3 5 8] [--stacks 20]

Simulated letters, memos and papers of two publications, of 1 to 4 pages; models of so many simulated documents each,
none of which is tested. Zones are the true ones. A stack is 10 to 30 pages of such documents in any order; its models
are made of whole documents, later pages by all of them. *First pages' models*: without those of later pages. *A class
unknown*: no model of letters. *Sure*: with a probability of 0.9 and more.
"""

import argparse
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import get_args

import numpy as np

from benchmarks.layout.part import share, table
from services.layout.page import Page, Zone
from services.layout.pipeline import VersionedModel, content_features, initialize_model, recognize
from services.layout.recognition.documents import class_of, recognize_document
from services.layout.recognition.page_recognition import RecognitionParameters
from services.layout.recognition.results import Recognition
from services.layout.recognition.stack import SURE, part_stack
from simulation.labelled_pages import DocumentKind, LabelledPage, document_pages

KINDS: tuple[DocumentKind, ...] = get_args(DocumentKind)
MOST_PAGES = 4
FIRST_SAMPLE = 9000
"""Seeds of pages that models are made of start here."""
FEWEST_OF_STACK, MOST_OF_STACK = 10, 30
"""Pages of a stack."""
LEFT_OF_FIRST_PAGE = 0.3
"""Share of the zones of a first page that is left where it is spoiled: a dark copy, a torn sheet."""
Documents = list[tuple[DocumentKind, list[Page]]]


def page_of(page: LabelledPage) -> Page:
    """A simulated page with its true labels, content features measured."""
    zones = tuple(
        Zone(
            zone.id,
            tuple(float(value) for value in zone.box),  # type: ignore[arg-type]
            zone.kind,
            zone.lines,
            zone.font_size or None,
            text=zone.text,
            label=zone.label,
        )
        for zone in page.zones
    )
    return content_features().measure_page(Page(page.width, page.height, zones))


def make_documents(count: int) -> Documents:
    """So many of each kind, of 1, 2, 3, 4, 1, ... pages."""
    return [
        (
            kind,
            [
                page_of(page)
                for page in document_pages(_rng(seed, kind), kind, 1 + seed % MOST_PAGES, draw=False)
            ],
        )
        for kind in KINDS
        for seed in range(count)
    ]


def make_models(samples: int) -> list[VersionedModel]:
    """Of each kind a model of first pages, and one of pages 2 and 3."""
    models = []
    for kind in KINDS:
        documents = [
            [
                page_of(page)
                for page in document_pages(_rng(FIRST_SAMPLE + seed, kind), kind, 2 + seed % 2, draw=False)
            ]
            for seed in range(samples)
        ]
        first, later = ([document[place] for document in documents] for place in (0, -1))
        models.append(VersionedModel(initialize_model(kind, first), 1))
        models.append(VersionedModel(initialize_model(f"{kind}-continuation", later), 1, continues=kind))
    return models


def spoiled(documents: Documents) -> Documents:
    """The same with little left of their first pages."""
    found = []
    for number, (kind, (first, *later)) in enumerate(documents):
        kept = np.random.default_rng(number).permutation(len(first.zones))
        kept = np.sort(kept[: max(2, round(LEFT_OF_FIRST_PAGE * len(first.zones)))])
        page = Page(first.width, first.height, tuple(first.zones[int(index)] for index in kept))
        found.append((kind, [page, *later]))
    return found


def measure_documents(documents: Documents, models: Sequence[VersionedModel]) -> Counter[str]:
    """Classes of documents, and labels of their pages by the models of these classes."""
    counts: Counter[str] = Counter()
    for kind, pages in documents:
        found = recognize_document(pages, models, content_features().names)
        counts["documents"] += 1
        counts["right"] += found.chosen is not None and found.chosen.name == kind
        counts["nearest right"] += found.classes[0].name == kind
        for place, page in enumerate(found.pages):
            _count_labels(counts, place, page.recognition)
    return counts


def measure_pages(documents: Documents, models: Sequence[VersionedModel]) -> Counter[str]:
    """The same of every page alone; a document is right when all of its pages are."""
    counts: Counter[str] = Counter()
    for kind, pages in documents:
        alone = [recognize(page, models) for page in pages]
        right = [page.chosen is not None and class_of(page.chosen.name, models) == kind for page in alone]
        counts["documents"] += 1
        counts["right"] += all(right)
        counts["nearest right"] += all(class_of(page.classes[0].name, models) == kind for page in alone)
        counts["pages"] += len(pages)
        counts["right pages"] += sum(right)
        for place, page in enumerate(alone):
            _count_labels(counts, place, page)
    return counts


def _count_labels(counts: Counter[str], place: int, page: Recognition) -> None:
    which = "first" if place == 0 else "later"
    counts[f"{which} zones"] += len(page.zones)
    counts[f"{which} wrong"] += sum(zone.label != zone.zone.label for zone in page.zones)


def _rng(seed: int, kind: DocumentKind) -> np.random.Generator:
    return np.random.default_rng([seed, KINDS.index(kind)])


def report(documents: Documents, samples: Iterable[int]) -> str:
    """The figures as a table."""
    head = (
        "samples",
        "models",
        "documents",
        "by",
        "right %",
        "nearest right %",
        "wrong labels, first %",
        "later %",
    )
    rows: list[Sequence[object]] = []
    for few in samples:
        models = make_models(few)
        firsts = [model for model in models if model.continues is None]
        for what, tested in (("whole", documents), ("spoiled", spoiled(documents))):
            for which, competing in (("all", models), ("first pages'", firsts)):
                ways: tuple[tuple[str, Callable[..., Counter[str]]], ...] = (
                    ("pages alone", measure_pages),
                    ("all pages", measure_documents),
                )
                for way, measure in ways:
                    counts = measure(tested, competing)
                    classes = [
                        share(counts[name], counts["documents"]) for name in ("right", "nearest right")
                    ]
                    labels = [
                        share(counts[f"{page} wrong"], counts[f"{page} zones"]) for page in ("first", "later")
                    ]
                    rows.append([few, which, what, way, *classes, *labels])
    return table("Classes of documents and labels of their pages", head, rows)


def make_stack_models(samples: int) -> list[VersionedModel]:
    """Of each kind a model of first pages, and one of all later pages, of documents of 1 to 4 pages."""
    models = []
    for kind in KINDS:
        documents = [
            [
                page_of(page)
                for page in document_pages(
                    _rng(FIRST_SAMPLE + seed, kind), kind, 1 + seed % MOST_PAGES, draw=False
                )
            ]
            for seed in range(samples)
        ]
        later = [page for document in documents for page in document[1:]]
        models.append(VersionedModel(initialize_model(kind, [document[0] for document in documents]), 1))
        models.append(VersionedModel(initialize_model(f"{kind}-continuation", later), 1, continues=kind))
    return models


def measure_stacks(documents: Documents, models: Sequence[VersionedModel], stacks: int) -> Counter[str]:
    """Beginnings that were found, and not, in stacks of these documents in any order."""
    counts: Counter[str] = Counter()
    rng = np.random.default_rng(0)
    for _ in range(stacks):
        size, pages, begins = int(rng.integers(FEWEST_OF_STACK, MOST_OF_STACK + 1)), [], set()
        for place in rng.permutation(len(documents)):
            _, own = documents[int(place)]
            if len(pages) + len(own) <= size:
                begins.add(len(pages))
                pages += own
        parts = part_stack(pages, models, content_features().names, RecognitionParameters())
        found = set(parts.beginnings)
        sure = {place for place, chance in enumerate(parts.probabilities) if max(chance, 1 - chance) >= SURE}
        counts += Counter(
            {
                "pages": len(pages),
                "beginnings": len(begins),
                "missed": len(begins - found),
                "wrong": len(found - begins),
                "unsure": len(pages) - len(sure),
                "sure and wrong": len(sure & (begins ^ found)),
            }
        )
    return counts


def report_stacks(documents: Documents, samples: Iterable[int], stacks: int) -> str:
    """The figures as a table."""
    head = ("samples", "models", "pages", "beginnings", "missed", "wrong", "unsure", "sure and wrong")
    rows: list[Sequence[object]] = []
    for few in samples:
        models = make_stack_models(few)
        sets = {
            "all": models,
            "first pages'": [model for model in models if model.continues is None],
            "a class unknown": [model for model in models if not model.model.name.startswith("letter")],
        }
        for which, competing in sets.items():
            counts = measure_stacks(documents, competing, stacks)
            rows.append([few, which, *(counts[name] for name in head[2:])])
    return table("Where the documents of a stack begin", head, rows)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks layout_documents", description=__doc__)
    parser.add_argument("--documents", type=int, default=12, help="of each kind")
    parser.add_argument("--samples", type=int, nargs="+", default=[2, 3, 5, 8], help="documents of a model")
    parser.add_argument("--stacks", type=int, default=20)
    options = parser.parse_args(arguments)
    documents = make_documents(options.documents)
    print(report(documents, options.samples))
    print()
    print(report_stacks(documents, [few for few in options.samples if few > 2], options.stacks))
    return 0
