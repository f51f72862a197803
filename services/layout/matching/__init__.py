"""From cost tables to the labelling of least cost (dissertation 5.4)."""

from services.layout.matching.direct import match_directly
from services.layout.matching.labelling import backbone_of, conditional_costs, own_costs, zone_costs
from services.layout.matching.parameters import NO_PROOF, MatchingParameters
from services.layout.matching.two_steps import TwoStepMatching, match_in_two_steps

__all__ = [
    "NO_PROOF",
    "MatchingParameters",
    "TwoStepMatching",
    "backbone_of",
    "conditional_costs",
    "match_directly",
    "match_in_two_steps",
    "own_costs",
    "zone_costs",
]
