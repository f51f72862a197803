"""The one place where a person's word becomes the result of a page; all representations show what it returns."""

from collections.abc import Iterator, Sequence
from typing import cast

from services.contract.boxes import are_one_place
from services.contract.layout_learning import Correction
from services.contract.result_json import ClassJson, FieldJson, LabelledZoneJson, ResultJson, WordJson
from services.layout.page import Box, Page, Zone, ZoneWord
from services.layout.recognition.results import ClassMatch, Recognition, RecognizedZone
from services.operations.corrected_tables import correct_tables
from services.operations.layout_result import describe_fields
from services.operations.replies import to_json_ready

_SAID = 1.0
"""Confidence of what a person has said."""


def correct_result(
    found: ResultJson, zones: Sequence[LabelledZoneJson], correction: Correction
) -> ResultJson:
    """The `LayoutResult` of the HTTP contract without its id, as the person has verified it.

    What the machine had found stands beside it as `found`, of the result and of its zones, where it differs.

    Parameters
    ----------
    found
        The result of the recognition.
    zones
        The `zones` of the verified page: as the result shows them so far, or as they were drawn.
    correction
        What the person said of class, labels and texts.
    """
    before = {zone["id"]: zone for zone in found["zones"]}
    shown = [_zone(zone, before.get(zone["id"]), correction) for zone in zones]
    tables, columns = correct_tables(found, shown, correction)
    values = [zone for zone in shown if zone["label"] not in columns]
    result: ResultJson = {**found, "zones": shown, "fields": _fields(values, found, correction)}
    result["tables"] = tables
    name, found_name = correction.class_name, None if found["class"] is None else found["class"]["name"]
    result["class"] = _class(name, found["classes"])
    if name != found_name:
        chance = found["unknown_probability"] if found["class"] is None else found["class"]["probability"]
        result["found"] = {"class": found_name, "probability": chance}
        result["part"] = None if name is None else "continuation" if correction.continues else "first"
        result["document_class"] = correction.continues or name
    if name != found_name or {(zone["id"], zone["label"]) for zone in shown} != {
        (zone["id"], zone["label"]) for zone in before.values()
    }:
        result["match"] = None  # it explains other labels
    result["decision"] = {
        "action": "accept",
        "tolerated_error": correction.tolerated_error,
        "reasons": [],
    }
    return cast(ResultJson, to_json_ready(result))


def _zone(
    zone: LabelledZoneJson, before: LabelledZoneJson | None, correction: Correction
) -> LabelledZoneJson:
    """A zone as it is shown: with all that was found of the zone at its place, and what the person said."""
    label, text = correction.labels[zone["id"]], zone["text"]
    shown: LabelledZoneJson = {**zone}
    shown.pop("found", None)
    if before is not None and are_one_place(zone["box"], before["box"]):
        shown = {**before, "order": zone["order"], "kind": zone["kind"]}
        if text != before["text"]:
            shown["text"], shown["text_confidence"] = text, None
            shown["words"] = None if before.get("words") is None else []
            shown["content"] = zone["content"]
    if zone["id"] in correction.texts or zone.get("text_confidence") == _SAID:
        shown["text_confidence"] = _SAID
    shown["label"], shown["confidence"], shown["group"] = label, _SAID, label
    if before is not None and (label, text) != (before["label"], before["text"]):
        shown["found"] = {
            "label": before["label"],
            "confidence": before["confidence"],
            "text": before["text"],
        }
    return shown


def _class(name: str | None, classes: Sequence[ClassJson]) -> ClassJson | None:
    if name is None:
        return None
    unknown = ClassJson(name=name, model_version=None, cost=None, probability=_SAID)
    compared = next((each for each in classes if each["name"] == name), unknown)
    return {**unknown, **compared, "probability": _SAID}


def _fields(zones: Sequence[LabelledZoneJson], found: ResultJson, correction: Correction) -> list[FieldJson]:
    """The fields of the verified zones; class and labels are sure, and texts as sure as they were read or given."""
    sure = ClassMatch("", 0, 0.0, _SAID)
    labelled = tuple(
        RecognizedZone(
            Zone(zone["id"], _box(zone), zone["kind"], text=zone["text"], words=tuple(_words(zone))),
            zone["label"],
            _SAID,
            zone["group"],
            zone["order"],
        )
        for zone in zones
    )
    page = Page(found["width"], found["height"], tuple(each.zone for each in labelled))
    fields = describe_fields(Recognition(page, labelled, sure, (sure,)), correction.fields)
    return [cast(FieldJson, field.model_dump(mode="json")) for field in fields]


def _words(zone: LabelledZoneJson) -> Iterator[ZoneWord]:
    """The words of a zone; where they were not kept, those of its text, as sure as it. None where a person gave it."""
    sure = zone.get("text_confidence")
    if sure is None or sure == _SAID:
        return
    for word in zone.get("words") or ():
        yield ZoneWord(word["text"], _box(word), word["confidence"], word["line"])
    if zone.get("words"):
        return
    for line, text in enumerate(zone["text"].split("\n")):
        for part in text.split():
            yield ZoneWord(part, _box(zone), sure, line)


def _box(part: LabelledZoneJson | WordJson) -> Box:
    x0, y0, x1, y1 = part["box"]
    return x0, y0, x1, y1
