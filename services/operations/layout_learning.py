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
from services.contract.result_json import LabelledZoneJson, TableJson
from services.errors import InvalidOption
from services.layout.content.content_features import content_features
from services.layout.exchange.page_json import page_from_document, page_to_document
from services.layout.learning import feedback
from services.layout.learning.label_transfer import transfer_labels
from services.layout.learning.revised_zones import is_text_known, revise_zones, zone_at
from services.layout.learning.training import train_in_rounds
from services.layout.model.layout_model import MOST_LABELS
from services.layout.model.model_document import model_to_document
from services.layout.page import InvalidLayout, Page, Zone
from services.layout.tables.learning import TablePage, gathered_samples, learn_table, table_page
from services.layout.tables.reading import TablePlan, read_tables
from services.layout.tables.sample_doubts import cells_of_several, doubts_of_rows
from services.layout.tables.table_model import TableModel
from services.operations.layout_models import FOUND, draft_of, read_samples, sample_document
from services.operations.layout_result import describe_zones
from services.operations.layout_tables import describe_tables
from services.operations.page_zones import check_boxes, exchange_limits, read_kept_page
from services.operations.replies import describe_warnings, to_json_ready
from services.operations.stored_models import read_model
from services.progress import report_progress


def adapt_models(
    verified: VerifiedPage[PageJson],
    models: Sequence[ModelDocument],
    settings: LayoutSettings,
    items: Sequence[str] = (),
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
    items
        The columns of the table of the verified class, by its settings.

    Raises
    ------
    InvalidModel
        When this release cannot read a model.
    InvalidOption
        When the model would have too many labels, when zones have no label and no model can find it, or when a box
        with the label of a column holds several cells.
    """
    features = content_features(settings.content_features)
    whole = verified.read_by(lambda page: features.measure_page(read_kept_page(page, settings)))
    named = {stored.name: read_model(stored) for stored in models}
    right = named.get(verified.verified_class or "")
    before = None if right is None else right.table
    columns = before.labels if before is not None else ()
    columns = (*columns, *(label for label in items if label not in columns))
    read, cells, table = _without_cells(whole, before, columns)
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
    if right is not None:
        tables[right.name] = table
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
        tables=None if right is None else _tables_again(whole, models, right.name, table, bool(cells)),
        columns=columns,
        warnings=describe_warnings(
            doubts_of_rows([table_page(replace(whole.page, zones=cells), None, columns)])
        ),
    )


def _tables_again(
    verified: VerifiedPage[Page],
    models: Sequence[ModelDocument],
    name: str,
    table: TableModel | None,
    has_cells: bool,
) -> list[TableJson] | None:
    """The tables of the page by the class's table; None where the class is the found one and no cell was labelled."""
    if verified.found_class == name and not has_cells:
        return None
    if table is None:
        return []
    types = next(model.fields for model in models if model.name == name)
    page = verified.page if verified.found_page is None else verified.found_page
    [tables] = read_tables([page], [TablePlan(table, types, 1.0)])
    return [cast(TableJson, each.model_dump(mode="json")) for each in describe_tables(tables)]


def _without_cells(
    verified: VerifiedPage[Page], known: TableModel | None, columns: tuple[str, ...]
) -> tuple[VerifiedPage[Page], tuple[Zone, ...], TableModel | None]:
    """The page without the cells that a person labelled, these cells, and the table that has learned from them.

    The layout graph does not know cells: they teach the table of the class, the first one too. `known` is the table
    before, `columns` are those after.
    """
    kept = verified.found_labels
    given = {zone.id: verified.labels.get(zone.id, kept.get(zone.id)) for zone in verified.page.zones}
    cells = tuple(
        replace(zone, label=given[zone.id]) for zone in verified.page.zones if given[zone.id] in columns
    )
    if not cells:
        return verified, (), known
    page = replace(
        verified.page, zones=tuple(zone for zone in verified.page.zones if given[zone.id] not in columns)
    )
    printed = verified.page if verified.found_page is None else verified.found_page
    taught = table_page(replace(page, zones=cells), printed, columns)
    _check_cells(cells, taught)
    return replace(verified, page=page), cells, learn_table([taught], columns, known)


def _check_cells(cells: Sequence[Zone], page: TablePage) -> None:
    for cell, of_several in zip(cells, cells_of_several(page), strict=True):
        if of_several:
            raise InvalidOption(
                f"labels.{cell.id}: {cell.label} is a column of the table, and the box of this zone holds several "
                "cells. Send `zones` with a box around each cell; those of one or two rows are enough.",
                f"labels.{cell.id}",
            )


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
        The person's zones, `[{"id"?, "box", "label"?, "text"?, "kind"?}]`. A zone without an id gets that of the zone
        at its place, or else a new one.
    settings
        Limits, and the settings file of content features.

    Raises
    ------
    InvalidOption
        When a zone is invalid; the error names it.
    """
    found = read_kept_page(page, settings)
    document = {"width": page["width"], "height": page["height"], "zones": _named(zones, found)}
    try:
        drawn = page_from_document(document, exchange_limits(settings))
    except InvalidLayout as error:
        raise InvalidOption(f"{error.field or 'zones'}: {error.detail}", error.field or "zones") from error
    check_boxes(drawn, {zone.box for zone in found.zones})
    features = content_features(settings.content_features)
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
            if given.text and is_text_known(found, given.box)
        ],
    )


def _named(zones: Sequence[GivenZoneJson], found: Page) -> list[GivenZoneJson]:
    """The zones, those without an id with that of the found zone at their place, or with a new one."""
    taken = {str(zone["id"]) for zone in zones if zone.get("id") is not None}
    known = taken | {zone.id for zone in found.zones}
    fresh = (name for name in map("n{}".format, count(1)) if name not in known)
    named: list[GivenZoneJson] = []
    for zone in zones:
        own = zone.get("id")
        if own is None:
            same = zone_at(zone["box"], found.zones)
            own = next(fresh) if same is None or same.id in taken else same.id
            taken.add(own)
        named.append({**zone, "id": own})
    return named


def _check_labels(name: str, labels: set[str | None]) -> None:
    number = len(labels - {None})
    if number > MOST_LABELS:
        raise InvalidOption(
            f"labels: model {name} would have {number} different labels; a model may have {MOST_LABELS}.",
            "labels",
        )
