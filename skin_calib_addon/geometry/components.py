"""Connected components of graphs."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..common.arrays import IntArray


def components(nodes: int, first: IntArray, second: IntArray) -> IntArray:
    """Return the number of the component of each node, shape (nodes,); they count from 0."""
    graph = coo_array((np.ones(len(first)), (first, second)), shape=(nodes, nodes))
    return connected_components(graph, directed=False)[1].astype(np.int64)
