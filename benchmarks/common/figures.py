"""The figures of one case and of groups of cases."""

import json
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.sheet_errors import SheetErrors
from benchmarks.common.stopwatch import Usage

NAN = float("nan")


@dataclass(frozen=True, slots=True)
class Score:
    """OCR of one image, percent: character recognition score and word recognition rate."""

    characters: float
    words: float


@dataclass(frozen=True, slots=True)
class StripErrors:
    """Errors of the dissertation's steps (3.3.3 to 3.3.5), degrees; NaN where a step found nothing.

    Of the detected rulings, their vanishing points, the first estimate of the shape and the optimised one.
    """

    ruling_2d_deg: float = NAN
    ruling_3d_deg: float = NAN
    first_fov_deg: float = NAN
    first_normal_deg: float = NAN
    fov_deg: float = NAN
    normal_deg: float = NAN


@dataclass(frozen=True, slots=True)
class CaseFigures:
    """What was measured on one photo. Errors are degrees, NaN where nothing was estimated.

    residual_percent: RMS of the mesh after the best similarity, in percent of the page's width.
    sheet: how the view keeps to its sheet.
    scores: by image: "photo", "rectified", "true map", "clean page" and a peer's name.
    usage: CPU and memory by step of the benchmark; stages_ms: by stage of the pipeline itself.
    failure: why the photo was refused, else empty.
    classified: whether planar and curved were told apart rightly.
    ruling_2d_deg, ruling_3d_deg, fov_deg, normal_deg: of the answer; `strips` has them for the dissertation's
        own way to it.
    """

    name: str
    page_number: int
    shape_number: int
    pose_number: int
    skew_deg: int
    failure: str = ""
    classified: bool = False
    upright: bool = False
    focal_source: str = ""
    major_deg: float = NAN
    minor_deg: float = NAN
    ruling_2d_deg: float = NAN
    ruling_3d_deg: float = NAN
    fov_deg: float = NAN
    normal_deg: float = NAN
    strips: StripErrors = StripErrors()
    residual_percent: float = NAN
    sheet: SheetErrors = field(default_factory=SheetErrors)
    warnings: tuple[str, ...] = ()
    scores: dict[str, Score] = field(default_factory=dict)
    usage: dict[str, Usage] = field(default_factory=dict)
    stages_ms: dict[str, float] = field(default_factory=dict)


Pick = Callable[[CaseFigures], float]


def score_of(image: str, part: str = "characters") -> Pick:
    """The score of one of the images; NaN where it was not read."""
    return lambda figures: float(getattr(figures.scores[image], part)) if image in figures.scores else NAN


def mean_std(values: Iterable[float]) -> tuple[float, float]:
    """Mean and standard deviation of the finite values."""
    finite = np.array([value for value in values if math.isfinite(value)])
    return (float(finite.mean()), float(finite.std())) if len(finite) else (NAN, NAN)


GROUPS = ("page", "shape", "pose", "skew")
"""What photos can be grouped by."""


def groups(cases: Sequence[CaseFigures], by: Sequence[str] = GROUPS) -> dict[str, list[CaseFigures]]:
    """All, and by page, shape, pose and skew as asked for: the tables' rows, as far as they have cases.

    Where all are of one shape, there are no rows of shapes.
    """
    rows: dict[str, list[CaseFigures]] = {"All": list(cases)}
    numbers: dict[str, tuple[str, Callable[[CaseFigures], int]]] = {
        "page": ("Page ", lambda case: case.page_number),
        "shape": ("Shape no.", lambda case: case.shape_number),
        "pose": ("Pose no.", lambda case: case.pose_number),
    }
    for kind, (label, number) in numbers.items():
        if kind in by and not (kind == "shape" and len({number(case) for case in cases}) < 2):
            for case in sorted(cases, key=number):
                rows.setdefault(f"{label}{number(case)}", []).append(case)
    for skew in (0, 15, -15) if "skew" in by else ():
        chosen = [case for case in cases if case.skew_deg == skew]
        if chosen:
            rows[f"{skew}° skew"] = chosen
    return rows


def to_json(cases: Sequence[CaseFigures]) -> list[dict[str, Any]]:
    """Plain values; NaN becomes null."""
    return [plain_values(asdict(case)) for case in cases]


def write_json(path: Path, content: object) -> None:
    """As indented UTF-8 with sorted keys, so that a committed file differs only where figures do."""
    path.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps(content, indent=1, sort_keys=True, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")


def plain_values(value: Any) -> Any:
    """Containers and numbers as JSON knows them: floats rounded, NaN as None."""
    if isinstance(value, dict):
        return {key: plain_values(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain_values(entry) for entry in value]
    if isinstance(value, (float, np.floating)):
        return round(float(value), 5) if math.isfinite(value) else None
    return value
