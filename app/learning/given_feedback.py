"""What a person said of a stored result: the body of a feedback, joined with the result to the verified page."""

from collections.abc import Sequence, Set
from dataclasses import dataclass, replace
from typing import cast

from app.learning.labelled_pages import layout_settings
from app.review.decisions import verdicts_of
from app.schemas.layout import known_result
from app.schemas.layout_feedback import FeedbackBody
from app.state import AppState
from models.feedback_records import GivenJson
from models.records import RECOGNIZED, recognized
from services.contract.answers.learning import GivenText, Verdict, WrongLabel
from services.contract.boxes import common_area, lie_on_each_other
from services.contract.layout_learning import Adaptation, VerifiedPage
from services.contract.page_json import GivenZoneJson, PageJson
from services.contract.result_json import (
    LabelledZoneJson,
    RecognizedJson,
    ResultJson,
    StoredResultJson,
)
from services.errors import InvalidOption

MOST_NAMED = 20
"""Of new labels, and of a result's pages, in one message."""


@dataclass(frozen=True, slots=True)
class GivenFeedback:
    """A feedback as it was given, the verified page, and the zones that its result shows.

    `document` is the stored result, `recognized` what was recognized of it, `texts` those that the person gave now,
    and `sure_texts` the ids of all zones whose text a person has given. `seen` has the ids of the earlier feedback on
    the result.
    """

    result_id: str
    key: str | None
    request: GivenJson
    owner: str | None
    seen: Set[str]
    document: StoredResultJson
    verified: VerifiedPage[PageJson]
    zones: list[LabelledZoneJson]
    texts: list[GivenText]

    @property
    def recognized(self) -> RecognizedJson:
        """Page and result of the recognition."""
        return recognized(self.document)

    @property
    def sure_texts(self) -> frozenset[str]:
        """Ids of the zones whose text a person has given, now or before."""
        before = {
            zone["id"]: zone["text"]
            for zone in self.document["result"]["zones"]
            if RECOGNIZED in self.document and zone.get("text_confidence") == 1.0
        }
        kept = (zone["id"] for zone in self.zones if zone["text"] == before.get(zone["id"]))
        return frozenset((*kept, *(each.zone for each in self.texts)))

    @property
    def left_out(self) -> list[WrongLabel]:
        """The recognized zones with a label that the person left out, with nothing drawn in their place."""
        if self.verified.verified_class is None:
            return []
        kept = {str(zone["id"]) for zone in self.verified.page["zones"]}
        places = [zone["box"] for zone in self.verified.page["zones"]]
        return [
            WrongLabel(zone=zone["id"], found=zone["label"], verified=None)
            for zone in self.recognized["result"]["zones"]
            if zone["label"] is not None
            and zone["id"] not in kept
            and not any(lie_on_each_other(zone["box"], box) for box in places)
        ]

    @property
    def is_new_class(self) -> bool:
        """Whether the verified class may be made."""
        return bool(self.request.get("new_class"))

    def verdicts(self, adaptation: Adaptation) -> list[Verdict]:
        """What the person said of the zones that were recognized."""
        verified = self.verified
        kept = {str(zone["id"]) for zone in verified.page["zones"]}
        wrong = {each.zone for each in adaptation.wrong}
        class_is_right = verified.found_class == verified.verified_class
        result = known_result(self.recognized["result"])
        return [] if result is None else verdicts_of(result, wrong, kept, class_is_right=class_is_right)


async def given_feedback(
    state: AppState,
    result_id: str,
    key: str | None,
    request: GivenJson,
    body: FeedbackBody,
    owner: str | None,
) -> GivenFeedback:
    """The feedback on the result as it is now.

    Raises
    ------
    ResultNotFound
    InvalidOption
        As `verified_page`; also when a zone is invalid.
    """
    seen = await state.store.call(lambda store: store.feedback_ids(result_id))  # before what follows from it
    document = (await state.store.call(lambda store: store.result(result_id))).document
    verified = verified_page(document, body)
    given = GivenFeedback(
        result_id, key, request, owner, seen, document, verified, document["result"]["zones"], []
    )
    if body.zones is None and not body.texts:
        return replace(given, verified=_with_found_labels(verified, given.recognized))
    zones = _zones_with_texts(document, body)
    if body.zones is not None:
        zones = [cast(GivenZoneJson, zone.model_dump(exclude_none=True)) for zone in body.zones]
    revised = await state.engine.submit(
        state.operations.revise_page, document["page"], zones, layout_settings(state.settings)
    )
    verified = replace(verified, page=revised.page)
    if body.zones is not None:
        labels = {str(zone["id"]): zone.get("label") for zone in revised.zones}
        found_page = given.recognized["page"]
        verified = replace(verified, found_labels={}, labels=labels, found_page=found_page)
    verified = _with_found_labels(verified, given.recognized)
    return replace(given, verified=verified, zones=revised.zones, texts=revised.texts)


