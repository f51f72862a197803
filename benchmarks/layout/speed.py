"""What recognition costs: a page image end to end, initialization, one matching; and its two ways beside each other."""

import time
from collections.abc import Sequence
from dataclasses import asdict

import cv2
import numpy as np

from benchmarks.common.baseline import Figures
from benchmarks.common.plots import load_picture
from benchmarks.common.stopwatch import measured
from benchmarks.layout.part import Part, Result, Results, share, table
from benchmarks.layout.protocols import error_percent, folds, page_labels, recognized
from benchmarks.layout.specimens import ZONES, Specimen, by_class, of_sources
from benchmarks.layout.truth import TITLES_REAL
from services.arrays import RgbImage
from services.layout.page import Page
from services.layout.pipeline import VersionedModel, initialize_model, read_page, recognize
from services.layout.recognition.page_recognition import RecognitionParameters
from services.ocr.engine import OcrEngine
from services.ocr.tesseract import open_engine

WANTED_S = {"with OCR": 3.0, "without OCR": 0.8}
"""Most CPU seconds of a page image end to end, 150 to 300 dpi."""
PAGE_DPI = 150
RESOLUTIONS = (150, 300)
MEASURED_CLASSES = ("jose", "juliacon", "rescience", "ieee", "letter", "memo")
SAMPLES = (1, 2, 3, 5, 10, 20, 40)
STEP_SETS = (*TITLES_REAL, "letters/real", "letters/made")
FOLDS = 10
_PAGE, _PARTS = "page image", "zones given"


def _jobs(specimens: Sequence[Specimen]) -> list[str]:
    return [_PAGE, _PARTS] if specimens else []


def _measure(job: str, specimens: Sequence[Specimen]) -> Result:
    return _measure_images(specimens) if job == _PAGE else _measure_parts(specimens)


def _measure_images(specimens: Sequence[Specimen]) -> Result:
    """CPU seconds and memory by resolution and page, with OCR and without, against models of all classes."""
    classes = by_class(specimens)
    models = [
        VersionedModel(initialize_model(name, [member.true for member in members]), 1)
        for name, members in classes.items()
    ]
    engine = open_engine()
    ways: dict[str, OcrEngine | None] = {"without OCR": None}
    if engine is not None:
        ways["with OCR"] = engine
        engine.read_page(np.full((200, 200), 255, np.uint8))
    result: Result = {"models": len(models)}
    for name in [name for name in MEASURED_CLASSES if name in classes]:
        specimen = next((each for each in classes[name] if each.source != "letters/real"), classes[name][0])
        whole = load_picture(specimen.image)
        for dpi in RESOLUTIONS:
            image = _scaled(whole, dpi / PAGE_DPI)
            for way, reader in ways.items():
                with measured() as usage:
                    page = read_page(image, reader)
                    recognize(page, models)
                result.setdefault(f"{dpi} dpi {way}", {})[name] = {**asdict(usage), "zones": len(page.zones)}
    return result


def _scaled(image: RgbImage, factor: float) -> RgbImage:
    if factor == 1:
        return image
    size = (round(image.shape[1] * factor), round(image.shape[0] * factor))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_CUBIC), np.uint8)


def _measure_parts(specimens: Sequence[Specimen]) -> Result:
    """Milliseconds of initialization by samples, and of recognition by one model and by all."""
    classes = by_class(specimens)
    initialization: Result = {}
    for name, members in classes.items():
        for size in [size for size in SAMPLES if size <= len(members)]:
            pages = [member.true for member in members[:size]]
            start = time.process_time()
            initialize_model(name, pages)
            initialization.setdefault(name, {})[str(size)] = 1000 * (time.process_time() - start)
    models = {
        name: initialize_model(name, [each.true for each in members]) for name, members in classes.items()
    }
    recognition: Result = {}
    for name, members in classes.items():
        one: list[float] = []
        every: list[float] = []
        for member in members[:20]:
            for spent, chosen in ((one, {name: models[name]}), (every, models)):
                recognized(member.true, chosen)
                start = time.process_time()
                recognized(member.true, chosen)
                spent.append(1000 * (time.process_time() - start))
        zones = float(np.mean([len(member.true.zones) for member in members]))
        labels = len(models[name].labels) - 1
        recognition[name] = {
            "zones": zones,
            "labels": labels,
            "one_ms": float(np.median(one)),
            "all_ms": float(np.median(every)),
        }
    return {"initialization": initialization, "recognition": recognition}


