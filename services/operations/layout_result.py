"""The `LayoutResult` of the HTTP contract as values that JSON can hold."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict

from services.contract.fields import FieldSetting
from services.layout.exchange.page_json import plain_number
from services.layout.graph.font_sizes import measure_font_classes
from services.layout.model.cost import MOST_EXPLAINED
from services.layout.page import Appearance, Page, ReadWord, Zone
from services.layout.recognition.fields import NO_FIELDS, Field, gather_fields
from services.layout.recognition.results import ClassMatch, MatchReport, Recognition
from services.operations.replies import rounded


def describe_recognition(
    recognition: Recognition,
    *,
    explain: bool,
    words: bool = False,
    fields: Mapping[str, FieldSetting] = NO_FIELDS,
) -> dict[str, object]:
    """The `LayoutResult` of the HTTP contract without id, warnings and timings; with `words`, those of every zone.

    `fields` has the types of the fields by label.
    """
    zones = describe_zones(
        recognition.page,
        [(each.zone, each.label, each.confidence, each.group) for each in recognition.zones],
        [each.order for each in recognition.zones],
        words=words,
    )
    return {
        "width": plain_number(recognition.page.width),
        "height": plain_number(recognition.page.height),
        **describe_classes(recognition.chosen, recognition.classes, recognition.unknown_probability),
        "zones": zones,
        "fields": describe_fields(recognition, fields),
        "match": None if recognition.match is None else _describe_match(recognition.match, explain),
    }


def describe_zones(
    page: Page,
    labelled: Sequence[tuple[Zone, str | None, float, str | None]],
    order: Sequence[int] | None = None,
    *,
    words: bool = False,
) -> list[dict[str, object]]:
    """The `zones` of the HTTP contract, from (zone, label, confidence, group) of each.

    `order` has their places in reading order; None: they are in it.
    """
    font_classes = dict(zip((zone.id for zone in page.zones), measure_font_classes(page), strict=True))
    return [
        {
            "id": zone.id,
            "box": [round(value, 2) for value in zone.box],
            "label": label,
            "confidence": rounded(confidence),
            "group": group,
            "order": place if order is None else order[place],
            "kind": zone.kind,
            "lines": zone.lines,
            "font_size": rounded(zone.font_size),
            "font_class": font_classes[zone.id],
            "line_spacing": rounded(zone.line_spacing),
            "weight": rounded(zone.weight),
            "alignment": zone.alignment,
            "appearance": _describe_appearance(zone.appearance),
            "text": zone.text,
            "text_confidence": rounded(zone.text_confidence),
            "words": [_describe_word(word) for word in zone.words] if words else None,
            "content": {name: round(value, 4) for name, value in zone.content.items() if value >= 5e-5},
        }
        for place, (zone, label, confidence, group) in enumerate(labelled)
    ]


def describe_fields(
    recognition: Recognition, settings: Mapping[str, FieldSetting]
) -> list[dict[str, object]]:
    """The `fields` of the HTTP contract; `settings` has their types by label."""
    return [_describe_field(field) for field in gather_fields(recognition, settings)]


def _describe_field(field: Field) -> dict[str, object]:
    return {
        "label": field.label,
        "text": field.text,
        "type": field.type,
        "value": field.value,
        "currency": field.currency,
        "problem": field.problem,
        "confidence": rounded(field.confidence),
        "zones": list(field.zones),
    }


def _describe_appearance(appearance: Appearance | None) -> dict[str, float] | None:
    return None if appearance is None else {name: round(v, 4) for name, v in asdict(appearance).items()}


def _describe_word(word: ReadWord) -> dict[str, object]:
    return {
        "text": word.text,
        "box": [round(value, 2) for value in word.box],
        "confidence": rounded(word.confidence),
        "line": word.line,
    }


def describe_classes(
    chosen: ClassMatch | None, classes: Sequence[ClassMatch], unknown_probability: float
) -> dict[str, object]:
    """The class of a page or a document, and all classes that were compared."""
    return {
        "class": None if chosen is None else _describe_class(chosen),
        "classes": [_describe_class(match) for match in classes],
        "unknown_probability": rounded(unknown_probability),
    }


def _describe_class(match: ClassMatch) -> dict[str, object]:
    return {
        "name": match.name,
        "model_version": match.model_version,
        "cost": rounded(match.cost),
        "probability": rounded(match.probability),
    }


def _describe_match(match: MatchReport, explain: bool) -> dict[str, object]:
    terms = [
        {"zone": term.zone, "other": term.other, "attribute": term.attribute, "cost": rounded(term.cost)}
        for term in match.explanation[:MOST_EXPLAINED]
    ]
    return {
        "cost": rounded(match.cost),
        "node_cost": rounded(match.node_cost),
        "edge_cost": rounded(match.edge_cost),
        "count_cost": rounded(match.count_cost),
        "optimal": match.optimal,
        "gap": rounded(match.gap),
        "backbone": dict(match.backbone),
        "explanation": terms if explain else None,
    }
