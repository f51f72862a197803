"""How probable another grouping of lines is: a zone cut in two, or two neighbours with different labels joined.

Let D be the lines of a page, G a grouping of them into zones, L labels of these. The costs of a match are log
likelihood ratios of zones against zones of any page (`model.cost`), so

    log P(G, L | D) = log P(G | D) - cost(G, L) + constant,

where P(G | D) is what print alone says: one factor for each space between neighbouring lines, cut or not. Every
grouping accounts for every line, so groupings compare by the costs of whole pages, whatever their numbers of zones.

Two things keep costs from being log likelihoods. Attributes say the same thing several times over, so differences are
too large. And zones of any page are taken as independent, but both parts of a block lie where the block lies, so one
more zone is explained for nothing: it must gain at least what zones of the page cost in the mean. So the odds are a
logistic regression on these gains and on the print at the space.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import logit

from services.layout.model.layout_model import PieceStatistics
from services.layout.segmentation import Line

_MOST_GAP = 3.0
_MOST_EDGE = 5.0
_MOST_END = 20.0
_MOST_STEP = 0.4
_MOST_CENTRE = 10.0


SPACE_FEATURES = ("gap", "left-edges", "early-end", "size-step", "centres", "after-first", "before-last")
"""What is measured of the space between two lines of a zone; `measure_space` has their order."""

CUT_WEIGHTS = (0.0, 0.27, 0.157, 12.1, 0.59, 0.92, 2.03)
CUT_GAIN, CUT_APART, CUT_CONSTANT = 0.32, 0.6, -9.5
"""Log odds of a cut: by `SPACE_FEATURES`, by gain, and by what one label for both parts would cost more.

The constant is -5.5 among spaces of which as many are cuts as not; few zones are wrongly whole, one space in a
hundred, so it is 4 less."""

JOIN_WEIGHTS = (-1.64, 0.0, -0.074, 0.0, 0.0, 0.0, 0.0)
JOIN_GAIN, JOIN_CONSTANT = 0.7, 3.4
"""The same of a join. A wrong one hides two right zones, a missing one leaves two pieces: its odds must be e^2."""


USUAL_MERGED = 0.02
"""Share of the zones that segmentation puts in one zone with one of another label: 0.5 to 2.2 % in five sets."""
MERGED_ZONES = 1.0
"""As if so many zones had been seen with the usual share."""


def merged_share(label: PieceStatistics) -> float:
    """Share of the zones of a label that segmentation merges with others, by what the class has seen of them."""
    known = label.merged + MERGED_ZONES * USUAL_MERGED
    return known / (label.merged + label.apart + MERGED_ZONES)


def merged_log_odds(parts: Iterable[PieceStatistics]) -> float:
    """Log odds, beyond the usual ones, that zones of these labels are merged.

    It is that of the label that is merged least; 0 where one was never merged: that it is rare is known.
    """
    usual = float(logit(USUAL_MERGED))
    learned = (max(0.0, float(logit(merged_share(each))) - usual) if each.merged else 0.0 for each in parts)
    return min(learned, default=0.0)


def measure_space(lines: Sequence[Line], at: int) -> NDArray[np.float64]:
    """`SPACE_FEATURES` of the space before line `at` of a zone of at least two lines, from the top down."""

    above, below = lines[at - 1], lines[at]
    em = max(above.em, below.em)
    centres = abs(above.box[0] + above.box[2] - below.box[0] - below.box[2]) / 2
    return np.array(
        [
            min((below.baseline - above.baseline) / em, _MOST_GAP),
            min(abs(below.box[0] - above.box[0]) / em, _MOST_EDGE),
            min((max(line.box[2] for line in lines) - above.box[2]) / em, _MOST_END),
            min(abs(float(np.log(above.em / below.em))), _MOST_STEP),
            np.log1p(min(centres / em, _MOST_CENTRE)),
            float(at == 1),
            float(at == len(lines) - 1),
        ]
    )


def cut_log_odds(gain: float, mean_cost: float, apart: float, space: NDArray[np.float64]) -> float:
    """Log odds that a zone is two zones with different labels.

    Parameters
    ----------
    gain
        By how much the page costs less with the cut.
    mean_cost
        Of the page's zones before the cut; usually negative.
    apart
        By how much the cut page costs more if both parts have one label.
    space
        `SPACE_FEATURES` at the cut.
    """
    odds = CUT_GAIN * (gain + mean_cost) + CUT_APART * apart + float(space @ CUT_WEIGHTS) + CUT_CONSTANT
    return odds


def join_log_odds(gain: float, space: NDArray[np.float64]) -> float:
    """Log odds that two neighbours with different labels are one zone; `gain` as in `cut_log_odds`."""
    return JOIN_GAIN * gain + float(space @ JOIN_WEIGHTS) + JOIN_CONSTANT
