"""Photos of one sheet that each hide something else: the words that the joint page loses, and single photos lose.

python -m benchmarks mosaic_glare [--limit N] [--unseen] [--read] [--update-baseline]

Glare of one lamp on about 5 % of the sheet in each photo, cast shadows, fingers, motion and focus blur, alone and all
together; two, three and five photos of the whole sheet, flat, bent and folded, or four of its parts. A word is lost
where a piece of it does not correlate with the page. A third of the sets was looked at only to judge (`--unseen`).
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.options import make_parser
from benchmarks.common.places import BASELINE, OUTPUT, data_folder
from benchmarks.common.plots import contact_sheet, make_strip, save_picture
from benchmarks.common.reading import Reader, make_reader, word_rate
from benchmarks.mosaic.lost_words import lost_words, place_in_mosaic, place_in_photo
from benchmarks.mosaic.subject import assemble
from benchmarks.rectify.cases import load_pages
from benchmarks.rectify.sheet_experiments import FOLDED
from services.arrays import RgbImage
from services.contract.rectify import RectifyParameters
from services.errors import DocumentError
from services.imaging.channels import luminance
from services.mosaic.results import MosaicResult
from services.rectify.pipeline import rectify
from simulation.flat_page import Page
from simulation.obstructed_sets import Kind, photograph_parts, photograph_whole_views
from simulation.obstructions import ObstructedPhoto
from simulation.scenes import BOOK, PLANE
from simulation.sheets import with_margins

NAME = "mosaic_glare"
METRICS = {"joint_percent": Metric(0.1), "avoidable_percent": Metric(0.1), "covered_error": Metric(0.02)}
SHAPES = {"plane": PLANE, "book": BOOK, "folded": FOLDED[0], "parts": PLANE}
PLANS: tuple[tuple[Kind, str, int], ...] = (
    ("glare", "plane", 3),
    ("finger", "plane", 2),
    ("all", "parts", 4),
    ("glare", "book", 3),
    ("shadow", "plane", 2),
    ("blur", "plane", 2),
    ("glare", "parts", 4),
    ("all", "plane", 3),
    ("glare", "plane", 2),
    ("finger", "folded", 2),
    ("shadow", "book", 3),
    ("finger", "parts", 4),
    ("all", "book", 5),
)
"""What hides the sheet, its shape ("parts": four photos of parts of a flat one), number of photos."""
_SETS = 3
"""Of each plan; the last of them is unseen."""
_MARGIN = 0.08
"""Blank paper beside the print of sheets that are seen whole, as a share of the sheet's width."""
_SHADED = 0.1
"""Share of the light from which a place is shaded."""
_GRID_PX = 12.0
"""Between points of the page at which hidden shares are counted."""
_HIDDEN = 0.5
"""Share of the print's contrast from which a place is hidden."""


@dataclass(frozen=True, slots=True)
class GlareSet:
    """One set: its plan, and the number that draws its page, poses and obstructions."""

    kind: Kind
    shape: str
    count: int
    number: int

    @property
    def name(self) -> str:
        """As figures are filed under."""
        return f"{self.kind} {self.shape} {self.count} {self.number}"


def all_sets(*, unseen: bool) -> list[GlareSet]:
    """The sets that were built with, or those set aside; any first few are varied."""
    numbers = range(_SETS - 1, _SETS) if unseen else range(_SETS - 1)
    return [GlareSet(*plan, number) for number in numbers for plan in PLANS]


def photograph(case: GlareSet, pages: Sequence[Page]) -> tuple[ObstructedPhoto, ...]:
    """The photos of a set."""
    plan = PLANS.index((case.kind, case.shape, case.count))
    rng = np.random.default_rng([7000, plan, case.number])
    page = pages[(plan + 2 * case.number) % len(pages)]
    if case.shape == "parts":
        return photograph_parts(page, PLANE, case.kind, rng)
    return photograph_whole_views(with_margins(page, _MARGIN), SHAPES[case.shape], case.count, case.kind, rng)


def measure(photos: Sequence[ObstructedPhoto]) -> tuple[dict[str, float], RgbImage | None]:
    """Figures of one set, and its page. Words of the page in percent.

    single_percent: lost in the photo that loses fewest. nowhere_percent: lost in all photos. joint_percent: lost in the
    joint page. avoidable_percent: lost there, but not in all photos. covered_error: mean error of `covered_fraction`.
    """
    truths = [photo.truth for photo in photos]
    page = truths[0].page
    words = [word for line in page.lines for word in line]
    singles = np.array(
        [lost_words(page, luminance(photo.image), place_in_photo(photo.truth), words) for photo in photos]
    )
    attempt = assemble([photo.image for photo in photos], upright=False)
    nowhere = singles.all(axis=0)
    joint, covered = np.ones(len(words), bool), 1.0
    if attempt.result is not None:
        place = place_in_mosaic(truths, [patch.mesh for patch in attempt.result.patches])
        joint = lost_words(page, luminance(attempt.result.image), place, words)
        covered = _covered_error(photos, attempt.result)
    return {
        "single_percent": 100 * float(singles.mean(axis=1).min()),
        "nowhere_percent": 100 * float(nowhere.mean()),
        "joint_percent": 100 * float(joint.mean()),
        "avoidable_percent": 100 * float((joint & ~nowhere).mean()),
        "words": float(len(words)),
        "covered_error": covered,
        "cpu_s": attempt.usage.cpu_s,
    }, None if attempt.result is None else attempt.result.image


