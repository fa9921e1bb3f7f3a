"""What a tare learned of readings without contact, and why they may not be without contact."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..common.arrays import Array, BoolArray, lock
from ..common.errors import counted
from .geometry import SkinGeometry
from .noise import LOAD_LIMIT, Noise

if TYPE_CHECKING:
    from ..calibration.taxel_responses import TaxelResponses

# [standard deviations] Mean of a taxel off its reading without force, from which on there is a warning. Larger: weak
# contacts at rest are learned as offsets; smaller: sensors with small offsets need a word of their user.
MAX_REST_OFFSET = 3.0
# [N] Force of a rest from which on there is one, while the noise is not known. Larger: as above.
MAX_REST_FORCE = 5.0
# [1] Correlation of the offsets of neighbours from which on they are a pattern of a contact. Only words depend on it.
CONTACT_CORRELATION = 0.5
# [reading] Power of two from which on readings that are all its multiples are left-aligned in a word. Larger: 14 bits
# in 16 are not found; smaller: converters with steps of two cause it.
MIN_ALIGNMENT = 4
# [reading] Range of a response in whole numbers from which on fractions cause a warning.
# Larger: newtons for counts of small converters are not found.
MIN_COUNTS = 200.0


class LearnedRest(NamedTuple):
    """What readings at rest say."""

    frames: int
    mean: Array  # (n,) reading, before the clipping where the noise is known; NaN where there is none
    sigma: Array  # (n,) standard deviation, as the mean
    noise: Noise | None  # None: they say nothing about it


@dataclass(frozen=True, eq=False)
class Tare:
    """What a skin learned at rest."""

    frames: int
    forces: Array  # (n,) that count as offsets from now on, by the response [N]
    noise: Noise | None  # None: too few frames, or readings that never change
    warnings: tuple[str, ...]  # why the readings may not be those without contact, or not those of the response

    def __post_init__(self) -> None:
        lock(self.forces)


def judged(
    rest: LearnedRest, rows: Array, dtype: np.dtype, responses: "TaxelResponses", alive: BoolArray, skin: SkinGeometry
) -> tuple[Array, tuple[str, ...]]:
    """Return the forces (n,) of a rest by the responses [N], and why it may be no rest, or in another unit.

    ``rows`` (frames, n) are the readings, given as ``dtype``, NaN where a taxel has none; ``alive`` (n,) not masked.
    """
    mean = np.where(np.isfinite(rest.mean) & alive, rest.mean, responses.rest)
    forces, noise = np.nan_to_num(responses.forces(mean)), rest.noise
    if noise is None:
        hidden = responses.forces(responses.rest + responses.sign * rest.sigma)
        limit, is_vague = max(MAX_REST_FORCE, LOAD_LIMIT * float(np.linalg.norm(hidden))), rest.sigma == 0
    else:
        limit, is_vague = noise.load_limit, noise.dead
    is_off = (np.abs(mean - responses.rest) > MAX_REST_OFFSET * rest.sigma) & ~is_vague
    depth = 0.0 if noise else float(np.nan_to_num(responses.forces(2 * responses.rest - mean)).sum())
    by_unit = warnings_of_unit(rows, dtype, responses.rest, responses.full)
    return forces, warnings_of_load(skin, forces, depth, is_off, limit) + by_unit


def warnings_of_load(
    skin: SkinGeometry, forces: Array, depth: float, is_off: BoolArray, limit: float
) -> tuple[str, ...]:
    """Return why readings at rest, with these mean forces (n,) [N], may be those under a load.

    ``is_off`` (n,): the mean of a taxel is off the reading without force. The noise of all taxels hides ``limit`` [N].
    ``depth`` [N]: total of mean readings below rest, as the forces of readings as far above it; 0 with a known noise.
    """
    total = float(forces.sum())
    if not is_off.any() and max(total, depth) <= limit:
        return ()
    worst = int(np.argmax(np.where(is_off, forces, -1.0) if is_off.any() else forces))
    what = f"they are those of {total:.3g} N, with {forces[worst]:.2g} N on {skin.ids[worst]}"
    if is_off.any():
        off = counted(int(np.count_nonzero(is_off)), "taxel")
        what += f", and the means of {off} are off the rest of their response"
    if depth > limit:
        what += f"; they are as far below rest as {depth:.3g} N are above it"
    apart = forces - forces.mean()
    first, second = apart[skin.pairs.T]
    if len(skin.pairs) and float((first * second).mean()) > CONTACT_CORRELATION * float((apart**2).mean()) > 0:
        what += "; neighbours are alike, as under a contact"
    return (what,)


def warnings_of_unit(rows: Array, dtype: np.dtype, rest: Array, full: Array) -> tuple[str, ...]:
    """Return why readings (frames, n), NaN where a taxel has none, may not be in the unit of their response.

    ``rest`` and ``full`` (n,) are those without force, and at the end of its range; infinite without a range.
    """
    found = []
    ends = np.concatenate((rest, full))[np.isfinite(np.concatenate((full, full)))]  # of responses with a range
    largest = float(np.iinfo(str(dtype)).max) if dtype.kind in "ui" else np.inf
    if len(ends) and ends.max() > largest:
        found.append(f"they are numbers up to {largest:g}, the response needs {ends.max():g}")
    values = rows[np.isfinite(rows)]
    if not len(values):
        return tuple(found)
    if (values == np.rint(values)).all():
        step = int(np.gcd.reduce(np.abs(values[np.abs(values) < 2**53]).astype(np.int64)))
        power = step & -step  # the largest power of two that divides all
        if len(np.unique(values)) > 2 and power >= MIN_ALIGNMENT and not (len(ends) and (ends % power == 0).all()):
            found.append(f"they are multiples of {power}: they may be aligned to the left of their word")
    elif len(ends) and (ends == np.rint(ends)).all() and np.ptp(ends) >= MIN_COUNTS and np.std(values) < 0.5:
        found.append(f"they have fractions, the response is for whole numbers up to {ends.max():g}")
    return tuple(found)
