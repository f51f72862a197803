"""The fields of a page: the text of every label, and its value by the type that the settings of the class name."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import prod
from typing import Final

import numpy as np
from scipy.special import expit, logit

from services.contract.fields import FieldSetting, FieldType, ValueProblem
from services.layout.page import ZoneWord
from services.layout.recognition.results import Recognition, RecognizedZone
from services.layout.values.typed_value import find_value, plain_text

_LEAST_DOUBT = 0.005
"""Probabilities nearer to 0 or 1 make no difference."""


@dataclass(frozen=True, slots=True)
class ValueTrust:
    """logit p = `constant` + `of_labels` logit(labels right) + `of_words` logit(words right), given the class.

    A value that can be read in a text is itself evidence that label and words are right, so that their product is
    much too low. Fitted to 1268 values of letters, memos and fax sheets by models of 3 to all samples (layout_values).
    """

    constant: float = -0.16
    of_labels: float = 0.48
    of_words: float = 0.32


VALUE_TRUST: Final[Mapping[FieldType, ValueTrust]] = {
    "text": ValueTrust(-0.53, 0.31, 0.34),
    "date": ValueTrust(constant=0.94),
    "amount": ValueTrust(constant=-0.81),
    "pattern": ValueTrust(constant=-0.60),
}
"""Types that have weights of their own. A text is right if all its words are, and no line is missing or too much:
fitted to companies and addresses of receipts. A page has few dates and many amounts: the constant of dates is fitted to
receipts (1.06 above the usual one) and to letters, memos and fax sheets (1.13), that of amounts to receipts, that of
patterns to letters, memos and fax sheets, each weighing the same."""
USUAL_TRUST: Final = ValueTrust()


def probability_of_value(labels: float, words: float, of_type: FieldType) -> float:
    """Probability, 0-1, that a value is right, by those that all its labels and all its words are.

    It is 1 where a person has said both.
    """
    if min(labels, words) >= 1.0:
        return 1.0
    t = VALUE_TRUST.get(of_type, USUAL_TRUST)
    odds = logit(np.clip((labels, words), _LEAST_DOUBT, 1.0 - _LEAST_DOUBT))
    return float(expit(t.constant + t.of_labels * odds[0] + t.of_words * odds[1]))


NO_FIELDS: Mapping[str, FieldSetting] = {}


@dataclass(frozen=True, slots=True)
class Field:
    """The text of all zones of one label, in reading order, and its value.

    `value` is normalized by `type` (`services.layout.values`); None where the text has no such value, with the reason
    in `problem`. `currency` is that of an amount. `confidence` is the probability, 0-1, that it is right, by those of
    the class, of the labels of the zones that hold it, and of its words (`ValueTrust`). A text that came with the zones
    has no word that may be wrong.
    `zones` are ids. Where no zone of the label has a value of the type, the field is of one zone that has, and whose
    other probable labels (`RecognizedZone.others`) have this one among them; its confidence is as low as that is.
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
    read = [each for each in sorted(recognition.zones, key=lambda each: each.order) if each.zone.text.strip()]
    by_label: dict[str, list[RecognizedZone]] = {}
    for each in read:
        if each.label is not None:
            by_label.setdefault(each.label, []).append(each)
    of_class = recognition.classes[0].probability if recognition.classes else 0.0
    found: list[tuple[int, Field]] = []
    for label in dict.fromkeys((*by_label, *settings)):
        setting, zones = settings.get(label, FieldSetting()), by_label.get(label, [])
        field = _field(label, zones, zones, setting, of_class) if zones else None
        if setting.type != "text":
            field = _of_equal_values(label, read, setting, of_class, field)
        if setting.type != "text" and (field is None or field.problem == "no-value"):
            field = _of_one_zone(label, zones, setting, of_class) or field
            if field is None or field.value is None:
                field = _of_another_label(label, read, setting, of_class) or field
        if field is not None:
            place = next(each.order for each in read if each.zone.id in field.zones)
            found.append((place, field))
    yield from (field for _, field in sorted(found, key=lambda each: each[0]))


