"""What verified pages teach about the pieces that segmentation makes of their zones."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from services.layout.grouping.joined_page import in_pieces
from services.layout.grouping.piece_pairs import (
    MOST_ZONES,
    PAIR_WEIGHTS,
    are_neighbours,
    describe_pieces,
    pair_features,
    print_size,
)
from services.layout.learning.label_transfer import (
    box_areas,
    merged_zones,
    shared_areas,
    transfer_labels,
    zones_within,
)
from services.layout.model.layout_model import LARGEST, PieceStatistics
from services.layout.page import Page, Zone

PRIOR = 0.5
"""Precision of a label's log odds about the usual ones: one or two pairs of a sample move them by a unit."""
MOST_ODDS = 20.0
LEAST_SIDE = 1e-3
"""Of a zone, as a share of the page."""
_STEPS = 20
_DIGITS = 4

Pairs = tuple[NDArray[np.float64], NDArray[np.bool_]]
"""Usual log odds (P,) of pairs of neighbours with one label, and which of them are pieces of one zone."""


def learn_pieces(
    samples: Iterable[tuple[Page, Page]], known: Mapping[str, PieceStatistics] | None = None
) -> dict[str, PieceStatistics]:
    """What is known of the pieces of each label, after `samples` more than `known` comes from.

    Log odds of joins are the most probable ones for all pairs of a label, with a normal prior: about 0, or about what
    is known, as sure as that is (Laplace's approximation).

    Parameters
    ----------
    samples
        Verified pages, and the same pages in the zones of segmentation; zones that were put together count as their
        pieces. Pages of more than `MOST_ZONES` teach nothing.
    known
        From earlier pages; what it has of labels that these pages have not stays.
    """
    learned = dict(known or {})
    pairs: dict[str, list[Pairs]] = {}
    for verified, page in samples:
        found = transfer_labels(verified, in_pieces(page))
        if len(found.zones) > MOST_ZONES:
            continue
        owner = owners_of(verified, found)
        for label, each in _pairs_by_label(found, owner).items():
            pairs.setdefault(label, []).append(each)
        for label, counted in _count_pieces(verified, found, owner, counts_apart=known is None).items():
            learned[label] = _sum(learned.get(label, PieceStatistics()), counted)
    for label, seen in pairs.items():
        odds, joined = (np.concatenate(part) for part in zip(*seen, strict=True))
        learned[label] = _joined(learned.get(label, PieceStatistics()), odds, joined)
    return dict(sorted(learned.items()))


def neighbours_of(
    found: Page, owner: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.bool_], list[str]]:
    """`pair_features` (P, F) of neighbours with one label on a page, which of them have one owner, their labels."""
    pieces, names = describe_pieces(found.zones, print_size(found))
    first, second = np.triu_indices(len(found.zones), 1)
    kept = are_neighbours(pieces, first, second, pieces)
    first, second = first[kept], second[kept]
    same = (owner[first] >= 0) & (owner[first] == owner[second])
    return pair_features(pieces, first, second), same, [str(names[place]) for place in pieces.labels[first]]


def _pairs_by_label(found: Page, owner: NDArray[np.intp]) -> dict[str, Pairs]:
    features, same, labels = neighbours_of(found, owner)
    odds = features @ PAIR_WEIGHTS
    rows: dict[str, list[int]] = {}
    for row, label in enumerate(labels):
        rows.setdefault(label, []).append(row)
    return {label: (odds[chosen], same[chosen]) for label, chosen in rows.items()}


def owners_of(verified: Page, found: Page) -> NDArray[np.intp]:
    """Place (N,) of the verified zone that covers most of each found zone, -1 where none covers half of it."""
    if not verified.zones or not found.zones:
        return np.full(len(found.zones), -1, np.intp)
    shares = shared_areas(found.zones, verified.zones) / box_areas(found.zones)[:, None]
    best = shares.argmax(axis=1)
    return np.where(shares[np.arange(len(best)), best] >= 0.5, best, -1)


def _count_pieces(
    verified: Page, found: Page, owner: NDArray[np.intp], *, counts_apart: bool
) -> dict[str, PieceStatistics]:
    """Sums of one page: verified zones by whether they were found in one piece, merged with others, and their sizes.

    `counts_apart` is False for pages that were recognized: they show what segmentation merged only where it stayed.
    """
    merged = {each for held in merged_zones(verified, found).values() for each in held}
    within = {each for held in zones_within(verified, found).values() for each in held}
    pieces = Counter(
        int(place)
        for zone, place in zip(found.zones, owner, strict=True)
        if place >= 0 and zone.label == verified.zones[place].label
    )
    counted: dict[str, PieceStatistics] = {}
    for place, zone in enumerate(verified.zones):
        if zone.label is not None:
            width, height = (
                (1.0, size, size**2) for size in _log_sides(zone, verified.width, verified.height)
            )
            one = PieceStatistics(
                whole=float(pieces[place] == 1),
                divided=float(pieces[place] > 1),
                merged=float(place in merged),
                apart=float(counts_apart and place not in merged),
                within=float(place in within),
                widths=width,
                heights=height,
            )
            counted[zone.label] = _sum(counted.get(zone.label, PieceStatistics()), one)
    return counted


def _log_sides(zone: Zone, width: float, height: float) -> tuple[float, float]:
    x0, y0, x1, y1 = zone.box
    return (
        float(np.log2(max((x1 - x0) / width, LEAST_SIDE))),
        float(np.log2(max((y1 - y0) / height, LEAST_SIDE))),
    )


def _sum(one: PieceStatistics, other: PieceStatistics) -> PieceStatistics:
    """The sums of both, with the log odds of the first."""

    def added(a: tuple[float, float, float], b: tuple[float, float, float]) -> tuple[float, float, float]:
        n, total, squares = (round(x + y, _DIGITS) for x, y in zip(a, b, strict=True))
        return n, total, squares

    return replace(
        one,
        whole=one.whole + other.whole,
        divided=one.divided + other.divided,
        merged=one.merged + other.merged,
        apart=one.apart + other.apart,
        within=one.within + other.within,
        widths=added(one.widths, other.widths),
        heights=added(one.heights, other.heights),
    )


def _joined(known: PieceStatistics, odds: NDArray[np.float64], joined: NDArray[np.bool_]) -> PieceStatistics:
    about, prior = known.joining, max(known.certainty, PRIOR)
    added = most_probable(odds, joined, about, prior)
    probability = expit(odds + added)
    certainty = min(prior + float((probability * (1 - probability)).sum()), LARGEST)
    return replace(known, joining=round(added, _DIGITS), certainty=round(certainty, _DIGITS))


def most_probable(
    odds: NDArray[np.float64], joined: NDArray[np.bool_], about: float = 0.0, prior: float = PRIOR
) -> float:
    """Log odds to be added to the usual ones (P,) of pairs, with a normal prior of precision `prior`.

    By Newton's method, steps of 1 at most; the likelihood is convex.
    """
    added = about
    for _ in range(_STEPS):
        probability = expit(odds + added)
        slope = float((probability - joined).sum()) + prior * (added - about)
        added -= float(np.clip(slope / (float((probability * (1 - probability)).sum()) + prior), -1.0, 1.0))
    return float(np.clip(added, -MOST_ODDS, MOST_ODDS))
