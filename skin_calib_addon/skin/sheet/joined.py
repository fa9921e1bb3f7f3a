"""Neighbours across patches: where one skin ends and another begins."""

from dataclasses import replace

import numpy as np

from ...calibration.model import Patch
from .taxels import neighbours


def joined(patches: tuple[Patch, ...]) -> tuple[Patch, ...]:
    """The same patches, whose taxels know those beside them in other patches too."""
    if len(patches) < 2:
        return patches
    taxels = [patch.taxels for patch in patches]
    ids = sum((t.ids for t in taxels), ())
    positions, normals = (np.concatenate([getattr(t, k) for t in taxels]) for k in ("positions_link", "normals_link"))
    patch_of = np.repeat(np.arange(len(patches)), [len(t.ids) for t in taxels])
    home = dict(zip(ids, patch_of.tolist()))
    found = dict(zip(ids, neighbours(ids, positions, normals, *(t.corners_link for t in taxels))))
    result = []
    for k, patch in enumerate(patches):
        t = patch.taxels
        beside = tuple(
            own + tuple(other for other in found[taxel] if home[other] != k) for taxel, own in zip(t.ids, t.neighbours)
        )
        result.append(replace(patch, taxels=replace(t, neighbours=beside)))
    return tuple(result)
