"""Clustering of similar models by the distributions of their zones' attributes."""

from collections.abc import Sequence
from math import ceil, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage

from services.layout.graph.node_attributes import NUMERIC_ATTRIBUTES
from services.layout.model.compiled_model import CompiledModel
from services.layout.model.layout_model import LayoutModel

MOST_CLUSTERED = 2000
"""Models that are compared with each other (the distances have 16 MB); more join the nearest group."""

LEAST_WEIGHT = 0.001
"""Zones that a node counts as at least, so that a model of none has a likeness too."""

FARTHEST = 10.0
"""Deviations of any page's zones that a mean may lie away; a model from elsewhere may hold any number."""


def describe_likeness(model: LayoutModel, compiled: CompiledModel) -> NDArray[np.float64]:
    """The model's zones in numbers (2 A + C,): means and log deviations of attributes, roots of content frequencies.

    In units of the deviations that attributes have over zones of any page. What the model does not know is as on any
    page. Labels have no part in it: those of other people's models may have other names.
    """
    zones = np.array([node.zones for node in model.nodes]) + LEAST_WEIGHT
    zones /= zones.sum()
    background = np.array([attribute.background for attribute in NUMERIC_ATTRIBUTES])
    known = np.isfinite(compiled.values)
    weights = zones[:, None] * known
    total = weights.sum(axis=0)
    weights = np.divide(weights, total, out=np.zeros_like(weights), where=total > 0)
    values = np.where(known, (compiled.values - background[:, 0]) / background[:, 1], 0.0)
    values = np.clip(values, -FARTHEST, FARTHEST)
    mean = (weights * values).sum(axis=0)
    spread = (weights * (values - mean) ** 2).sum(axis=0)
    deviation = np.where(total > 0, 0.5 * np.log(spread + 0.001), 0.0)
    features = np.isfinite(compiled.content)
    content = (zones[:, None] * np.where(features, compiled.content, 0.0)).sum(axis=0)
    return np.concatenate([mean, deviation, 2 * np.sqrt(content)])


def group_alike(likenesses: Sequence[NDArray[np.float64]]) -> NDArray[np.intp]:
    """Group (M,) of each of M models, numbered from 0: about sqrt(M) groups, in which two steps down are shortest.

    Groups grow by Ward's criterion, the least variance within. The order of the models may change the numbers of the
    groups, and where distances are equal their members.
    """
    points = np.asarray(likenesses)
    if len(points) < 2:
        return np.zeros(len(points), np.intp)
    compared = points[:MOST_CLUSTERED]
    groups = fcluster(linkage(compared, "ward"), ceil(sqrt(len(points))), "maxclust") - 1
    if len(points) == len(compared):
        return np.asarray(groups, np.intp)
    centres = np.stack([compared[groups == group].mean(axis=0) for group in range(groups.max() + 1)])
    rest = points[MOST_CLUSTERED:]
    squares = (rest**2).sum(axis=1)[:, None] - 2 * rest @ centres.T + (centres**2).sum(axis=1)
    return np.concatenate([groups, squares.argmin(axis=1)]).astype(np.intp)
