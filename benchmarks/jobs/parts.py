"""`python -m benchmarks jobs`: accepted jobs while processes are killed, and what the queue costs."""

import argparse
from collections.abc import Callable, Mapping, Sequence

from benchmarks.jobs.chaos import AWAY, Chaos, disturb_cluster, disturb_service
from benchmarks.jobs.costs import measure_overhead, measure_uploads, measure_worker
from benchmarks.jobs.scaling import measure_scaling

PARTS: Mapping[str, Callable[[Chaos], bool]] = {
    "chaos": disturb_cluster,
    "sqlite": disturb_service,
    "away": lambda chaos: disturb_cluster(chaos, only=AWAY),
    "overhead": lambda chaos: measure_overhead(chaos.jobs),
    "scaling": lambda chaos: measure_scaling(chaos.jobs),
    "uploads": lambda chaos: measure_uploads(chaos.jobs),
    "worker": lambda chaos: measure_worker(chaos.jobs),
}
"""Each part prints its figures; False: they are not as they must be."""


def main(arguments: Sequence[str]) -> int:
    """Run the parts; 1 if one of them fails."""
    parser = argparse.ArgumentParser(prog="benchmarks jobs", description=__doc__)
    parser.add_argument("--parts", nargs="+", choices=tuple(PARTS), default=["chaos", "sqlite"])
    parser.add_argument("--jobs", type=int, default=1000)
    parser.add_argument("--apis", type=int, default=2)
    parser.add_argument(
        "--workers", type=int, default=2, help="worker processes of `chaos`, workers of `sqlite`"
    )
    parser.add_argument(
        "--chaos-every",
        type=float,
        default=20.0,
        help="seconds between disruptions while all processes are up; 0: none",
    )
    options = parser.parse_args(arguments)
    chaos = Chaos(options.jobs, options.chaos_every, options.apis, options.workers)
    return int(not all([PARTS[part](chaos) for part in options.parts]))
