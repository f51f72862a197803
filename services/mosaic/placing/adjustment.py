"""Robust global adjustment of all photos over all pairs, so that errors do not accumulate.

The dissertation fits each pair separately (4.3) and adds photo after photo (4.5), so errors accumulate along the chain.
Here they are distributed over all pairs by a bundle of homographies, as for panoramas (Brown and Lowe 2007, section 4).
Residuals are measured in the photos' own pixels, so that neither the world frame nor the root photo affects the result.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree

from services.arrays import Floats, Homography, Vector
from services.geometry.homographies import transform_points
from services.mosaic.placing.frontal_frame import ViewInWorld, agree_on_views
from services.mosaic.placing.homography_bundle import (
    PRIOR_POINTS,
    Bundle,
    BundleSolution,
    FrontalPrior,
    solve_bundle,
    transfer_distances,
)
from services.mosaic.placing.placement import Placement
from services.mosaic.registration.pair_registration import PairRegistration
from services.robust import CAUCHY_WIDTH

OWN_STEPS = 6
"""Steps of the fit of a single pair, which starts at its registration."""
# Lengths are relative to the mean diagonal of the views.
CONTRADICTED_WEIGHT = 0.1
"""Mean weight of matches below which a pair is contradicted: it is off by seven standard deviations."""
CONTRADICTED_RESIDUAL = 0.001
"""Least residual of a contradicted pair, about half a character; a smaller one is only inaccurate."""
LEAST_DEPARTURE = 0.0015
"""Least RMS departure from a similarity, relative to half a diagonal: good rectifications have a pixel or two."""
PRIOR_SHARE = 0.7
"""Factor on the median departure, which also contains match errors: the prior shrinks from pass to pass."""
PRIOR_PASSES = 4
"""Passes that shrink the prior, from a hundredth to the least departure."""
SHRINKING = 0.8
"""Passes end when the prior keeps more than this share of its width."""
SUSPICIOUS_WEIGHT = 0.4
"""Mean weight below which a pair is left out on trial: it is off by three standard deviations."""
MOST_SUSPECTS = 5
"""Largest number of pairs tried in turn; a false pair affects hardly more neighbours."""
TRIAL_STEP_PX = 0.01
"""Convergence of trials, and of passes that shrink the prior: the last solution uses the bundle's own."""
MOST_LEFT_OUT = 3
"""Largest number of pairs left out; pairs are verified before, so false ones are rare."""
GAIN = 0.8
"""A pair is left out if this reduces the total loss to at most this share."""


@dataclass(frozen=True, slots=True)
class AdjustedPair:
    """State of a pair after the adjustment.

    `kept_weight` is the mean of its matches' weights under the robust loss (1: all agree with the other pairs).
    `contradicted`: the other pairs place the two photos differently, so the pair was left out.
    """

    a: int
    b: int
    kept_weight: float
    contradicted: bool


@dataclass(frozen=True, slots=True, eq=False)
class GlobalAdjustment:
    """Photo index -> `H_world_flat`, up to one common homography, and the pairs in their order.

    `deviation_px` is the matches' standard deviation per axis, in pixels of the views' mean resolution.
    """

    H_world_flat: dict[int, Homography]
    pairs: tuple[AdjustedPair, ...]
    deviation_px: float
    converged: bool


def adjust_globally(
    sizes: Mapping[int, tuple[int, int]], pairs: Sequence[PairRegistration]
) -> GlobalAdjustment:
    """Homographies of all photos of a connected component, from all its pairs together.

    The result, up to one common homography, does not depend on the order of photos or pairs. The views are assumed to
    be frontal, except for errors of similar size.

    Parameters
    ----------
    sizes
        Photo index -> width and height of its flat view.
    pairs
        Registrations that connect the photos.
    parameters
        Parameters of the adjustment.

    Raises
    ------
    ValueError
        When the pairs do not connect the photos.
    """
    photos = sorted(sizes)
    if len(photos) == 1:
        return GlobalAdjustment({photos[0]: np.eye(3)}, (), 0.0, True)
    bundle = Bundle.of(photos, sizes, pairs)
    own = np.array([_own_deviation(bundle, k) for k in range(len(pairs))])
    solution, left_out = _without_contradictions(bundle, len(photos), own)
    solution = _as_frontal_as_known(bundle, solution, own, left_out)
    maps = solution.maps
    adjusted = []
    for k, (pair, weight) in enumerate(zip(pairs, solution.weights, strict=True)):
        off = k in _suspects(bundle, solution, CONTRADICTED_WEIGHT)
        adjusted.append(AdjustedPair(pair.a, pair.b, float(weight), bool(off)))
    # The world frame is the view of a photo of the best pair, to about a pixel.
    root = int(bundle.ends[int(np.argmax(bundle.evidence)), 0])
    H_world = np.linalg.inv(maps[root] @ bundle.normalisations[root])
    H_world_flat = {}
    for k, photo in enumerate(photos):
        H = H_world @ maps[k] @ bundle.normalisations[k]
        width, height = sizes[photo]
        H_world_flat[photo] = H / (H[2] @ [(width - 1) / 2, (height - 1) / 2, 1.0])
    return GlobalAdjustment(H_world_flat, tuple(adjusted), solution.deviation_px, solution.converged)


def residual_px(pair: PairRegistration, placement_a: Placement, placement_b: Placement) -> float:
    """RMS distance of a pair's matches, weighted by their confidence, in mosaic pixels."""
    apart = placement_a.to_mosaic(pair.points_a) - placement_b.to_mosaic(pair.points_b)
    total = max(float(pair.weights.sum()), 1e-12)
    return float(np.sqrt((pair.weights * (apart**2).sum(axis=1)).sum() / total))


