"""The review queue: the order that needs fewest corrections, and what goes through without a person.

python -m benchmarks review [--parts orders,acceptance,lists] [--limit N]

Pages of the layout benchmarks in their true zones; all classes compete. A person corrects pages, the models learn by
the steps of the service's feedback, and open pages are recognized again. Results are kept as in `learning`.
"""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.figures import plain_values, write_json
from benchmarks.common.options import make_parser
from benchmarks.common.places import BASELINE, MEMORY, OUTPUT
from benchmarks.layout.jobs import KeptResults, measure_all
from benchmarks.layout.part import Part, Results, choose_parts
from benchmarks.layout.specimens import load_specimens
from benchmarks.layout.truth import layout_folder
from benchmarks.review.acceptance import ACCEPTANCE, draw_acceptance
from benchmarks.review.lists import LISTS_OVER_HTTP
from benchmarks.review.orders import ORDERS, draw_orders

NAME = "review"
PARTS: dict[str, Part] = {"orders": ORDERS, "acceptance": ACCEPTANCE, "lists": LISTS_OVER_HTTP}
PICTURES: dict[str, Callable[[Path, Results], None]] = {"orders": draw_orders, "acceptance": draw_acceptance}
TIMED = {"lists"}
"""Parts whose results are times, which are not kept."""
METRICS = {
    "corrections": Metric(5.0),
    "accepted_in_hindsight_percent": Metric(3.0, True),
    "beyond_bound": Metric(0.5),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save, compare; 1 when something got worse than the baseline."""
    parser = make_parser(NAME, __doc__)
    parser.add_argument("--parts", default="", help=f"only these, comma separated: {','.join(PARTS)}")
    parser.add_argument(
        "--limit", type=int, default=None, help="only the first N pages of each class and set"
    )
    options = parser.parse_args(arguments)
    options.no_reading = False
    names = choose_parts(parser, options, PARTS)
    specimens = load_specimens(options.data, options.limit)
    if not specimens:
        print(f"no pages in {layout_folder(options.data)}: only simulated ones are measured", file=sys.stderr)
    kept = KeptResults(None if options.fresh else MEMORY / NAME, specimens)
    results: dict[str, Results] = {}
    for name in names:
        part = {name: PARTS[name]}
        results |= measure_all(part, specimens, options.workers, (), None if name in TIMED else kept)
    figures: Figures = {}
    for name in names:
        print(f"===== {name} =====\n\n{PARTS[name].report(results[name])}\n", flush=True)
        figures.update(PARTS[name].figures(results[name]))
        write_json(OUTPUT / f"{NAME}_{name}.json", plain_values(results[name]))
        if results[name] and name in PICTURES:
            PICTURES[name](OUTPUT / f"{NAME}_{name}.png", results[name])
    if options.limit:
        print("not compared with the baseline, which is of all pages")
        return 0
    path = BASELINE / f"{NAME}.json"
    verdict, good = judge(path, plain_values(figures), METRICS, update=options.update_baseline)
    print(f"{verdict}\n\nfigures and pictures: {OUTPUT}", flush=True)
    return 0 if good else 1
