"""What a tare learnt of readings without contact, and why they may not be without contact."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..common.arrays import Array, IntArray, lock
from ..common.errors import counted
from .noise import Noise

# [standard deviations] Mean of a taxel off its reading without force, from which on there is a warning. Larger: weak
# contacts at rest are learnt as offsets; smaller: sensors with small offsets need a word of their user.
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


@dataclass(frozen=True, eq=False)
class Tare:
    """What a skin learnt at rest."""

    frames: int
    forces: Array  # (n,) that count as offsets from now on, by the response [N]
    noise: Noise | None  # None: too few frames, or readings that never change
    warnings: tuple[str, ...]  # why the readings may not be those without contact, or not those of the response

    def __post_init__(self) -> None:
        lock(self.forces)


def load_warnings(
    ids: Sequence[str], offsets: Array, forces: Array, sigma: Array, limit: float, pairs: IntArray
) -> tuple[str, ...]:
    """Return why readings at rest may be those under a load.

    Parameters
    ----------
    ids : sequence of str
        Of the taxels.
    offsets : array, shape (n,)
        Mean signed readings, less those without force by the responses; 0 where there is none.
    forces : array, shape (n,)
        Of these means, by the response [N].
    sigma : array, shape (n,)
        Standard deviations of these readings; infinite for a dead taxel.
    limit : float
        Force that the noise of all taxels hides [N].
    pairs : array, shape (e, 2)
        Rows of neighbours.
    """
    total, is_far = float(forces.sum()), np.abs(offsets) > MAX_REST_OFFSET * sigma
    if not is_far.any() and total <= limit:
        return ()
    worst = int(np.argmax(np.where(is_far, np.abs(offsets), 0.0) if is_far.any() else forces))
    what = f"they are those of {total:.3g} N, with {forces[worst]:.2g} N on {ids[worst]}"
    if is_far.any():
        far = counted(int(np.count_nonzero(is_far)), "taxel")
        what += f", and the means of {far} are off the rest of their response"
    apart = forces - forces.mean()
    first, second = apart[pairs.T]
    if len(pairs) and float((first * second).mean()) > CONTACT_CORRELATION * float((apart**2).mean()) > 0:
        what += "; neighbours are alike, as under a contact"
    return (what,)


def scale_warnings(rows: Array, largest: float, rest: Array, full: Array) -> tuple[str, ...]:
    """Return why readings (frames, n) may not be in the unit of their response.

    Parameters
    ----------
    rows : array, shape (frames, n)
        NaN where a taxel has none.
    largest : float
        Number that the data type of the readings can have; infinite for floating-point numbers.
    rest, full : array, shape (n,)
        Readings without force, and at the end of the range of the response; infinite without a range.
    """
    found = []
    ends = np.concatenate((rest, full))[np.isfinite(np.concatenate((full, full)))]  # of responses with a range
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
