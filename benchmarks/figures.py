"""The figures of one case and of groups of cases."""

import json
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.stopwatch import Usage

NAN = float("nan")


@dataclass(frozen=True, slots=True)
class Score:
    """OCR of one image, percent: character recognition score and word recognition rate."""

    characters: float
    words: float


@dataclass(frozen=True, slots=True)
class CaseFigures:
    """What was measured on one photo. Errors are degrees, NaN where nothing was estimated.

    residual_percent: RMS of the mesh after the best similarity, in percent of the page's width.
    scores: by image: "photo", "rectified", "true map", "clean page" and a peer's name.
    usage: CPU and memory by step of the benchmark; stages_ms: by stage of the pipeline itself.
    failure: why the photo was refused, else empty.
    """

    name: str
    page_number: int
    pose_number: int
    skew_deg: int
    failure: str = ""
    planar: bool = False
    upright: bool = False
    focal_source: str = ""
    major_deg: float = NAN
    minor_deg: float = NAN
    fov_deg: float = NAN
    normal_deg: float = NAN
    residual_percent: float = NAN
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


def groups(cases: Sequence[CaseFigures]) -> dict[str, list[CaseFigures]]:
    """All, by page, by pose, by skew: the rows of the dissertation's tables that have cases."""
    rows: dict[str, list[CaseFigures]] = {"All": list(cases)}
    for case in sorted(cases, key=lambda case: case.page_number):
        rows.setdefault(f"Page {case.page_number}", []).append(case)
    for case in sorted(cases, key=lambda case: case.pose_number):
        rows.setdefault(f"Pose no.{case.pose_number}", []).append(case)
    for skew in (0, 15, -15):
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
