"""The fields of a page: the text of every label, and its value by the type that the settings of the class name."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import prod

from services.contract.fields import FieldSetting, FieldType, ValueProblem
from services.layout.page import ReadWord
from services.layout.recognition.results import LabelledZone, Recognition
from services.layout.values.typed_value import find_value, plain_text

NO_FIELDS: Mapping[str, FieldSetting] = {}


@dataclass(frozen=True, slots=True)
class Field:
    """The text of all zones of one label, in reading order, and its value.

    `value` is normalized by `type` (`services.layout.values`); None where the text has no such value, with the reason
    in `problem`. `currency` is that of an amount. `confidence` is the probability, 0-1, that the class, all labels and
    the text of the value are right, as if these were independent. A text that came with the zones counts as right.
    `zones` are ids.
    """

    label: str
    text: str
    value: str | None
    type: FieldType
    currency: str | None
    problem: ValueProblem | None
    confidence: float
    zones: tuple[str, ...]


def gather_fields(
    recognition: Recognition, settings: Mapping[str, FieldSetting] = NO_FIELDS
) -> tuple[Field, ...]:
    """Fields of the labels that have a text, in the order in which they are read; none without a model.

    `settings` has the types by label; the type of other labels is `text`.
    """
    return tuple(_fields(recognition, settings))


def _fields(recognition: Recognition, settings: Mapping[str, FieldSetting]) -> Iterator[Field]:
    by_label: dict[str, list[LabelledZone]] = {}
    for each in sorted(recognition.zones, key=lambda each: each.order):
        if each.label is not None and each.zone.text.strip():
            by_label.setdefault(each.label, []).append(each)
    of_class = recognition.classes[0].probability if recognition.classes else 0.0
    for label, zones in by_label.items():
        setting = settings.get(label, FieldSetting())
        text = "\n".join(each.zone.text for each in zones)
        plain = plain_text(text)
        words = [word for each in zones for word in each.zone.words]
        found = find_value(plain, setting)
        if setting.type == "text" or found.value is None:
            read = _mean_confidence(words)
        else:
            read = prod(word.confidence for word in _words_in(plain, words, found.span))
        yield Field(
            label=label,
            text=text,
            value=found.value,
            type=setting.type,
            currency=found.currency,
            problem=found.problem,
            confidence=of_class * prod(each.confidence for each in zones) * read,
            zones=tuple(each.zone.id for each in zones),
        )


def _mean_confidence(words: list[ReadWord]) -> float:
    """Mean confidence of the words by their length; 1 where OCR read none of them."""
    letters = sum(len(word.text) for word in words)
    return sum(len(word.text) * word.confidence for word in words) / letters if letters else 1.0


def _words_in(text: str, words: list[ReadWord], span: tuple[int, int]) -> Iterator[ReadWord]:
    """The words of `text`, in their order, that overlap a span of it."""
    end = 0
    for word in words:
        begin = text.find(word.text, end)
        if begin < 0:  # the text of the zone came from elsewhere
            continue
        end = begin + len(word.text)
        if begin < span[1] and end > span[0]:
            yield word
