"""Overlaps of boards in space, and the largest set of boards without one."""

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from ...common.arrays import Array, BoolArray, IntArray, unit
from ..lattice import ROUNDING, HexLattice

# [1] Depth of an overlap, and protrusion over an edge, that count as touching, in sides of a board. Larger: boards
# overlap and protrude (half: 54, double: 57 instead of 55 boards on four links of the G1).
TOUCH = 1e-3


def overlapping(
    positions: Array, normals: Array, tangents: Array, lattice: HexLattice, half: float
) -> tuple[IntArray, Array, Array]:
    """Return the pairs of boards that overlap, by the separating axis theorem for prisms.

    Two prisms are apart if their shadows on the plane between them are. Boards on two sides of a thin part face away
    from each other; there the prisms themselves are compared. Trimmed boards have the width of the pitch.
    """
    pairs = cKDTree(positions).query_pairs(2 * (lattice.side + half), output_type="ndarray")
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    i, j = pairs.T
    size = min(1.0, lattice.pitch / (np.sqrt(3) * lattice.side))
    frames = np.stack((tangents, np.cross(normals, tangents)), axis=1)
    corners = size * lattice.corners[:3] @ frames  # the other three are opposite
    sides = np.stack((corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 1], corners[:, 0] + corners[:, 2]), 1)
    sides_of_both, both_normals = np.concatenate((sides[i], sides[j]), axis=1), np.stack((normals[i], normals[j]), 1)
    middle = unit(normals[i] + normals[j])[:, None]
    shadows = np.cross(middle, np.concatenate((sides_of_both, both_normals), axis=1))
    solids = np.concatenate((np.cross(np.repeat(both_normals, 3, axis=1), sides_of_both), both_normals), axis=1)
    face_alike = (normals[i] * normals[j]).sum(axis=1) > 0
    axes = np.where(face_alike[:, None, None], shadows, solids)
    has_length = np.linalg.norm(axes, axis=2) > ROUNDING * lattice.side
    axes = unit(axes)
    extents = [
        np.abs(axes @ corners[k].swapaxes(1, 2)).max(axis=2) + half * np.abs((axes @ normals[k][..., None])[..., 0])
        for k in (i, j)
    ]
    along = (axes @ (positions[j] - positions[i])[..., None])[..., 0]
    gaps = np.where(has_length, np.abs(along) - extents[0] - extents[1], -np.inf)
    row, best = np.arange(len(pairs)), gaps.argmax(axis=1)
    deep = gaps[row, best] < -TOUCH * lattice.side
    away = np.where(along[row, best] < 0, -1.0, 1.0)[:, None] * axes[row, best]
    return pairs[deep], -gaps[row, best][deep], away[deep]


def largest_apart(count: int, conflicts: IntArray) -> BoolArray:
    """Return a largest set of boards without conflicts, shape (count,); the first boards are preferred."""
    kept = np.ones(count, bool)
    if len(conflicts):
        from scipy.optimize import Bounds, LinearConstraint, milp  # the import takes .1 s, and conflicts are rare

        which, pairs = np.unique(conflicts, return_inverse=True)
        rows = csr_array((np.ones(pairs.size), (np.repeat(np.arange(len(conflicts)), 2), pairs.ravel())))
        # All preferences together are less than one board. Sums of roots differ, so that the best set is unique.
        preference = np.sqrt(np.arange(len(which), 0, -1)) / (2 * len(which) ** 1.5)
        found = milp(
            -1 - preference,
            integrality=np.ones(len(which), np.int64),
            bounds=Bounds(0, 1),
            constraints=LinearConstraint(rows, ub=1),
            options={"mip_rel_gap": 0.0},
        )
        assert found.x is not None  # no board at all is always a solution
        kept[which] = found.x > 0.5
    return kept
