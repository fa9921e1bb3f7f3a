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
# Another order of the channels is right if it leaves less than this fraction of the distances. Larger: accepts more.
ORDER_GAIN = 0.5
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
        order = other_order(self)
        if order:
            message = f"The touches of {name} fit another order of its channels: {order}."
            yield Warning("channel-order", "warning", message, place, advice="Check the order of the channels.")
            return
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
    def outliers(self) -> IntArray:
        """Touches (k,) that no motion of the skin explains, most probably with a wrong channel."""
        if len(self.rows) == 0:
            return self.rows
        height = np.nan_to_num(self.offsets[:, 2] - (np.median(self.heights) if len(self.heights) else 0.0))
        far = np.hypot(self.residuals, height)
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
    return Placement(patch, lines[known], rows[known], places[known], offsets[known], lines[~known])


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


def other_order(placement: Placement) -> str | None:
    """Describe the order of the channels of a sheet that fits the touches better; None if there is no better one."""
    patch = placement.patch
    rows, columns = patch.shape
    taxels = patch.taxels
    if patch.kind != "sheet" or len(taxels.ids) != rows * columns:
        return None
    known = ~np.isnan(placement.offsets[:, 2])
    if known.sum() < MIN_TOUCHES:
        return None
    places, touched = placement.places[known], placement.rows[known]
    i, j = taxels.index[touched].T
    number = i * columns + j
    best, description = ORDER_GAIN * _mean(taxels.positions_link[touched] - places), None
    row_at = np.empty((rows, columns), np.int64)
    row_at[tuple(taxels.index.T)] = np.arange(len(taxels.ids))
    for by_columns, flip_rows, flip_columns in product((False, True), repeat=3):
        a, b = (number % rows, number // rows) if by_columns else (i, j)
        other = row_at[rows - 1 - a if flip_rows else a, columns - 1 - b if flip_columns else b]
        mean = _mean(taxels.positions_link[other] - places)
        if mean < best and mean < max(patch.pitch):
            flips = [name for name, is_so in (("rows", flip_rows), ("columns", flip_columns)) if is_so]
            order = "column by column" if by_columns else ""
            ends = f"{' and '.join(flips)} counted from the other end" if flips else ""
            best, description = mean, ", ".join(part for part in (order, ends) if part)
    return description


def _listed(items: list[str]) -> str:
    return "; ".join(items[:MAX_NAMED]) + (f"; and {len(items) - MAX_NAMED} more" if len(items) > MAX_NAMED else "")


def _mean(ends: Array) -> float:
    return float(np.linalg.norm(ends, axis=1).mean())
