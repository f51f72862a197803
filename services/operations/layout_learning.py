"""Learning in a worker: from JSON documents of pages and models to JSON documents of adapted models."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import count
from typing import cast

from rapidfuzz.distance import Levenshtein

from services.contract.answers.learning import GivenText, LabellingCosts, WrongLabel
from services.contract.layout import LayoutSettings, ModelDocument
from services.contract.layout_learning import Adaptation, RevisedPage, TrainingReport, VerifiedPage
from services.contract.layout_models import ModelDraft
from services.contract.page_json import GivenZoneJson, PageJson, SampleJson
from services.contract.result_json import LabelledZoneJson
from services.errors import InvalidOption
from services.layout.content.content_features import content_features
from services.layout.exchange.page_json import page_from_document, page_to_document
from services.layout.learning import feedback
from services.layout.learning.label_transfer import transfer_labels
from services.layout.learning.revised_zones import revise_zones
from services.layout.learning.training import train_in_rounds
from services.layout.model.layout_model import MOST_LABELS, LayoutModel
from services.layout.model.model_document import model_to_document
from services.layout.page import InvalidLayout, Page, Zone
from services.layout.tables.learning import gathered_samples, learn_table, table_page
from services.layout.tables.table_model import TableModel
from services.operations.layout_models import FOUND, draft_of, read_samples, sample_document
from services.operations.layout_result import describe_zones
from services.operations.page_zones import exchange_limits, read_kept_page
from services.operations.replies import to_json_ready
from services.operations.stored_models import read_model
from services.progress import report_progress


def adapt_models(
    verified: VerifiedPage[PageJson], models: Sequence[ModelDocument], settings: LayoutSettings
) -> Adaptation:
    """The models of the found and of the verified class, adapted to a verified page.

    Parameters
    ----------
    verified
        The page and the feedback on it.
    models
        The newest versions of both classes; a class without a version is left out.
    settings
        Limits, and the settings file of content features.

    Raises
    ------
    InvalidModel
        When this release cannot read a model.
    InvalidOption
        When the model would have too many labels, or when zones have no label and no model can find it.
    """
    features = content_features(settings.content_features)
    whole = verified.read_by(lambda page: features.measure_page(read_kept_page(page, settings)))
    named = {stored.name: read_model(stored) for stored in models}
    read, cells, table = _without_cells(whole, named.get(verified.verified_class or ""))
    right = named.get(verified.verified_class or "")
    if right is not None:  # checked before learning: tables for hundreds of labels take gigabytes
        kept = verified.found_labels if verified.found_class == verified.verified_class else {}
        given = {verified.labels.get(zone.id, kept.get(zone.id)) for zone in read.page.zones}
        _check_labels(right.name, {*right.labels, *given})
    try:
        labels, learned = feedback.adapt_models(
            read, named, {stored.name: stored.learner for stored in models}, features.names, features
        )
    except feedback.LabelsMissing as error:
        raise InvalidOption(
            f"labels.{error.zone}: {verified.verified_class} has no model yet that could supply the labels which are "
            "not named; name those of all zones.",
            "labels",
        ) from error
    zones = tuple(replace(zone, label=label) for zone, label in zip(read.page.zones, labels, strict=True))
    tables = {name: model.table for name, model in named.items()}
    if table is not None:
        tables[table[0]] = table[1]
    return Adaptation(
        documents={
            name: model_to_document(replace(each.model, table=tables[name])) for name, each in learned.items()
        },
        wrong=[
            WrongLabel(zone=zone.id, found=verified.found_labels.get(zone.id), verified=zone.label)
            for zone in zones
            if zone.label != verified.found_labels.get(zone.id) and verified.verified_class is not None
        ],
        costs=[
            LabellingCosts(model=name, found=each.found, verified=each.verified)
            for name, each in learned.items()
        ],
        sample=_sample(replace(whole.page, zones=(*zones, *cells)), whole.found_page),
        zones=len(zones),
    )


def _without_cells(
    verified: VerifiedPage[Page], right: LayoutModel | None
) -> tuple[VerifiedPage[Page], tuple[Zone, ...], tuple[str, TableModel | None] | None]:
    """The page without the cells that a person labelled, these cells, and the table that has learned from them.

    The layout graph does not know cells: they teach the table of the class, which is None where nothing changes.
    """
    if right is None or right.table is None:
        return verified, (), None
    items, kept = frozenset(right.table.labels), verified.found_labels
    given = {zone.id: verified.labels.get(zone.id, kept.get(zone.id)) for zone in verified.page.zones}
    cells = tuple(
        replace(zone, label=given[zone.id]) for zone in verified.page.zones if given[zone.id] in items
    )
    if not cells:
        return verified, (), None
    page = replace(
        verified.page, zones=tuple(zone for zone in verified.page.zones if given[zone.id] not in items)
    )
    printed = verified.page if verified.found_page is None else verified.found_page
    taught = table_page(replace(page, zones=cells), printed, right.table.labels)
    table = learn_table([taught], right.table.labels, right.table)
    return replace(verified, page=page), cells, (right.name, table)


def _sample(verified: Page, found: Page | None) -> SampleJson:
    """The stored form of a verified page, with the found zones as its second view where a person drew others."""
    document = sample_document(verified)
    if found is not None:
        document[FOUND] = sample_document(transfer_labels(verified, found))
    return document


def train_model(
    model: ModelDocument, samples: Sequence[SampleJson], rounds: int, settings: LayoutSettings
) -> tuple[ModelDraft, TrainingReport]:
    """The model after at most `rounds` rounds over its samples, and the errors of each round.

    Raises
    ------
    InvalidModel
        When this release cannot read the model.
    InvalidOption
        When a sample is not a valid page under the present limits, or the samples have too many labels.
    """
    pages, found = read_samples(samples, settings)
    before = read_model(model)
    if before.table is not None:
        pages, found = gathered_samples(pages, found, before.table)
    trained, report = train_in_rounds(
        before,
        pages,
        found,
        rounds,
        model.learner,
        content_features(settings.content_features),
        lambda share: report_progress("training", share),
    )
    _check_labels(trained.name, set(trained.labels))
    return draft_of(replace(trained, table=before.table)), report


def revise_page(page: PageJson, zones: Sequence[GivenZoneJson], settings: LayoutSettings) -> RevisedPage:
    """The page of a stored result with the zones or texts of a person.

    Parameters
    ----------
    page
        The page of the stored result.
    zones
        The person's zones, `[{"id"?, "box", "label"?, "text"?, "kind"?}]`. A zone without an id gets one.
    settings
        Limits, and the settings file of content features.

    Raises
    ------
    InvalidOption
        When a zone is invalid; the error names it.
    """
    taken = {str(zone["id"]) for zone in zones if zone.get("id") is not None}
    fresh = (name for name in map("n{}".format, count(1)) if name not in taken)
    named = [{**zone, "id": zone["id"] if zone.get("id") is not None else next(fresh)} for zone in zones]
    document = {"width": page["width"], "height": page["height"], "zones": named}
    try:
        drawn = page_from_document(document, exchange_limits(settings))
    except InvalidLayout as error:
        raise InvalidOption(f"{error.field or 'zones'}: {error.detail}", error.field or "zones") from error
    features = content_features(settings.content_features)
    found = read_kept_page(page, settings)
    revised = features.measure_page(revise_zones(found, drawn))
    read = revise_zones(found, replace(drawn, zones=tuple(replace(zone, text="") for zone in drawn.zones)))
    return RevisedPage(
        page=to_json_ready(page_to_document(revised)),
        zones=[
            cast(LabelledZoneJson, zone.model_dump(mode="json"))
            for zone in describe_zones(revised, [(each, each.label, 1.0, None) for each in revised.zones])
        ],
        texts=[
            GivenText(
                zone=given.id,
                found=before.text,
                verified=given.text,
                edits=Levenshtein.distance(before.text, given.text),
            )
            for given, before in zip(drawn.zones, read.zones, strict=True)
            if given.text
        ],
    )


def _check_labels(name: str, labels: set[str | None]) -> None:
    number = len(labels - {None})
    if number > MOST_LABELS:
        raise InvalidOption(
            f"labels: model {name} would have {number} different labels; a model may have {MOST_LABELS}.",
            "labels",
        )
