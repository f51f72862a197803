"""What an experiment on simulated photos prints, and what the baseline holds of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.common.baseline import Figures, Metric
from benchmarks.common.figures import GROUPS, CaseFigures, Pick, mean_std, score_of
from benchmarks.rectify import dissertation
from benchmarks.rectify.dissertation import Row
from benchmarks.rectify.tables import format_table, format_usage

FLOW_COLUMNS: dict[str, Pick] = {
    "major flow": lambda case: case.major_deg,
    "minor flow": lambda case: case.minor_deg,
}
RULING_COLUMNS: dict[str, Pick] = {
    "2D ruling": lambda case: case.ruling_2d_deg,
    "3D ruling": lambda case: case.ruling_3d_deg,
}
SHAPE_COLUMNS: dict[str, Pick] = {
    "field of view": lambda case: case.fov_deg,
    "normal": lambda case: case.normal_deg,
}
STRIP_RULING_COLUMNS: dict[str, Pick] = {
    "strips 2D": lambda case: case.strips.ruling_2d_deg,
    "strips 3D": lambda case: case.strips.ruling_3d_deg,
}
FIRST_STRIP_COLUMNS: dict[str, Pick] = {
    "first f.o.v.": lambda case: case.strips.first_fov_deg,
    "first normal": lambda case: case.strips.first_normal_deg,
}
STRIP_COLUMNS: dict[str, Pick] = {
    "strips f.o.v.": lambda case: case.strips.fov_deg,
    "strips normal": lambda case: case.strips.normal_deg,
}
OCR_COLUMNS: dict[str, Pick] = {
    "photo CRS": score_of("photo"),
    "photo WRR": score_of("photo", "words"),
    "rectified CRS": score_of("rectified"),
    "rectified WRR": score_of("rectified", "words"),
}
CUT_WITHIN_PERCENT = 0.3
"""Of the page's width: where a view should end, on each side of a sheet that is seen whole."""
IMAGES = ("photo", "rectified", "alone", "true map, our frame", "true map", "clean page", "page-dewarp")
FAR_BELOW_POINTS = 5.0
"""No page may read this much worse than the same photo flattened by the true map."""


@dataclass(frozen=True, slots=True)
class Table:
    """Columns of ours, and the dissertation's for the first of them where it has printed some."""

    title: str
    columns: Mapping[str, Pick]
    printed: Mapping[str, Row] | None = None


_FLOWS_AND_RULINGS = FLOW_COLUMNS | RULING_COLUMNS | STRIP_RULING_COLUMNS
_SHAPES = FIRST_STRIP_COLUMNS | SHAPE_COLUMNS | STRIP_COLUMNS
"""The answer's error stands where the dissertation has its optimised one; that of its own steps is added."""

_OURS: tuple[Table, ...] = (
    Table("texture flow and rulings, degrees", _FLOWS_AND_RULINGS),
    Table("shape, degrees", _SHAPES),
    Table("OCR, percent", OCR_COLUMNS),
)


def _series(flows: int, flow: Mapping[str, Row], shape: Mapping[str, Row]) -> tuple[Table, ...]:
    """Tables 3.(flows) and 3.(flows + 1) of a series, and its OCR, of which the dissertation has none."""
    return (
        Table(f"Table 3.{flows}  texture flow and rulings, degrees", _FLOWS_AND_RULINGS, flow),
        Table(f"Table 3.{flows + 1}  shape, degrees", _SHAPES, shape),
        _OURS[2],
    )


TABLES: Mapping[str, tuple[Table, ...]] = {
    "planar": (
        Table("Table 2.1  texture flow, degrees", FLOW_COLUMNS, dissertation.TABLE_2_1),
        Table("Table 3.1  shape, degrees", SHAPE_COLUMNS, dissertation.TABLE_3_1),
        Table("Table 3.8  OCR, percent", OCR_COLUMNS, dissertation.TABLE_3_8),
    ),
    "curved": (
        Table("Table 2.2  texture flow, degrees", FLOW_COLUMNS, dissertation.TABLE_2_2),
        Table("Table 3.2  rulings, degrees", RULING_COLUMNS | STRIP_RULING_COLUMNS, dissertation.TABLE_3_2),
        Table("Table 3.3  shape, degrees", _SHAPES, dissertation.TABLE_3_3),
        Table("Table 3.9  OCR, percent", OCR_COLUMNS, dissertation.TABLE_3_9),
    ),
    "curvature": _series(4, dissertation.TABLE_3_4, dissertation.TABLE_3_5),
    "tilt": _series(6, dissertation.TABLE_3_6, dissertation.TABLE_3_7),
    "cone": _OURS,
}
GROUPED_BY: Mapping[str, Sequence[str]] = {"curvature": ("shape",), "tilt": ("pose",)}
"""The rows of a series' tables; those of all others are by page, shape, pose and skew, or by shape where each
is photographed once."""

