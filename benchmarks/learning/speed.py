"""CPU time of adaptation after feedback, beside recognition of the same page: documents in, documents out."""

import cProfile
import json
import pstats
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from app.engine.worker import collect_seldom
from benchmarks.common.baseline import Figures
from benchmarks.layout.part import Part, Result, Results, table
from benchmarks.layout.protocols import make_model, page_labels, unlabelled
from benchmarks.layout.specimens import Specimen, by_class
from benchmarks.learning.pages import LEARNERS, verdict
from services.contract.answers.layout import LayoutResult
from services.contract.layout import LayoutOptions, LayoutSettings, ModelDocument
from services.contract.layout_learning import Learner, VerifiedPage
from services.layout.exchange.page_json import page_to_document
from services.layout.model.model_document import model_to_document
from services.layout.page import Page
from services.operations.layout import recognize_upload
from services.operations.layout_learning import adapt_models

MOST_MS = 50.0
MOST_PAGES = 12
"""Of each class; the model is made of the others of its class."""
_TOP = 12
SETTINGS = LayoutSettings()


@dataclass(frozen=True, slots=True)
class _Spent:
    """CPU ms of one page: its recognition, and the adaptation to what a person said of it."""

    recognition: float
    adaptation: float


def _jobs(specimens: Sequence[Specimen]) -> list[str]:
    names = [name for name, members in by_class(specimens).items() if len(members) > 1]
    return [
        *(f"{name} | {learner}" for name in names for learner in LEARNERS),
        *(f"{n} | wrong class" for n in names),
    ]


def _measure(job: str, specimens: Sequence[Specimen]) -> Result:
    name, _, how = job.partition(" | ")
    classes = by_class(specimens)
    pages = [each.true for each in classes[name] if each.true.zones]
    taught, samples = pages[:MOST_PAGES], pages[MOST_PAGES:] or pages
    names = [name]
    if how == "wrong class":
        names.append(next(each for each in classes if each != name))
    models = {name: stored_model(name, samples)}
    for other in names[1:]:
        models[other] = stored_model(other, [each.true for each in classes[other] if each.true.zones])
    learner = next((each for each in LEARNERS if each == how), LEARNERS[0])
    # Reads settings and fills caches, as a worker's first task does.
    follow_feedback(taught[:1], models, names, learner)
    collect_seldom()
    spent = follow_feedback(taught, models, names, learner)
    profile = cProfile.Profile()
    profile.enable()
    follow_feedback(taught[:4], models, names, learner)
    profile.disable()
    return {
        "labels": len(json.loads(models[name].document)["nodes"]) - 1,
        "zones": float(np.mean([len(page.zones) for page in taught])),
        "kb": len(models[name].document) / 1000,
        "recognition_ms": [each.recognition for each in spent],
        "adaptation_ms": [each.adaptation for each in spent],
        "hot": _hot_spots(profile),
    }


def stored_model(name: str, samples: Sequence[Page]) -> ModelDocument:
    document = model_to_document(make_model(name, [(page, None) for page in samples]))
    return ModelDocument(name, 1, _bytes(document))


def _bytes(document: Mapping[str, object]) -> bytes:
    """As the app hands it to workers."""
    return json.dumps(document, ensure_ascii=False, separators=(",", ":")).encode()


def follow_feedback(
    pages: Sequence[Page], models: Mapping[str, ModelDocument], names: Sequence[str], learner: Learner
) -> list[_Spent]:
    """Each page is recognized and taught; the models go on from version to version, as they do in the service.

    The class that is said to be found is the last of `names`, the verified one the first.
    """
    now, spent = dict(models), []
    for page in pages:
        zones = json.dumps(page_to_document(unlabelled(page))).encode()
        found = [now[names[-1]]]
        start = time.process_time()
        reply = recognize_upload(None, zones, None, found, LayoutOptions(ocr=False), SETTINGS)
        recognition = time.process_time() - start
        task = _task(reply.page, reply.answer, names, page)
        start = time.process_time()
        adaptation = adapt_models(task, [replace(now[name], learner=learner) for name in names], SETTINGS)
        spent.append(_Spent(1000 * recognition, 1000 * (time.process_time() - start)))
        for name, document in adaptation.documents.items():
            now[name] = ModelDocument(name, now[name].version + 1, _bytes(document))
    return spent


def _task(
    kept: dict[str, object], answer: LayoutResult, names: Sequence[str], page: Page
) -> VerifiedPage[dict[str, Any]]:
    return VerifiedPage(
        page=kept,
        found_class=names[-1],
        found_labels={zone.id: zone.label for zone in answer.zones},
        verified_class=names[0],
        labels=dict(zip((zone.id for zone in page.zones), page_labels(page), strict=True)),
    )


def _hot_spots(profile: cProfile.Profile) -> list[list[object]]:
    """Functions by their own share of the time of both, percent."""
    stats = pstats.Stats(profile)
    total = sum(each[2] for each in stats.stats.values()) or 1.0  # type: ignore[attr-defined]
    rows = sorted(stats.stats.items(), key=lambda item: -item[1][2])[:_TOP]  # type: ignore[attr-defined]
    return [[f"{file.rpartition('/')[2]}:{name}", 100 * row[2] / total] for (file, _, name), row in rows]


def _row(name: str, result: Result) -> list[object]:
    recognition, adaptation = (np.array(result[f"{what}_ms"]) for what in ("recognition", "adaptation"))
    return [
        *(name, result["labels"], result["zones"], result["kb"]),
        *(float(np.median(recognition)), float(np.percentile(recognition, 95))),
        *(float(np.median(adaptation)), float(np.percentile(adaptation, 95)), float(adaptation.max())),
    ]


def _report(results: Results) -> str:
    ordered = sorted(results.items(), key=lambda item: (item[0].partition(" | ")[2], item[1]["labels"]))
    rows = [_row(name, result) for name, result in ordered]
    head = (
        "class | learner",
        "labels",
        "zones",
        "document kB",
        "recognize ms",
        "p95",
        "adapt ms",
        "p95",
        "most",
    )
    parts = [
        table(
            "CPU ms a page by number of labels: recognition by one model, and adaptation (median)", head, rows
        )
    ]
    required = []
    for learner in dict.fromkeys(name.partition(" | ")[2] for name in results):
        spent = np.concatenate(
            [result["adaptation_ms"] for name, result in results.items() if name.endswith(f" | {learner}")]
        )
        middle, high = float(np.median(spent)), float(np.percentile(spent, 95))
        met = f"{verdict(middle <= MOST_MS)} / {verdict(high <= MOST_MS)}"
        required.append(
            [f"{learner}: at most {MOST_MS:g} ms (median / p95)", f"{middle:.1f} / {high:.1f}", met]
        )
    parts.append(table("Required", ("what", "ms", "met"), required))
    if ordered:
        slowest = max(ordered, key=lambda item: float(np.median(item[1]["adaptation_ms"])))
        spots = "\n".join(f"  {share:5.1f} %  {place}" for place, share in slowest[1]["hot"])
        parts.append(f"Where the time of recognition and adaptation goes, {slowest[0]}:\n{spots}")
    return "\n\n".join(parts)


def _figures(results: Results) -> Figures:
    return {}


ADAPTATION_SPEED = Part(_jobs, _measure, _report, _figures)
