"""Documents of several pages: their class from all pages together, then each page's labels by that class's models.

A class has a model of its first page, and may have models of the pages that follow (`VersionedModel.continues`). Given
the class, pages are independent; so the evidence for a class is the sum of its pages' log likelihoods: that of the
first page by its own model, that of each later one by the best of its continuation models.

A later page may not belong to the class, as an enclosure. So its likelihood is a mixture with the likelihood of a page
of any kind, approximated by the best of all models. This bounds the effect of one stray page. For a class without
continuation models this part dominates, so that later pages give it neither an advantage nor a disadvantage.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.special import expit, softmax

from services.layout.page import Page
from services.layout.recognition.classification import class_evidence, log_odds_of_fit
from services.layout.recognition.page_recognition import (
    USUAL,
    RecognitionParameters,
    VersionedModel,
    recognize_page,
)
from services.layout.recognition.results import ClassMatch, Recognition

Part = Literal["first", "continuation"]


STRAY = 0.2
"""Probability of a stray later page, for a class with continuation models, by simulated letters, memos and papers of 2
to 4 pages; 0.1 to 0.3 give equal results. Later pages of different classes are more alike than first ones. By models of
two or three samples they mislead as often as they help, so that 0.05 named 5 of 84 documents wrong, first pages alone
2; by models of five they help, most where little is left of the first page."""
UNTAUGHT = 0.9
"""The same for a class without continuation models; its samples may include later pages."""


@dataclass(frozen=True, slots=True)
class PageInDocument:
    """A page, labelled by a model of its document's class.

    `document_class` is that class, None when there is none. `recognition.chosen` is the page's model among all that
    competed for the page; None when the page does not look like one of it.
    """

    recognition: Recognition
    part: Part | None
    document_class: str | None


@dataclass(frozen=True, slots=True)
class DocumentRecognition:
    """The class of a document (None: no model, or none fits), all that competed, and its pages.

    Of a class `cost` is the sum of its pages' least costs by its models, `model_version` that of its first page's.
    """

    chosen: ClassMatch | None
    classes: tuple[ClassMatch, ...]
    unknown_probability: float
    pages: tuple[PageInDocument, ...]


def class_of(name: str, models: Sequence[VersionedModel]) -> str:
    """The document class of a model: its own name, or the class at the end of its chain of `continues`."""
    continues = {model.model.name: model.continues for model in models}
    for _ in models:
        following = continues.get(name)
        if following is None or following == name:
            break
        name = following
    return name


def place_page(recognition: Recognition, models: Sequence[VersionedModel]) -> PageInDocument:
    """The page with the document class of its model, for a page that is recognized alone."""
    if recognition.chosen is None:
        return PageInDocument(recognition, None, None)
    document_class = class_of(recognition.chosen.name, models)
    part: Part = "first" if document_class == recognition.chosen.name else "continuation"
    return PageInDocument(recognition, part, document_class)


def place_again(
    recognition: Recognition,
    document_class: str,
    part: Part | None,
    models: Sequence[VersionedModel],
    content_names: tuple[str, ...],
    parameters: RecognitionParameters = USUAL,
) -> PageInDocument:
    """A page of a document that is recognized again without the document's other pages.

    The document keeps its class, which was decided by all its pages; labels are those of the class's newest models.
    A class that has no model any more is left, and the page placed as if it were alone.
    """
    each = gather_classes(models).get(document_class)
    if each is None or part is None:
        return place_page(recognition, models)
    place = 0 if part == "first" else 1
    model = _model_of_page(place, page_evidence(recognition, models, parameters), each)
    labelled = _label(recognition, model, content_names, parameters)
    fits = place == 0 or _fit(labelled, model, parameters) >= 0
    return PageInDocument(labelled if fits else replace(labelled, chosen=None), part, document_class)


@dataclass(frozen=True, slots=True)
class ClassModels:
    """A class of documents: the model of its first page, and those of later ones."""

    first: VersionedModel
    later: tuple[VersionedModel, ...]


def recognize_document(
    pages: Sequence[Page],
    models: Sequence[VersionedModel],
    content_names: tuple[str, ...],
    parameters: RecognitionParameters = USUAL,
    on_page: Callable[[int], None] = lambda index: None,
    matched: Sequence[Recognition] = (),
) -> DocumentRecognition:
    """Class of a document and labels of the zones of its pages, which carry their content features.

    The first page is the first one that has zones: the sheet before it may be blank. Continuation models do not compete
    for it, unless there are no others. `on_page` is called after every page that was matched. `matched` are the same
    pages, matched with all `models` already, as in a stack.
    """
    classes = gather_classes(models)
    first = next((index for index, page in enumerate(pages) if page.zones), None)
    seen: list[Recognition] = []
    for index, page in enumerate(pages):
        competing = [each.first for each in classes.values()] if index == first else models
        if matched and len(competing) == len(models):
            seen.append(matched[index])
        else:
            seen.append(recognize_page(page, competing, content_names, parameters))
        on_page(index)
    if first is None or not models:
        return DocumentRecognition(None, (), 0.0, tuple(PageInDocument(each, None, None) for each in seen))
    evidence = [page_evidence(each, models, parameters) for each in seen]
    among = softmax([_log_likelihood(evidence[first:], each) for each in classes.values()])
    best = list(classes)[int(np.argmax(among))]
    by_page = [_model_of_page(index - first, evidence[index], classes[best]) for index in range(len(pages))]
    labelled = [
        _label(recognition, model, content_names, parameters)
        for recognition, model in zip(seen, by_page, strict=True)
    ]
    odds = _fit(labelled[first], classes[best].first, parameters)
    matches = [
        ClassMatch(
            name, each.first.version, _cost(seen[first:], evidence[first:], each), float(expit(odds) * share)
        )
        for (name, each), share in zip(classes.items(), among, strict=True)
    ]
    matches.sort(key=lambda match: -match.probability)
    unknown = float(expit(-odds))
    is_known = matches[0].probability >= unknown
    found = []
    for index, recognition in enumerate(labelled):
        fits = index == first or _fit(recognition, by_page[index], parameters) >= 0
        part: Part | None = None
        if is_known and pages[index].zones:
            part = "first" if index == first else "continuation"
        chosen = recognition.chosen if is_known and fits else None
        found.append(PageInDocument(replace(recognition, chosen=chosen), part, best if is_known else None))
    return DocumentRecognition(matches[0] if is_known else None, tuple(matches), unknown, tuple(found))


def gather_classes(models: Sequence[VersionedModel]) -> dict[str, ClassModels]:
    """Classes by name; continuation models whose class does not compete describe strangers only."""
    roots = {model.model.name: class_of(model.model.name, models) for model in models}
    firsts = [model for model in models if roots[model.model.name] == model.model.name]
    if not firsts:
        return {model.model.name: ClassModels(model, ()) for model in models}
    return {
        first.model.name: ClassModels(
            first,
            tuple(
                model
                for model in models
                if model is not first and roots[model.model.name] == first.model.name
            ),
        )
        for first in firsts
    }


def page_evidence(
    recognition: Recognition, models: Sequence[VersionedModel], parameters: RecognitionParameters
) -> dict[str, float]:
    """Log likelihoods of a page by the models that were matched with it."""
    by_name = {model.model.name: model.model for model in models}
    if not recognition.classes:
        return {}
    found = class_evidence(
        np.array([match.comparable_cost for match in recognition.classes]),
        [by_name[match.name].calibration for match in recognition.classes],
    )
    return {match.name: float(value) for match, value in zip(recognition.classes, found, strict=True)}


def _log_likelihood(evidence: Sequence[Mapping[str, float]], each: ClassModels) -> float:
    """Log likelihood of the pages from the first one on, given the class, up to a constant of all classes."""
    total = evidence[0].get(each.first.model.name, -np.inf)
    stray = STRAY if each.later else UNTAUGHT
    for page in evidence[1:]:
        if page:
            # A page of any kind has 0; the best of all models may give more.
            total += later_log_likelihood(page, each, max(0.0, *page.values()), stray)
    return total


def later_log_likelihood(
    evidence: Mapping[str, float], each: ClassModels, any_kind: float, stray: float
) -> float:
    """Log likelihood of a page as a later one of a class, mixed with `any_kind`, that of a stray page.

    `stray` is the probability of such a page, 0-1.
    """
    own = max(evidence.get(model.model.name, -np.inf) for model in each.later or (each.first,))
    return float(np.logaddexp(np.log1p(-stray) + own, np.log(stray) + any_kind))


def _model_of_page(place: int, evidence: Mapping[str, float], each: ClassModels) -> VersionedModel:
    """The class's model for its page number `place`, from 0; of several the one that fits best."""
    if place <= 0 or not each.later:
        return each.first
    return max(each.later, key=lambda model: evidence.get(model.model.name, -np.inf))