WANTED_PLANAR = {
    "major flow": 0.25,
    "minor flow": 0.9,
    "field of view": 2.0,
    "normal": 1.5,
    "residual %": 0.3,
}
WANTED_CURVED = {
    "major flow": 0.4,
    "minor flow": 1.12,
    "2D ruling": 1.82,
    "3D ruling": 2.91,
    "field of view": 2.0,
    "normal": 1.5,
    "residual %": 0.3,
}

PICKS: dict[str, tuple[Pick, Metric]] = {
    "classified": (lambda case: float(case.classified), Metric(0.0, True)),
    "upright": (lambda case: float(case.upright), Metric(0.0, True)),
    "major_deg": (lambda case: case.major_deg, Metric(0.01)),
    "minor_deg": (lambda case: case.minor_deg, Metric(0.03)),
    "ruling_2d_deg": (lambda case: case.ruling_2d_deg, Metric(0.1)),
    "ruling_3d_deg": (lambda case: case.ruling_3d_deg, Metric(0.1)),
    "fov_deg": (lambda case: case.fov_deg, Metric(0.1)),
    "normal_deg": (lambda case: case.normal_deg, Metric(0.1)),
    "residual_percent": (lambda case: case.residual_percent, Metric(0.02)),
    "mesh_median_percent": (lambda case: case.sheet.mesh_median_percent, Metric(0.02)),
    "mesh_p95_percent": (lambda case: case.sheet.mesh_p95_percent, Metric(0.05)),
    "cut_worst_percent": (lambda case: case.sheet.cut_worst_percent, Metric(0.05)),
    "area_ratio": (lambda case: case.sheet.area_ratio, Metric(0.02)),
    "density": (lambda case: case.sheet.density, Metric(0.02, True)),
    "aspect_error_percent": (lambda case: abs(case.sheet.aspect_percent), Metric(0.1)),
    "characters_rectified": (score_of("rectified"), Metric(0.2, True)),
    "words_rectified": (score_of("rectified", "words"), Metric(0.3, True)),
}
"""What the baseline holds of each case, and how it is judged."""
METRICS = {name: metric for name, (_, metric) in PICKS.items()}
OCR_METRICS = ("characters_rectified", "words_rectified")
"""Those that only a run with a reader has."""


def figures_by_case(cases: Sequence[CaseFigures]) -> Figures:
    """The finite metrics of each case, for the baseline."""
    return {
        case.name: {
            name: round(pick(case), 4) for name, (pick, _) in PICKS.items() if np.isfinite(pick(case))
        }
        for case in cases
    }


def report(cases: Sequence[CaseFigures], experiment: str) -> str:
    """All tables and totals of an experiment."""
    by = GROUPED_BY.get(experiment, GROUPS if experiment in TABLES else ("shape",))
    read = any(case.scores for case in cases)
    parts = [
        format_table(table.title, table.columns, cases, table.printed, by)
        for table in TABLES.get(experiment, _OURS)
        if read or table.columns is not OCR_COLUMNS
    ]
    if read:
        parts.append(_format_scores(cases))
        below = sorted(far_below(cases), key=lambda case: case.name)
        parts.append(
            f"more than {FAR_BELOW_POINTS:g} points below the true map: {len(below)}"
            + "".join(f"\n  {case.name} {_gap(case):.1f}" for case in below)
        )
    residuals = [case.residual_percent for case in cases if np.isfinite(case.residual_percent)]
    if residuals:
        middle, high = np.percentile(residuals, [50, 95])
        parts.append(
            f"mesh after the best similarity, % of page width: "
            f"median {middle:.3f}, 95th percentile {high:.3f} ({len(residuals)} photos)"
        )
    parts += _format_sheets(cases)
    refused = [f"  {case.name}: {case.failure}" for case in cases if case.failure]
    wrong = [f"  {case.name}: the other kind" for case in cases if not case.classified and not case.failure]
    parts.append(
        f"classified {sum(case.classified for case in cases)}/{len(cases)}, "
        f"upright {sum(case.upright for case in cases)}/{len(cases)}, refused {len(refused)}"
    )
    if refused or wrong:
        parts.append("\n".join(refused + wrong))
    parts.append(format_usage(cases))
    return "\n\n".join(parts)