def _with_found_labels(verified: VerifiedPage[PageJson], before: RecognizedJson) -> VerifiedPage[PageJson]:
    """The verified page with the recognized label of each of its zones; of a drawn zone that of the zone it lies on.

    So a zone that a person has divided or moved is wrong only where its label was.
    """
    recognized_zones = before["result"]["zones"]
    by_id = {zone["id"]: zone["label"] for zone in recognized_zones}
    labels = {
        str(zone["id"]): by_id[str(zone["id"])]
        if str(zone["id"]) in by_id
        else _label_under(zone["box"], recognized_zones)
        for zone in verified.page["zones"]
    }
    return replace(verified, found_labels=labels)


def _label_under(box: Sequence[float], zones: Sequence[LabelledZoneJson]) -> str | None:
    """The label of the zone that has most of a box in common with it, at least half of the smaller one."""
    under = [zone for zone in zones if lie_on_each_other(zone["box"], box)]
    nearest = max(under, key=lambda zone: common_area(box, zone["box"]), default=None)
    return None if nearest is None else nearest["label"]


def _zones_with_texts(document: StoredResultJson, body: FeedbackBody) -> list[GivenZoneJson]:
    """All zones of a result in reading order, with the labels and the texts that the person gave.

    Raises
    ------
    InvalidOption
        When the result has no zone for one of the texts.
    """
    found = {zone["id"]: zone for zone in document["result"]["zones"]}
    for zone in body.texts:
        if zone not in found:
            shown = zone[:80]
            raise InvalidOption(
                f"texts: the result has no zone {shown!a}. Use the ids in `zones` of the result.",
                f"texts.{shown}",
            )
    return [
        {
            "id": zone,
            "box": each["box"],
            "kind": each["kind"],
            "label": body.labels.get(zone, each["label"]),
            "text": body.texts.get(zone, ""),
        }
        for zone, each in sorted(found.items(), key=lambda item: item[1].get("order", 0))
    ]


def verified_page(document: StoredResultJson, body: FeedbackBody) -> VerifiedPage[PageJson]:
    """The page of a stored result, with the feedback applied to what the result shows; drawn zones are not in it yet.

    Raises
    ------
    InvalidOption
        When the result is of a document of several pages, each of which has its own result; when the result has no
        such zone; when no class was found and none is given.
    """
    _require_single_page(document)
    before, result = recognized(document), document["result"]
    shown_class, found_class = _class_of(result), _class_of(before["result"])
    shown_labels = {zone["id"]: zone["label"] for zone in result["zones"]}
    for zone, label in body.labels.items():
        if zone not in shown_labels:
            shown = zone[:80]
            raise InvalidOption(
                f"labels: the result has no zone {shown!a}. Use the ids in `zones` of the result.",
                f"labels.{shown}",
            )
        if label is not None and not (label and label.isprintable()):
            raise InvalidOption(
                f"labels.{zone}: expected printable characters, or null for no label of the model; got {label!a}.",
                f"labels.{zone}",
            )
    has_class = "class_" in body.model_fields_set
    if not has_class and shown_class is None:
        raise InvalidOption(
            "class: no class was found for this page. Give its class, or null for none.", "class"
        )
    verified_class = body.class_ if has_class else shown_class
    if RECOGNIZED not in document:
        return VerifiedPage(document["page"], found_class, shown_labels, verified_class, body.labels)
    found_labels = {zone["id"]: zone["label"] for zone in before["result"]["zones"]}
    labels = {**shown_labels, **body.labels} if verified_class == shown_class else body.labels
    is_drawn = _places(document["page"]) != _places(before["page"])
    found_page = before["page"] if is_drawn else None
    found_labels = {zone: found_labels.get(zone) for zone in shown_labels}
    return VerifiedPage(document["page"], found_class, found_labels, verified_class, labels, found_page)


def _class_of(result: ResultJson) -> str | None:
    return None if result["class"] is None else result["class"]["name"]


def _places(page: PageJson) -> dict[str, list[float]]:
    return {str(zone["id"]): zone["box"] for zone in page["zones"]}


def _require_single_page(document: StoredResultJson) -> None:
    if "page" not in document:
        pages = ", ".join(document["pages"][:MOST_NAMED])
        raise InvalidOption(
            f"id: this document has {len(document['pages'])} pages. Send the feedback on each page to the result of "
            f"that page ({pages}).",
            "id",
        )
