"""Type that leans: strokes of italics stand aslant on a sheet that is not.

On a sheet, bent or not, the directions of strokes change smoothly from place to place. Where a page has upright and
leaning type and is seen nearly from the front, they have two values, with nothing between.
"""

import numpy as np

from services.arrays import Floats, Vector
from services.robust import robust_scale
from services.texture_flow.field import FlowSamples

GAP_RAD = np.deg2rad(5.0)
"""Between the directions of two kinds of type. Italics lean by 8 to 20 degrees."""
SURE = 0.3
"""Weight of samples between which there must be the gap: windows that hold both kinds lie in it, with little weight."""
FEWEST = 12
"""Samples of each kind."""


def upright_type(samples: FlowSamples, lean_rad: Vector) -> FlowSamples:
    """The samples (N), those of leaning type turned by its lean; as they are where there are no two kinds of type.

    `lean_rad` (N,) is their angle to the perpendicular of their text line. Type leans to its right, whichever way up it
    is.
    """
    sure = samples.weights >= SURE
    between = np.sort(lean_rad[sure])[FEWEST - 1 : 1 - FEWEST]
    gaps = np.diff(between)
    if not len(gaps) or gaps.max() < GAP_RAD:
        return samples
    below = int(np.argmax(gaps))
    leaning = lean_rad > 0.5 * (between[below] + between[below + 1])
    lean = lean_rad[sure]
    x, y = (samples.points[sure] - samples.points[sure].mean(axis=0)).T
    level = np.column_stack([np.ones_like(x), x, y])
    stepped, smooth = np.column_stack([level, leaning[sure]]), np.column_stack([level, x * x, x * y, y * y])
    by_step = _best(stepped, lean)
    if robust_scale(lean - stepped @ by_step) > robust_scale(lean - smooth @ _best(smooth, lean)):
        return samples
    return FlowSamples(samples.points, samples.angles - by_step[-1] * leaning, samples.weights)


def _best(terms: Floats, values: Vector) -> Vector:
    """Coefficients (P,) of `terms` (N, P) for `values` (N,) by least squares."""
    return np.asarray(np.linalg.lstsq(terms, values, rcond=None)[0])
