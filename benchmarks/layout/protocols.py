"""Protocols of 5.6: leave one out, folds and draws of samples, and what is counted over them."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.layout.specimens import Lesson
from services.layout.model.layout_model import LayoutModel
from services.layout.page import Page
from services.layout.pipeline import VersionedModel, complete_recognition, initialize_model, recognize
from services.layout.recognition.page_recognition import RecognitionParameters
from services.layout.recognition.results import Recognition
from services.layout.segmentation import FinePage, compose_page

Labels = tuple[str | None, ...]
Labeller = Callable[[Sequence[Lesson], Sequence[Page]], list[Labels]]
"""(samples, pages) -> labels of each page's zones by a model of the samples."""


@dataclass(frozen=True, slots=True)
class ComponentCounts:
    """Zones of a logical component: those that have it, those that were given it, and both (Table 5.3)."""

    true: int = 0
    found: int = 0
    correct: int = 0

    @property
    def recall(self) -> float:
        """NaN where no zone has the component."""
        return self.correct / self.true if self.true else float("nan")

    @property
    def precision(self) -> float:
        """NaN where no zone was given it."""
        return self.correct / self.found if self.found else float("nan")


def unlabelled(page: Page) -> Page:
    """The page without its labels: all that recognition may see of it."""
    return replace(page, zones=tuple(replace(zone, label=None) for zone in page.zones))


def page_labels(page: Page) -> Labels:
    return tuple(zone.label for zone in page.zones)


def recognized(
    page: Page, models: Mapping[str, LayoutModel], parameters: RecognitionParameters | None = None
) -> Recognition:
    """Class and labels of a page, which is taken without its labels."""
    return recognize(unlabelled(page), [VersionedModel(model, 1) for model in models.values()], parameters)


def recognize_finely(fine: FinePage, model: LayoutModel) -> Recognition:
    """Class and labels of a page in the zones of segmentation, regrouped by the model."""
    models = [VersionedModel(model, 1)]
    return complete_recognition(fine, recognize(compose_page(fine), models), models)


def make_model(name: str, samples: Sequence[Lesson]) -> LayoutModel:
    """Layout graph model of the samples, initialized only (round 0)."""
    return initialize_model(name, [page for page, _ in samples], found=[found for _, found in samples])


def label_by_graph(samples: Sequence[Lesson], pages: Sequence[Page]) -> list[Labels]:
    """Labels by the layout graph model of the samples, initialized only (round 0)."""
    model = make_model("class", samples)
    return [tuple(zone.label for zone in recognized(page, {"class": model}).zones) for page in pages]


def folds(count: int, most: int) -> Iterator[tuple[list[int], list[int]]]:
    """(samples, tested) of `count` pages in `most` folds, every `most`-th page in one; leave one out from count on."""
    number = min(count, most)
    for fold in range(number):
        tested = list(range(fold, count, number))
        yield [page for page in range(count) if page % number != fold], tested


def label_in_folds(
    labeller: Labeller, samples: Sequence[Lesson], most: int, *tested: Sequence[Page]
) -> list[list[Labels]]:
    """Labels of every page by a model without it, for each form of the pages in `tested`.

    `samples[i]` is what is learned of a page, `tested[form][i]` what it is tested as.
    """
    found: list[list[Labels]] = [[()] * len(samples) for _ in tested]
    for learned, held_out in folds(len(samples), most):
        asked = [pages[page] for pages in tested for page in held_out]
        labels = iter(labeller([samples[page] for page in learned], asked))
        for form in found:
            for page in held_out:
                form[page] = next(labels)
    return found


def draws(count: int, size: int, number: int, seed: int) -> list[list[int]]:
    """`number` random choices of `size` of `count` pages, the same for the same seed."""
    rng = np.random.default_rng([seed, size])
    return [sorted(rng.choice(count, size, replace=False).tolist()) for _ in range(number)]


def wrong_zones(truth: Iterable[Labels], found: Iterable[Labels]) -> tuple[int, int]:
    """Zones with another label than the true one, and all zones."""
    pairs = [pair for true, given in zip(truth, found, strict=True) for pair in zip(true, given, strict=True)]
    return sum(true != given for true, given in pairs), len(pairs)


def error_percent(truth: Iterable[Labels], found: Iterable[Labels]) -> float:
    """Incorrectly labelled zones, percent of all (5.6.1); NaN without zones."""
    wrong, zones = wrong_zones(truth, found)
    return 100 * wrong / zones if zones else float("nan")


def floor_percent(samples: Sequence[Page], tested: Sequence[Page]) -> float:
    """Zones whose label no sample has, percent: nobody can label them."""
    known = {zone.label for page in samples for zone in page.zones}
    labels = [zone.label for page in tested for zone in page.zones]
    return 100 * sum(label not in known for label in labels) / len(labels) if labels else float("nan")


def confusions(truth: Iterable[Labels], found: Iterable[Labels]) -> Counter[tuple[str, str]]:
    """How often a label was taken for another one."""
    return Counter(
        (str(true), str(given))
        for labels, others in zip(truth, found, strict=True)
        for true, given in zip(labels, others, strict=True)
        if true != given
    )


def component_counts(truth: Iterable[Labels], found: Iterable[Labels]) -> dict[str | None, ComponentCounts]:
    """Counts of every label that occurs, None for unlabelled zones."""
    pairs = [pair for true, given in zip(truth, found, strict=True) for pair in zip(true, given, strict=True)]
    true, given = Counter(a for a, _ in pairs), Counter(b for _, b in pairs)
    correct = Counter(a for a, b in pairs if a == b)
    return {label: ComponentCounts(true[label], given[label], correct[label]) for label in true | given}
