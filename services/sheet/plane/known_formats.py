"""The aspect of a sheet by the formats that paper has, where a photo does not show the focal length.

Four sides whose vanishing points are not both seen leave a curve: every focal length has its aspect. A format on this
curve needs one focal length, which is more or less likely. So the formats and "some other aspect" are hypotheses, and
each is weighed by how much of the focal length's prior, and of what the sides themselves say of it, lies at its aspect.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from services.arrays import Floats, Vector
from services.geometry.focal_prior import FocalPrior
from services.geometry.planar import PagePlane
from services.sheet.plane.straight_lines import HELD, StraightLines, fit_line_plane, sheet_aspect

SHARES: tuple[tuple[str, float, float], ...] = (
    ("a4", 210 / 297, 0.42),
    ("letter", 215.9 / 279.4, 0.18),
    ("legal", 215.9 / 355.6, 0.05),
    ("bank card", 53.98 / 85.6, 0.04),
    ("business card", 55 / 85, 0.03),
    ("business card (US)", 2 / 3.5, 0.03),
)
"""Formats (A4 stands for the A and B series), their short side over the long one, and their shares of all sheets, which
are assumed. The rest, a quarter, has some other aspect: books, photos, receipts."""
OTHER_SHARE = 1.0 - sum(share for _, _, share in SHARES)
OTHER_RANGE = 2 * math.log(3.0)
"""Other sheets are up to three times as long as wide, upright or not: the range of the logarithm of their aspect."""
NODES, REACH = 7, 3.0
"""Focal lengths at which the sides are fitted, and how far these reach, in deviations of the prior."""
STEPS = 601
"""Focal lengths to which the curves are interpolated: steps of 0.0025 in the logarithm."""


# When a format decides.
CUT = 0.002
"""Deviation of the logarithm of a sheet's aspect from that of its format: 0.4 mm on A4."""
CLEAR_PROBABILITY = 0.7
"""Probability from which on a format is taken: of simulated sheets of a format, nine in ten are then those of this
one, of less probable ones three in ten."""


@dataclass(frozen=True, slots=True, eq=False)
class AspectBelief:
    """What four sides, the prior of the focal length and the formats say of the logarithm of a sheet's aspect.

    `name` is the most probable format, with its `probability`; `prior` is the focal length that it needs, None where
    it is not clear. `log_aspects` (N,) are possible values with their `probabilities` (N,).
    """

    name: str
    probability: float
    prior: FocalPrior | None
    log_aspects: Vector
    probabilities: Vector

    def deviation_about(self, log_aspect: float) -> float:
        """Half the distance from `log_aspect` within which 95 % of the probability lies.

        The root of the mean square would be less where one value is likely and the others are far.
        """
        off = np.abs(self.log_aspects - log_aspect)
        order = np.argsort(off)
        within = np.searchsorted(np.cumsum(self.probabilities[order]), 0.95)
        return float(off[order[min(int(within), len(off) - 1)]]) / 2


def weigh_formats(
    lines: StraightLines, prior: FocalPrior, start: PagePlane, noise: float
) -> AspectBelief | None:
    """What the formats say of the sheet between the four `lines`; None where most focal lengths fit no rectangle.

    Parameters
    ----------
    lines
        The sides, two along each axis.
    prior
        Of the focal length.
    start
        Plane of the sides.
    noise
        Deviation of the logarithm of the aspect under a known focal length.
    """
    curve = _curve(lines, prior, start)
    if curve is None:
        return None
    log_focals, log_aspects, weights = curve
    # Sheets of a format lie upright or not, one as often as the other.
    names = [name for name, _, _ in SHARES] * 2
    upright = np.log([aspect for _, aspect, _ in SHARES])
    formats = np.concatenate([upright, -upright])[:, None]
    shares = np.array([share / 2 for _, _, share in SHARES] * 2)[:, None]
    # The likelihood of each focal length, under each format (rows) and under any other aspect (last row).
    of_formats = shares * weights * _normal(log_aspects - formats, math.hypot(noise, CUT))
    joint = np.vstack([of_formats, OTHER_SHARE / OTHER_RANGE * weights])
    joint /= joint.sum()
    likely = int(np.argmax(joint[:-1].sum(axis=1)))
    probability = float(joint[likely].sum())
    needed = None
    if probability >= CLEAR_PROBABILITY:
        middle = float(joint[likely] @ log_focals) / probability
        variance = float(joint[likely] @ (log_focals - middle) ** 2) / probability
        needed = FocalPrior(middle, math.sqrt(variance), prior.source, prior.of_diagonal)
    values = np.vstack([np.broadcast_to(formats, of_formats.shape), log_aspects])
    return AspectBelief(names[likely], probability, needed, values.ravel(), joint.ravel())


def _normal(off: Floats, deviation: float) -> Floats:
    """Density of a normal distribution at `off` from its mean."""
    return np.asarray(np.exp(-0.5 * (off / deviation) ** 2) / (deviation * math.sqrt(2 * math.pi)))


def _curve(lines: StraightLines, prior: FocalPrior, start: PagePlane) -> tuple[Vector, Vector, Vector] | None:
    """Logarithms of focal lengths (N,) and of the aspects (N,) that they give, and their likelihoods (N,)."""
    nodes = prior.log_focal + prior.deviation * np.linspace(-REACH, REACH, NODES)
    aspects, costs = np.full(NODES, np.nan), np.full(NODES, np.nan)
    first = int(np.argmin(np.abs(nodes - math.log(start.focal))))
    for way in (range(first, NODES), range(first - 1, -1, -1)):
        rotation = start.rotation
        for k in way:
            held = FocalPrior(float(nodes[k]), HELD, prior.source)
            fit = fit_line_plane(lines, held, PagePlane(rotation, math.exp(nodes[k])))
            aspect, rotation = sheet_aspect(fit.plane, lines), fit.plane.rotation
            costs[k] = fit.cost
            if aspect is not None and aspect > 0:
                aspects[k] = math.log(aspect)
    known = np.isfinite(aspects)
    if 2 * known.sum() <= NODES:
        return None
    log_focals = np.linspace(nodes[known].min(), nodes[known].max(), STEPS)
    cost = CubicSpline(nodes[known], costs[known])(log_focals)
    off = (log_focals - prior.log_focal) / prior.deviation
    weights = np.exp(-0.5 * (cost - cost.min() + off**2))
    return log_focals, CubicSpline(nodes[known], aspects[known])(log_focals), weights
