"""The figures of mosaics: by overlap against what is wanted, set by set, and peers beside them."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.common.baseline import Metric
from benchmarks.common.figures import NAN, Score, plain_values
from benchmarks.common.stopwatch import Usage

WANTED_RMS_MEDIAN_PX, WANTED_RMS_MAX_PX = 0.3, 1.5
WANTED_CHARACTER_LOSS = 1.0
"""Points of the character score that a mosaic may read worse than the clean page."""
WANTED_AT_10_PERCENT = 0.85
"""Share of the sets of 10 % overlap in which every photo is placed; of the others, all."""

METRICS: Mapping[str, Metric] = {
    "placed_percent": Metric(1.0, larger_is_better=True),
    "false": Metric(0.0),
    "rms_px": Metric(0.03),
    "disagreement_px": Metric(0.04),
    "frontal_percent": Metric(0.05),
    "characters": Metric(0.5, larger_is_better=True),
}
READING_METRICS = ("characters",)


@dataclass(frozen=True, slots=True)
class PeerFigures:
    """What a peer made of the same photos; `rms_px` where it tells how it placed them."""

    placed: int
    rms_px: float = NAN
    false: int = 0
    score: Score | None = None
    usage: Usage = field(default_factory=Usage)


@dataclass(frozen=True, slots=True)
class SetFigures:
    """What was measured on one set; see `PlacementErrors`. `clean` is how the flat page itself reads."""

    name: str
    kind: str
    photos: int
    overlap: float
    failure: str = ""
    placed: int = 0
    false: tuple[int, ...] = ()
    rms_px: float = NAN
    disagreement_px: float = NAN
    frontal_percent: float = NAN
    by_photo_px: tuple[float, ...] = ()
    unplaced: tuple[int, ...] = ()
    true_overlaps: dict[str, float] = field(default_factory=dict)
    score: Score | None = None
    clean: Score | None = None
    usage: Usage = field(default_factory=Usage)
    stages_ms: dict[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    peers: dict[str, PeerFigures] = field(default_factory=dict)

    @property
    def complete(self) -> bool:
        """Whether every photo was placed, and none falsely."""
        return self.placed == self.photos and not self.false

    @property
    def character_loss(self) -> float:
        """Points of the character score below the clean page's."""
        return (
            NAN if self.score is None or self.clean is None else self.clean.characters - self.score.characters
        )


def figures_by_set(sets: Sequence[SetFigures]) -> dict[str, dict[str, float]]:
    """For the baseline; figures that there are none of are left out."""
    found = {}
    for entry in sets:
        values = {
            "placed_percent": 100.0 * entry.placed / entry.photos,
            "false": float(len(entry.false)),
            "rms_px": entry.rms_px,
            "disagreement_px": entry.disagreement_px,
            "frontal_percent": entry.frontal_percent,
            "characters": NAN if entry.score is None else entry.score.characters,
        }
        found[entry.name] = {
            name: plain_values(value) for name, value in values.items() if math.isfinite(value)
        }
    return found


def report(sets: Sequence[SetFigures]) -> str:
    """Tables by overlap and kind, what is wanted beside it, peers, and the sets that fell short."""
    parts = [_by_group(sets), _wanted(sets), _peers(sets), _trouble(sets), _stages(sets)]
    return "\n\n".join(part for part in parts if part)


def _groups(sets: Sequence[SetFigures]) -> dict[str, list[SetFigures]]:
    plain = [entry for entry in sets if entry.kind in ("shared", "own")]
    rows = {"All": plain}
    for overlap in (0.1, 0.2, 0.4):
        rows[f"{round(100 * overlap)} %"] = [entry for entry in plain if abs(entry.overlap - overlap) < 0.01]
    for count in (2, 4, 8):
        rows[f"{count} photos"] = [entry for entry in plain if entry.photos == count]
    rows["shared"] = [entry for entry in plain if entry.kind == "shared"]
    for kind in ("curved", "turned", "bent"):
        rows[kind] = [entry for entry in sets if entry.kind == kind]
    return {label: members for label, members in rows.items() if members}


_COLUMNS: Mapping[str, Callable[[Sequence[SetFigures]], str]] = {
    "sets": lambda sets: str(len(sets)),
    "complete": lambda sets: str(sum(entry.complete for entry in sets)),
    "photos": lambda sets: str(sum(entry.photos for entry in sets)),
    "placed": lambda sets: str(sum(entry.placed for entry in sets)),
    "false": lambda sets: str(sum(len(entry.false) for entry in sets)),
    "RMS med": lambda sets: _median(entry.rms_px for entry in sets),
    "RMS max": lambda sets: _largest(entry.rms_px for entry in sets),
    "apart med": lambda sets: _median(entry.disagreement_px for entry in sets),
    "apart max": lambda sets: _largest(entry.disagreement_px for entry in sets),
    "frontal %": lambda sets: _median(entry.frontal_percent for entry in sets),
    "CRS": lambda sets: _mean(NAN if entry.score is None else entry.score.characters for entry in sets),
    "loss med": lambda sets: _median(entry.character_loss for entry in sets),
    "loss max": lambda sets: _largest(entry.character_loss for entry in sets),
    "WRR": lambda sets: _mean(NAN if entry.score is None else entry.score.words for entry in sets),
    "CPU s": lambda sets: _mean(entry.usage.cpu_s for entry in sets),
    "CPU max": lambda sets: _largest(entry.usage.cpu_s for entry in sets),
    "peak MB": lambda sets: _largest((entry.usage.peak_mb for entry in sets), 0),
}


def _by_group(sets: Sequence[SetFigures]) -> str:
    lines = [f"{'':<10}" + "".join(f"{name:>10}" for name in _COLUMNS)]
    for label, members in _groups(sets).items():
        lines.append(f"{label:<10}" + "".join(f"{show(members):>10}" for show in _COLUMNS.values()))
    return "\n".join(lines)


