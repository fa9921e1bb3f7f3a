"""Compute the results of many readings with the arrays of another library: PyTorch, JAX, CuPy, or NumPy itself.

:func:`constants` gives the numbers of a skin as plain arrays. :func:`evaluate` is one pure function of them and of the
readings for any namespace of the array API standard (2023.12): it can be compiled, differentiated, and run on a GPU.
Rows do not depend on each other, as in :meth:`.Skin.batch` without times, whose results these are.
"""

from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..common.arrays import Array
from .frame import MIN_LOAD
from .lost import MAX_LOST_FRACTION
from .noise import HIDDEN_LOAD
from .skin import Skin

if TYPE_CHECKING:
    from ..calibration.model import LinkCalibration


def constants(skin: Skin) -> dict[str, Array]:
    """Return the constants of a skin, with its baseline, noise, drift and masked taxels of now, by name.

    Convert each to an array of your library, in one precision: ``{k: xp.asarray(v) for k, v in ...}``.
    """
    readings, ground, noise = skin._readings, skin.ground, skin.noise
    live, everything = readings.live, np.eye(len(skin.ids))
    found: dict[str, Any] = _responses(skin._calibration)
    found |= {"channels": skin.channels, "neighbours": skin.geometry.neighbours, "live": live}
    found |= {"shift": readings.baseline - skin.drift, "limits": readings._limits}
    # what a masked taxel may carry is linear in what the others carry
    found["fill"] = np.stack([skin.geometry.filled(row, live) for row in everything]) * ~live
    found["sums"] = skin._terms.sums.T
    found["full_sums"] = found["sums"] if ground is None else ground.full_contact.sums.T
    found["standing"] = np.zeros(len(live), bool) if ground is None else ground.can_stand
    found["switch_on"] = np.array(skin.switch_on)
    if noise is not None and not skin._has_thresholds:
        names = "sign", "mean", "sure", "pair", "slopes", "rectified", "clip", "below_clip"
        found |= {name: getattr(noise, name) for name in names} | {"drift": skin.drift, "free": noise.free}
        scale, offset = noise._step_line
        clear, total = noise._clear_terms
        found |= {"step_scale": scale, "step_offset": offset, "clear_offset": clear, "clear_total": np.array(total)}
        found |= {"free_sum": np.array(noise.free_sum), "load_level": np.array(noise.load_level)}
    return found


def _responses(calibration: "LinkCalibration") -> dict[str, Array]:
    """Return polynomials (k, n) with their ranges (n,), and tables as sums of ramps (r, n)."""
    from ..calibration.response import Response, ResponseTable  # imported late: only a skin needs these modules
    from ..calibration.taxel_responses import responses_of

    kinds, index = responses_of(calibration)
    tables = [kind for kind in kinds if isinstance(kind, ResponseTable)]
    powers = max([2, *(len(k.coefficients) for k in kinds if isinstance(k, Response))])
    ramps = max([0, *(len(t.readings) - 1 for t in tables)])
    coefficients, ends = np.zeros((powers, len(kinds))), np.array([k.ends for k in kinds], float).T
    knots, widths, rises = np.zeros((3, ramps, len(kinds)))
    for i, kind in enumerate(kinds):
        if isinstance(kind, ResponseTable):
            count = len(kind.readings) - 1
            coefficients[-1, i] = kind.forces[0]
            knots[:count, i], widths[:count, i] = kind.readings[:-1], np.diff(kind.readings)
            rises[:count, i] = np.diff(kind.forces) / np.diff(kind.readings)
        else:
            coefficients[powers - len(kind.coefficients) :, i] = kind.coefficients[::-1]
    named = {"coefficients": coefficients, "knots": knots, "widths": widths, "rises": rises}
    return {name: values[:, index] for name, values in named.items()} | {"low": ends[0, index], "high": ends[1, index]}


def evaluate(xp: ModuleType, c: dict[str, Any], readings: Any, rounds: int = 32) -> dict[str, Any]:
    """Return the results of readings (T, channels) as arrays of ``xp``, a namespace such as ``jax.numpy``.

    ``c`` has the constants of :func:`constants`, converted. Contacts pass their number to neighbours ``rounds`` times:
    one with a longer path inside counts as several. The results are ``forces`` (T, n) [N], ``known``, ``active`` (T,
    n), ``contact_counts`` (T,), ``wrench`` (T, 6) [N, N m], ``load`` (T,) [N], ``stands`` (T,), ``cop`` and ``zmp``
    (T, 2) [m]. A row in which a live taxel has no valid force has no wrench (NaN): a single one cannot be left out
    without its past.
    """
    raw = xp.take(readings, c["channels"], axis=1)
    zero, nan = xp.zeros_like(raw), xp.asarray(xp.nan, dtype=raw.dtype)
    forces = _forces(xp, c, raw + c["shift"])
    known = forces <= c["limits"]
    forces = xp.where(known, forces, zero)
    if "sign" in c:
        active, pushes, has_load = _by_noise(xp, c, (raw - c["drift"]) * c["sign"], forces, known)
    else:
        active = (forces >= c["switch_on"]) & known
        pushes, has_load = xp.where(active, forces, zero), None
    sums = pushes @ c["sums"]
    is_full = xp.all(active | ~c["standing"], axis=1) & xp.any(c["standing"])
    sums = xp.where(is_full[:, None], pushes @ c["full_sums"], sums)
    bounds, total = xp.sum(xp.maximum(pushes @ c["fill"], zero), axis=1), xp.sum(pushes, axis=1)
    is_lost = (bounds > MAX_LOST_FRACTION * xp.maximum(total, xp.zeros_like(total))) | xp.any(
        c["live"] & ~known, axis=1
    )
    sums = xp.where(is_lost[:, None], nan, sums)
    load = sums[:, 6]
    stands = load >= MIN_LOAD if has_load is None else (load > 0) & has_load
    cop = xp.where(stands[:, None], sums[:, 7:9] / sums[:, 6:7], nan)
    zmp = xp.stack((-sums[:, 11], sums[:, 10]), axis=1) / sums[:, 9:10]
    zmp = xp.where((stands & (sums[:, 9] > 0))[:, None], zmp, nan)
    return {
        "forces": forces,
        "known": known,
        "active": active,
        "contact_counts": _contact_counts(xp, c["neighbours"], active, rounds),
        "wrench": sums[:, :6],
        "load": load,
        "stands": stands,
        "cop": cop,
        "zmp": zmp,
    }