def _field(
    label: str,
    zones: Sequence[RecognizedZone],
    searched: Sequence[RecognizedZone],
    setting: FieldSetting,
    of_class: float,
) -> Field:
    """The field of `zones`, its value from the text of those that are `searched`."""
    plain = plain_text(_text(searched))
    words = [word for each in searched for word in each.zone.words]
    found = find_value(plain, setting)
    if setting.type == "text" or found.value is None:
        labels, read = prod(each.confidence for each in zones), prod(word.confidence for word in words)
        right = probability_of_value(labels, read, "text")
    else:
        own = list(_words_in(plain, words, found.span))
        held_by = [each for each in searched if any(word in each.zone.words for word in own)] or searched
        labels = prod(each.confidence for each in held_by)
        right = probability_of_value(labels, prod(word.confidence for word in own), setting.type)
    return Field(
        label=label,
        text=_text(zones),
        value=found.value,
        type=setting.type,
        currency=found.currency,
        problem=found.problem,
        confidence=of_class * right,
        zones=tuple(each.zone.id for each in zones),
    )


def _of_one_zone(
    label: str, zones: Sequence[RecognizedZone], setting: FieldSetting, of_class: float
) -> Field | None:
    """The field of `zones` if their texts one by one have one value: a pattern may tell where a text begins."""
    each = [_field(label, zones, [zone], setting, of_class) for zone in zones]
    found = [field for field in each if field.problem != "no-value"]
    same = len({(field.value, field.currency) for field in found}) == 1
    return max(found, key=lambda field: field.confidence) if same and found[0].value is not None else None


def _of_another_label(
    label: str, read: Sequence[RecognizedZone], setting: FieldSetting, of_class: float
) -> Field | None:
    """The field of the zone that most probably has this label among those with another one, if it has a value."""
    taken = [
        replace(each, confidence=(1.0 - each.confidence) * each.others[label])
        for each in read
        if label in each.others
    ]
    for each in sorted(taken, key=lambda each: -each.confidence):
        field = _field(label, [each], [each], setting, of_class)
        if field.value is not None:
            return field
    return None


def _of_equal_values(
    label: str,
    read: Sequence[RecognizedZone],
    setting: FieldSetting,
    of_class: float,
    field: Field | None,
) -> Field | None:
    """The field of the zones whose equal values have this label most probably, all together.

    Only of a label that samples have once a page (`RecognizedZone.shares`); else `field`.
    """
    by_value: dict[tuple[str, str | None], list[tuple[float, Field]]] = {}
    for each in read:
        share = each.shares.get(label, 0.0)
        if share < _LEAST_DOUBT:
            continue
        own = _field(label, [each], [replace(each, confidence=share)], setting, of_class)
        if own.value is not None:
            by_value.setdefault((own.value, own.currency), []).append((share, own))
    if not by_value:
        return field
    best = max(by_value.values(), key=lambda found: sum(share for share, _ in found))
    total = sum(share for share, _ in best)
    _, surest = max(best, key=lambda found: found[0])
    if field is not None and field.value == surest.value:
        return field
    zone = next(each for each in read if each.zone.id == surest.zones[0])
    return _field(label, [zone], [replace(zone, confidence=total)], setting, of_class)


def _text(zones: Iterable[RecognizedZone]) -> str:
    return "\n".join(each.zone.text for each in zones)


def _words_in(text: str, words: list[ZoneWord], span: tuple[int, int]) -> Iterator[ZoneWord]:
    """The words of `text`, in their order, that overlap a span of it."""
    end = 0
    for word in words:
        begin = text.find(word.text, end)
        if begin < 0:  # the text of the zone came from elsewhere
            continue
        end = begin + len(word.text)
        if begin < span[1] and end > span[0]:
            yield word
