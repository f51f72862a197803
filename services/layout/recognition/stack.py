"""Where the documents of a stack of pages begin: one search over all its pages for the most probable parts.

A stack is a chain. A page either begins a document, which the class's first-page model then describes, or goes on with
the document before it, as one of that class's continuation models describes (`documents`). Later pages without
such a model look like the first one but for what only that shows; so a page begins a document as far as it has the
labels of the class's samples. Documents of no known class take part as a class of their own: its pages are as
likely as one that fits the nearest class as well as none. The most probable chain is found by Viterbi's dynamic
programming, the probability of each beginning by sums over all chains (forward and backward; Rabiner 1989, III.A, B).
"""

import math
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from services.layout.model.layout_model import LayoutModel
from services.layout.page import Page
from services.layout.recognition.classification import log_odds_of_fit
from services.layout.recognition.documents import (
    STRAY,
    ClassModels,
    gather_classes,
    later_log_likelihood,
    page_evidence,
)
from services.layout.recognition.page_recognition import RecognitionParameters, VersionedModel, recognize_page
from services.layout.recognition.results import Recognition

BEGINNING = 0.35
"""Probability that a page begins a document, before anybody looks at it: documents of three pages. By first-page models
alone 0.5 parts three times as many documents; with continuation models 0.2 to 0.7 give the same parts."""
_STRAY = 0.5
"""Probability that a later page of a class without continuation models looks like no page of it."""
_UNTAUGHT = 0.03
"""Probability that a later page of a class with them looks like none of their samples, and in its print like a first
one: as a middle page, where all samples were last ones. Without it 80 of 690 such pages began documents, nearly all
with a probability above 0.9; 0.1 makes as many mistakes."""

SURE = 0.9
"""Of 6900 pages of simulated stacks by models of 2 to 8 samples 6 were wrong that were surer to begin a document, or
not to; where a class has no model 11 of 3500."""
_MOST_LACKING = 0.9
"""Probability that a page has no zone with a label that no sample has: they are few, and labels may be wrong."""

