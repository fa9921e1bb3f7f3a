"""Planes of rigid boards with several taxels, from the positions of imported taxels."""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..common.arrays import Array, IntArray, unit

# Distance from its plane up to which a taxel is on a flat board [m]: positions of files have six decimals. Nine taxels
# of a square at a pitch of 6.5 mm are deeper if the radius is below 1 m. Larger: bent sheets count as boards.
FLAT_TOLERANCE = 1e-5
# Least number of taxels whose plane is found from positions alone. Derived: five points are always on a conic.
MIN_FOUND_TAXELS = 6
# Least number of taxels of a board that the file states. Derived: three points are always in a plane.
MIN_STATED_TAXELS = 4
# Smallest relative deviation from every line and conic. A plane meets cylinders, cones and spheres in conics. Taxels of
# a sheet bent over them can be in a plane, too, but only on one. Larger: finds fewer boards, above all narrow ones.
MIN_CONIC_DEVIATION = 0.02
NEAREST_TAXELS = 12  # taxels near a taxel that give the planes to try. Larger: a safer search, slower
JOINED_PITCHES = 1.7  # distance of taxels of one board, in distances to the nearest one. Larger: joins distant taxels


def board_planes(positions: Array, boards: IntArray | None = None) -> tuple[IntArray, Array]:
    """Return the board (n,) of each taxel, -1 without one, and the unit normal (n, 3) of its plane, of either sign.

    A board is a group that the file states, if its taxels are in a plane. Without such groups, it is a set of adjacent
    taxels in a plane that are on no conic: a flexible sheet has such sets only where it is flat.
    """
    groups = _found(positions) if boards is None else [np.flatnonzero(boards == k) for k in np.unique(boards)]
    least = MIN_FOUND_TAXELS if boards is None else MIN_STATED_TAXELS
    board, normals, nearest = (
        np.full(len(positions), -1),
        np.zeros((len(positions), 3)),
        np.full(len(positions), np.inf),
    )
    for number, members in enumerate(groups):
        plane = None if len(members) < least else _plane(positions[members])
        if plane is None or _on_conic(positions[members], plane[1]):
            continue
        # A taxel on the line where two planes meet belongs to the nearer board.
        away = np.linalg.norm(positions[members] - plane[0], axis=1)
        nearer = members[away < nearest[members]]
        nearest[nearer] = away[away < nearest[members]]
        board[nearer], normals[nearer] = number, plane[1]
    return board, normals


def _plane(points: Array) -> tuple[Array, Array] | None:
    """Return centre and normal of the plane of points; None if they are not flat, or on a line."""
    centre = points.mean(axis=0)
    _, extent, axes = np.linalg.svd(points - centre, full_matrices=False)
    if extent[1] < MIN_CONIC_DEVIATION * extent[0] or np.abs((points - centre) @ axes[2]).max() > FLAT_TOLERANCE:
        return None
    return centre, axes[2]


def _found(positions: Array) -> list[IntArray]:
    """Return the sets of adjacent taxels in a plane that are on no conic."""
    _, first = np.unique(np.round(positions / FLAT_TOLERANCE), axis=0, return_index=True)
    chosen = np.sort(first)  # one taxel for each position
    points = positions[chosen]
    if len(points) < MIN_FOUND_TAXELS:
        return []
    tree = cKDTree(points)
    count = min(NEAREST_TAXELS + 1, len(points))
    distance, near = map(np.asarray, tree.query(points, k=np.arange(1, count + 1)))
    joined = JOINED_PITCHES * np.median(distance[:, 1])
    pairs = tree.query_pairs(joined, output_type="ndarray")
    adjacent = csr_array((np.ones(len(pairs)), pairs.T), (len(points), len(points)))
    a, b = (1 + k for k in np.triu_indices(count - 1, 1))
    groups: dict[bytes, IntArray] = {}
    is_done = np.zeros(len(points), bool)
    for i in range(len(points)):
        if is_done[i]:
            continue
        arms = points[near[i]] - points[i]
        normals = unit(np.cross(arms[a], arms[b]))
        within = np.abs(arms @ normals.T) <= FLAT_TOLERANCE
        within[:, ~normals.any(axis=1)] = False
        within = within[:, np.sort(np.unique(within, axis=1, return_index=True)[1])]  # of equal ones the first
        for column in np.argsort(-within.sum(axis=0), kind="stable"):
            if within[:, column].sum() < MIN_FOUND_TAXELS:
                break
            members = _connected(adjacent, near[i][within[:, column]], i)
            plane = _plane(points[members]) if len(members) >= MIN_FOUND_TAXELS else None
            if plane is None:
                continue
            flat = np.abs((points - plane[0]) @ plane[1]) <= FLAT_TOLERANCE
            members = _connected(adjacent, np.flatnonzero(flat), i) if flat[i] else members
            plane = _plane(points[members]) if len(members) >= MIN_FOUND_TAXELS else None
            if plane is not None and not _on_conic(points[members], plane[1]):
                groups[members.tobytes()] = members
                is_done[members] = True
                break
    # The largest sets first: a set that others have for the most part is no board of its own.
    result: list[IntArray] = []
    is_taken = np.zeros(len(points), bool)
    for members in sorted(groups.values(), key=len, reverse=True):
        if 2 * np.count_nonzero(is_taken[members]) <= len(members):
            result.append(members)
            is_taken[members] = True
    inverse = np.asarray(tree.query(positions)[1])
    return [np.flatnonzero(np.isin(inverse, members)) for members in result]


def _connected(adjacent: csr_array, members: IntArray, start: int) -> IntArray:
    """Return the members that adjacent members connect with a start, in ascending order."""
    members = np.unique(np.append(members, start))
    group = connected_components(adjacent[members][:, members], directed=False)[1]
    return members[group == group[np.searchsorted(members, start)]]


def _on_conic(points: Array, normal: Array) -> bool:
    r"""Return whether six or more points (n, 3) in a plane are on a conic.

    The least singular value of the matrix with the rows :math:`(x^2, x y, y^2, x, y, 1)`, in units of the extent, is
    zero on a conic.
    """
    if len(points) < MIN_FOUND_TAXELS:  # always on one
        return False
    arms = points - points.mean(axis=0)
    x_axis = unit(arms[np.linalg.norm(arms, axis=1).argmax()])
    flat = np.column_stack((arms @ x_axis, arms @ np.cross(normal, x_axis)))
    x, y = (flat / np.sqrt((flat**2).mean(axis=0))).T
    rows = np.column_stack((x * x, x * y, y * y, x, y, np.ones(len(x))))
    return float(np.linalg.svd(rows, compute_uv=False)[-1]) < MIN_CONIC_DEVIATION * np.sqrt(len(x))
