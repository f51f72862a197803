"""Search for all overlapping pairs of photos (4.3)."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from services.arrays import Homography
from services.geometry.homographies import scaling, transform_points, translation
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.photo_graph import connect_photos, overlap_fraction
from services.mosaic.registration.displacement_vote import CompatibleGroup, vote_displacements
from services.mosaic.registration.features import FeatureMatches, Features, match_features
from services.mosaic.registration.homography_fit import USUAL, FitParameters, fit_homography, is_sane
from services.mosaic.registration.pair_consistency import (
    Pairs,
    drop_contradictions,
    drop_lonely_lines,
    find_ways,
    matched_extent,
)
from services.mosaic.registration.pair_registration import PairRegistration
from services.mosaic.registration.pair_verification import (
    SEARCH,
    Overlap,
    PreparedPhoto,
    refine_overlap,
    shows_otherwise,
    verify_overlap,
)
from services.mosaic.registration.reduced_view import quarter_turn

# Parameters of the search for pairs.
GROUP_LOSS_PX = 5.0
"""Loss width of the first fit, pixels of the word scale (as in the prototype)."""
FIRST_LOSS = 3.0
SKEWED_LOSS = 6.0
"""The loss at which a fit to a group begins, over `GROUP_LOSS_PX`; and a skewed view's to all matches."""
COARSER = 0.5
"""Resolution of the first look relative to word scale: where views share much, a quarter of the features do."""
CLEAR_LEAD = 2.0
"""The first look takes only pairs whose largest group has so many times the votes of the next. Rows that repeat
have as many elsewhere, and need all features to be told apart."""
PAIRS_PER_PHOTO = 4
"""Largest number of pairs, per photo, in a look at word scale or finer: up to nine photos all of them, of more
photos those with most votes at half of it. Of 16 photos in four rows, 24 to 42 pairs are neighbours."""
FINER = 1.5
"""Resolution of the third look at unturned views, relative to word scale."""
HOPELESS = 4
"""Of more photos than this, if no two overlap at word scale, upside down or not, none are searched any finer."""
LOOKS = (0, COARSER), (0, 1.0), (2, 1.0), (0, FINER), (2, FINER), (1, 1.0), (3, 1.0)
"""Quarter turns and fineness of the looks."""
QUICK_LOOKS = LOOKS[:2]
"""Those at views that are not turned, none finer than words."""
LARGEST_SCALE = 4.0
"""Largest scale between two views, by their text sizes; text below a quarter can hardly be read."""
RIVAL = 0.5
"""A result is ambiguous if a second place has at least this share of the found blocks. It has about as many votes: a
group that is smaller than one that was verified is not looked at."""
LEAST_OVERLAP = 0.01
"""Least predicted overlap, as a share of the smaller view, that is searched."""
GUIDED_FOUND = 5
"""Least number of found blocks of a predicted pair. It is lower, because such a pair connects no new parts."""
LINES = 1.5
"""Extent of matches perpendicular to the lines, text heights, from which they are not of one line only ..."""
PHRASE = 15.0
"""... and least extent along a single line (about 25 characters) that may connect two parts."""
SURE_AGREEMENT = 0.9
"""Least share of found blocks of a pair by which others are known to lie apart; its matches extend over `LINES`
too. A piece of a line that is printed twice reached 0.73."""
SKEWED_VOTES = 40
"""A group with so many votes, and so many times those of the second largest, ..."""
SKEWED_LEAD = 3.0
"""... that is not verified belongs to a view whose rectification failed (pictures, or too few lines)."""
SKEWED = FitParameters(0.2, 0.3, 0.3, largest_stretch=2.5)
"""Prior for such a view: it was taken at up to 40 degrees from the vertical."""
CONTRADICTION = 4.0
"""Largest difference between a pair and a chain, text heights per photo in between. True pairs differ by less than
one; false ones by at least words or lines."""


