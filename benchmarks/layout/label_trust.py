"""Calibration of the confidences of labels, from images: expected error, and zones that can be accepted.

python -m benchmarks layout_calibration [--sets letters/real,memos] [--sizes 3,5,all] [--limit N]

Models of N samples label other pages from their images. The expected calibration error is the mean distance of
confidence and share of right labels over 15 bins of confidence. Beside it is what a perfectly calibrated predictor has
on as many zones (noise), and by how much confidences are too high in the mean (excess). Zones are accepted from the
most confident on, as long as at most 1 % of them are wrong; a curve shows the error of every share.
"""

import sys
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.figures import plain_values, write_json
from benchmarks.common.options import make_parser
from benchmarks.common.places import BASELINE, OUTPUT
from benchmarks.common.workers import Progress, run_in_workers
from benchmarks.layout.part import table
from benchmarks.layout.protocols import draws, folds, make_model, recognize_finely
from benchmarks.layout.truth import layout_folder
from benchmarks.layout.weight_learning import read_named, start_reading
from benchmarks.layout.word_labels import SETS, Photo, load_pages
from services.layout.learning.label_transfer import transfer_labels

NAME = "layout_calibration"
SIZES = ("3", "5", "all")
DRAWS = 6
"""Of a class, three samples more or less alike move all confidences by 10 %: two draws say little."""
FOLDS = 4
BINS = 15
TOLERATED = 0.01
METRICS = {"expected_error_percent": Metric(1.0, False), "accepted_percent": Metric(3.0, True)}

Judged = tuple[NDArray[np.float64], NDArray[np.bool_]]
"""Confidences (N,) of zones, and which of their labels are right."""


def splits_of(pages: int, size: str, number: int) -> list[tuple[list[int], list[int]]]:
    """(samples, tested): `number` draws of `size` samples, or folds of all."""
    if size == "all":
        return list(folds(pages, FOLDS))
    drawn = draws(pages, int(size), number, seed=7)
    return [(each, [at for at in range(pages) if at not in each]) for each in drawn]


def judge_zones(photos: Sequence[Photo], size: str) -> Judged:
    """Zones of pages that models of `size` samples have labelled, over draws or folds."""
    confidence: list[float] = []
    is_right: list[bool] = []
    for learned, tested in splits_of(len(photos), size, DRAWS):
        model = make_model("class", [(photos[at].true, photos[at].own) for at in learned])
        for at in tested:
            seen = recognize_finely(photos[at].fine, model)
            true = transfer_labels(photos[at].true, seen.page)
            confidence += [each.confidence for each in seen.zones]
            is_right += [each.label == zone.label for each, zone in zip(seen.zones, true.zones, strict=True)]
    return np.array(confidence), np.array(is_right, bool)


def expected_error(judged: Judged) -> float:
    """Expected calibration error, 0-1."""
    confidence, is_right = judged
    bins = np.minimum((confidence * BINS).astype(int), BINS - 1)
    total = sum(abs(float(np.sum(confidence[bins == each] - is_right[bins == each]))) for each in range(BINS))
    return total / len(confidence)


def noise(judged: Judged, repetitions: int = 200) -> float:
    """Mean expected calibration error, 0-1, if labels are right with exactly these confidences."""
    rng = np.random.default_rng(0)
    confidence = judged[0]
    drawn = (
        expected_error((confidence, rng.random(len(confidence)) < confidence)) for _ in range(repetitions)
    )
    return float(np.mean(list(drawn)))


def error_of_shares(judged: Judged) -> NDArray[np.float64]:
    """Share of wrong labels among the 1, 2, ... most confident zones."""
    order = np.argsort(-judged[0], kind="stable")
    return np.asarray(np.cumsum(~judged[1][order]) / np.arange(1, len(order) + 1))


def accepted_share(judged: Judged, tolerated: float = TOLERATED) -> float:
    """Largest share of zones, the most confident ones, with at most `tolerated` wrong labels."""
    good = np.flatnonzero(error_of_shares(judged) <= tolerated)
    return float(good[-1] + 1) / len(judged[0]) if len(good) else 0.0


