"""What a run on simulated photos prints and saves."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks import dissertation
from benchmarks.baseline import Figures, Metric
from benchmarks.figures import CaseFigures, Pick, mean_std, score_of, to_json, write_json
from benchmarks.places import OUTPUT
from benchmarks.plots import draw_distributions, load_picture, save_picture, stack_strips
from benchmarks.tables import format_table, format_usage

WANTED = {
    "major flow": 0.25,
    "minor flow": 0.90,
    "field of view": 2.0,
    "plane normal": 1.5,
    "residual %": 0.3,
}
FLOW_COLUMNS: dict[str, Pick] = {
    "major flow": lambda case: case.major_deg,
    "minor flow": lambda case: case.minor_deg,
}
SHAPE_COLUMNS: dict[str, Pick] = {
    "field of view": lambda case: case.fov_deg,
    "plane normal": lambda case: case.normal_deg,
}
OCR_COLUMNS: dict[str, Pick] = {
    "photo CRS": score_of("photo"),
    "photo WRR": score_of("photo", "words"),
    "rectified CRS": score_of("rectified"),
    "rectified WRR": score_of("rectified", "words"),
}
IMAGES = ("photo", "rectified", "true map, our frame", "true map", "clean page", "page-dewarp")


PICKS: dict[str, tuple[Pick, Metric]] = {
    "planar": (lambda case: float(case.planar), Metric(0.0, True)),
    "upright": (lambda case: float(case.upright), Metric(0.0, True)),
    "major_deg": (lambda case: case.major_deg, Metric(0.01)),
    "minor_deg": (lambda case: case.minor_deg, Metric(0.03)),
    "fov_deg": (lambda case: case.fov_deg, Metric(0.1)),
    "normal_deg": (lambda case: case.normal_deg, Metric(0.1)),
    "residual_percent": (lambda case: case.residual_percent, Metric(0.02)),
    "characters_rectified": (score_of("rectified"), Metric(0.2, True)),
    "words_rectified": (score_of("rectified", "words"), Metric(0.3, True)),
}
"""What the baseline holds of each case, and how it is judged."""
METRICS = {name: metric for name, (_, metric) in PICKS.items()}


def figures_by_case(cases: Sequence[CaseFigures]) -> Figures:
    """The finite metrics of each case, for the baseline."""
    return {
        case.name: {
            name: round(pick(case), 4) for name, (pick, _) in PICKS.items() if np.isfinite(pick(case))
        }
        for case in cases
    }


def report(cases: Sequence[CaseFigures]) -> str:
    """All tables and totals."""
    parts = [
        format_table("Table 2.1  texture flow, degrees", FLOW_COLUMNS, cases, dissertation.TABLE_2_1),
        format_table(
            "Table 3.1  shape, degrees (field of view: error of the half angle, axis to image corner)",
            SHAPE_COLUMNS,
            cases,
            dissertation.TABLE_3_1,
        ),
    ]
    if any(case.scores for case in cases):
        parts.append(format_table("Table 3.8  OCR, percent", OCR_COLUMNS, cases, dissertation.TABLE_3_8))
        parts.append(_format_scores(cases))
    residuals = [case.residual_percent for case in cases if np.isfinite(case.residual_percent)]
    if residuals:
        middle, high = np.percentile(residuals, [50, 95])
        parts.append(
            f"mesh after the best similarity, % of page width: "
            f"median {middle:.3f}, 95th percentile {high:.3f} ({len(residuals)} photos)"
        )
    refused = [f"  {case.name}: {case.failure}" for case in cases if case.failure]
    parts.append(
        f"classified planar {sum(case.planar for case in cases)}/{len(cases)}, "
        f"upright {sum(case.upright for case in cases)}/{len(cases)}, refused {len(refused)}"
    )
    parts += refused
    parts.append(format_usage(cases))
    return "\n\n".join(parts)


def _format_scores(cases: Sequence[CaseFigures]) -> str:
    lines = [f"{'OCR of':<20}{'CRS mean/std':>16}{'WRR mean/std':>16}{'CRS least':>12}"]
    for image in IMAGES:
        pick = score_of(image)
        values = [value for value in map(pick, cases) if np.isfinite(value)]
        if values:
            (crs, crs_std), (wrr, wrr_std) = mean_std(values), mean_std(map(score_of(image, "words"), cases))
            lines.append(
                f"{image:<20}{crs:>10.2f}/{crs_std:5.2f}{wrr:>10.2f}/{wrr_std:5.2f}{min(values):>12.2f}"
            )
    return "\n".join(lines)


def save_run(name: str, cases: Sequence[CaseFigures], pictures: Path) -> None:
    """Figures as JSON, distributions and contact sheet as PNG, in the output folder."""
    write_json(OUTPUT / f"{name}.json", to_json(cases))
    columns: dict[str, Pick] = {
        **FLOW_COLUMNS,
        **SHAPE_COLUMNS,
        "residual %": lambda case: case.residual_percent,
        "rectified CRS": score_of("rectified"),
    }
    draw_distributions(OUTPUT / f"{name}.png", columns, cases, WANTED)
    # The worst first: that is what one wants to look at.
    ranked = sorted(cases, key=lambda case: -np.nan_to_num(case.residual_percent, nan=1e9))
    files = [pictures / f"{case.name}.jpg" for case in ranked[:16]]
    strips = [load_picture(file) for file in files if file.is_file()]
    if strips:
        save_picture(OUTPUT / f"{name}-worst.png", stack_strips(strips, columns=2))
