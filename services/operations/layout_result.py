"""The answer about a recognized page."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict

from services.contract.answers import layout as answers
from services.contract.answers.layout import CostTerm, DocumentClass, LabelField, LayoutResult
from services.contract.fields import FieldSetting
from services.layout.exchange.page_json import plain_number
from services.layout.graph.font_sizes import measure_font_classes
from services.layout.model.cost import MOST_EXPLAINED
from services.layout.page import InkAppearance, Page, Zone, ZoneWord
from services.layout.recognition.fields import NO_FIELDS, Field, gather_fields
from services.layout.recognition.results import ClassMatch, ModelMatch, Recognition
from services.operations.layout_tables import describe_tables
from services.operations.page_reading import rounded_box
from services.operations.replies import rounded


def describe_recognition(
    recognition: Recognition,
    *,
    explain: bool,
    words: bool = False,
    fields: Mapping[str, FieldSetting] = NO_FIELDS,
) -> LayoutResult:
    """The answer without id, warnings and timings; with `words`, those of every zone.

    `fields` has the types of the fields by label.
    """
    zones = describe_zones(
        recognition.page,
        [(each.zone, each.label, each.confidence, each.group) for each in recognition.zones],
        [each.order for each in recognition.zones],
        words=words,
    )
    return LayoutResult(
        id="",
        width=plain_number(recognition.page.width),
        height=plain_number(recognition.page.height),
        class_=describe_class(recognition.chosen),
        classes=describe_classes(recognition.classes),
        unknown_probability=round(recognition.unknown_probability, 4),
        zones=zones,
        fields=describe_fields(recognition, fields),
        tables=describe_tables(recognition.tables),
        match=None if recognition.match is None else _describe_match(recognition.match, explain),
        warnings=[],
        timings_ms={},
    )


def describe_zones(
    page: Page,
    labelled: Sequence[tuple[Zone, str | None, float, str | None]],
    order: Sequence[int] | None = None,
    *,
    words: bool = False,
) -> list[answers.LabelledZone]:
    """The `zones` of an answer, from (zone, label, confidence, group) of each.

    `order` has their places in reading order; None: they are in it.
    """
    font_classes = dict(zip((zone.id for zone in page.zones), measure_font_classes(page), strict=True))
    return [
        answers.LabelledZone(
            id=zone.id,
            box=rounded_box(zone.box),
            label=label,
            confidence=round(confidence, 4),
            group=group,
            order=place if order is None else order[place],
            kind=zone.kind,
            lines=zone.lines,
            font_size=rounded(zone.font_size),
            font_class=font_classes[zone.id],
            line_spacing=rounded(zone.line_spacing),
            weight=rounded(zone.weight),
            alignment=zone.alignment,
            appearance=_describe_appearance(zone.appearance),
            text=zone.text,
            text_confidence=rounded(zone.text_confidence),
            words=[_describe_word(word) for word in zone.words] if words else None,
            content={name: round(value, 4) for name, value in zone.content.items() if value >= 5e-5},
        )
        for place, (zone, label, confidence, group) in enumerate(labelled)
    ]


def describe_fields(recognition: Recognition, settings: Mapping[str, FieldSetting]) -> list[LabelField]:
    """The `fields` of an answer; `settings` has their types by label."""
    return [_describe_field(field) for field in gather_fields(recognition, settings)]


def _describe_field(field: Field) -> LabelField:
    return LabelField(
        label=field.label,
        text=field.text,
        type=field.type,
        value=field.value,
        currency=field.currency,
        problem=field.problem,
        confidence=round(field.confidence, 4),
        zones=list(field.zones),
    )


def _describe_appearance(appearance: InkAppearance | None) -> answers.Appearance | None:
    if appearance is None:
        return None
    return answers.Appearance(**{name: round(value, 4) for name, value in asdict(appearance).items()})


def _describe_word(word: ZoneWord) -> answers.ReadWord:
    return answers.ReadWord(
        text=word.text, box=rounded_box(word.box), confidence=round(word.confidence, 4), line=word.line
    )


def describe_classes(classes: Sequence[ClassMatch]) -> list[DocumentClass]:
    """The classes that were compared."""
    return [
        DocumentClass(
            name=match.name,
            model_version=match.model_version,
            cost=rounded(match.cost),
            probability=round(match.probability, 4),
        )
        for match in classes
    ]


def describe_class(chosen: ClassMatch | None) -> DocumentClass | None:
    """The class of a page or a document."""
    return None if chosen is None else describe_classes([chosen])[0]


def _describe_match(match: ModelMatch, explain: bool) -> answers.MatchReport:
    terms = [
        CostTerm(zone=term.zone, other=term.other, attribute=term.attribute, cost=round(term.cost, 4))
        for term in match.explanation[:MOST_EXPLAINED]
    ]
    return answers.MatchReport(
        cost=round(match.cost, 4),
        node_cost=round(match.node_cost, 4),
        edge_cost=round(match.edge_cost, 4),
        count_cost=round(match.count_cost, 4),
        optimal=match.optimal,
        gap=round(match.gap, 4),
        backbone=dict(match.backbone),
        explanation=terms if explain else None,
    )
