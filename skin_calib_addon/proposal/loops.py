"""From a mask of sites to closed loops around it."""

import numpy as np

from ..common.arrays import Array, BoolArray
from ..plan.keys import MAX_CORNERS, MAX_LOOPS
from .candidates import DECIMALS

# [m^2] least area of a loop: a cell of 8 mm. Larger: holes that a skin must leave free are missing; smaller: vents and
# lettering make boundaries that nobody can edit.
MIN_LOOP_AREA = 64e-6

Corner = tuple[int, int]
Loops = tuple[tuple[tuple[float, float, float], ...], ...]


def loops_around(mask: BoolArray, points: Array, closed: bool, tolerance: float) -> Loops:
    """Return closed loops of points [m] halfway between the sites inside a mask (k, l) and those outside.

    Loops smaller than a cell are left out, and the smallest of more than a plan can have.
    """
    found: list[tuple[float, Array]] = []
    for chain in chains(mask, closed):
        corners, near = np.array([corner(points, at, closed) for at in chain]), tolerance
        while len(kept := simplified(corners, near)) > MAX_CORNERS:
            near *= 2
        area = np.linalg.norm(np.cross(kept - kept[0], np.roll(kept, -1, axis=0) - kept[0]).sum(axis=0)) / 2
        if len(kept) >= 3 and area >= MIN_LOOP_AREA:
            found.append((float(area), np.round(kept, DECIMALS)))
    least = sorted((area for area, _ in found), reverse=True)[:MAX_LOOPS]
    largest = [loop for area, loop in found if area >= least[-1]][:MAX_LOOPS]
    return tuple(tuple((x, y, z) for x, y, z in loop.tolist()) for loop in largest)


def chains(mask: BoolArray, closed: bool) -> list[list[Corner]]:
    """Return the corners of the squares around the sites of a mask, in order around it.

    Corner (i, j) is before row i and column j.
    """
    k, l = mask.shape
    wide = np.zeros((k + 2, l + 2), bool)
    wide[1:-1, 1:-1] = mask
    if closed:
        wide[1:-1, 0], wide[1:-1, -1] = mask[:, -1], mask[:, 0]
    following: dict[Corner, list[Corner]] = {}
    for i, j in np.argwhere(mask).tolist():
        right = (j + 1) % l if closed else j + 1
        sides = (
            (wide[i, j + 1], (i, j), (i, right)),
            (wide[i + 1, j + 2], (i, right), (i + 1, right)),
            (wide[i + 2, j + 1], (i + 1, right), (i + 1, j)),
            (wide[i + 1, j], (i + 1, j), (i, j)),
        )
        for is_inside, start, end in sides:
            if not is_inside:
                following.setdefault(start, []).append(end)
    found = []
    while following:
        first = at = min(following)
        chain = []
        while True:
            ends = following[at]
            step = ends.pop()
            if not ends:
                del following[at]
            chain.append(at)
            at = step
            if at == first:
                break
        found.append(chain)
    return found


def corner(points: Array, at: Corner, closed: bool) -> Array:
    """Return the mean (3,) of the points of the four sites around a corner; at open edges of two or one."""
    k, l = points.shape[:2]
    rows = np.clip((at[0] - 1, at[0]), 0, k - 1)
    columns = np.array((at[1] - 1, at[1])) % l if closed else np.clip((at[1] - 1, at[1]), 0, l - 1)
    return points[rows][:, columns].reshape(-1, 3).mean(axis=0)


def simplified(loop: Array, tolerance: float) -> Array:
    """Return the corners of a loop that are needed to stay near it (Douglas and Peucker, 1973)."""
    middle = loop.mean(axis=0)
    first = int(np.argmax(np.linalg.norm(loop - middle, axis=1)))
    loop = np.roll(loop, -first, axis=0)
    half = int(np.argmax(np.linalg.norm(loop - loop[0], axis=1)))
    kept = {0, half}
    ends = [(0, half), (half, len(loop))]
    around = np.concatenate((loop, loop[:1]))
    while ends:
        start, stop = ends.pop()
        if stop - start < 2:
            continue
        step = around[stop] - around[start]
        arms = around[start + 1 : stop] - around[start]
        length = step @ step
        part = np.clip(arms @ step / length, 0, 1) if length > 0 else np.zeros(len(arms))
        away = np.linalg.norm(arms - part[:, None] * step, axis=1)
        if away.max() > tolerance:
            middle_index = start + 1 + int(away.argmax())
            kept.add(middle_index)
            ends += [(start, middle_index), (middle_index, stop)]
    return loop[sorted(kept)]
