"""How probable it is that a zone is several which the samples of its class label apart, where no cut could tell."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.special import expit, logit

from services.layout.grouping.joining import SPREAD, USUAL_ZONES
from services.layout.grouping.regrouping_odds import merged_share
from services.layout.model.layout_model import PieceStatistics
from services.layout.recognition.results import Recognition, RecognizedZone


def with_merged_doubts(seen: Recognition, learned: Mapping[str, PieceStatistics]) -> Recognition:
    """The recognition; zones whose cuts nobody has judged have the probability that they are several.

    A label of the class that segmentation merges with others may be hidden in a zone where it is missing on the page.
    The share of merged zones in the samples is the odds; the zone's height is likely as that of its label alone, or as
    that of both.
    """
    on_page = {each.label for each in seen.zones}
    missing = [each for label, each in learned.items() if each.merged and label not in on_page]

    def doubt(zone: RecognizedZone) -> float:
        own = learned.get(zone.label or "", PieceStatistics())
        if not own.merged or not missing or zone.zone.kind != "text":
            return 0.0
        share = (zone.zone.box[3] - zone.zone.box[1]) / seen.page.height
        return max(_probability(share, own, other) for other in missing)

    zones = (replace(each, several=doubt(each)) if each.several is None else each for each in seen.zones)
    return replace(seen, zones=tuple(zones))


def _probability(share: float, own: PieceStatistics, other: PieceStatistics) -> float:
    """Probability that a zone, its height a share of the page's, is one of its own label and another one together."""

    (alone, variance), (added, _) = _height(own), _height(other)
    together = np.log2(2.0**alone + 2.0**added)
    height = np.log2(max(share, 1e-6))
    likelier = ((height - alone) ** 2 - (height - together) ** 2) / (2 * variance)
    return float(expit(logit(min(merged_share(own), merged_share(other))) + likelier))


def _height(label: PieceStatistics) -> tuple[float, float]:
    """Mean and variance of the binary logarithms of heights of verified zones, the variance drawn to what is usual."""
    count, total, squares = label.heights
    mean = total / max(count, 1e-9)
    spread = max(squares - count * mean**2, 0.0) + USUAL_ZONES * SPREAD**2
    return mean, spread / (count + USUAL_ZONES)
