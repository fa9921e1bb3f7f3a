"""Overlaps between the cells of different skins on a link."""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial import cKDTree

from ..calibration.model import Patch
from ..common.arrays import Array, unit
from ..common.errors import listed
from ..common.warnings import Place, Warning, point_of
from .warnings import OVERLAP_LIMIT

# [1] cosine between two normals below which cells do not lie side by side, as on both sides of a thin part. Larger:
# overlaps over sharp edges are not found.
MIN_NORMAL_COSINE = 0.5


def overlap_warnings(patches: Sequence[Patch]) -> Iterator[Warning]:
    """Yield a warning for each pair of skins at the same height whose cells overlap."""
    placed = [patch for patch in patches if patch.kind != "imported"]
    for k, one in enumerate(placed):
        for other in placed[k + 1 :]:
            found = overlaps(one, other) if one.offset == other.offset else []
            if found:
                found.sort(key=lambda pair: -pair[2])
                first, second, depth = found[0]
                taxels = tuple(dict.fromkeys(name for pair in found for name in pair[:2]))
                position = one.taxels.positions_link[one.taxels.ids.index(first)]
                yield Warning(
                    "skins-overlap",
                    "warning",
                    f"{one.name} and {other.name} overlap: {listed([f'{a} and {b}' for a, b, _ in found])}. "
                    f"The first overlap by {depth * 1e3:.1f} mm.",
                    Place(point_of(position), skin=one.name, taxels=taxels),
                    depth,
                    f"Move {second.rsplit('.', 2)[0]}, or leave the cells of one skin out.",
                )


def overlaps(one: Patch, other: Patch) -> list[tuple[str, str, float]]:
    """Return the pairs of cells of two skins that overlap, with the depth [m]."""
    a, b = one.taxels, other.taxels
    size = max(float(np.linalg.norm(t.corners_link - t.positions_link[:, None], axis=2).max()) for t in (a, b))
    found = []
    pairs = cKDTree(a.positions_link).sparse_distance_matrix(cKDTree(b.positions_link), 2 * size, output_type="ndarray")
    for i, j in sorted(zip(pairs["i"].tolist(), pairs["j"].tolist())):
        cosine = a.normals_link[i] @ b.normals_link[j]
        depth = shadow_depth(a.corners_link[i], b.corners_link[j], unit(a.normals_link[i] + b.normals_link[j]))
        if cosine > MIN_NORMAL_COSINE and depth > OVERLAP_LIMIT:
            found.append((a.ids[i], b.ids[j], depth))
    return found


def shadow_depth(one: Array, other: Array, up: Array) -> float:
    """Return how deep the shadows of two convex outlines overlap; negative if they are apart [m]."""
    axes = np.concatenate([np.cross(up, np.roll(c, -1, axis=0) - c) for c in (one, other)])
    axes = unit(axes[np.linalg.norm(axes, axis=1) > 0])
    a, b = one @ axes.T, other @ axes.T
    return float(np.minimum(a.max(axis=0) - b.min(axis=0), b.max(axis=0) - a.min(axis=0)).min())
