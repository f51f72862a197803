"""Photo in, text out: the product's text beside that of Tesseract alone (its own layout analysis) on the same view.

python -m benchmarks reading [--parts photos,app,receipts,pages] [--only NAME,...] [--limit N] [--show FOLDER]

Score: `character_score`, percent. Error: character error after lines are put where the printed ones have their text.
Words: share of printed words that were read. Kept: share of true neighbours within a line that stay neighbours. CPU s:
of the reading alone. A third of the sheets, firms and shops was not looked at while the code was written; both groups
have means of their own. Texts in ten languages are read by `python -m benchmarks languages`.
"""

import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.figures import write_json
from benchmarks.common.options import make_parser
from benchmarks.common.places import BASELINE, MEMORY, OUTPUT, data_folder
from benchmarks.common.reading import character_score, word_rate
from benchmarks.reading.cases import PARTS, Case, find_cases, lines_of, text_of, view_of
from benchmarks.reading.measures import aligned_error, neighbours_kept, value_read
from services.arrays import RgbImage
from services.imaging.channels import luminance
from services.layout.pipeline import readable
from services.ocr.engine import OcrEngine
from services.operations.page_reading import read_flat_page
from services.operations.reader import ocr_engine

NAME = "reading"
METRICS = {
    "score": Metric(0.3, larger_is_better=True),
    "error": Metric(0.5),
    "words": Metric(0.5, larger_is_better=True),
    "kept": Metric(0.2, larger_is_better=True),
    **dict.fromkeys(("total", "date", "company", "address"), Metric(2.0, larger_is_better=True)),
}
"""Figures of a page, in percent, that are compared with the committed ones."""
VALUES = ("total", "date", "company", "address")
Lines = list[str]


def read_by_us(view: RgbImage, engine: OcrEngine, language: str) -> Lines:
    """Lines of the product's text, as in `format=txt`."""
    return [line.text for line in read_flat_page(view, engine, language).lines]


def read_alone(view: RgbImage, engine: OcrEngine, language: str) -> Lines:
    """The engine's own lines on the view in even light."""
    return [text_of(line) for line in lines_of(engine.read_page(readable(luminance(view))))]


def judge_text(case: Case, read: Sequence[str]) -> dict[str, float]:
    """Figures of one text, percent; `pairs` is how many neighbours `kept` is a share of.

    The known text of receipts is in capitals, whatever was printed.
    """
    if case.part == "receipts":
        read = [line.upper() for line in read]
    text = " ".join(read)
    kept, pairs = neighbours_kept(case.lines, read)
    figures = {
        "score": 100 * character_score(case.lines, text),
        "error": 100 * aligned_error(case.lines, read),
        "words": 100 * word_rate(case.lines, text),
        "pairs": float(pairs),
    }
    if pairs:
        figures["kept"] = 100 * kept / pairs
    for name in VALUES:
        if case.values.get(name):
            full, nearly = value_read(case.values[name], read)
            figures |= {name: 100.0 * full, f"{name} nearly": 100.0 * nearly}
    return figures


def measure(
    read: Callable[[RgbImage, OcrEngine, str], Lines], case: Case, view: RgbImage | None
) -> tuple[dict[str, float], Lines]:
    """Figures of one reading with its CPU seconds, and its lines; a view that was refused has no text."""
    if view is None:
        return {**judge_text(case, []), "cpu_s": 0.0}, []
    engine = ocr_engine(case.language)
    assert engine is not None
    start = time.process_time()
    lines = read(view, engine, case.language)
    spent = time.process_time() - start
    return {**judge_text(case, lines), "cpu_s": spent}, lines


def means(figures: Iterable[dict[str, float]]) -> dict[str, float]:
    """Means of all figures; `kept` is the share of all neighbours."""
    each = list(figures)
    found = {name: [f[name] for f in each if name in f] for name in (*METRICS, "cpu_s")}
    found |= {f"{name} nearly": [f[f"{name} nearly"] for f in each if name in f] for name in VALUES}
    mean = {name: float(np.mean(values)) for name, values in found.items() if values}
    pairs = sum(f["pairs"] for f in each)
    mean["kept"] = sum(f.get("kept", 0.0) * f["pairs"] for f in each) / max(pairs, 1.0)
    return mean


def format_means(title: str, ours: Figures, alone: Figures, cases: Sequence[str]) -> str:
    """Lines for both readers, and how much better or worse our score is on the pages that differ most."""
    if not cases:
        return f"{title}: none"
    rows = [f"{title}: {len(cases)} pages"]
    for name, figures in (("ours", ours), ("Tesseract", alone)):
        told = means(figures[case] for case in cases)
        rows.append(f"  {name:<10}" + ", ".join(f"{key} {value:.2f}" for key, value in told.items()))
    gains = sorted((ours[case]["score"] - alone[case]["score"], case) for case in cases)
    worse = ", ".join(f"{case} {gain:+.1f}" for gain, case in gains if gain < -1)
    rows.append(f"  worse by more than 1: {worse or 'none'}")
    return "\n".join(rows)


def main(arguments: Sequence[str]) -> int:
    """Print a line a page and the means of each part; compare with the committed figures."""
    parser = make_parser(NAME, __doc__)
    parser.add_argument("--parts", default=",".join(PARTS), help="with commas: " + ", ".join(PARTS))
    parser.add_argument("--only", default="", help="files by their names without suffix, with commas")
    parser.add_argument("--limit", type=int, help="so many pages of each part")
    parser.add_argument("--show", type=Path, help="folder for the texts that were read")
    parser.add_argument("--set-aside", choices=("with", "without", "only"), default="with")
    asked = parser.parse_args(arguments)
    memory = None if asked.fresh else MEMORY / NAME
    ours: Figures = {}
    alone: Figures = {}
    for part in asked.parts.split(","):
        cases = list(find_cases(data_folder(asked.data), part))
        if not cases:
            print(f"{part}: NOT MEASURED, no data in {data_folder(asked.data)} or no language data for it")
        only = asked.only.split(",") if asked.only else None
        wanted = {"with": (True, False), "without": (False,), "only": (True,)}[asked.set_aside]
        cases = [c for c in cases if c.is_set_aside in wanted and (only is None or c.path.stem in only)]
        cases = cases[: asked.limit]
        for case in cases:
            view = view_of(case, memory)
            ours[case.name], lines = measure(read_by_us, case, view)
            alone[case.name], own = measure(read_alone, case, view)
            print(_line(case.name, ours[case.name], alone[case.name]), flush=True)
            if asked.show:
                _show(asked.show, case, lines, own)
        for title, aside in (("looked at", False), ("set aside", True)):
            names = [case.name for case in cases if case.is_set_aside == aside]
            print(format_means(f"{part}, {title}", ours, alone, names), flush=True)
    write_json(OUTPUT / f"{NAME}.json", {"ours": ours, "alone": alone})
    report, fine = judge(BASELINE / f"{NAME}.json", ours, METRICS, update=asked.update_baseline)
    print(report)
    return 0 if fine else 1


def _line(name: str, ours: dict[str, float], alone: dict[str, float]) -> str:
    told = ("score", "error", "words", "kept", "cpu_s")
    return f"{name:<42}" + "  ".join(
        f"{key} {ours.get(key, 100.0):.1f} ({alone.get(key, 100.0):.1f})" for key in told
    )


def _show(folder: Path, case: Case, ours: Lines, alone: Lines) -> None:
    folder = folder / case.part
    folder.mkdir(parents=True, exist_ok=True)
    for kind, lines in (("truth", case.lines), ("ours", ours), ("alone", alone)):
        (folder / f"{case.path.stem}.{kind}.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
