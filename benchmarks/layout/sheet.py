"""One page of every class, read and labelled with all models, its wrong zones marked: a sheet to be looked at."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from benchmarks.common.places import OUTPUT
from benchmarks.common.plots import contact_sheet, load_picture, make_strip, save_picture
from benchmarks.layout.part import Part, Result, Results, table
from benchmarks.layout.protocols import Labels, make_model, page_labels, recognized
from benchmarks.layout.specimens import Specimen, by_class, lessons
from services.arrays import RgbImage
from services.layout.page import Page
from services.layout.recognition.results import Recognition
from services.layout.rendering.overlay import draw_overlay

SHEET = OUTPUT / "layout_overlays.png"
_HEIGHT_PX = 1000
_WRONG = (230, 0, 0)


def _jobs(specimens: Sequence[Specimen]) -> list[str]:
    return ["sheet"] if len(by_class(specimens)) > 1 else []


def _measure(job: str, specimens: Sequence[Specimen]) -> Result:
    """Draw `SHEET`; how many zones are wrong, by page."""
    classes = by_class(specimens)
    samples = {name: lessons(members, ("true", "own")) for name, members in classes.items()}
    models = {name: make_model(name, pages) for name, pages in samples.items()}
    strips, result = [], {}
    for name, members in classes.items():
        specimen = members[len(members) // 2]
        page = specimen.page("own")
        rest = lessons((other for other in members if other is not specimen), ("true", "own"))
        if not rest or not page.zones:
            continue
        answer = recognized(page, {**models, name: make_model(name, rest)})
        true = page_labels(page)
        wrong = sum(zone.label != label for zone, label in zip(answer.zones, true, strict=True))
        chosen = answer.chosen.name if answer.chosen else "unknown"
        picture = draw_overlay(_crossed(load_picture(specimen.image), answer, true), _told(answer, true))
        caption = f"{name}: {chosen}, {wrong} of {len(page.zones)} zones wrong"
        strips.append(make_strip([picture], [caption], height=_HEIGHT_PX))
        result[f"{name} {specimen.name}"] = {"zones": len(page.zones), "wrong": wrong, "class": chosen}
    save_picture(SHEET, contact_sheet(strips, most_px=3400))
    return result


def _told(answer: Recognition, true: Labels) -> Recognition:
    """Labels of wrong zones tell what would be right."""
    zones = tuple(
        zone
        if zone.label == label
        else replace(zone, label=f"{zone.label or 'none'} (not {label or 'none'})")
        for zone, label in zip(answer.zones, true, strict=True)
    )
    return replace(answer, zones=zones)


def _crossed(image: RgbImage, answer: Recognition, true: Labels) -> RgbImage:
    """The picture with a red cross through every wrong zone."""
    picture = np.ascontiguousarray(image).copy()
    scale = _pixels_per_unit(image, answer.page)
    thick = max(3, round(image.shape[0] / 300))
    for zone, label in zip(answer.zones, true, strict=True):
        if zone.label != label:
            x0, y0, x1, y1 = (round(edge * scale) for edge in zone.zone.box)
            for a, b in (((x0, y0), (x1, y1)), ((x0, y1), (x1, y0))):
                cv2.line(picture, a, b, _WRONG, thick, cv2.LINE_AA)
    return picture


def _pixels_per_unit(image: RgbImage, page: Page) -> float:
    return float(image.shape[1] / page.width)


def _report(results: Results) -> str:
    rows = [
        [name, row["zones"], row["wrong"], row["class"]]
        for result in results.values()
        for name, row in result.items()
    ]
    head = ("page", "own zones", "wrong", "class")
    return f"{table('Sheet of overlays, one page of every class', head, rows)}\n{SHEET}"


SHEETS = Part(_jobs, _measure, _report, lambda results: {})
