"""Deviation of taxels from measured touches, and the motion of the skin that explains most of it.

The position of a touch can be anywhere in the cell of the taxel that felt it. A single distance of half a cell is
therefore no error, but a mean over many touches is.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from ..calibration.model import LinkCalibration, Patch
from ..common.arrays import Array, IntArray
from ..common.errors import MAX_NAMED
from ..common.warnings import Place, Warning
from .touches import Touches

# Distance with weight one half in the robust fit, in units of the expected rms. Larger: outliers have more influence.
ROBUST_SCALE = 2.0
# Iterations of the weights. Larger: more exact.
REWEIGHTING_STEPS = 30
# Smallest number of touches for a motion. Larger: no motion for fewer touches.
MIN_TOUCHES = 4
# Smallest sine of the angle between a line of action and the skin. Larger: leaves out more touches.
MIN_INCIDENCE_SINE = 0.17
# Standard errors from which on a motion is significant. Larger: fewer significant motions.
MIN_SIGNIFICANCE = 2.0
# A touch farther off than this multiple of the usual distance is an outlier, ...
OUTLIER_FACTOR = 3.0
# ... if it is farther off than this number of cells, too. Larger: fewer outliers.
OUTLIER_CELLS = 1.5
# [1] Misfit of a touch that is nowhere near the taxel that felt it, as a logarithm of odds. Larger: fewer touches
# decide which order of the channels is right.
MAX_MISFIT = 6.0
# [1] Another order of the channels is right if it reduces the misfit by this much. Larger: needs more touches.
ORDER_GAIN = 8.0
# [1] Fraction of the touches that it must explain. Larger: fewer orders of files with many wrong channels are named.
MIN_EXPLAINED = 2 / 3
# [m, rad] Usual displacement and rotation of a glued skin. Larger: a displacement of a cell is a lesser reason to
# assume another order.
USUAL_SHIFT, USUAL_TURN = 5e-3, np.deg2rad(5.0)
# Median height of touches above or below the taxels from which on a warning is given [m]: half of the distance at which
# a single touch is an error. Larger: fewer warnings.
HEIGHT_LIMIT = 2.5e-3


@dataclass(frozen=True, eq=False)
class Motion:
    """Translation of a skin on its surface, and rotation about the mean position of its touches."""

    middle: Array  # (2,) mean flat position of the touched cells, along and across the rows [m]
    shift: Array  # (2,) along and across the rows [m]
    turn: float  # counter-clockwise seen from outside [rad]
    shift_error: Array  # (2,) standard errors [m]
    turn_error: float  # standard error [rad]; infinite if the touches are too near to each other

    @property
    def is_certain(self) -> bool:
        """Whether the motion is significant."""
        return (
            bool((np.abs(self.shift) > MIN_SIGNIFICANCE * self.shift_error).any())
            or abs(self.turn) > MIN_SIGNIFICANCE * self.turn_error
        )

    def at(self, flat: Array) -> Array:
        """Return the displacement of flat positions (k, 2) along and across the rows, shape (k, 2) [m]."""
        arm = flat - self.middle
        return self.shift + self.turn * np.stack((-arm[:, 1], arm[:, 0]), axis=1)


@dataclass(frozen=True, eq=False)
class Placement:
    """The touches of one patch; row i of every array is the same touch."""

    patch: Patch
    lines: IntArray  # (m,) lines of the file
    rows: IntArray  # (m,) rows of the taxels in the patch
    places: Array  # (m, 3) positions of the touches, in the link frame [m]
    offsets: Array  # (m, 3) from the taxel to the touch: along the row, across it, outward (NaN for a wrench) [m]
    directions: Array  # (m, 3) of the wrenches; zero for points
    grazing: IntArray  # lines of the file whose line of action is nearly parallel to the skin; they are left out

    @cached_property
    def distances(self) -> Array:
        """Distance of each touch from its taxel along the skin, shape (m,) [m]."""
        return np.linalg.norm(self.offsets[:, :2], axis=1)

    @cached_property
    def heights(self) -> Array:
        """Heights of the touches above the tangent planes of their taxels, as far as they are known [m]."""
        return self.offsets[~np.isnan(self.offsets[:, 2]), 2]

    @property
    def expected_rms(self) -> float:
        """Root mean square of the distances that follows from the size A of the cells alone: sqrt(A / 6) [m].

        It is exact for squares. For hexagons it is 2 % smaller.
        """
        return float(np.sqrt(self.patch.taxels.areas.mean() / 6))

    @cached_property
    def flat(self) -> Array:
        """Flat positions of the touched cells, shape (m, 2) [m]."""
        return flat_places(self.patch, self.patch.taxels.index[self.rows])

    @cached_property
    def motion(self) -> Motion | None:
        """Motion of the skin that explains the touches; None for imported taxels, and for too few touches.

        A robust least-squares fit of shift s and rotation r explains the distances d along the skin:

            d_i = s + r * (-y_i, x_i)    [m]

        with the flat positions (x, y) relative to their mean [m]. Distant touches have a small weight.
        """
        if self.patch.kind == "imported" or len(self.rows) < MIN_TOUCHES:
            return None
        middle = self.flat.mean(axis=0)
        x, y = (self.flat - middle).T
        turns = bool(np.hypot(x, y).max() > self.expected_rms)  # otherwise all touches are in one cell
        design = np.stack((np.column_stack((x * 0 + 1, x * 0, -y)), np.column_stack((x * 0, x * 0 + 1, x))), axis=1)
        found, errors = _robust(design[..., : 3 if turns else 2], self.offsets[:, :2], ROBUST_SCALE * self.expected_rms)
        turn, turn_error = (float(found[2]), float(errors[2])) if turns else (0.0, np.inf)
        return Motion(middle, found[:2], turn, errors[:2], turn_error)

    @cached_property
    def residuals(self) -> Array:
        """Distances along the skin after the motion, shape (m,) [m]."""
        if self.motion is None:
            return self.distances
        return np.linalg.norm(self.offsets[:, :2] - self.motion.at(self.flat), axis=1)

    def warnings(self) -> Iterator[Warning]:
        """Yield warnings for the author: order of channels, grazing touches, wrong taxels, height."""
        name, place = self.patch.name, Place(skin=self.patch.name)
        order, is_certain = self.other_order
        if order and is_certain:
            message = f"The touches of {name} fit another order of its channels: {order}."
            yield Warning("channel-order", "warning", message, place, advice="Check the order of the channels.")
            return
        if order:
            message = f"The displacement of {name} may be another order of its channels: {order}."
            yield Warning("channel-order", "warning", message, place, advice="Touch both ends of its rows and columns.")
        if len(self.grazing):
            lines = [f"line {line}" for line in self.grazing.tolist()]
            message = f"Touches of {name} with a force nearly parallel to the skin are left out: {_listed(lines)}."
            yield Warning("grazing-touch", "warning", message, place, float(len(lines)))
        if len(self.outliers):
            which = [self._other_taxel(i) for i in self.outliers.tolist()]
            taxels = tuple(self.patch.taxels.ids[row] for row in self.rows[self.outliers])
            yield Warning(
                "wrong-taxel",
                "warning",
                f"Some touches of {name} are far from the taxel that felt them: {_listed(which)}.",
                replace(place, taxels=taxels),
                float(len(which)),
                "Check the channels of these taxels.",
            )
        if len(self.heights) and abs(height := float(np.median(self.heights))) > HEIGHT_LIMIT:
            side = "above" if height > 0 else "below"
            yield Warning(
                "touch-height",
                "warning",
                f"The touches of {name} are {abs(height) * 1e3:.1f} mm {side} its taxels.",
                place,
                height,
                "Check that they are given in the link frame.",
            )

    @cached_property
    def _far(self) -> Array:
        """Distance (m,) of each touch that neither the motion nor a common height explains [m]."""
        height = self.offsets[:, 2] - (np.median(self.heights) if len(self.heights) else 0.0)
        return np.hypot(self.residuals, np.nan_to_num(height))

    @cached_property
    def misfit(self) -> Array:
        """Misfit (m,) of each touch after the motion: 0 in the cell, at most `MAX_MISFIT`.

        It is the square of the distance in standard deviations of a place in the cell, less that of a corner. A wrench
        whose direction differs from that of most others, inward or outward, belongs to another side of the link.
        """
        misfit = np.clip((self._far / self.expected_rms) ** 2 - 3.0, 0.0, MAX_MISFIT)
        pull = np.sign((self.directions * self.patch.taxels.normals_link[self.rows]).sum(axis=1))
        return np.where(pull * np.sign(pull.sum()) < 0, MAX_MISFIT, misfit)

    @cached_property
    def other_order(self) -> tuple[str, bool]:
        """Description of an order of the channels that explains the touches, and whether it is certain.

        It is empty if no other order does. If it is not certain, a displacement of a cell explains them as well. Each
        order is judged with the motion that fits it best.
        """
        if len(self.rows) < MIN_TOUCHES:
            return "", False
        given, best, description, similar = _cost(self, 0), np.inf, "", ""
        is_far = self.motion is not None and np.linalg.norm(self.motion.shift) > min(self.patch.pitch) / 2
        for words, rows, is_shift in other_orders(self.patch, self.rows):
            if (rows == self.rows).all() or not (is_far or given > ORDER_GAIN):
                continue
            found = rows >= 0
            other = _placement(self.patch, self.lines[found], rows[found], self.places[found], self.directions[found])
            left_out = len(rows) - len(other.rows)
            cost = _cost(other, left_out)
            if (other.misfit < MAX_MISFIT).sum() < MIN_EXPLAINED * len(rows):
                continue
            if cost < min(best, given - ORDER_GAIN):
                best, description = cost, words
            if is_far and is_shift and not similar and cost < given + ORDER_GAIN and _shift(other) < _shift(self):
                similar = words
        return (description, True) if description else (similar, False)

    @cached_property
    def outliers(self) -> IntArray:
        """Touches (k,) that no motion of the skin explains, most probably with a wrong channel."""
        if len(self.rows) == 0:
            return self.rows
        far = self._far
        usual = max(self.expected_rms, float(np.median(far)))
        return np.flatnonzero((far > OUTLIER_FACTOR * usual) & (far > OUTLIER_CELLS * max(self.patch.pitch)))

    def _other_taxel(self, i: int) -> str:
        """Describe an outlier, and the taxel at its position."""
        taxels = self.patch.taxels
        directions = np.linalg.norm(taxels.positions_link - self.places[i], axis=1)
        mine = int(self.rows[i])
        text = f"line {self.lines[i]}, {taxels.ids[mine]}, {directions[mine] * 1e3:.1f} mm"
        if np.isnan(self.offsets[i, 2]):
            return text
        return f"{text} ({taxels.ids[int(directions.argmin())]} is there)"


def placements(calibration: LinkCalibration, touches: Touches) -> list[Placement]:
    """Return the touches of each touched patch, compared with its taxels; taxels without a patch are left out."""
    found = []
    for patch in calibration.patches:
        row_of = {name: row for row, name in enumerate(patch.taxels.ids)}
        mine = [i for i, name in enumerate(touches.taxels) if name in row_of]
        if mine:
            rows = np.array([row_of[touches.taxels[i]] for i in mine])
            found.append(_placement(patch, touches.lines[mine], rows, touches.points[mine], touches.directions[mine]))
    return found


def _placement(patch: Patch, lines: IntArray, rows: IntArray, points: Array, directions: Array) -> Placement:
    """Compare touches (m, 3) of a patch with their taxels; a line of action is intersected with the tangent plane."""
    centres, normals = patch.taxels.positions_link[rows], patch.taxels.normals_link[rows]
    is_line, slope = directions.any(axis=1), (directions * normals).sum(axis=1)
    known = ~is_line | (np.abs(slope) >= MIN_INCIDENCE_SINE)
    height = ((points - centres) * normals).sum(axis=1)
    places = points - (height / np.where(is_line & known, slope, np.inf))[:, None] * directions
    axes = np.concatenate((patch.taxels.axes_link[rows], normals[:, None]), axis=1)
    offsets = (axes @ (places - centres)[:, :, None])[:, :, 0]
    offsets[is_line, 2] = np.nan
    return Placement(patch, lines[known], rows[known], places[known], offsets[known], directions[known], lines[~known])


def _robust(design: Array, offsets: Array, far: float) -> tuple[Array, Array]:
    r"""Solve ``offsets (m, 2) = design (m, 2, k) @ parameters`` robustly for parameters (k,) and standard errors.

    Iteratively reweighted least squares with Cauchy's weights, from the medians. With the residuals :math:`r` [m]:

    .. math::

        w_i = \frac{1}{1 + \lVert \mathbf{r}_i \rVert^2 / f^2}, \qquad
        \boldsymbol{\psi}_i = w_i\, \mathbf{r}_i

    The weights depend on the residuals, so the errors of a weighted least squares are too small (by 17 % for touches
    anywhere in their cells). The covariance of an M-estimate has the slope of :math:`\boldsymbol{\psi}` (Huber, 1981,
    eq. 7.6.6):

    .. math::

        C = \frac{\sum \lVert \boldsymbol{\psi}_i \rVert^2 / (2 m - k)}{\bigl( \frac{1}{2 m} \sum
        \operatorname{tr} \partial \boldsymbol{\psi}_i / \partial \mathbf{r}_i \bigr)^2}\, (A^T A)^{-1} , \qquad
        \operatorname{tr} \frac{\partial \boldsymbol{\psi}_i}{\partial \mathbf{r}_i} = 2 w_i^2
    """
    found = np.zeros(design.shape[2])
    found[:2] = np.median(offsets, axis=0)
    for _ in range(REWEIGHTING_STEPS):
        weights = 1 / (1 + ((offsets - design @ found) ** 2).sum(axis=1) / far**2)
        normal = np.einsum("mik,m,mil->kl", design, weights, design)
        found = np.linalg.solve(normal, np.einsum("mik,m,mi->k", design, weights, offsets))
    squares = ((offsets - design @ found) ** 2).sum(axis=1)
    weights = 1 / (1 + squares / far**2)
    spread = (weights**2 * squares).sum() / max(2 * len(offsets) - len(found), 1) / (weights**2).mean() ** 2
    plain = np.einsum("mik,mil->kl", design, design)
    return found, np.sqrt(spread * np.diag(np.linalg.inv(plain)))


def flat_places(patch: Patch, cells: IntArray | Array) -> Array:
    """Return the positions of cells in the flat skin, x along the rows, shape (n, 2) [m]."""
    i, j = cells.T.astype(float)
    if patch.kind == "hexagons":
        return patch.pitch[0] * np.column_stack((i + j / 2, np.sqrt(0.75) * j))
    return np.column_stack((patch.pitch[1] * j, _hand(patch) * patch.pitch[0] * i))


def link_point(patch: Patch, flat: Array) -> Array:
    """Return the point of a flat position (2,), in the tangent plane of the nearest taxel, shape (3,) [m]."""
    arms = flat - flat_places(patch, patch.taxels.index)
    row = int((arms**2).sum(axis=1).argmin())
    point: Array = patch.taxels.positions_link[row] + arms[row] @ patch.taxels.axes_link[row]
    return point


def flat_point(patch: Patch, point: Array) -> Array:
    """Return the flat position (2,) [m] of a point, in the tangent plane of the nearest taxel."""
    arms = point - patch.taxels.positions_link
    row = int((arms**2).sum(axis=1).argmin())
    flat: Array = flat_places(patch, patch.taxels.index[row][None])[0] + patch.taxels.axes_link[row] @ arms[row]
    return flat


def _hand(patch: Patch) -> float:
    """Return 1 if the next row of a sheet is to the left of a row, -1 if it is to the right."""
    taxels = patch.taxels
    row_of = {cell: row for row, cell in enumerate(map(tuple, taxels.index.tolist()))}
    pairs = [(row, row_of[i + 1, j]) for (i, j), row in row_of.items() if (i + 1, j) in row_of]
    if not pairs:
        return 1.0
    here, there = np.array(pairs).T
    rows_apart = taxels.positions_link[there] - taxels.positions_link[here]
    return 1.0 if (taxels.axes_link[here, 1] * rows_apart).sum() > 0 else -1.0


def other_orders(patch: Patch, rows: IntArray) -> Iterator[tuple[str, IntArray, bool]]:
    """Yield other orders of the channels: a description, the taxels (m,) instead of ``rows``, whether it is a shift.

    A taxel is -1 if the order has none. The most common mistakes come first.
    """
    taxels = patch.taxels
    row_of = {channel: row for row, channel in enumerate(taxels.channels.tolist())}
    channels = taxels.channels[rows].tolist()

    def shifted(by: int) -> IntArray:
        return np.array([row_of.get(channel + by, -1) for channel in channels], np.int64)

    yield "off by one, as if counted from 1", shifted(-1), True
    yield "off by one, each too low", shifted(1), True
    height, width = patch.shape
    if patch.kind != "sheet" or len(taxels.ids) != height * width:
        return
    yield "off by one row, each too high", shifted(-width), True
    yield "off by one row, each too low", shifted(width), True
    row_at = np.empty((height, width), np.int64)
    row_at[tuple(taxels.index.T)] = np.arange(len(taxels.ids))
    i, j = taxels.index[rows].T
    for by, words in (
        (-1, "columns off by one"),
        (1, "columns off by one"),
        (width // 2, "halves of the rows swapped"),
    ):
        yield words, row_at[i, (j + by) % width], True
    number = i * width + j
    for by_columns, turns, flip_rows, flip_columns in product((False, True), repeat=4):
        a, b = (number % height, number // height) if by_columns else (i, j)
        if turns:
            a, b = (np.where(b % 2, height - 1 - a, a), b) if by_columns else (a, np.where(a % 2, width - 1 - b, b))
        other = row_at[height - 1 - a if flip_rows else a, width - 1 - b if flip_columns else b]
        flips = [name for name, is_so in (("rows", flip_rows), ("columns", flip_columns)) if is_so]
        parts = ["column by column"] * by_columns
        parts += [f"every second {'column' if by_columns else 'row'} backwards"] * turns
        parts += [f"{' and '.join(flips)} counted from the other end"] if flips else []
        yield ", ".join(parts), other, False


def _cost(placement: Placement, left_out: int) -> float:
    """Return the misfit of all touches, of those without a taxel, and of the motion, as a logarithm of odds."""
    turn = 0.0 if placement.motion is None else placement.motion.turn
    motion = np.log1p((_shift(placement) / USUAL_SHIFT) ** 2) + np.log1p((turn / USUAL_TURN) ** 2)
    return float(placement.misfit.sum() + MAX_MISFIT * left_out + motion)


def _shift(placement: Placement) -> float:
    """Return the length of the displacement [m]."""
    return 0.0 if placement.motion is None else float(np.linalg.norm(placement.motion.shift))


def _listed(items: list[str]) -> str:
    return "; ".join(items[:MAX_NAMED]) + (f"; and {len(items) - MAX_NAMED} more" if len(items) > MAX_NAMED else "")