def _gap(case: CaseFigures) -> float:
    return score_of("true map")(case) - score_of("rectified")(case)


SHEET_LINES: Mapping[str, Pick] = {
    "mesh, median of nodes %": lambda case: case.sheet.mesh_median_percent,
    "mesh, 95th of nodes %": lambda case: case.sheet.mesh_p95_percent,
    "CRS below the true map": _gap,
    "cut, worst side %": lambda case: abs(case.sheet.cut_percent),
    "cut, worst twentieth %": lambda case: case.sheet.cut_worst_percent,
    "view over page area": lambda case: case.sheet.area_ratio,
    "pixels over photo's": lambda case: case.sheet.density,
    "aspect error %": lambda case: abs(case.sheet.aspect_percent),
}


def _format_sheets(cases: Sequence[CaseFigures]) -> list[str]:
    """How the views keep to their sheets: over the photos, and how many are cut where they should."""
    lines = [f"{'over the photos':<26}{'median':>9}{'mean':>9}{'95th':>9}{'least':>9}{'most':>9}"]
    for label, pick in SHEET_LINES.items():
        values = np.array([value for value in map(pick, cases) if np.isfinite(value)])
        if len(values):
            row = (np.median(values), values.mean(), np.percentile(values, 95), values.min(), values.max())
            lines.append(f"{label:<26}" + "".join(f"{value:>9.3f}" for value in row))
    if len(lines) == 1:
        return []
    # A refused photo of a whole sheet is not cut at all: it counts where any other is.
    whole = [case for case in cases if np.isfinite(case.sheet.cut_percent)]
    if whole:
        for label, name in (
            ("cut, worst side %", "on average"),
            ("cut, worst twentieth %", "at their worst"),
        ):
            near = sum(SHEET_LINES[label](case) <= CUT_WITHIN_PERCENT for case in whole)
            lines.append(f"all sides within {CUT_WITHIN_PERCENT:g} % {name}: {near}/{len(whole)}")
    return ["\n".join(lines)]


def far_below(cases: Sequence[CaseFigures]) -> list[CaseFigures]:
    """Those that read more than `FAR_BELOW_POINTS` worse than the same photo flattened by the true map."""
    return [case for case in cases if _gap(case) > FAR_BELOW_POINTS]


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


def summary(runs: Mapping[str, Sequence[CaseFigures]]) -> str:
    """One line an experiment: means of errors (degrees), the mesh (% of the page's width), OCR (CRS, %)."""
    head = (
        f"{'':<22}{'classified':>11}{'major':>7}{'minor':>7}{'2D rul.':>8}{'3D rul.':>8}{'f. of v.':>9}"
        f"{'normal':>7}{'mesh 50%':>10}{'95%':>8}  |{'photo':>8}{'rectified':>10}{'true map':>10}"
        f"{'page-dewarp':>12}{f'>{FAR_BELOW_POINTS:g} below':>10}"
    )
    return "\n".join([head, *(_summary_line(name, cases) for name, cases in runs.items())])


def _summary_line(name: str, cases: Sequence[CaseFigures]) -> str:
    columns = [*(FLOW_COLUMNS | RULING_COLUMNS | SHAPE_COLUMNS).values()]
    line = f"{name:<22}{f'{sum(case.classified for case in cases)}/{len(cases)}':>11}"
    for pick, width in zip(columns, (7, 7, 8, 8, 9, 7), strict=True):
        line += _number(mean_std(map(pick, cases))[0], width, 2)
    residuals = [case.residual_percent for case in cases if np.isfinite(case.residual_percent)]
    middle, high = np.percentile(residuals, [50, 95]) if residuals else (np.nan, np.nan)
    line += _number(middle, 10, 3) + _number(high, 8, 3) + "  |"
    for image, width in (("photo", 8), ("rectified", 10), ("true map", 10), ("page-dewarp", 12)):
        line += _number(mean_std(map(score_of(image), cases))[0], width, 2)
    return line + (f"{len(far_below(cases)):>10}" if any(case.scores for case in cases) else f"{'-':>10}")


def _number(value: float, width: int, digits: int) -> str:
    return f"{value:>{width}.{digits}f}" if np.isfinite(value) else f"{'-':>{width}}"