def _covered_error(photos: Sequence[ObstructedPhoto], result: MosaicResult) -> float:
    page = photos[0].truth.page
    x, y = np.arange(4.0, page.width, _GRID_PX), np.arange(4.0, page.height, _GRID_PX)
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    shown, hidden = np.zeros((2, len(photos), len(points)), bool)
    for k, photo in enumerate(photos):
        seen = place_in_photo(photo.truth)(points)
        shown[k] = np.isfinite(seen).all(axis=1)
        i, j = np.round(seen[shown[k]]).astype(int).T
        hidden[k, shown[k]] = (photo.lost[j, i] > _HIDDEN) | (photo.shaded[j, i] > _SHADED)
    elsewhere = (shown & ~hidden).any(axis=0)
    true = (hidden & elsewhere).sum(axis=1) / np.maximum(shown.sum(axis=1), 1)
    told = np.array([patch.covered_fraction or 0.0 for patch in result.patches])
    return float(np.mean(np.abs(told - true)))


def read_percent(
    reader: Reader, photos: Sequence[ObstructedPhoto], page: RgbImage | None
) -> dict[str, float]:
    """Words that the reader does not find, percent: on the best single photo's flat page, and on the joint page."""
    lines = [" ".join(word.text for word in line) for line in photos[0].truth.page.lines]

    def missed(image: RgbImage) -> float:
        return 100 * (1 - word_rate(lines, reader.read(image).text))

    singles = []
    for photo in photos:
        try:
            singles.append(missed(rectify(photo.image, RectifyParameters(upright=False)).image))
        except DocumentError:
            singles.append(100.0)
    return {
        "single_read_percent": min(singles),
        "joint_read_percent": 100.0 if page is None else missed(page),
        "page_read_percent": missed(np.repeat(photos[0].truth.page.image[..., None], 3, axis=2)),
    }


def main(arguments: Sequence[str]) -> int:
    """Print a line a set, and means of each kind; compare with the committed figures."""
    parser = make_parser(NAME, __doc__)
    parser.add_argument("--limit", type=int, default=None, help="only the first N sets (a varied choice)")
    parser.add_argument("--only", default="", help="only sets whose name contains this")
    parser.add_argument("--unseen", action="store_true", help="the sets that were set aside")
    parser.add_argument("--read", action="store_true", help="words by a reader too")
    asked = parser.parse_args(arguments)
    cv2.setNumThreads(1)
    pages, _ = load_pages(data_folder(asked.data))
    reader = make_reader(asked.reader, asked.rapidocr_python) if asked.read else None
    figures: Figures = {}
    strips = []
    for case in [case for case in all_sets(unseen=asked.unseen) if asked.only in case.name][: asked.limit]:
        photos = photograph(case, pages)
        found, page = measure(photos)
        if reader is not None:
            found |= read_percent(reader, photos, page)
        figures[case.name] = found
        print(f"{case.name:18s} " + _line(found), flush=True)
        strips.append(
            make_strip(
                [*(photo.image for photo in photos), page],
                ["photo"] * len(photos) + ["page"],
                title=case.name,
            )
        )
    for kind in dict.fromkeys(name.rsplit(" ", 2)[0] for name in figures):
        print(f"{kind:18s} " + _line(_means([row for name, row in figures.items() if name.startswith(kind)])))
    print(f"{'all sets':18s} " + _line(_means(list(figures.values()))))
    save_picture(OUTPUT / f"{NAME}.jpg", contact_sheet(strips))
    judged = {name: {key: row[key] for key in METRICS} for name, row in figures.items()}
    report, fine = judge(BASELINE / f"{NAME}.json", judged, METRICS, update=asked.update_baseline)
    print(report)
    return 0 if fine else 1


def _means(rows: Sequence[dict[str, float]]) -> dict[str, float]:
    return {key: float(np.mean([row[key] for row in rows])) for key in rows[0]}


def _line(row: dict[str, float]) -> str:
    read = (
        f"  read: single {row['single_read_percent']:.2f} joint {row['joint_read_percent']:.2f} page "
        f"{row['page_read_percent']:.2f}"
        if "joint_read_percent" in row
        else ""
    )
    return (
        f"lost %: best single {row['single_percent']:6.2f}  in all {row['nowhere_percent']:5.2f}  joint "
        f"{row['joint_percent']:5.2f}  avoidable {row['avoidable_percent']:5.2f}  covered error "
        f"{row['covered_error']:.3f}  CPU {row['cpu_s']:.1f} s{read}"
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
