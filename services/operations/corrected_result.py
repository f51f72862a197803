"""The one place where a person's word becomes the result of a page; all representations show what it returns."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from services.contract.layout_learning import Correction
from services.layout.page import Page, Zone, ZoneWord
from services.layout.recognition.results import ClassMatch, Recognition, RecognizedZone
from services.operations.layout_result import describe_fields
from services.operations.replies import to_json_ready

_SAME_PX = 1.0
"""Largest distance of the sides of one zone, as in `services.layout.learning.revised_zones`."""
_SAID = 1.0
"""Confidence of what a person has said."""


def correct_result(
    found: Mapping[str, Any], zones: Sequence[Mapping[str, Any]], correction: Correction
) -> dict[str, Any]:
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
    result = {**found, "zones": shown, "fields": _fields(shown, found, correction)}
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
    ready: dict[str, Any] = to_json_ready(result)
    return ready


def _zone(
    zone: Mapping[str, Any], before: Mapping[str, Any] | None, correction: Correction
) -> dict[str, Any]:
    """A zone as it is shown: with all that was found of the zone at its place, and what the person said."""
    label, text = correction.labels[zone["id"]], zone["text"]
    shown = {name: value for name, value in zone.items() if name != "found"}
    if before is not None and _are_one_place(zone["box"], before["box"]):
        shown = {**before, "order": zone["order"], "kind": zone["kind"]}
        if text != before["text"]:
            words: list[object] | None = None if before.get("words") is None else []
            shown |= {"text": text, "text_confidence": None, "words": words, "content": zone["content"]}
    if zone["id"] in correction.texts or zone.get("text_confidence") == _SAID:
        shown["text_confidence"] = _SAID
    shown |= {"label": label, "confidence": _SAID, "group": label}
    if before is not None and (label, text) != (before["label"], before["text"]):
        shown["found"] = {name: before[name] for name in ("label", "confidence", "text")}
    return shown


def _are_one_place(first: Sequence[float], second: Sequence[float]) -> bool:
    return max(abs(a - b) for a, b in zip(first, second, strict=True)) <= _SAME_PX


def _class(name: str | None, classes: Sequence[Mapping[str, Any]]) -> dict[str, Any] | None:
    if name is None:
        return None
    compared = next((each for each in classes if each["name"] == name), {})
    return {"name": name, "model_version": None, "cost": None, **compared, "probability": _SAID}


def _fields(
    zones: Sequence[Mapping[str, Any]], found: Mapping[str, Any], correction: Correction
) -> list[dict[str, Any]]:
    """The fields of the verified zones; class and labels are sure, and texts as sure as they were read or given."""
    sure = ClassMatch("", 0, 0.0, _SAID)
    labelled = tuple(
        RecognizedZone(
            Zone(zone["id"], tuple(zone["box"]), zone["kind"], text=zone["text"], words=tuple(_words(zone))),
            zone["label"],
            _SAID,
            zone["group"],
            zone["order"],
        )
        for zone in zones
    )
    page = Page(found["width"], found["height"], tuple(each.zone for each in labelled))
    fields = describe_fields(Recognition(page, labelled, sure, (sure,)), correction.fields)
    return [field.model_dump(mode="json") for field in fields]


def _words(zone: Mapping[str, Any]) -> Iterator[ZoneWord]:
    """The words of a zone; where they were not kept, those of its text, as sure as it. None where a person gave it."""
    sure = zone.get("text_confidence")
    if sure is None or sure == _SAID:
        return
    for word in zone.get("words") or ():
        yield ZoneWord(word["text"], tuple(word["box"]), word["confidence"], word["line"])
    if zone.get("words"):
        return
    for line, text in enumerate(zone["text"].split("\n")):
        for word in text.split():
            yield ZoneWord(word, tuple(zone["box"]), sure, line)
