"""Proposals of new classes, of classes to merge, and of classes to split, from unknown pages and samples.

The app reads the pages from the store and shows the proposals to a person. Nothing is changed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from services.contract.answers.proposals import LookedAt, Merge, ModelPart, NewClass, Proposals, Split
from services.contract.layout import LayoutSettings
from services.contract.layout_models import PageDocument
from services.layout.content.content_features import ContentFeatures
from services.layout.discovery.class_samples import ClassSamples, gather_samples
from services.layout.discovery.groups import MOST_ZONES, PageGroup, choose_pages, group_pages
from services.layout.discovery.merging import propose_merges
from services.layout.discovery.splitting import propose_split
from services.layout.exchange.limits import ExchangeLimits
from services.layout.exchange.page_json import page_from_document
from services.layout.graph.layout_graph import build_graph
from services.layout.page import InvalidLayout, Page
from services.layout.pipeline import content_features
from services.operations.layout_models import FOUND
from services.operations.page_zones import exchange_limits
from services.progress import report_progress


def propose_classes(
    unknown: Sequence[PageDocument], classes: Mapping[str, Sequence[PageDocument]], settings: LayoutSettings
) -> Proposals:
    """Proposals for the set of classes, from the unknown pages and the samples of all classes.

    The work is limited: the first unknown pages up to a number of zones, 24 evenly chosen samples of each class, and
    the 100 most similar pairs of classes are compared. Stored pages that exceed the present limits are left out.
    `looked_at` has the numbers of compared pages.
    """
    features = content_features(settings.content_features)
    # Limits may have been higher when the page was stored.
    limits = replace(exchange_limits(settings), max_zones=max(settings.max_zones, 10_000))
    report_progress("unknown_pages", 0.0)
    read = [(kept.id, _read(kept.document, limits, features)) for kept in unknown]
    known = _without_repeats([(page_id, page) for page_id, page in read if page is not None])
    graphs = [build_graph(page, features.names) for _, page in known]
    graphs = graphs[: choose_pages(graphs, MOST_ZONES)]
    groups = group_pages(graphs)
    new = [_describe_group(group, known) for group in groups]
    gathered: list[ClassSamples] = []
    splits = []
    for index, (name, samples) in enumerate(sorted(classes.items())):
        report_progress("samples", 0.2 + 0.6 * index / len(classes))
        verified = [(sample, _read(sample.document, limits, features)) for sample in samples]
        pages = [
            (sample, page, _read(sample.document.get(FOUND), limits, features))
            for sample, page in verified
            if page is not None
        ]
        if not pages:
            continue
        of_class, taken = gather_samples(name, [(page, found) for _, page, found in pages], features.names)
        gathered.append(of_class)
        split = propose_split(of_class)
        if split is not None:
            ids = [pages[at][0].id for at in taken]
            parts = zip(split.parts, split.typical, strict=True)
            splits.append(
                Split(
                    model=name,
                    parts=[
                        ModelPart(samples=[ids[at] for at in part], typical=ids[typical])
                        for part, typical in parts
                    ],
                    gain=round(split.gain, 3),
                    better=round(split.better, 3),
                    next=[],
                )
            )
    report_progress("pairs_of_classes", 0.8)
    merges = [
        Merge(
            models=[merge.first, merge.second],
            fit=round(merge.fit, 3),
            unsure=round(merge.unsure, 3),
            agreement=round(merge.agreement, 3),
            labels=merge.labels,
            next=[],
        )
        for merge in propose_merges(gathered)
    ]
    compared = sum(len(each.samples) for each in gathered)
    looked_at = LookedAt(unknown_pages=len(graphs), models=len(gathered), samples=compared)
    return Proposals(new_classes=new, merges=merges, splits=splits, looked_at=looked_at)


def _without_repeats(known: Sequence[tuple[str, Page]]) -> list[tuple[str, Page]]:
    """The pages without duplicates: a page that was sent twice must not form a group with itself."""
    first: dict[tuple[object, ...], tuple[str, Page]] = {}
    for page_id, page in known:
        seen = (page.width, page.height, *((zone.box, zone.text) for zone in page.zones))
        first.setdefault(seen, (page_id, page))
    return list(first.values())


def _describe_group(group: PageGroup, known: Sequence[tuple[str, Page]]) -> NewClass:
    return NewClass(
        pages=[known[page][0] for page in group.pages],
        typical=known[group.typical][0],
        cohesion=round(group.cohesion, 3),
        recurring_zones=[
            {known[page][0]: known[page][1].zones[zone].id for page, zone in recurring.zones.items()}
            for recurring in group.recurring
        ],
        next=[],
    )


def _read(document: Any, limits: ExchangeLimits, features: ContentFeatures) -> Page | None:
    """The page with its content features; None when the document is no valid page or has no zones."""
    try:
        page = None if document is None else page_from_document(document, limits)
    except InvalidLayout:
        return None
    return features.measure_page(page) if page is not None and page.zones else None