Likelihoods = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Log likelihoods (K,) of a page as the first one of a document of each class, and as a later one."""


@dataclass(frozen=True, slots=True)
class StackParts:
    """`beginnings` are the places of the documents' first pages, from 0, ascending; the first one is 0.

    `probabilities` has for every page that of beginning a document, 0-1; `matched` the pages as they were matched with
    all models, empty where none were.
    """

    beginnings: tuple[int, ...]
    probabilities: tuple[float, ...]
    matched: tuple[Recognition, ...] = ()

    def unsure(self, begin: int, end: int) -> Iterator[tuple[int, float]]:
        """Places of pages of the document from `begin` to `end` that are less sure than `SURE` to begin it, or not to.

        With each its probability of beginning a document.
        """
        for place in range(begin, end):
            chance = self.probabilities[place]
            if (chance if place == begin else 1.0 - chance) < SURE:
                yield place, chance


def part_stack(
    pages: Sequence[Page],
    models: Sequence[VersionedModel],
    content_names: tuple[str, ...],
    parameters: RecognitionParameters,
) -> StackParts:
    """Where documents begin among `pages`, which carry their content features; one document if there is no model.

    A page without zones, as the blank back of a sheet, begins none; blank pages before the first document belong to it.
    """
    printed = next((index for index, page in enumerate(pages) if page.zones), len(pages))
    if not models or printed == len(pages):
        return StackParts((0,), (1.0,) + (0.0,) * (len(pages) - 1))
    classes = list(gather_classes(models).values())
    blank = np.full(len(classes) + 1, -np.inf), np.zeros(len(classes) + 1)
    matched = tuple(recognize_page(page, models, content_names, parameters) for page in pages)
    likelihoods = [
        _likelihoods(seen, models, classes, parameters) if seen.page.zones else blank for seen in matched
    ]
    found = most_probable_parts(likelihoods[printed:])
    return StackParts(
        (0, *(place + printed for place in found.beginnings[1:])),
        (1.0,) + (0.0,) * printed + found.probabilities[1:],
        matched,
    )


def _likelihoods(
    seen: Recognition,
    models: Sequence[VersionedModel],
    classes: Sequence[ClassModels],
    parameters: RecognitionParameters,
) -> Likelihoods:
    """Of documents of no class, then of each class."""
    evidence = page_evidence(seen, models, parameters)
    (nearest,) = (model.model for model in models if model.model.name == seen.classes[0].name)
    fit = log_odds_of_fit(seen.classes[0].comparable_cost, nearest.calibration, len(seen.page.zones))
    stranger = evidence[nearest.name] - fit
    first, later = [stranger], [stranger]
    for each in classes:
        as_first = evidence.get(each.first.model.name, -np.inf)
        stray = STRAY if each.later else _STRAY
        as_later = later_log_likelihood(evidence, each, stranger, stray)
        if each.later:
            as_later = np.logaddexp(math.log1p(-_UNTAUGHT) + as_later, math.log(_UNTAUGHT) + as_first)
        if each.first.model is nearest:
            as_first += _presence(
                nearest, {zone.label for zone in seen.zones}, [own.model for own in each.later]
            )
        first.append(as_first)
        later.append(as_later)
    return np.array(first), np.array(later)


def _presence(model: LayoutModel, labels: Set[str | None], later: Sequence[LayoutModel]) -> float:
    """Log likelihood ratio of a page with these labels as one like the samples, against a later one.

    A page like the samples lacks a label with the probability of which `count_costs[0]` is the negative logarithm. A
    later page lacks it as often as the samples of the models of `later` do, or with 1/2 where there are none. Labels
    that most samples lack say nothing. Those that they have within larger zones are mostly missing on either page, as
    these zones are whole yet (`line_parts`).
    """
    total = 0.0
    for node in model.nodes:
        lacking = math.exp(-node.count_costs[0])
        if node.label is not None and lacking < 0.5:
            other = max((_lacking(each, node.label) for each in later), default=0.5)
            own, others = (_unseen(each, node.pieces.share_within) for each in (lacking, other))
            total += math.log((1.0 - own) / (1.0 - others) if node.label in labels else own / others)
    return total


def _unseen(lacking: float, within: float) -> float:
    """Probability that no zone of a page has a label, by that of lacking it and the share within larger zones."""
    return min(_MOST_LACKING, lacking + (1.0 - lacking) * within)


def _lacking(model: LayoutModel, label: str) -> float:
    """Probability that a page of the model lacks a label."""
    for node in model.nodes:
        if node.label == label:
            return min(_MOST_LACKING, math.exp(-node.count_costs[0]))
    return min(_MOST_LACKING, (model.samples + 0.5) / (model.samples + 1.0))


def most_probable_parts(likelihoods: Sequence[Likelihoods], beginning: float = BEGINNING) -> StackParts:
    """The parts of a stack of N >= 1 pages by their log likelihoods, each (K,) as a first and as a later page.

    The first page begins a document. All K classes are equally probable.
    """
    first = np.array([each for each, _ in likelihoods]) + np.log(beginning / len(likelihoods[0][0]))
    later = np.array([each for _, each in likelihoods]) + np.log1p(-beginning)
    return StackParts(_best_chain(first, later), _beginning_probabilities(first, later))


def _best_chain(first: NDArray[np.float64], later: NDArray[np.float64]) -> tuple[int, ...]:
    """Places (N, K) of the beginnings in the most probable chain."""
    best = first[0]
    begins = np.ones_like(first, dtype=bool)
    before = np.zeros(len(first), dtype=int)
    for place in range(1, len(first)):
        before[place] = np.argmax(best)
        fresh, going_on = best.max() + first[place], best + later[place]
        begins[place] = fresh > going_on
        best = np.maximum(fresh, going_on)
    of_class, found = int(np.argmax(best)), []
    for place in range(len(first) - 1, -1, -1):
        if begins[place, of_class]:
            found.append(place)
            of_class = int(before[place])
    return tuple(reversed(found))


def _beginning_probabilities(first: NDArray[np.float64], later: NDArray[np.float64]) -> tuple[float, ...]:
    """Probability of each of N pages (N, K) of being a document's first one, over all chains."""
    forward = [first[0]]
    for place in range(1, len(first)):
        forward.append(np.logaddexp(logsumexp(forward[-1]) + first[place], forward[-1] + later[place]))
    total, backward = logsumexp(forward[-1]), np.zeros_like(first[0])
    found = []
    for place in range(len(first) - 1, 0, -1):
        here = logsumexp(forward[place - 1]) + first[place]
        found.append(float(np.exp(logsumexp(here + backward) - total)))
        backward = np.logaddexp(logsumexp(first[place] + backward), later[place] + backward)
    return (1.0, *reversed(found))
