"""The text of every label of a page: its fields."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import prod

from services.layout.recognition.results import LabelledZone, Recognition


@dataclass(frozen=True, slots=True)
class Field:
    """The text of all zones of one label, in reading order.

    `confidence` is the probability, 0-1, that the class, all labels and the text are right, as if these were
    independent. A text that came with the zones counts as right. `zones` are ids.
    """

    label: str
    text: str
    confidence: float
    zones: tuple[str, ...]


def gather_fields(recognition: Recognition) -> tuple[Field, ...]:
    """Fields of the labels that have a text, in the order in which they are read; none without a model."""
    return tuple(_fields(recognition))


def _fields(recognition: Recognition) -> Iterator[Field]:
    by_label: dict[str, list[LabelledZone]] = {}
    for each in sorted(recognition.zones, key=lambda each: each.order):
        if each.label is not None and each.zone.text.strip():
            by_label.setdefault(each.label, []).append(each)
    of_class = recognition.classes[0].probability if recognition.classes else 0.0
    for label, zones in by_label.items():
        yield Field(
            label=label,
            text="\n".join(each.zone.text for each in zones),
            confidence=of_class * prod(each.confidence for each in zones) * _text_confidence(zones),
            zones=tuple(each.zone.id for each in zones),
        )


def _text_confidence(zones: list[LabelledZone]) -> float:
    """Mean confidence of the words of all zones by their length; 1 where OCR read none of them."""
    words = [word for each in zones for word in each.zone.words]
    letters = sum(len(word.text) for word in words)
    return sum(len(word.text) * word.confidence for word in words) / letters if letters else 1.0