def plot(judged: Sequence[tuple[str, Judged]]) -> None:
    """The error of every accepted share: a panel for each number of samples, a colour for each set."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    cases = [(*case.rsplit(", ", 1), each) for case, each in judged]
    sizes, names = (list(dict.fromkeys(keys)) for keys in ([c[1] for c in cases], [c[0] for c in cases]))
    figure, panels = pyplot.subplots(1, len(sizes), figsize=(11, 4), sharey=True, squeeze=False)
    for name, size, each in cases:
        errors = error_of_shares(each)
        share = 100 * np.arange(1, len(errors) + 1) / len(errors)
        axes = panels[0, sizes.index(size)]
        axes.plot(share, 100 * errors, label=name, color=f"C{names.index(name)}", linewidth=1)
    for size, axes in zip(sizes, panels[0], strict=True):
        axes.axhline(100 * TOLERATED, color="black", linewidth=0.5)
        axes.set(title=size, xlabel="accepted zones, percent", ylim=(0, 20))
    panels[0, 0].set(ylabel="wrong labels among them, percent")
    panels[0, -1].legend(fontsize="small")
    figure.savefig(OUTPUT / f"{NAME}.png", dpi=120, bbox_inches="tight")
    pyplot.close(figure)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save, compare; 1 when something got worse than the baseline."""
    parser = make_parser(NAME, __doc__)
    parser.add_argument("--sets", default=",".join(SETS), help="which sets, by commas (default: all)")
    parser.add_argument("--sizes", default=",".join(SIZES), help="numbers of samples, by commas")
    parser.add_argument("--limit", type=int, default=None, help="only the first N pages of each set")
    options = parser.parse_args(arguments)
    names, sizes = options.sets.split(","), options.sizes.split(",")
    if unknown := [name for name in names if name not in SETS]:
        parser.error(f"no such set: {', '.join(unknown)} (there are {', '.join(SETS)})")
    pages = [(name, page) for name in names for page in load_pages(name, options.data, options.limit)]
    if not pages:
        print(f"no pages in {layout_folder(options.data)}: nothing is measured", file=sys.stderr)
        return 0
    kept = None if options.fresh else "kept"
    photos: dict[str, list[Photo]] = {}
    progress = Progress(len(pages))
    for name, photo in run_in_workers(read_named, pages, start_reading, kept, options.workers):
        photos.setdefault(name, []).append(photo)
        progress.tell(photo.name)
    tasks = [
        (name, size, sorted(each, key=lambda photo: photo.name))
        for name, each in photos.items()
        for size in sizes
        if size == "all" or int(size) < len(each)
    ]
    order = [f"{name}, {size} samples" for name in names for size in sizes]
    judged = sorted(
        run_in_workers(_judge, tasks, start_reading, kept, options.workers),
        key=lambda each: order.index(each[0]),
    )
    figures: Figures = {
        case: {
            "expected_error_percent": 100 * expected_error(each),
            "noise_percent": 100 * noise(each),
            "excess_percent": 100 * float(each[0].mean() - each[1].mean()),
            "accepted_percent": 100 * accepted_share(each),
            "right_percent": 100 * float(each[1].mean()),
            "zones": len(each[0]),
        }
        for case, each in judged
    }
    columns = (
        "expected_error_percent",
        "noise_percent",
        "excess_percent",
        "accepted_percent",
        "right_percent",
        "zones",
    )
    rows = [[case, *(float(row[each]) for each in columns)] for case, row in figures.items()]
    print(table("Confidences of labels from images", ("set, samples", *columns), rows))
    write_json(OUTPUT / f"{NAME}.json", plain_values(figures))
    plot(judged)
    if options.limit or len(names) < len(SETS) or sizes != list(SIZES):
        return 0
    verdict, good = judge(
        BASELINE / f"{NAME}.json", plain_values(figures), METRICS, update=options.update_baseline
    )
    print(verdict, flush=True)
    return 0 if good else 1


def _judge(task: tuple[str, str, Sequence[Photo]]) -> tuple[str, Judged]:
    name, size, photos = task
    return f"{name}, {size} samples", judge_zones(photos, size)
