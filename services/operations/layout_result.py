"""The contract's `LayoutResult`, ready for JSON."""

from services.layout.font_sizes import measure_font_classes
from services.layout.results import ClassMatch, MatchReport, Recognition

EXPLAINED_TERMS = 1000
"""Terms of the cost that are told, largest first; a page of 500 zones has a million."""


def describe_recognition(recognition: Recognition, *, explain: bool) -> dict[str, object]:
    """The contract's `LayoutResult`, but for its id, warnings and timings."""
    font_classes = dict(
        zip((zone.id for zone in recognition.page.zones), measure_font_classes(recognition.page), strict=True)
    )
    zones = []
    for labelled in recognition.zones:
        zone = labelled.zone
        zones.append(
            {
                "id": zone.id,
                "box": [round(value, 2) for value in zone.box],
                "label": labelled.label,
                "confidence": _rounded(labelled.confidence),
                "group": labelled.group,
                "order": labelled.order,
                "kind": zone.kind,
                "lines": zone.lines,
                "font_size": _rounded(zone.font_size),
                "font_class": font_classes[zone.id],
                "line_spacing": _rounded(zone.line_spacing),
                "weight": _rounded(zone.weight),
                "alignment": zone.alignment,
                "text": zone.text,
                "content": {name: round(value, 4) for name, value in zone.content.items() if value >= 5e-5},
            }
        )
    return {
        "width": _plain(recognition.page.width),
        "height": _plain(recognition.page.height),
        "class": None if recognition.chosen is None else _describe_class(recognition.chosen),
        "classes": [_describe_class(match) for match in recognition.classes],
        "unknown_probability": _rounded(recognition.unknown_probability),
        "zones": zones,
        "match": None if recognition.match is None else _describe_match(recognition.match, explain),
    }


def _describe_class(match: ClassMatch) -> dict[str, object]:
    return {
        "name": match.name,
        "model_version": match.model_version,
        "cost": _rounded(match.cost),
        "probability": _rounded(match.probability),
    }


def _describe_match(match: MatchReport, explain: bool) -> dict[str, object]:
    terms = [
        {"zone": term.zone, "other": term.other, "attribute": term.attribute, "cost": _rounded(term.cost)}
        for term in match.explanation[:EXPLAINED_TERMS]
    ]
    return {
        "cost": _rounded(match.cost),
        "node_cost": _rounded(match.node_cost),
        "edge_cost": _rounded(match.edge_cost),
        "count_cost": _rounded(match.count_cost),
        "optimal": match.optimal,
        "gap": _rounded(match.gap),
        "backbone": dict(match.backbone),
        "explanation": terms if explain else None,
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(float(value), 4)


def _plain(side_px: float) -> float:
    """A whole number without its fraction, as clients expect of an image's size."""
    return int(side_px) if float(side_px).is_integer() else float(side_px)
