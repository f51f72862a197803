"""What goes through without a person: accepted zones and their errors, at thresholds from feedback so far."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import beta

from app.review.decisions import CANDIDATES, CERTAINTY, threshold_of
from benchmarks.common.baseline import Figures
from benchmarks.common.plots import draw_panels
from benchmarks.layout.hierarchy import simulated_pages
from benchmarks.layout.label_trust import accepted_share, error_of_shares
from benchmarks.layout.part import Part, Result, Results, share, table
from benchmarks.layout.specimens import Specimen, by_class
from benchmarks.review.queue import OpenPage, first_models, learn, recognize_open
from services.contract.answers.learning import Verdict
from services.layout.page import Page, Zone

SIZES = ("3", "5", "all")
TOLERATED = (0.01, 0.02, 0.05)
UNREAD_SHIFT = 0.02
"""Standard deviation of the sides of zones on `unread` pages, as a share of the page's width."""
SIMULATED = ("simulated letter", "simulated memo", "simulated fax", "simulated plain")
SIMULATED_PAGES = 150
"""Of each class: as many zones as a threshold for 1 % needs, which the development pages do not have."""
REAL_SHARES = (0.4, 0.8)
SIMULATED_SHARES = (0.1, 0.7)
"""Shares of a class's pages at which its samples (all: those before the first) and its feedback end."""
CURVE_POINTS = 50
SEED = 11


@dataclass(frozen=True, slots=True)
class Split:
    """Pages of a class: samples of its model, pages that people verify, and pages that are decided about."""

    samples: Sequence[Page]
    verified: Sequence[Page]
    judged: Sequence[Page]


def split_pages(
    pages: Sequence[Page], size: str, shares: tuple[float, float], rng: np.random.Generator
) -> Split:
    """A random split."""
    shuffled = [pages[at] for at in rng.permutation(len(pages))]
    first, last = (round(part * len(pages)) for part in shares)
    samples = first if size == "all" else int(size)
    return Split(shuffled[:samples], shuffled[first:last], shuffled[last:])


def _jobs(specimens: Sequence[Specimen]) -> list[str]:
    kinds = ("development", "simulated", "unread") if specimens else ("simulated", "unread")
    return [f"{kind}, {size} samples" for kind in kinds for size in SIZES]


def _measure(job: str, specimens: Sequence[Specimen]) -> Result:
    kind, _, size = job.removesuffix(" samples").partition(", ")
    rng = np.random.default_rng(SEED)
    if kind != "development":
        pages = {name: simulated_pages(name, SIMULATED_PAGES) for name in SIMULATED}
        if kind == "unread":
            pages = {name: [unread(page, rng) for page in of_class] for name, of_class in pages.items()}
        shares = SIMULATED_SHARES
    else:
        pages = {
            name: [each.true for each in members if each.true.zones]
            for name, members in by_class(specimens).items()
        }
        shares = REAL_SHARES
    splits = {name: split_pages(of_class, size, shares, rng) for name, of_class in pages.items()}
    verdicts, judged = verify_and_judge(splits, rng)
    confidence = np.array([value for each in judged for value in each.confidences])
    is_right = np.array([value for each in judged for value in each.right], bool)
    errors = error_of_shares((confidence, is_right))
    places = np.unique(np.linspace(1, len(errors), CURVE_POINTS).round().astype(int))
    return {
        "zones": len(confidence),
        "wrong": int(np.count_nonzero(~is_right)),
        "in_hindsight": accepted_share((confidence, is_right)),
        "curve": [[float(place / len(errors)), float(errors[place - 1])] for place in places],
        "classes": {
            f"{tolerated:g}": {name: judge_class(name, verdicts[name], judged, tolerated) for name in splits}
            for tolerated in TOLERATED
        },
    }


def unread(page: Page, rng: np.random.Generator) -> Page:
    """The page as if nothing of it had been read and its zones had been found roughly.

    The simulated pages are labelled without an error. Without content, and with sides that are off, they are not.
    """

    def roughly(zone: Zone) -> Zone:
        x0, y0, x1, y1 = np.array(zone.box) + rng.normal(0.0, UNREAD_SHIFT * page.width, 4)
        box = (min(x0, x1 - 1.0), min(y0, y1 - 1.0), max(x1, x0 + 1.0), max(y1, y0 + 1.0))
        return replace(zone, box=box, content={}, text="", words=())

    return replace(page, zones=tuple(roughly(zone) for zone in page.zones))


