"""Limits of a search for the least cost."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MatchingParameters:
    """Budgets are counted in steps, so that the answer does not depend on the machine's speed.

    `max_nodes`: zones that branch and bound opens (40 us each); 300 prove nearly all pages of 15 zones. `max_sweeps`:
    passes of the dual ascent over all pairs; after 12 the bound hardly rises. `max_ms`: processor time of the thread
    (a loaded machine gives the same answers), the last stop only, well above what the other two take on pages of 200
    zones. `manhattan`: in two steps, grouped zones must not overlap zones of other groups (5.4); paragraphs and
    headings that take turns are kept apart by it.
    """

    max_nodes: int = 300
    max_sweeps: int = 12
    max_ms: float = 250.0
    manhattan: bool = False


NO_PROOF = MatchingParameters(max_nodes=0, max_sweeps=0)
"""Local search alone: costs change by 0.2 a zone at most and their means by 1 %, in a third to a tenth of the time."""
LEAST_GAIN = 1e-10
"""Share of a cost that is lost to rounding: a step that gains less is none."""