def _without_contradictions(bundle: Bundle, count: int, own: Vector) -> tuple[BundleSolution, frozenset[int]]:
    """The solution of all pairs, or of all except a few that contradict them, and the set of those.

    With few pairs a false pair can distort the others until the loss alone does not recover. Therefore each
    suspicious pair is left out on trial. It stays out if the loss of all pairs, including its own, then falls clearly.
    """
    left_out: frozenset[int] = frozenset()
    best = solve_bundle(bundle, _chain(bundle, count, left_out), own, left_out)
    for _ in range(MOST_LEFT_OUT):
        suspects = [k for k in _suspects(bundle, best, SUSPICIOUS_WEIGHT) if k not in left_out]
        trials = []
        for k in suspects[:MOST_SUSPECTS]:
            without = left_out | {k}
            if _connected(bundle, count, without):
                start = _chain(bundle, count, without)
                trials.append((solve_bundle(bundle, start, own, without, step_px=TRIAL_STEP_PX), without))
        if not trials:
            break
        deviation = min(solution.deviation_px for solution, _ in trials)
        widths = CAUCHY_WIDTH * np.maximum(own, min(deviation, best.deviation_px))
        losses = [_disagreement(bundle, solution.maps, widths) for solution, _ in trials]
        if min(losses) > GAIN * _disagreement(bundle, best.maps, widths):
            break
        best, left_out = trials[int(np.argmin(losses))]
    if left_out:
        best = solve_bundle(bundle, best.maps, own, left_out)
    return best, left_out


def _as_frontal_as_known(
    bundle: Bundle, solution: BundleSolution, own: Vector, left_out: frozenset[int]
) -> BundleSolution:
    """The solution with a prior on the views' rectifications in addition to the matches.

    Matches in a narrow strip determine the foreshortening of both views poorly: a hundredth of a pixel in the strip is
    several pixels at the far end. The knowledge that all views are nearly frontal determines it well enough. The width
    of this prior is estimated from the views (empirical Bayes). It has little effect where views are not frontal, or
    where matches determine the result.
    """
    points = PRIOR_POINTS[:, 0] + 1j * PRIOR_POINTS[:, 1]
    expected, prior = np.inf, None
    for _ in range(PRIOR_PASSES):
        views = [ViewInWorld(points, transform_points(A, PRIOR_POINTS), 1.0) for A in solution.maps]
        agreed = agree_on_views(views, np.full(len(views), 1 / len(views)))
        usual = max(PRIOR_SHARE * float(np.median(agreed.departures)), LEAST_DEPARTURE)
        if usual > SHRINKING * expected:
            break
        expected = usual
        # A view with a larger departure than the others gets a wider prior.
        prior = FrontalPrior(usual / np.sqrt(np.maximum(agreed.trust / agreed.trust.max(), 1e-12)))
        start = agreed.H_frontal_world @ solution.maps
        solution = solve_bundle(bundle, start, own, left_out, prior, step_px=TRIAL_STEP_PX)
    return solution if prior is None else solve_bundle(bundle, solution.maps, own, left_out, prior)


def _disagreement(bundle: Bundle, maps: Floats, widths: Vector) -> float:
    """Cauchy loss of all pairs. Matches of one pair are right or wrong together, so n of them count as sqrt(n)."""
    distances = transfer_distances(bundle, maps)
    losses = bundle.confidences * np.log1p((distances / widths[bundle.pair]) ** 2)
    return sum(float(each.sum() / np.sqrt(len(each))) for each in bundle.of_pairs(losses))


def _suspects(bundle: Bundle, solution: BundleSolution, weight: float) -> list[int]:
    """Pairs with a weight below `weight` and a visible residual, the smallest weight first."""
    order = np.argsort(solution.weights, kind="stable")
    far = CONTRADICTED_RESIDUAL * bundle.diagonal
    return [int(k) for k in order if solution.weights[k] < weight and solution.medians[k] > far]


def _graph(bundle: Bundle, count: int, left_out: frozenset[int]) -> csr_array:
    """Graph (count, count) of the photos with the pairs that are not left out; more evidence gives a shorter edge."""
    kept = np.array([k not in left_out for k in range(len(bundle.ends))])
    lengths = 1.0 / (1.0 + bundle.evidence[kept])
    return csr_array((lengths, tuple(bundle.ends[kept].T)), shape=(count, count))


def _connected(bundle: Bundle, count: int, left_out: frozenset[int]) -> bool:
    return int(connected_components(_graph(bundle, count, left_out), directed=False)[0]) == 1


def _chain(bundle: Bundle, count: int, left_out: frozenset[int]) -> Floats:
    """Initial maps (count, 3, 3) along the spanning tree of the strongest evidence."""
    tree = minimum_spanning_tree(_graph(bundle, count, left_out))
    root = int(bundle.ends[int(np.argmax(bundle.evidence)), 0])
    order, parents = breadth_first_order(tree, root, directed=False)
    if len(order) < count:
        raise ValueError("the pairs do not connect the photos")
    between = dict(zip(map(tuple, bundle.ends.tolist()), bundle.initial, strict=True))
    maps = np.tile(np.eye(3), (count, 1, 1))
    for k in order[1:]:
        parent = int(parents[k])
        M = between[parent, k] if (parent, k) in between else np.linalg.inv(between[k, parent])
        maps[k] = maps[parent] @ M
        maps[k] /= np.linalg.norm(maps[k])
    return maps


def _own_deviation(bundle: Bundle, k: int) -> float:
    """Standard deviation of a pair's matches from its own best homography, common pixels."""
    maps = np.tile(np.eye(3), (len(bundle.units), 1, 1))
    maps[bundle.ends[k, 1]] = bundle.initial[k]
    return solve_bundle(bundle.only(k), maps, np.zeros(1), most_steps=OWN_STEPS).deviation_px
