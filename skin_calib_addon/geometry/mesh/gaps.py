"""Close gaps of rounding: corners of faces that nearly coincide with those of the adjacent face."""

import numpy as np
from scipy.spatial import cKDTree

from ...common.arrays import Array, BoolArray, IntArray, norms
from ..components import components

# [1] of twice the median distance from the middle of a mesh, the widest gap that is closed. Larger: thin gaps between
# parts are closed. Smaller: some meshes have no connected faces, and these count as parts inside.
MAX_GAP = 1e-5
# [fraction of the edges] that closing must join. Larger: more meshes keep their gaps. Smaller: single cracks, which
# change no surface, change the mesh of existing plans.
MIN_JOINED = 0.05


def closed(vertices: Array, faces: IntArray, on_rim: BoolArray) -> Array:
    """Return vertices (v, 3), moved to near ones where this joins edges with one face; ``on_rim`` (v,) has the ends.

    A gap stays open if a face would lose its area, or an edge would have more than two faces; all stay if they are few.
    """
    rim = np.flatnonzero(on_rim)
    gap = 2 * MAX_GAP * np.median(norms(vertices - np.median(vertices, axis=0)))
    near = cKDTree(vertices[rim]).query_pairs(gap, output_type="ndarray") if len(rim) else np.zeros((0, 2), int)
    if not len(near):
        return vertices
    _, first, cluster = np.unique(components(len(rim), *near.T), return_index=True, return_inverse=True)
    to = np.arange(len(vertices))
    to[rim] = rim[first[cluster]]
    before, after = (np.sort(np.stack((f, np.roll(f, -1, axis=1)), axis=2).reshape(-1, 2)) for f in (faces, to[faces]))
    _, edge, count = np.unique(before @ (len(vertices), 1), return_inverse=True, return_counts=True)
    _, joined, total = np.unique(after @ (len(vertices), 1), return_inverse=True, return_counts=True)
    joins = (count[edge] == 1) & (total[joined] == 2)
    if joins.mean() < MIN_JOINED:
        return vertices
    spoils = (after[:, 0] == after[:, 1]) | (total[joined] > 2) & (total[joined] > count[edge])
    good = np.isin(to, after[joins]) & ~np.isin(to, after[spoils])
    return vertices[np.where(good, to, np.arange(len(to)))]