def register_photos(
    photos: Sequence[FlatPhoto], looks: Sequence[tuple[int, float]] = LOOKS
) -> tuple[PairRegistration, ...]:
    """All overlapping pairs, independent of the order of `photos`.

    The search starts at half the word scale with the same text direction. Photos in separate parts are then searched at
    word scale, upside down, at a finer scale, and rotated by quarter turns, the most promising pairs only where there
    are many. Pairs whose overlap the graph predicts are matched from there, and after the first look not searched where
    sure pairs predict it.
    A pair that contradicts stronger ones in a loop is dropped. So is a pair that connects two parts by a piece of a
    single line.
    """
    prepared = {photo.index: PreparedPhoto(photo) for photo in photos}
    # Everything below depends on the order of content, not on the order of the upload.
    order = sorted(prepared, key=lambda index: prepared[index].key)
    heights = {index: one.photo.text_height_px for index, one in prepared.items()}
    pairs: dict[tuple[int, int], PairRegistration] = {}
    sure: dict[tuple[int, int], PairRegistration] = {}
    promises: dict[tuple[int, int, int], int] = {}
    for number, (turns, fineness) in enumerate(looks):
        apart = _apart(order, pairs, number)
        if number > 0:
            apart = _promising(apart, prepared, turns, promises)
        # The surest pairs come first: these tell where others lie, and whether they overlap.
        first = {}
        if number == 0:
            first = {(i, j): _vote(prepared[i], prepared[j], turns, fineness) for i, j in apart}
            promises = {(*pair, turns): _promise(each) for pair, each in first.items()}
        for i, j in sorted(apart, key=lambda pair: -promises.get((*pair, turns), 0)):
            if number == 0 and (not _is_clear(first[i, j]) or _are_apart(i, j, sure, order, prepared)):
                continue
            if number > 0 and (i, j) in find_ways(sure, order, [i]):
                continue
            registered = _register(first.get((i, j)) or _vote(prepared[i], prepared[j], turns, fineness))
            if registered is not None:
                pairs[registered.a, registered.b] = registered
                if _is_sure(registered, heights):
                    sure[registered.a, registered.b] = registered
        if len(connect_photos(order, pairs)) == 1:
            break
    pairs = drop_contradictions(pairs, order, heights, CONTRADICTION)
    pairs = drop_lonely_lines(
        pairs,
        order,
        heights,
        LINES,
        PHRASE,
        lambda joined, one, other: _contradicted(joined, one, other, order, prepared),
    )
    for _ in range(2):
        added = dict(_guided(pairs, order, prepared))
        pairs |= added
        if not added:
            break
    pairs = drop_contradictions(pairs, order, heights, CONTRADICTION)
    return tuple(pairs[key] for key in sorted(pairs))


@dataclass(frozen=True, slots=True, eq=False)
class PairCandidate:
    """Two photos, b turned by `turns` quarters, their matches and the groups of compatible ones, surest first."""

    a: PreparedPhoto
    b: PreparedPhoto
    turns: int
    features: tuple[Features, Features]
    matches: FeatureMatches
    groups: tuple[CompatibleGroup, ...]

    @property
    def votes(self) -> list[int]:
        """Sizes of the groups, the largest first."""
        return sorted((group.votes for group in self.groups), reverse=True)


def _vote(a: PreparedPhoto, b: PreparedPhoto, turns: int, fineness: float) -> PairCandidate:
    if b.key < a.key:
        a, b, turns = b, a, -turns % 4
    features = a.features(fineness, 0), b.features(fineness, turns)
    matches = match_features(*features)
    expected = a.photo.text_height_px / max(b.photo.text_height_px, 1e-6)
    expected = float(np.clip(expected, 1 / LARGEST_SCALE, LARGEST_SCALE))
    groups = vote_displacements(matches, float(np.hypot(*a.photo.size)), expected_scale=expected)
    return PairCandidate(a, b, turns, features, matches, groups)


def _apart(order: Sequence[int], pairs: Pairs, number: int) -> list[tuple[int, int]]:
    """The pairs of photos in separate parts that the look `number` searches."""
    part_of = {i: part for part in connect_photos(order, pairs) for i in part}
    apart = [(i, j) for i, j in combinations(order, 2) if part_of[i] != part_of[j]]
    if number > 3:
        # Photos that are already connected had several attempts.
        apart = [(i, j) for i, j in apart if min(len(part_of[i]), len(part_of[j])) == 1]
    is_hopeless = not pairs and len(order) > HOPELESS
    return [] if number > 2 and is_hopeless else apart


