"""What a run on simulated photos saves: figures, distributions, curves of the series, contact sheets."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.common.figures import CaseFigures, Pick, groups, score_of, to_json, write_json
from benchmarks.common.places import OUTPUT
from benchmarks.common.plots import (
    contact_sheet,
    draw_distributions,
    draw_series,
    load_picture,
    make_strip,
    save_picture,
)
from benchmarks.rectify.experiments import Experiment
from benchmarks.rectify.simulated_report import (
    FLOW_COLUMNS,
    GROUPED_BY,
    RULING_COLUMNS,
    SHAPE_COLUMNS,
    TABLES,
    WANTED_CURVED,
    WANTED_PLANAR,
)
from services.arrays import RgbImage

_PAIR_HEIGHT_PX = 220
_WORST = 16


def save_case(
    folder: Path,
    figures: CaseFigures,
    photo: RgbImage,
    rectified: RgbImage | None,
    shown: dict[str, RgbImage | None],
) -> None:
    """The case's strip of all images, and its small pair of before and after for the contact sheet."""
    strip = make_strip([photo, rectified, *shown.values()], [figures.name, "rectified", *shown])
    save_picture(folder / f"{figures.name}.jpg", strip)
    crs, residual = score_of("rectified")(figures), figures.residual_percent
    captions = ["", figures.failure[:20] or f"CRS {crs:.1f} mesh {residual:.2f} %"]
    pair = make_strip([photo, rectified], captions, title=figures.name, height=_PAIR_HEIGHT_PX)
    save_picture(folder / "pairs" / f"{figures.name}.jpg", pair)


def save_run(experiment: Experiment, cases: Sequence[CaseFigures], pictures: Path, *, degraded: bool) -> None:
    """All of a run's figures and pictures, in the output folder."""
    name = experiment.file_name(degraded=degraded)
    write_json(OUTPUT / f"{name}.json", to_json(cases))
    columns: dict[str, Pick] = {
        **FLOW_COLUMNS,
        **({} if experiment.name == "planar" else RULING_COLUMNS),
        **SHAPE_COLUMNS,
        "residual %": lambda case: case.residual_percent,
        "rectified CRS": score_of("rectified"),
    }
    wanted = WANTED_PLANAR if experiment.name == "planar" else WANTED_CURVED
    draw_distributions(OUTPUT / f"{name}.png", columns, cases, wanted)
    if experiment.name in GROUPED_BY:
        _save_series(OUTPUT / f"{name}-series.png", experiment.name, cases)
    # The worst first: that is what one wants to look at.
    ranked = sorted(cases, key=lambda case: -np.nan_to_num(case.residual_percent, nan=1e9))
    for kind, folder, chosen in (
        ("worst", pictures, ranked[:_WORST]),
        ("pairs", pictures / "pairs", cases),
    ):
        files = [folder / f"{case.name}.jpg" for case in chosen]
        save_picture(OUTPUT / f"{name}-{kind}.png", contact_sheet([load_picture(file) for file in files]))


def _save_series(path: Path, experiment: str, cases: Sequence[CaseFigures]) -> None:
    by = GROUPED_BY[experiment]
    rows = {label: members for label, members in groups(cases, by).items() if label != "All"}
    if not rows:
        return
    columns = FLOW_COLUMNS | RULING_COLUMNS | SHAPE_COLUMNS
    nothing = (float("nan"), float("nan"))
    printed = {
        column: [table.printed[row][place] if row in table.printed else nothing for row in rows]
        for table in TABLES[experiment]
        if table.printed
        for place, column in enumerate(table.columns)
        if place < len(next(iter(table.printed.values())))
    }
    draw_series(path, columns, rows, printed, f"{by[0]} no.")
