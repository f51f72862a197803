"""Which samples are held out in turn: evenly from all, as many as the work on them allows."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def choose_evenly(work: Sequence[float], most: int, most_work: float) -> NDArray[np.intp]:
    """Indices, rising, of at most `most` samples whose `work` is at most `most_work` together; of one at least.

    They are spread evenly over all, so that they do not depend on which samples came first.
    """
    each = np.asarray(work, dtype=np.float64)
    count = min(len(each), most)
    while True:
        chosen = np.unique(np.linspace(0, len(each) - 1, count).astype(np.intp))
        needed = each[chosen].sum()
        if count <= 1 or needed <= most_work:
            return chosen
        count = max(1, min(count - 1, int(count * most_work / needed)))
