"""What samples with images teach about the pieces that segmentation makes of their zones."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from services.layout.grouping.piece_pairs import (
    MOST_ZONES,
    USUAL_WEIGHTS,
    neighbours_of,
    piece_features,
    print_size,
)
from services.layout.learning.label_transfer import box_areas, shared_areas
from services.layout.page import Page

PRIOR = 0.5
"""Precision of a label's log odds about the usual ones: one or two pairs of a sample move them by a unit."""
MOST_ODDS = 20.0
_STEPS = 20


def learn_joining(samples: Iterable[tuple[Page, Page]]) -> dict[str, float]:
    """Log odds for each label, beyond the usual ones, that neighbouring zones with it are pieces of one zone.

    `samples` are verified pages, and the same pages in the zones of segmentation with the verified labels; those of
    more than `MOST_ZONES` teach nothing. The odds are the most probable ones for all pairs of the label, with a normal
    prior about 0.
    """
    odds: dict[str, list[float]] = {}
    joined: dict[str, list[bool]] = {}
    for verified, found in samples:
        if len(found.zones) > MOST_ZONES:
            continue
        owner = _owners(verified, found)
        em = print_size(found)
        for place, zone in enumerate(found.zones):
            for other in neighbours_of(place, found.zones, em):
                if other < place and zone.label is not None:
                    features = piece_features(zone, found.zones[other], em)
                    odds.setdefault(zone.label, []).append(float(features @ USUAL_WEIGHTS))
                    joined.setdefault(zone.label, []).append(
                        owner[place] >= 0 and owner[place] == owner[other]
                    )
    return {label: _most_probable(np.array(odds[label]), np.array(joined[label])) for label in sorted(odds)}


def _owners(verified: Page, found: Page) -> list[int]:
    """Place of the verified zone that covers most of each found zone, -1 where none covers half of it."""
    if not verified.zones or not found.zones:
        return [-1] * len(found.zones)
    shares = shared_areas(found.zones, verified.zones) / box_areas(found.zones)[:, None]
    best = shares.argmax(axis=1)
    return [int(place) if shares[row, place] >= 0.5 else -1 for row, place in enumerate(best)]


def _most_probable(odds: NDArray[np.float64], joined: NDArray[np.bool_]) -> float:
    """Newton's method, steps of 1 at most; the likelihood is convex."""
    added = 0.0
    for _ in range(_STEPS):
        probability = expit(odds + added)
        slope = float((probability - joined).sum()) + PRIOR * added
        added -= float(np.clip(slope / (float((probability * (1 - probability)).sum()) + PRIOR), -1.0, 1.0))
    return float(np.clip(added, -MOST_ODDS, MOST_ODDS))
