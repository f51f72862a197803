"""A queue of pages that are corrected one by one, while the models learn and the open pages are recognized again."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from benchmarks.layout.protocols import make_model, page_labels, unlabelled
from services.contract.layout_learning import VerifiedPage
from services.layout.learning.feedback import adapt_models
from services.layout.model.layout_model import LayoutModel
from services.layout.page import Page
from services.layout.pipeline import VersionedModel, content_features, with_believable_labels
from services.layout.recognition.page_recognition import recognize_page

IMPROBABLE = 1e-3
"""A class that is less probable than this for a page at first does not compete for it later. This saves time."""

Models = Mapping[str, LayoutModel]


@dataclass(frozen=True, slots=True, eq=False)
class OpenPage:
    """A page of the queue as it was recognized last.

    `confidences` are those of the service's queue: joint probabilities that class and label of a zone are right.
    """

    page: Page
    true_class: str
    competing: tuple[str, ...]
    found_class: str | None
    labels: tuple[str | None, ...]
    confidences: tuple[float, ...]

    @property
    def right(self) -> list[bool]:
        """Which zones have the right label; none of them if the class is wrong."""
        is_class_right = self.found_class == self.true_class
        return [
            is_class_right and found == true
            for found, true in zip(self.labels, page_labels(self.page), strict=True)
        ]

    @property
    def wrong(self) -> int:
        """Number of zones that are not right."""
        return self.right.count(False)


def recognize_open(page: Page, true_class: str, models: Models) -> OpenPage:
    """The page as it is recognized at first, when all models compete."""
    seen, probabilities = _recognize(page, true_class, tuple(models), models)
    competing = tuple(name for name in models if probabilities[name] >= IMPROBABLE)
    return replace(seen, competing=competing or tuple(models))


def recognize_again(each: OpenPage, models: Models) -> OpenPage:
    """The page as these models recognize it."""
    return _recognize(each.page, each.true_class, each.competing, models)[0]


def _recognize(
    page: Page, true_class: str, names: tuple[str, ...], models: Models
) -> tuple[OpenPage, dict[str, float]]:
    competing = [VersionedModel(models[name], 1) for name in names]
    seen = recognize_page(unlabelled(page), competing, content_features().names)
    seen = with_believable_labels(seen, competing)
    sure = 0.0 if seen.chosen is None else seen.chosen.probability
    opened = OpenPage(
        page,
        true_class,
        names,
        None if seen.chosen is None else seen.chosen.name,
        tuple(zone.label for zone in seen.zones),
        tuple(sure * zone.confidence for zone in seen.zones),
    )
    return opened, {match.name: match.probability for match in seen.classes}


def learn(each: OpenPage, models: Models) -> dict[str, LayoutModel]:
    """New models of the classes that learn when a person confirms or corrects the page."""
    ids = [zone.id for zone in each.page.zones]
    verified = VerifiedPage(
        each.page,
        each.found_class,
        dict(zip(ids, each.labels, strict=True)),
        each.true_class,
        dict(zip(ids, page_labels(each.page), strict=True)),
    )
    concerned = {name: models[name] for name in (each.found_class, each.true_class) if name is not None}
    _, learned = adapt_models(verified, concerned, {}, content_features().names)
    return {name: one.model for name, one in learned.items()}


class Queue:
    """Open pages of all classes, and the models that know them."""

    def __init__(self, models: Models, pages: Sequence[OpenPage]) -> None:
        self.models = dict(models)
        self.open = list(pages)
        self._changed: set[str] = set()

    @property
    def wrong(self) -> int:
        """Zones of open pages that are not right; those of verified pages are."""
        return sum(each.wrong for each in self.open)

    def verify(self, index: int) -> OpenPage:
        """A person confirms or corrects the open page of this number, and the models learn from it."""
        each = self.open.pop(index)
        learned = learn(each, self.models)
        self.models |= learned
        self._changed |= set(learned)
        return each

    def refresh(self) -> None:
        """Recognize the open pages again whose classes have learned."""
        self.open = [
            recognize_again(each, self.models) if self._changed.intersection(each.competing) else each
            for each in self.open
        ]
        self._changed.clear()


def first_models(samples: Mapping[str, Collection[Page]]) -> dict[str, LayoutModel]:
    """Models of labelled pages, by class."""
    return {name: make_model(name, [(page, None) for page in pages]) for name, pages in samples.items()}