def _forces(xp: ModuleType, c: dict[str, Any], readings: Any) -> Any:
    """Return the forces (T, n) of readings that the responses take [N]; NaN where they are not finite."""
    inside = xp.minimum(xp.maximum(readings, c["low"]), c["high"])
    forces = xp.where(xp.isfinite(readings), xp.zeros_like(readings), xp.asarray(xp.nan, dtype=readings.dtype))
    inside = xp.where(xp.isfinite(readings), inside, xp.zeros_like(readings))
    for k in range(c["coefficients"].shape[0]):
        forces = forces * inside + c["coefficients"][k, :]
    for k in range(c["knots"].shape[0]):
        above = xp.maximum(readings - c["knots"][k, :], xp.zeros_like(c["low"]))
        forces = forces + c["rises"][k, :] * xp.minimum(above, c["widths"][k, :])
    return xp.maximum(forces, xp.zeros_like(forces)) + (forces - forces)  # NaN after an overflow


def _by_noise(xp: ModuleType, c: dict[str, Any], signed: Any, forces: Any, known: Any) -> tuple[Any, Any, Any]:
    """Return active taxels and parts of the sums [N] (T, n), and which rows (T,) have a load; see :class:`.Noise`."""
    zero = xp.zeros_like(forces)
    signed = xp.where(known, signed, c["free"])
    sure, pair = (signed > c["sure"]) & (forces > 0), (signed > c["pair"]) & (forces > 0)
    on = sure | (pair & _any_around(xp, c["neighbours"], pair))
    excess = signed @ c["slopes"] - c["free_sum"]
    has_load = xp.any(on, axis=1) | (excess > c["load_level"])
    step = xp.minimum(xp.maximum(signed * c["step_scale"] + c["step_offset"], zero), zero + 1)
    weights = step * step * (3 - 2 * step)
    clear = (weights * signed) @ c["slopes"] + weights @ c["clear_offset"] - c["clear_total"]
    start, full = HIDDEN_LOAD
    few = excess > (1 + start) * clear
    ratio = excess / xp.where(clear > 0, clear, xp.ones_like(clear))
    hidden = xp.minimum((ratio - 1 - start) / (full - start), xp.ones_like(ratio))
    hidden = xp.where(few, xp.where(clear > 0, hidden, xp.ones_like(ratio)), xp.zeros_like(ratio))[:, None]
    weights = weights + hidden * (1 - weights)
    below = xp.where(signed <= c["clip"], c["below_clip"] + zero, (signed - c["mean"]) * c["slopes"])
    forces = forces + xp.where(few[:, None], xp.minimum(below, zero), zero)
    pushes = (forces + c["rectified"]) * weights - c["rectified"]
    pushes = xp.where(has_load[:, None] & known, pushes, zero)
    return on & has_load[:, None] & known, pushes, has_load


def _any_around(xp: ModuleType, neighbours: Any, values: Any) -> Any:
    """Return whether any neighbour of each taxel has a value (T, n) of True."""
    return xp.max(_around(xp, neighbours, xp.astype(values, neighbours.dtype)), axis=1) > 0


def _around(xp: ModuleType, neighbours: Any, values: Any) -> Any:
    """Return the values (T, n), zero or positive, of the neighbours of each taxel, (T, k + 1, n); 0 for none."""
    none = xp.zeros_like(values[:, :1])
    padded = xp.concat((values, none), axis=1)
    rows = xp.reshape(neighbours, (-1,))
    found = xp.reshape(xp.take(padded, rows, axis=1), (values.shape[0], *neighbours.shape))
    return xp.concat((found, xp.zeros_like(values)[:, None, :]), axis=1)


def _contact_counts(xp: ModuleType, neighbours: Any, active: Any, rounds: int) -> Any:
    """Return the number (T,) of connected groups of active taxels (T, n): each passes its largest number on."""
    own = xp.arange(1, active.shape[1] + 1, dtype=neighbours.dtype)
    numbers = xp.where(active, own, xp.zeros_like(own))
    first = numbers
    for _ in range(rounds):
        largest = xp.maximum(numbers, xp.max(_around(xp, neighbours, numbers), axis=1))
        numbers = xp.where(active, largest, xp.zeros_like(largest))
    return xp.sum(xp.astype(active & (numbers == first), neighbours.dtype), axis=1)
