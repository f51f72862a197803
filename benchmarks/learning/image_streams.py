"""Streams and single corrections from images: pages in zones that we found, and people who draw the right ones.

Each page is read, segmented, labelled and regrouped as the service does it. The feedback is the page in its true zones
with their labels, as `zones` of the feedback route has them.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.common.baseline import Figures
from benchmarks.common.memory import Memory
from benchmarks.common.places import MEMORY
from benchmarks.layout.learning_curve import TEN
from benchmarks.layout.marks import SAME_ZONE, Marks, count_right, count_zones_right
from benchmarks.layout.part import Part, Result, Results, share, table
from benchmarks.layout.specimens import Specimen, with_ten_components
from benchmarks.layout.truth import TITLES_REAL, LabelledPage
from benchmarks.layout.word_labels import read_photo
from benchmarks.learning.pages import CLASS, NONE, verdict
from benchmarks.learning.streams import WINDOW, in_windows
from services.contract.layout_learning import DEFAULT_LEARNER, VerifiedPage
from services.layout.learning.feedback import adapt_models
from services.layout.learning.label_transfer import box_areas, shared_areas, transfer_labels
from services.layout.learning.revised_zones import revise_zones
from services.layout.model.layout_model import LayoutModel
from services.layout.page import Page, Zone
from services.layout.pipeline import (
    VersionedModel,
    complete_recognition,
    content_features,
    initialize_model,
    recognize,
)
from services.layout.segmentation import FinePage, compose_page
from services.ocr.tesseract import open_engine

SETS = (*TITLES_REAL, "letters/real" + TEN, "letters/made memo", "letters/made fax")
SEEDS = 2
MOST_PAGES = 40
SIZES = (1, 5)
"""Samples of the models whose splits and merges are corrected."""
MOST_TRIALS, MOST_NEXT = 6, 20
"""Pages that are each corrected alone, and pages that come after."""
WANTED_LEFT, WANTED_SPARED = 100 / 3, 70.0

METHODS = (NONE, DEFAULT_LEARNER)
Fault = tuple[str, tuple[str, ...]]
"""What is wrong with boxes: "split" or "merge", and the true labels."""


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """A page by its image: its true zones, its lines and first zones, and its words with their right labels."""

    true: Page
    own: Page
    fine: FinePage
    words: Marks


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """A page as recognition found it, its zones with their labels, and what was found of its class."""

    page: Page
    found_class: str | None


def see_images(specimens: Sequence[Specimen], name: str) -> list[Sight]:
    """The pages of a set, from their images."""
    source, _, class_name = name.removesuffix(TEN).partition(" ")
    chosen = [
        each
        for each in specimens
        if each.source == source and (not class_name or each.class_name == class_name) and each.true.zones
    ]
    engine, memory = open_engine(), Memory(MEMORY)
    sights = []
    for each in chosen:
        photo = read_photo(LabelledPage(each.name, each.true, each.class_name, each.image), engine, memory)
        sight = Sight(photo.true, photo.own, photo.fine, photo.words)
        if name.endswith(TEN):
            true = with_ten_components(photo.true)
            labels = {
                zone.label: other.label for zone, other in zip(photo.true.zones, true.zones, strict=True)
            }
            marks = replace(photo.words, labels=tuple(map(labels.__getitem__, photo.words.labels)))
            sight = replace(sight, true=true, own=transfer_labels(true, photo.own), words=marks)
        sights.append(sight)
    return sights


def begin(samples: Sequence[Sight]) -> LayoutModel:
    """The model of samples with their images."""
    features = content_features()
    return initialize_model(CLASS, [each.true for each in samples], features, [each.own for each in samples])


def recognized(model: LayoutModel, sight: Sight) -> Seen:
    """The page as the service answers it."""
    models = [VersionedModel(model, 1)]
    found = complete_recognition(sight.fine, recognize(compose_page(sight.fine), models), models)
    zones = tuple(replace(each.zone, label=each.label) for each in found.zones)
    chosen = found.chosen
    return Seen(replace(found.page, zones=zones), None if chosen is None else chosen.name)


def taught(model: LayoutModel, seen: Seen, true: Page) -> LayoutModel:
    """The model after a person has drawn the true zones over the found ones."""
    features = content_features()
    drawn = replace(
        true, zones=tuple(Zone(zone.id, zone.box, zone.kind, label=zone.label) for zone in true.zones)
    )
    page = features.measure_page(revise_zones(seen.page, drawn))
    labels = {zone.id: zone.label for zone in page.zones}
    found_labels = dict.fromkeys(labels)
    verified = VerifiedPage(page, seen.found_class, found_labels, CLASS, labels, seen.page)
    return adapt_models(verified, {CLASS: model}, {}, features.names)[1][CLASS].model


def wrong_of(sight: Sight, found: Page) -> tuple[int, int]:
    """True zones that are not found with their labels, and words with a wrong label."""
    right, zones = count_zones_right(sight.true, found)
    words_right, words = count_right(sight.words, found)
    return zones - right, words - words_right


def follow(sample: Sight, stream: Sequence[Sight], method: str) -> tuple[list[int], list[int]]:
    """Wrong zones and words of each page as it comes, before a person corrects it."""
    model = begin([sample])
    zones, words = [], []
    for sight in stream:
        seen = recognized(model, sight)
        wrong = wrong_of(sight, seen.page)
        zones.append(wrong[0])
        words.append(wrong[1])
        if method != NONE:
            model = taught(model, seen, sight.true)
    return zones, words


def _orders(count: int, seed: int) -> list[int]:
    order: list[int] = np.random.default_rng([seed, count]).permutation(count).tolist()
    return order


def _jobs(specimens: Sequence[Specimen]) -> list[str]:
    sources = {each.source for each in specimens}
    return [name for name in SETS if name.removesuffix(TEN).partition(" ")[0] in sources]


def _measure_stream(job: str, specimens: Sequence[Specimen]) -> Result:
    sights = see_images(specimens, job)
    errors: dict[str, list[tuple[list[int], list[int]]]] = {method: [] for method in METHODS}
    zones, words = [], []
    for seed in range(SEEDS):
        order = _orders(len(sights), seed)[: MOST_PAGES + 1]
        stream = [sights[at] for at in order[1:]]
        zones.append([len(each.true.zones) for each in stream])
        words.append([len(each.words.labels) for each in stream])
        for method, rows in errors.items():
            rows.append(follow(sights[order[0]], stream, method))
    return {
        "pages": len(zones[0]),
        **{
            what: {
                method: in_windows([row[place] for row in rows], of, WINDOW)
                for method, rows in errors.items()
            }
            for place, (what, of) in enumerate((("zones", zones), ("words", words)))
        },
    }


def _report_streams(results: Results) -> str:
    rows = []
    most = max((len(result["zones"][NONE]) for result in results.values()), default=0)
    for job, result in results.items():
        for what in ("zones", "words"):
            for method in METHODS:
                windows = result[what][method]
                rows.append(
                    [f"{job} | {what} | {method}", result["pages"], *windows, *[None] * (most - len(windows))]
                )
    head = ("set | wrong | learner", "pages", *(f"pages {k * WINDOW + 1}-" for k in range(most)))
    title = f"Wrong zones and words from images, percent, before each page's feedback, from 1 sample, {SEEDS} orders"
    lasts = []
    for what in ("zones", "words"):
        for job, result in (*results.items(), ("mean of the sets", None)):
            chosen = list(results.values()) if result is None else [result]
            before, after = (
                float(np.mean([each[what][method][-1] for each in chosen])) if chosen else float("nan")
                for method in METHODS
            )
            left = share(after, before)
            lasts.append([f"{job} | {what}", before, after, left, verdict(left <= WANTED_LEFT)])
    head_lasts = ("last pages | wrong", NONE, DEFAULT_LEARNER, "left %", "a third")
    return "\n\n".join(
        [table(title, head, rows), table("Required: at most a third is left", head_lasts, lasts)]
    )


def _stream_figures(results: Results) -> Figures:
    return {
        f"image stream, {job}": {
            "image_stream_zones_percent": result["zones"][DEFAULT_LEARNER][-1],
            "image_stream_words_percent": result["words"][DEFAULT_LEARNER][-1],
        }
        for job, result in results.items()
    }


def faults(true: Page, found: Page) -> Counter[Fault]:
    """Zones with a label that are split, and found zones that hold several true ones, one with a label at least."""
    if not true.zones or not found.zones:
        return Counter()
    shared = shared_areas(true.zones, found.zones)
    area, found_area = box_areas(true.zones)[:, None], box_areas(found.zones)
    same = shared / (area + found_area - shared) >= SAME_ZONE
    within, held = shared / found_area >= 0.5, shared / area >= 0.5
    counted: Counter[Fault] = Counter()
    for row, zone in enumerate(true.zones):
        if zone.label is not None and not same[row].any() and within[row].sum() > 1:
            counted["split", (str(zone.label),)] += 1
    for column in range(len(found.zones)):
        labels = {str(true.zones[row].label) for row in np.flatnonzero(held[:, column])}
        if held[:, column].sum() > 1 and labels != {"None"} and not same[:, column].any():
            counted["merge", tuple(sorted(labels))] += 1
    return counted


def _again(corrected: Counter[Fault], pages: Sequence[tuple[Page, Page]]) -> Counter[str]:
    """Faults of (true, found) pages that a corrected page had, too, by their kind."""
    seen = sum((faults(*pair) for pair in pages), Counter[Fault]())
    again: Counter[str] = Counter()
    for fault in corrected:
        again[fault[0]] += seen[fault]
    return again


def _measure_once(job: str, specimens: Sequence[Specimen]) -> Result:
    sights = see_images(specimens, job)
    result: Result = {"trials": 0, "before": Counter(), "after": Counter()}
    for size in (size for size in SIZES if size + 2 <= len(sights)):
        order = _orders(len(sights), size)
        model = begin([sights[at] for at in order[:size]])
        rest = [sights[at] for at in order[size:]]
        seen = [recognized(model, sight) for sight in rest]
        found = [faults(sight.true, each.page) for sight, each in zip(rest, seen, strict=True)]
        for at in [at for at, each in enumerate(found) if each][:MOST_TRIALS]:
            others = [other for other in range(len(rest)) if other != at][:MOST_NEXT]
            after = taught(model, seen[at], rest[at].true)
            result["trials"] += 1
            result["before"] += _again(found[at], [(rest[each].true, seen[each].page) for each in others])
            result["after"] += _again(
                found[at], [(rest[each].true, recognized(after, rest[each]).page) for each in others]
            )
    return result


def _spared(results: Sequence[Result], kind: str) -> tuple[int, float]:
    """Faults of a kind on next pages without the correction, and how many of them it spares, percent."""
    before, after = (sum(result[when].get(kind, 0) for result in results) for when in ("before", "after"))
    return before, 100 - share(after, before)


def _report_once(results: Results) -> str:
    rows: list[list[object]] = []
    for job, result in (*results.items(), ("all sets", None)):
        chosen = list(results.values()) if result is None else [result]
        counted = [_spared(chosen, kind) for kind in ("split", "merge")]
        rows.append(
            [job, sum(each["trials"] for each in chosen), *(cell for pair in counted for cell in pair)]
        )
    head = ("set", "pages", "splits", "spared %", "merges", "merges spared %")
    title = (
        f"One correction of zones, models of {' and '.join(map(str, SIZES))} samples: the same splits and merges on "
        f"up to {MOST_NEXT} next pages, and how many of them it spares (wanted: {WANTED_SPARED:g} %)"
    )
    return table(title, head, rows)


def _once_figures(results: Results) -> Figures:
    return {
        f"image once, {kind}": {"image_spared_percent": _spared(list(results.values()), kind)[1]}
        for kind in ("split", "merge")
    }


IMAGE_STREAMS = Part(_jobs, _measure_stream, _report_streams, _stream_figures)
IMAGE_ONCE = Part(_jobs, _measure_once, _report_once, _once_figures)