def verify_and_judge(
    splits: Mapping[str, Split], rng: np.random.Generator
) -> tuple[dict[str, list[Verdict]], list[OpenPage]]:
    """What feedback said of each found class, page by page while the models learn; then the pages to decide about."""
    models = first_models({name: split.samples for name, split in splits.items()})
    stream = [(page, name) for name, split in splits.items() for page in split.verified]
    verdicts: dict[str, list[Verdict]] = {name: [] for name in splits}
    for at in rng.permutation(len(stream)):
        page, name = stream[at]
        each = recognize_open(page, name, models)
        if each.found_class is not None:
            verdicts[each.found_class] += zip(each.labels, each.confidences, each.right, strict=True)
        models |= learn(each, models)
    judged = [recognize_open(page, name, models) for name, split in splits.items() for page in split.judged]
    return verdicts, judged


def judge_class(
    name: str, verdicts: Sequence[Verdict], judged: Sequence[OpenPage], tolerated: float
) -> dict[str, float | int | None]:
    """Accepted zones of the pages found to be of this class, and how many of them are wrong."""
    threshold = threshold_of(verdicts, tolerated)
    found = [
        pair
        for each in judged
        if each.found_class == name
        for pair in zip(each.confidences, each.right, strict=True)
    ]
    accepted = [right for confidence, right in found if threshold is not None and confidence >= threshold]
    return {
        "evidence": len(verdicts),
        "threshold": threshold,
        "zones": len(found),
        "accepted": len(accepted),
        "wrong": accepted.count(False),
    }


def is_within(wrong: int, accepted: int, tolerated: float) -> bool:
    """Whether so many errors may come from an error rate of `tolerated`, with the certainty of decisions."""
    return wrong == 0 or float(beta.ppf(1.0 - CERTAINTY, wrong, accepted - wrong + 1)) <= tolerated


def _report(results: Results) -> str:
    rows, classes = [], []
    for job, result in results.items():
        row: list[object] = [job, result["zones"], share(result["wrong"], result["zones"])]
        row.append(100 * result["in_hindsight"])
        for tolerated, of_class in result["classes"].items():
            accepted = sum(each["accepted"] for each in of_class.values())
            wrong = sum(each["wrong"] for each in of_class.values())
            row += [share(accepted, result["zones"]), share(wrong, accepted)]
            for name, each in of_class.items():
                if each["accepted"]:
                    within = is_within(each["wrong"], each["accepted"], float(tolerated))
                    classes.append(
                        [
                            f"{job}, {tolerated}, {name}",
                            each["evidence"],
                            each["threshold"],
                            share(each["accepted"], each["zones"]),
                            each["accepted"],
                            each["wrong"],
                            "yes" if within else "NO",
                        ]
                    )
        rows.append(row)
    head = (
        *("pages, samples", "zones", "wrong %", "1 % in hindsight: accepted %"),
        *(f"{100 * tolerated:g} %: {what}" for tolerated in TOLERATED for what in ("accepted %", "wrong %")),
    )
    title = (
        f"Zones accepted at thresholds from feedback ({len(CANDIDATES)} candidates, certainty {CERTAINTY:g})"
    )
    of_class = (
        "pages, tolerated error, class",
        "verdicts",
        "threshold",
        "accepted %",
        "zones",
        "wrong",
        "within",
    )
    return "\n\n".join([table(title, head, rows), table("Classes that accept zones", of_class, classes)])


def draw_acceptance(path: Path, results: Results) -> None:
    """Error of the most confident zones against their share, a panel for each kind of pages."""
    panels: dict[str, dict[str, tuple[list[float], list[float]]]] = {}
    for job, result in results.items():
        kind, _, size = job.partition(", ")
        shares, errors = (100 * np.array(result["curve"])).T.tolist()
        panels.setdefault(f"{kind} pages", {})[size] = shares, errors
    colours = {
        f"{size} samples": colour
        for size, colour in zip(SIZES, ("#c03030", "#c09030", "#4878a8"), strict=True)
    }
    draw_panels(
        path, panels, colours, "accepted zones, percent", "wrong zones among them, percent", columns=3
    )


def _figures(results: Results) -> Figures:
    return {
        f"acceptance, {job}": {
            "accepted_in_hindsight_percent": 100 * result["in_hindsight"],
            "beyond_bound": float(
                sum(
                    not is_within(each["wrong"], each["accepted"], float(tolerated))
                    for tolerated, of_class in result["classes"].items()
                    for each in of_class.values()
                )
            ),
        }
        for job, result in results.items()
    }


ACCEPTANCE = Part(_jobs, _measure, _report, _figures)