def _promise(candidate: PairCandidate) -> int:
    """Votes of the largest group."""
    return max(candidate.votes, default=0)


def _promising(
    apart: list[tuple[int, int]],
    prepared: Mapping[int, PreparedPhoto],
    turns: int,
    promises: Mapping[tuple[int, int, int], int],
) -> list[tuple[int, int]]:
    """The pairs with most votes at half the word scale, as many as may be looked at; their order stays.

    So the work on photos that do not overlap grows with their number, and not with that of their pairs. `promises` has
    the votes of pairs and turns that are known.
    """
    most = PAIRS_PER_PHOTO * len(prepared)
    if len(apart) <= most:
        return apart
    votes = {
        (i, j): promises[i, j, turns]
        if (i, j, turns) in promises
        else _promise(_vote(prepared[i], prepared[j], turns, COARSER))
        for i, j in apart
    }
    least = sorted(votes.values(), reverse=True)[most - 1]
    return [pair for pair in apart if votes[pair] >= least][:most]


def _is_clear(candidate: PairCandidate) -> bool:
    """Whether one displacement has far more votes than any other."""
    most, next_most = (*candidate.votes, 0, 0)[:2]
    return most >= CLEAR_LEAD * next_most


def _is_sure(pair: PairRegistration, heights_px: Mapping[int, float]) -> bool:
    """Whether two photos have more in common than a piece of a line, which may be printed twice."""
    return pair.agreement >= SURE_AGREEMENT and matched_extent(pair, heights_px)[1] >= LINES


def _are_apart(
    i: int, j: int, sure: Pairs, order: Sequence[int], prepared: Mapping[int, PreparedPhoto]
) -> bool:
    """Whether the two photos do not overlap, by the `sure` pairs between them."""
    way = find_ways(sure, order, [i]).get((i, j))
    return way is not None and overlap_fraction(prepared[i].photo, prepared[j].photo, way[1]) < LEAST_OVERLAP


def _register(candidate: PairCandidate) -> PairRegistration | None:
    """Registration of the two photos; None: their overlap is not verified, or another place is as good."""
    a, b, turns = candidate.a, candidate.b, candidate.turns
    groups, matches, votes = candidate.groups, candidate.matches, candidate.votes
    if not groups:
        return None
    H_turned_b = quarter_turn(turns, *b.photo.size)
    features = candidate.features
    loss = GROUP_LOSS_PX / features[0].reduction
    overlaps: list[tuple[CompatibleGroup, Overlap]] = []
    for group in groups:
        if group.votes < RIVAL * max((verified.votes for verified, _ in overlaps), default=0):
            continue
        H_a_turned = _fit_group(group, matches, loss, features[1].width, features[1].height)
        if H_a_turned is not None:
            overlap = verify_overlap(a, b, H_a_turned @ H_turned_b, turns)
            if overlap is not None:
                overlaps.append((group, overlap))
    fit = USUAL
    if not overlaps and votes[0] >= max(SKEWED_VOTES, SKEWED_LEAD * sum(votes[1:2])):
        fit = SKEWED
        group = max(groups, key=lambda group: group.votes)
        H_a_turned = _fit_skewed(group, matches, loss)
        skewed = verify_overlap(a, b, H_a_turned @ H_turned_b, turns, fit=fit)
        overlaps = [(group, skewed)] if skewed else []
    if not overlaps:
        return None
    group, best = max(overlaps, key=lambda one: one[1].found)
    if any(_elsewhere(best, other, b) for _, other in overlaps if other is not best):
        return None
    rival = max((each.votes for each in groups if each is not group), default=0)
    return _refined(a, b, best, (len(matches.points_a), group.votes, rival), fit)


def _fit_group(
    group: CompatibleGroup, matches: FeatureMatches, loss: float, width: int, height: int
) -> Homography | None:
    points_a, points_b = matches.points_a[group.members], matches.points_b[group.members]
    initial = translation(*group.displacement) @ scaling(group.scale)
    H, _ = fit_homography(points_a, points_b, np.ones(group.votes), initial, FIRST_LOSS * loss, loss)
    corners = np.array([[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1]], float)
    return H if is_sane(H, corners, group.scale) else None