def _report(results: Results) -> str:
    parts: list[str] = []
    head: tuple[str, ...]
    if _PAGE in results:
        images = dict(results[_PAGE])
        models = images.pop("models")
        rows = []
        for way, pages in images.items():
            cpu = [usage["cpu_s"] for usage in pages.values()]
            wanted = next(limit for name, limit in WANTED_S.items() if way.endswith(name))
            verdict = "yes" if max(cpu) <= wanted else "NO"
            peak = max(usage["peak_mb"] for usage in pages.values())
            rows.append([way, len(cpu), float(np.mean(cpu)), max(cpu), peak, wanted, verdict])
        head = ("page image", "pages", "CPU s mean", "CPU s max", "peak MB", "wanted s", "within")
        parts.append(table(f"End to end, image to class and labels, {models} models", head, rows))
    if _PARTS in results:
        made = results[_PARTS]["initialization"]
        rows = [[name, *(row.get(str(size)) for size in SAMPLES)] for name, row in made.items()]
        head = ("class", *(f"{size}" for size in SAMPLES))
        parts.append(table("Initialization, CPU ms by number of samples", head, rows))
        rows = [[name, *row.values()] for name, row in results[_PARTS]["recognition"].items()]
        head = ("class", "zones", "labels", "one model ms", "all models ms")
        parts.append(table("Recognition with zones given, median CPU ms a page", head, rows))
    return "\n\n".join(parts)


SPEED = Part(_jobs, _measure, _report, lambda results: {})


def _step_jobs(specimens: Sequence[Specimen]) -> list[str]:
    return [source for source in STEP_SETS if len(_step_pages(source, specimens)) > 1]


def _step_pages(source: str, specimens: Sequence[Specimen]) -> list[Specimen]:
    letters = source.startswith("letters")
    return [
        specimen
        for specimen in of_sources(specimens, (source,))
        if not letters or specimen.class_name == "letter"
    ]


def _measure_steps(job: str, specimens: Sequence[Specimen]) -> Result:
    """Both ways of 5.4 on the same pages by the same models."""
    chosen = _step_pages(job, specimens)
    return {zones: _both_ways([each.page(zones) for each in chosen]) for zones in ZONES}


def _both_ways(pages: Sequence[Page]) -> Result:
    ways = {
        "direct": RecognitionParameters(method="direct"),
        "two-steps": RecognitionParameters(method="two-steps"),
    }
    result: Result = {
        name: {"error_percent": [], "ms": [], "optimal": [], "gap": [], "cost": []} for name in ways
    }
    errors: dict[str, tuple[list[tuple[str | None, ...]], list[tuple[str | None, ...]]]]
    errors = {name: ([], []) for name in ways}
    for learned, tested in folds(len(pages), FOLDS):
        model = initialize_model("class", [pages[at] for at in learned])
        for page in (pages[at] for at in tested if pages[at].zones):
            for name, parameters in ways.items():
                start = time.process_time()
                answer = recognized(page, {"class": model}, parameters)
                row = result[name]
                row["ms"].append(1000 * (time.process_time() - start))
                if answer.match is not None:
                    row["optimal"].append(answer.match.optimal)
                    row["gap"].append(answer.match.gap)
                    row["cost"].append(answer.match.cost)
                errors[name][0].append(page_labels(page))
                errors[name][1].append(tuple(zone.label for zone in answer.zones))
    costs = {name: np.array(row.pop("cost")) for name, row in result.items()}
    same = [a == b for a, b in zip(errors["direct"][1], errors["two-steps"][1], strict=True)]
    for name, row in result.items():
        row["error_percent"] = error_percent(*errors[name])
        row["optimal_percent"] = share(sum(row.pop("optimal")), len(same))
        row["largest_gap"] = max(row.pop("gap"), default=0.0)
        row["worst_ms"], row["ms"] = max(row["ms"]), float(np.median(row["ms"]))
        row["least_cost_percent"] = share(int(np.sum(costs[name] <= costs["direct"] + 1e-6)), len(same))
    result["same_labels_percent"] = share(sum(same), len(same))
    return result


def _report_steps(results: Results) -> str:
    rows = []
    for job, by_zones in results.items():
        for zones, result in by_zones.items():
            direct, steps = result["direct"], result["two-steps"]
            rows.append(
                [
                    *(f"{job}, {zones} zones", direct["error_percent"], steps["error_percent"]),
                    *(result["same_labels_percent"], steps["least_cost_percent"]),
                    *(direct["ms"], direct["worst_ms"], steps["ms"], steps["worst_ms"]),
                    *(direct["optimal_percent"], direct["largest_gap"]),
                ]
            )
    head = (
        *("set", "direct err %", "two-step err %", "same labels %", "two-step least %", "direct ms", "max"),
        *("two-step ms", "max", "proved %", "largest gap"),
    )
    title = f"The two ways of 5.4, {FOLDS} folds: error, CPU time a page and model (median, worst), proofs"
    return table(title, head, rows)


def _step_figures(results: Results) -> Figures:
    return {
        f"two steps, {job}, {zones} zones": {
            "two_step_error_percent": result["two-steps"]["error_percent"],
            "optimal_percent": result["direct"]["optimal_percent"],
        }
        for job, by_zones in results.items()
        for zones, result in by_zones.items()
    }


STEPS = Part(_step_jobs, _measure_steps, _report_steps, _step_figures)
