"""Groups of items that links lead through, each link between two of them."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Indices = NDArray[np.intp]


def group_linked(count: int, first: Indices, second: Indices) -> Indices:
    """Numbers (count,) of the connected groups of items, numbered from 0, by links (M,) of `first` and `second`."""
    links = coo_array((np.ones(len(first), dtype=np.int8), (first, second)), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.intp)