def _label(
    recognition: Recognition,
    model: VersionedModel,
    content_names: tuple[str, ...],
    parameters: RecognitionParameters,
) -> Recognition:
    """The page with labels of this model, which need not be the one that fits it best."""
    if not recognition.classes:
        return recognition
    nearest, *_ = recognition.classes
    if nearest.name == model.model.name:
        return replace(recognition, chosen=nearest)
    alone = recognize_page(recognition.page, [model], content_names, parameters)
    # With many models the search for this one was short, or left out.
    (best,) = alone.classes
    shares = {match.name: match.probability for match in recognition.classes}
    chosen = replace(best, probability=shares.get(best.name, 0.0))
    return replace(recognition, zones=alone.zones, match=alone.match, chosen=chosen)


def _fit(recognition: Recognition, model: VersionedModel, parameters: RecognitionParameters) -> float:
    """Log odds of a labelled page being of its model."""
    if recognition.chosen is None:
        return 0.0
    zones = len(recognition.page.zones)
    return log_odds_of_fit(recognition.chosen.comparable_cost, model.model.calibration, zones)


def _cost(seen: Sequence[Recognition], evidence: Sequence[Mapping[str, float]], each: ClassModels) -> float:
    """Sum of the least costs of the pages by the class's models."""
    total = 0.0
    for place, (recognition, page) in enumerate(zip(seen, evidence, strict=True)):
        name = _model_of_page(place, page, each).model.name
        total += sum(match.cost for match in recognition.classes if match.name == name)
    return total
