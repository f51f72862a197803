"""From cost tables to the labelling of least cost (dissertation 5.4)."""

from services.layout.matching.direct import match_directly
from services.layout.matching.labelling import backbone_of, conditional_costs, own_costs, zone_costs
from services.layout.matching.parameters import NO_PROOF, MatchingParameters

__all__ = [
    "NO_PROOF",
    "MatchingParameters",
    "backbone_of",
    "conditional_costs",
    "match_directly",
    "own_costs",
    "zone_costs",
]
