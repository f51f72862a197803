"""Registration of two flat views, and the evidence for it."""

from dataclasses import dataclass

from services.arrays import Homography, Points, Vector


@dataclass(frozen=True, slots=True, eq=False)
class PairRegistration:
    """Two photos, indices `a` < `b`, with a verified overlap.

    Attributes
    ----------
    H_a_b : flat pixels of b -> flat pixels of a (with a quarter turn where the views differ by one).
    points_a, points_b : (N, 2) matched points, flat pixels, dense over the overlap, to a fraction of a pixel.
    weights : (N,) confidence of each match, 0-1.
    matches, votes, runner_up_votes : candidate matches, and the sizes of the two largest compatible groups (4.3).
    agreement : share of the text blocks in the overlap that were found where `H_a_b` predicts them, 0-1.
    """

    a: int
    b: int
    H_a_b: Homography
    points_a: Points
    points_b: Points
    weights: Vector
    matches: int
    votes: int
    runner_up_votes: int
    agreement: float
