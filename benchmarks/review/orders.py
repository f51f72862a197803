"""Corrections until nearly all zones of a queue are right, by the order in which a person takes the pages."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from app.review.decisions import expected_wrong_zones
from benchmarks.common.baseline import Figures
from benchmarks.common.plots import draw_panels
from benchmarks.layout.part import Part, Result, Results, share, table
from benchmarks.layout.specimens import Specimen, by_class
from benchmarks.review.queue import OpenPage, Queue, first_models, recognize_open

SAMPLES = 5
SEEDS = 3
RIGHT = 0.99
"""Share of right zones at which a trial ends."""
REFRESHED_EVERY = 5
"""Corrections after which the open pages of classes that have learned are recognized again."""
GAIN, FIXED, CONFIDENCE, RANDOM = "gain", "gain at first", "least confidence", "random"
COLOURS = {GAIN: "#4878a8", FIXED: "#50a060", CONFIDENCE: "#c09030", RANDOM: "#888888"}
KEPT = ", not recognized again"
"""Trials in which open pages keep what was found at first."""

Urgency = Callable[[OpenPage], float]


def _gain(each: OpenPage) -> float:
    return expected_wrong_zones(each.confidences)


def _least_confidence(each: OpenPage) -> float:
    return -min(each.confidences, default=0.0)


def urgency_of(order: str, pages: Sequence[OpenPage], rng: np.random.Generator) -> Urgency:
    """How urgent a page is; the most urgent one is next."""
    if order == GAIN:
        return _gain
    if order == CONFIDENCE:
        return _least_confidence
    numbers = [_gain(each) for each in pages] if order == FIXED else rng.permutation(len(pages)).tolist()
    of_page = {id(each.page): float(number) for each, number in zip(pages, numbers, strict=True)}
    return lambda each: of_page[id(each.page)]


def follow(queue: Queue, order: str, rng: np.random.Generator, *, refreshed: bool) -> list[int]:
    """Zones that are not right before the first correction, and after each one, until enough are right."""
    zones = sum(len(each.labels) for each in queue.open)
    urgency = urgency_of(order, queue.open, rng)
    wrong = [queue.wrong]
    while queue.open and wrong[-1] > (1 - RIGHT) * zones:
        queue.verify(int(np.argmax([urgency(each) for each in queue.open])))
        if refreshed and len(wrong) % REFRESHED_EVERY == 0:
            queue.refresh()
        wrong.append(queue.wrong)
    return wrong


def _jobs(specimens: Sequence[Specimen]) -> list[str]:
    return [f"seed {seed}" for seed in range(SEEDS)] if specimens else []


def _measure(job: str, specimens: Sequence[Specimen]) -> Result:
    rng = np.random.default_rng(int(job.split()[1]))
    samples, others = {}, []
    for name, members in by_class(specimens).items():
        pages = [each.true for each in members if each.true.zones]
        order = rng.permutation(len(pages)).tolist()
        samples[name] = [pages[at] for at in order[:SAMPLES]]
        others += [(pages[at], name) for at in order[SAMPLES:]]
    models = first_models(samples)
    first = [recognize_open(page, name, models) for page, name in others]
    wrong = {
        order: follow(Queue(models, first), order, rng, refreshed=True)
        for order in (GAIN, FIXED, CONFIDENCE, RANDOM)
    }
    for order in (GAIN, RANDOM):
        wrong[order + KEPT] = follow(Queue(models, first), order, rng, refreshed=False)
    return {"pages": len(first), "zones": sum(len(each.labels) for each in first), "wrong": wrong}


def corrections(results: Results) -> dict[str, list[int]]:
    """Number of corrections of each trial, by order."""
    found: dict[str, list[int]] = {}
    for result in results.values():
        for order, wrong in result["wrong"].items():
            found.setdefault(order, []).append(len(wrong) - 1)
    return found


def _report(results: Results) -> str:
    found = corrections(results)
    if not found:
        return "no pages"
    random = float(np.mean(found[RANDOM]))
    rows = [
        [order, *numbers, float(np.mean(numbers)), share(float(np.mean(numbers)), random)]
        for order, numbers in found.items()
    ]
    pages = ", ".join(f"{result['pages']} pages, {result['zones']} zones" for result in results.values())
    title = f"Corrected pages until {100 * RIGHT:g} % of zones are right, from {SAMPLES} samples a class ({pages})"
    needed = share(float(np.mean(found[GAIN])), random)
    verdict = "yes" if needed <= 50 else "NO"
    return "\n".join(
        [
            table(title, ("order", *results, "mean", "% of random"), rows),
            f"required: gain at most 50 % of random: {needed:.1f} %, {verdict}",
        ]
    )


def draw_orders(path: Path, results: Results) -> None:
    """Zones that are not right against corrections, a panel for each draw of samples."""
    panels = {
        job: {
            order: (list(range(len(wrong))), [share(one, result["zones"]) for one in wrong])
            for order, wrong in result["wrong"].items()
            if order in COLOURS
        }
        for job, result in results.items()
    }
    draw_panels(path, panels, COLOURS, "corrected pages", "zones that are not right, percent", columns=3)


def _figures(results: Results) -> Figures:
    found = corrections(results)
    return {f"order, {order}": {"corrections": float(np.mean(numbers))} for order, numbers in found.items()}


ORDERS = Part(_jobs, _measure, _report, _figures)