def _fit_skewed(group: CompatibleGroup, matches: FeatureMatches, loss: float) -> Homography:
    """A homography with foreshortening, fitted first to the group, then to all matches that agree with it."""
    points_a, points_b = matches.points_a, matches.points_b
    H: Homography = translation(*group.displacement) @ scaling(group.scale)
    for members, first_loss in (
        (group.members, FIRST_LOSS * loss),
        (np.arange(len(points_a)), SKEWED_LOSS * loss),
    ):
        weights = np.ones(len(members))
        H, _ = fit_homography(points_a[members], points_b[members], weights, H, first_loss, loss, SKEWED)
    return H


def _elsewhere(best: Overlap, other: Overlap, b: PreparedPhoto) -> bool:
    """Whether another place is nearly as good."""
    if other.found < RIVAL * best.found:
        return False
    width, height = b.photo.size
    middle = np.array([[(width - 1) / 2, (height - 1) / 2]])
    apart = transform_points(best.H_a_b, middle) - transform_points(other.H_a_b, middle)
    return float(np.linalg.norm(apart)) > CONTRADICTION * b.photo.text_height_px


def _refined(
    a: PreparedPhoto,
    b: PreparedPhoto,
    overlap: Overlap,
    vote: tuple[int, int, int],
    fit: FitParameters = USUAL,
) -> PairRegistration | None:
    """The registration of all found blocks; `vote` has its `matches`, `votes` and `runner_up_votes`."""
    refined = refine_overlap(a, b, overlap, fit)
    if refined is None:
        return None
    H, points_a, points_b, weights = refined
    i, j = a.photo.index, b.photo.index
    if i > j:
        i, j, H, points_a, points_b = j, i, np.linalg.inv(H), points_b, points_a
    return PairRegistration(i, j, H / H[2, 2], points_a, points_b, weights, *vote, overlap.blocks.agreement)


def _guided(
    pairs: Pairs, order: Sequence[int], prepared: Mapping[int, PreparedPhoto]
) -> Iterator[tuple[tuple[int, int], PairRegistration]]:
    """Pairs that were not found, but that overlap according to the other pairs."""
    ways = find_ways(pairs, order)
    for i, j in combinations(order, 2):
        key = min(i, j), max(i, j)
        if key in pairs or (i, j) not in ways:
            continue
        between, H = ways[i, j]
        a, b = prepared[i], prepared[j]
        if overlap_fraction(a.photo, b.photo, H) < LEAST_OVERLAP:
            continue
        turns = _quarter_turns(H, b.photo)
        overlap = verify_overlap(a, b, H, turns, SEARCH * between, least_found=GUIDED_FOUND)
        if overlap is not None:
            refined = _refined(a, b, overlap, (0, 0, 0))
            if refined is not None:
                yield key, refined


def _contradicted(
    pairs: Pairs,
    one: tuple[int, ...],
    other: tuple[int, ...],
    order: Sequence[int],
    prepared: Mapping[int, PreparedPhoto],
) -> bool:
    """Whether photos of two parts show different print where `pairs` predict an overlap."""
    ways = find_ways(pairs, order)
    for i, j in product(one, other):
        between, H = ways[i, j]
        a, b = prepared[i], prepared[j]
        if not between or overlap_fraction(a.photo, b.photo, H) < LEAST_OVERLAP:
            continue
        if shows_otherwise(a, b, H, _quarter_turns(H, b.photo), SEARCH * between):
            return True
    return False


def _quarter_turns(H_a_b: Homography, b: FlatPhoto) -> int:
    """Number of quarters by which b is rotated counter-clockwise on a."""
    width, height = b.size
    x, y = (width - 1) / 2, (height - 1) / 2
    start, end = transform_points(H_a_b, np.array([[x, y], [x + 1, y]]))
    return round(float(np.arctan2(start[1] - end[1], end[0] - start[0])) / (np.pi / 2)) % 4
