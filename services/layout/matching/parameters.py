"""What a search for the least cost may take."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MatchingParameters:
    """Budgets are counted in steps, so that the answer does not depend on the machine's speed.

    `max_nodes`: zones that branch and bound opens (about 20 us each). `max_sweeps`: passes of the dual ascent over
    all pairs; more prove more of the hard pages, on which they find nothing better. `max_ms`: wall clock, the last
    stop only, well above what the other two allow on pages of 60 zones. `manhattan`: in two steps, grouped zones
    must not overlap zones of other groups (5.4).
    """

    max_nodes: int = 800
    max_sweeps: int = 12
    max_ms: float = 250.0
    manhattan: bool = True
