"""Tables in a worker: pages whose tables are one zone each, and the tables of the answer."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol, TypeVar

from services.contract.answers import tables as answers
from services.contract.layout import ModelDocument
from services.layout.content.content_features import ContentFeatures
from services.layout.page import Page
from services.layout.pipeline import VersionedModel
from services.layout.recognition.documents import PageInDocument
from services.layout.recognition.results import ClassMatch
from services.layout.segmentation import FinePage, compose_page
from services.layout.tables.found_table import FoundTable
from services.layout.tables.gathering import best_tables, gather_lines
from services.layout.tables.item_table import ItemTable, TableCell, TableChecks
from services.layout.tables.reading import TablePlan, read_tables
from services.operations.page_reading import rounded_box

SegmentedPage = tuple[Page, FinePage | None]
"""A page, and its lines if we segmented it."""


def gather_tables(
    pages: Sequence[SegmentedPage], models: Sequence[VersionedModel], features: ContentFeatures
) -> list[SegmentedPage]:
    """The pages with each table of items as one zone; the same objects where no class has tables, or none is found.

    Zones that a client sent stay.
    """
    tables = [model.model.table for model in models if model.model.table is not None]
    if not tables:
        return list(pages)
    gathered: list[SegmentedPage] = []
    before: tuple[FoundTable, ...] = ()
    for page, fine in pages:
        before = () if fine is None else best_tables(page, tables, before)
        if fine is None or not before:
            gathered.append((page, fine))
            continue
        finer = gather_lines(fine, before)
        gathered.append((features.measure_page(compose_page(finer)), finer))
    return gathered


class _Compared(Protocol):
    @property
    def classes(self) -> tuple[ClassMatch, ...]: ...


R = TypeVar("R", bound=_Compared)


def recognize_view(
    gathered: Sequence[SegmentedPage],
    plain: Sequence[SegmentedPage],
    versions: Sequence[VersionedModel],
    recognize: Callable[[Sequence[SegmentedPage]], R],
) -> tuple[Sequence[SegmentedPage], R]:
    """Pages as their class knows them, and what `recognize` makes of them.

    What looked like a table is none to a class without one: its pages are matched as they are. Where both kinds of
    classes compete, each kind is asked of its own view, and the more probable class is taken: a page without its table
    is little like the samples of a class that has none. Zones are regrouped later, once.
    """
    seen = recognize(gathered)
    if all(a is b for (a, _), (b, _) in zip(gathered, plain, strict=True)):
        return gathered, seen
    with_table = {model.model.name for model in versions if model.model.table is not None}
    is_rival = len(with_table) < len({model.model.name for model in versions})
    nearest = _nearest(seen)
    if nearest is not None and nearest.name in with_table and not is_rival:
        return gathered, seen
    as_it_is = recognize(plain)
    other = _nearest(as_it_is)
    if nearest is None or nearest.name not in with_table:
        return plain, as_it_is
    if other is not None and other.name not in with_table and other.probability > nearest.probability:
        return plain, as_it_is
    return gathered, seen


def _nearest(seen: _Compared) -> ClassMatch | None:
    return seen.classes[0] if seen.classes else None


def with_tables(
    placed: Sequence[PageInDocument], versions: Sequence[VersionedModel], models: Sequence[ModelDocument]
) -> list[PageInDocument]:
    """The pages of a document with their tables, each by the model of its class."""
    plans = [_plan(each, versions, models) for each in placed]
    if not any(plans):
        return list(placed)
    tables = read_tables([each.recognition.page for each in placed], plans)
    return [
        replace(each, recognition=replace(each.recognition, tables=own))
        for each, own in zip(placed, tables, strict=True)
    ]


def _plan(
    placed: PageInDocument, versions: Sequence[VersionedModel], models: Sequence[ModelDocument]
) -> TablePlan | None:
    """By the model of the page, or else by that of the document's class."""
    classes = placed.recognition.classes
    chosen = placed.recognition.chosen or (classes[0] if classes else None)
    if chosen is None:
        return None
    names = (chosen.name, placed.document_class)
    table = next(
        (
            model.model.table
            for name in names
            for model in versions
            if model.model.name == name and model.model.table is not None
        ),
        None,
    )
    if table is None:
        return None
    types = {label: each for name in names[::-1] for model in models if model.name == name
             for label, each in model.fields.items()}  # fmt: skip
    return TablePlan(table, types, chosen.probability)


def describe_tables(tables: Sequence[ItemTable]) -> list[answers.ItemTable]:
    """The `tables` of an answer."""
    return [
        answers.ItemTable(
            columns=list(table.columns),
            types=list(table.types),
            headers=list(table.headers),
            box=rounded_box(table.box),
            rows=[[None if cell is None else _describe_cell(cell) for cell in row] for row in table.rows],
            checks=_describe_checks(table.checks),
        )
        for table in tables
    ]


def _describe_cell(cell: TableCell) -> answers.ItemCell:
    return answers.ItemCell(
        box=rounded_box(cell.box),
        text=cell.text,
        value=cell.value,
        currency=cell.currency,
        problem=cell.problem,
        confidence=round(cell.confidence, 4),
    )


def _describe_checks(checks: TableChecks) -> answers.TableChecks:
    return answers.TableChecks(
        products=None if checks.products_fit is None else "fit" if checks.products_fit else "differ",
        unlike_rows=list(checks.unlike),
        sum=None if checks.sum_fits is None else "fits" if checks.sum_fits else "differs",
    )


def tables_from(described: Sequence[answers.ItemTable]) -> tuple[ItemTable, ...]:
    """The tables that an answer describes."""
    return tuple(
        ItemTable(
            columns=tuple(table.columns),
            types=tuple(table.types),
            headers=tuple(table.headers),
            box=table.box,
            rows=tuple(
                tuple(
                    None
                    if cell is None
                    else TableCell(
                        cell.box, cell.text, cell.value, cell.currency, cell.problem, cell.confidence
                    )
                    for cell in row
                )
                for row in table.rows
            ),
        )
        for table in described
    )
