"""Residuals of spline fits to sampled heights, and their means over spans."""

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray
from ...common.errors import EmptySection
from ..sampling.basis import SplineSites
from ..sampling.rays import TURN


def shifted(positions: Array) -> Array:
    """Return the centres of the intervals between ascending positions (m,), and both ends; shape (m + 1,)."""
    return np.concatenate((positions[:1], (positions[1:] + positions[:-1]) / 2, positions[-1:]))


def moving_part(residuals: Array, others: Array) -> tuple[float, float]:
    """Return the mean square of residuals, and of the part that residuals of another spline do not have in common."""
    return float((residuals**2).mean()), float(((residuals - others) ** 2).mean() / 2)


def refitted(changes: Array, sites: SplineSites) -> Array:
    """Return the residuals of a least-squares fit to changes at the sites."""
    r, l, m = changes.shape
    flat = changes.transpose(1, 0, 2).reshape(l, -1)
    left = flat - sites.values @ (sites.inverse @ flat)
    return left.reshape(l, r, m).transpose(1, 0, 2)


def lengths(positions: Array) -> Array:
    """Return the length about each of some ascending positions (..., l): half of the distance between its neighbors."""
    steps = np.diff(positions) / 2
    none = np.zeros_like(steps[..., :1])
    return np.concatenate((none, steps), axis=-1) + np.concatenate((steps, none), axis=-1)


def periodic_lengths(positions: Array) -> Array:
    """Return the length about each of some angles (..., l) of a full turn [rad]."""
    lengths = np.roll(positions, -1, axis=-1) - np.roll(positions, 1, axis=-1)
    return np.abs((lengths + TURN / 2) % TURN - TURN / 2) / 2


def mean_square(values: Array) -> Array:
    """Return the mean square over the last two axes, shape (...)."""
    return np.asarray(np.einsum("...ij,...ij->...", values, values) / (values.shape[-2] * values.shape[-1]))


def is_known(known: Array, positions: Array, at: Array, closed: bool) -> BoolArray:
    """Return whether rows are known on both sides of positions."""
    if known.all():
        return np.ones((*at.shape[:-2], len(known), at.shape[-1]), bool)
    return interpolated(known, positions, at, closed) == 1


def interpolated(heights: Array, known: Array, wanted: Array, closed: bool) -> Array:
    """Interpolate heights at even positions linearly."""
    r, k = heights.shape
    position = (wanted - known[0]) / (known[1] - known[0])
    if not closed:
        position = np.clip(position, 0, k - 1)
    before: IntArray = np.floor(position).astype(np.int64)
    if not closed:
        before = np.minimum(before, k - 2)
    fraction = position - before
    after = before + 1
    if closed:
        before, after = before % k, after % k
    start = k * np.arange(r)[:, None]
    low, high = heights.take(before + start), heights.take(after + start)
    return low + fraction * (high - low)


def misfits(residuals: Array, weights: Array, measure: str) -> Array:
    """Return the mean or largest absolute value of residuals; a weight of zero excludes a site."""
    size = np.abs(residuals) * (weights if measure == "mean" else weights > 0)
    if measure == "max":
        return np.asarray(size.max(axis=(-2, -1)))
    return np.asarray(size.sum(axis=(-2, -1)) / np.maximum(weights.sum(axis=(-2, -1)), 1e-300))


def root_mean_squares(residuals: Array, known: BoolArray, unknowns: int, weights: Array | float = 1.0) -> Array:
    r"""Return the root mean square of residuals, corrected for the number of unknowns.

    .. math::

        \sqrt{ \frac{\sum w e^2}{\sum w\, (1 - m / l)} }

    for :math:`m` unknowns and :math:`l` sites per row.
    """
    counts, squares = known.sum(axis=-2), (residuals**2 * known).sum(axis=-2)
    known = (counts * weights).sum(axis=-1) * (1 - unknowns / residuals.shape[-1])
    return np.sqrt((squares * weights).sum(axis=-1) / np.where(known > 0, known, np.inf))


def span_errors(
    residuals: Array, known: BoolArray, unknowns: int, spans: int, closed: bool, weights: Array | float = 1.0
) -> tuple[float, Array]:
    """Return the root mean square of residuals, and the mean square of each span.

    A span without hits has no error. A site on a knot counts half for each side, so that a mirrored mesh has mirrored
    errors.
    """
    sites = residuals.shape[1]
    counts, squares = known.sum(axis=0) * 0.5, (residuals**2 * known).sum(axis=0) * 0.5
    position, last = np.arange(sites) * spans, sites if closed else sites - 1
    sides = [(position + side) // last for side in (0, -1)]
    sides = [side % spans if closed else np.clip(side, 0, spans - 1) for side in sides]
    by_span, count = (sum(np.bincount(side, x, spans) for side in sides) for x in (squares, counts))
    return float(root_mean_squares(residuals, known, unknowns, weights)), by_span / np.maximum(count, 1)


def filled(heights: Array, closed: bool) -> Array:
    """Fill each gap of heights (r, k) by linear interpolation along its row; copy empty rows from the nearest row."""
    missing = np.isnan(heights)
    if not missing.any():
        return heights
    if missing.all():
        raise EmptySection("No ray of the grid hits the mesh. Move the axis into the mesh, or choose another grid.")
    heights, positions = heights.copy(), np.arange(heights.shape[1])
    whole = np.flatnonzero(~missing.all(axis=1))
    for i in np.flatnonzero(missing.any(axis=1)):
        source = i if i in whole else whole[np.argmin(np.abs(whole - i))]
        known = np.flatnonzero(~missing[source])
        period = len(positions) if closed else None
        heights[i] = np.interp(positions, known, heights[source, known], period=period)
    return heights