def _wanted(sets: Sequence[SetFigures]) -> str:
    plain = [entry for entry in sets if entry.kind in ("shared", "own")]
    if not plain:
        return ""
    near = [entry.complete for entry in plain if entry.overlap < 0.15]
    rest = [entry.complete for entry in plain if entry.overlap >= 0.15]
    rms = _finite(entry.rms_px for entry in plain)
    losses = _finite(entry.character_loss for entry in plain)
    false = sum(len(entry.false) for entry in plain)
    checks = [
        (
            f"every photo placed in all sets of 20 and 40 %: {sum(rest)} of {len(rest)}",
            all(rest),
        ),
        (
            f"and in {100 * WANTED_AT_10_PERCENT:.0f} % of those of 10 %: {sum(near)} of {len(near)}",
            sum(near) >= WANTED_AT_10_PERCENT * len(near),
        ),
        (f"no false placement: {false}", false == 0),
    ]
    if rms:
        median, largest = float(np.median(rms)), max(rms)
        checks.append(
            (
                f"RMS {median:.3f} px in the median (wanted {WANTED_RMS_MEDIAN_PX}), {largest:.3f} at most "
                f"(wanted {WANTED_RMS_MAX_PX})",
                median <= WANTED_RMS_MEDIAN_PX and largest <= WANTED_RMS_MAX_PX,
            )
        )
    if losses:
        within = sum(loss <= WANTED_CHARACTER_LOSS for loss in losses)
        checks.append(
            (
                f"character score within {WANTED_CHARACTER_LOSS:g} of the clean page's: {within} of {len(losses)} sets",
                within == len(losses),
            )
        )
    return "\n".join(f"{'yes' if good else 'NO ':<4}{text}" for text, good in checks)


def _peers(sets: Sequence[SetFigures]) -> str:
    names = list(dict.fromkeys(name for entry in sets for name in entry.peers))
    if not names:
        return ""
    lines = [
        f"{'':<22}{'complete':>10}{'placed':>10}{'false':>8}{'RMS med':>10}{'RMS max':>10}{'CRS':>8}{'CPU s':>8}"
    ]
    having = [entry for entry in sets if entry.peers]
    rows: dict[str, list[tuple[SetFigures, SetFigures | PeerFigures]]] = {
        "ours": [(entry, entry) for entry in having]
    }
    for name in names:
        rows[name] = [(entry, entry.peers[name]) for entry in having if name in entry.peers]
    for name, members in rows.items():
        complete = 0
        for entry, who in members:
            false = len(who.false) if isinstance(who, SetFigures) else who.false
            complete += who.placed == entry.photos and not false
        wrong = sum(len(who.false) if isinstance(who, SetFigures) else who.false for _, who in members)
        rms = [who.rms_px for _, who in members]
        read = [NAN if who.score is None else who.score.characters for _, who in members]
        lines.append(
            f"{name:<22}{f'{complete}/{len(members)}':>10}{sum(who.placed for _, who in members):>10}{wrong:>8}"
            f"{_median(rms):>10}{_largest(rms):>10}{_mean(read):>8}{_mean(who.usage.cpu_s for _, who in members):>8}"
        )
    return "\n".join(lines)


def _trouble(sets: Sequence[SetFigures]) -> str:
    """One line a set that is not complete, is far off, or reads worse than is wanted."""
    lines = []
    for entry in sets:
        what = []
        if entry.failure:
            what.append(entry.failure)
        for k in entry.unplaced:
            shares = [
                f"{pair} {share:.3f}"
                for pair, share in entry.true_overlaps.items()
                if str(k) in pair.split("-")
            ]
            what.append(f"photo {k} not placed (true overlaps {', '.join(shares)})")
        what += [
            f"photo {k} placed falsely ({entry.by_photo_px[k]:.0f} px off)"
            for k in entry.false
            if entry.by_photo_px
        ]
        if entry.rms_px > WANTED_RMS_MEDIAN_PX:
            worst = int(np.nanargmax(entry.by_photo_px))
            what.append(f"RMS {entry.rms_px:.2f} px, photo {worst} {entry.by_photo_px[worst]:.2f}")
        if entry.character_loss > WANTED_CHARACTER_LOSS:
            what.append(f"reads {entry.character_loss:.1f} points worse than the clean page")
        if what:
            lines.append(f"  {entry.name}: " + "; ".join(what))
    return "Short of what is wanted:\n" + "\n".join(lines) if lines else ""


def _stages(sets: Sequence[SetFigures]) -> str:
    names = list(dict.fromkeys(name for entry in sets for name in entry.stages_ms))
    if not names:
        return ""
    lines = [f"{'stage, ms':<22}" + "".join(f"{f'{n} photos':>12}" for n in (2, 4, 8))]
    for name in names:
        line = f"  {name:<20}"
        for count in (2, 4, 8):
            spent = [entry.stages_ms.get(name, NAN) for entry in sets if entry.photos == count]
            line += f"{_mean(spent, 0):>12}"
        lines.append(line)
    return "\n".join(lines)


def _finite(values: Iterable[float]) -> list[float]:
    return [value for value in values if math.isfinite(value)]


def _median(values: Iterable[float]) -> str:
    found = _finite(values)
    return f"{np.median(found):.3f}" if found else "-"


def _largest(values: Iterable[float], digits: int = 2) -> str:
    found = _finite(values)
    return f"{max(found):.{digits}f}" if found else "-"


def _mean(values: Iterable[float], digits: int = 2) -> str:
    found = _finite(values)
    return f"{np.mean(found):.{digits}f}" if found else "-"
