"""Where touches say that a skin lies: how far each taxel is off, and the slide of the skin that explains most of it.

A touch tells no more than that its place lies in the cell of the taxel that felt it: single distances of half a cell
are no error. Their mean over many touches is.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..calibration.model import LinkCalibration, Patch
from ..common.arrays import Array, IntArray
from ..common.warnings import Place, Warning
from .touches import Touches

# Distances of so many times what the size of the cells gives count half; steps until the weights have settled.
ROBUST_SCALE, REWEIGHTING_STEPS = 2.0, 30
MIN_TOUCHES = 4  # touches of a patch that tell how it lies
MIN_INCIDENCE_SINE = 0.17  # sine of the least angle between a line of action and the skin that it meets
MIN_SIGNIFICANCE = 2.0  # standard errors beyond which a slide is more than chance
# A touch that is off by so many times what is usual, and by more than so many cells, has another taxel's name.
OUTLIER_FACTOR, OUTLIER_CELLS = 3.0, 1.5
ORDER_GAIN = 0.5  # another order of the channels that leaves less than this share of the distances is the right one
MAX_TOUCHES_NAMED = 3  # touches, at most, that a doubt names
HEIGHT_LIMIT = 0.01  # over or below the taxels of a skin nothing touches it [m]


@dataclass(frozen=True, eq=False)
class Motion:
    """A slide of a skin on its surface, turned about the middle of its touches."""

    middle: Array  # (2,) of the touched cells, along and across the rows, as the flat skin has them [m]
    shift: Array  # (2,) along and across the rows [m]
    turn: float  # counter-clockwise seen from outside [rad]
    shift_error: Array  # (2,) standard errors [m]
    turn_error: float  # [rad]; infinite where the touches are too near to each other to tell

    @property
    def is_certain(self) -> bool:
        """Whether it is more than chance."""
        return (
            bool((np.abs(self.shift) > MIN_SIGNIFICANCE * self.shift_error).any())
            or abs(self.turn) > MIN_SIGNIFICANCE * self.turn_error
        )

    def at(self, flat: Array) -> Array:
        """By how much cells at places (k, 2) of the flat skin move along and across the rows, shape (k, 2) [m]."""
        arm = flat - self.middle
        return self.shift + self.turn * np.stack((-arm[:, 1], arm[:, 0]), axis=1)


@dataclass(frozen=True, eq=False)
class Placement:
    """The touches of one patch; row i of every array is the same touch."""

    patch: Patch
    lines: IntArray  # (m,) of the file
    rows: IntArray  # (m,) of the taxels in the patch
    places: Array  # (m, 3) that were touched, in the link frame [m]
    off: Array  # (m, 3) from the taxel to the place: along its row, across it, outward [m]; no height (NaN) of a line
    passing: IntArray  # lines of the file whose line of action passes along the skin, and tells no place

    @cached_property
    def distances(self) -> Array:
        """Along the skin, of each touch (m,) [m]."""
        return np.linalg.norm(self.off[:, :2], axis=1)

    @cached_property
    def heights(self) -> Array:
        """Of the places over the taxels' tangent planes [m], those that are told."""
        return self.off[~np.isnan(self.off[:, 2]), 2]

    @property
    def expected_rms(self) -> float:
        """Root of the mean square of distances that the size of the cells alone gives [m]."""
        return float(np.sqrt(self.patch.taxels.areas.mean() / 6))  # of squares; of hexagons 2 % less

    @cached_property
    def flat(self) -> Array:
        """Where the touched cells lie in the flat skin (m, 2) [m]."""
        return flat_places(self.patch, self.patch.taxels.index[self.rows])

    @cached_property
    def motion(self) -> Motion | None:
        """What slide of the skin the touches ask for; None of imported taxels, and of too few touches.

        Distances along the skin are explained by ``shift + turn x arm``; what is far off counts little.
        """
        if self.patch.kind == "imported" or len(self.rows) < MIN_TOUCHES:
            return None
        middle = self.flat.mean(axis=0)
        x, y = (self.flat - middle).T
        turns = bool(np.hypot(x, y).max() > self.expected_rms)  # else all touched one cell
        directions = np.stack((np.column_stack((x * 0 + 1, x * 0, -y)), np.column_stack((x * 0, x * 0 + 1, x))), axis=1)
        found, errors = _robust(directions[..., : 3 if turns else 2], self.off[:, :2], ROBUST_SCALE * self.expected_rms)
        turn, turn_error = (float(found[2]), float(errors[2])) if turns else (0.0, np.inf)
        return Motion(middle, found[:2], turn, errors[:2], turn_error)

    @cached_property
    def residuals(self) -> Array:
        """Distances (m,) once the skin has slid so [m]."""
        if self.motion is None:
            return self.distances
        return np.linalg.norm(self.off[:, :2] - self.motion.at(self.flat), axis=1)

    def warnings(self) -> Iterator[Warning]:
        """Yield what the author should look at."""
        name, place = self.patch.name, Place(skin=self.patch.name)
        order = other_order(self)
        if order:
            message = f"The touches of {name} fit another order of its channels: {order}."
            yield Warning("channel-order", "warning", message, place, advice="Check the order of the channels.")
            return
        if len(self.passing):
            lines = [f"line {line}" for line in self.passing.tolist()]
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
        """Touches (k,) that no slide of the skin explains: most likely a wrong channel."""
        if len(self.rows) == 0:
            return self.rows
        height = np.nan_to_num(self.off[:, 2] - (np.median(self.heights) if len(self.heights) else 0.0))
        far = np.hypot(self.residuals, height)
        usual = max(self.expected_rms, float(np.median(far)))
        return np.flatnonzero((far > OUTLIER_FACTOR * usual) & (far > OUTLIER_CELLS * max(self.patch.pitch)))

    def _other_taxel(self, i: int) -> str:
        """A touch that is astray, and which taxel lies where it was."""
        taxels = self.patch.taxels
        directions = np.linalg.norm(taxels.positions_link - self.places[i], axis=1)
        mine = int(self.rows[i])
        text = f"line {self.lines[i]}, {taxels.ids[mine]}, {directions[mine] * 1e3:.1f} mm"
        if np.isnan(self.off[i, 2]):
            return text
        return f"{text} ({taxels.ids[int(directions.argmin())]} is there)"


def placements(calibration: LinkCalibration, touches: Touches) -> list[Placement]:
    """Touches beside the taxels that felt them, for each patch that was touched; a taxel of no patch is left out."""
    found = []
    for patch in calibration.patches:
        row_of = {name: row for row, name in enumerate(patch.taxels.ids)}
        mine = [i for i, name in enumerate(touches.taxels) if name in row_of]
        if mine:
            rows = np.array([row_of[touches.taxels[i]] for i in mine])
            found.append(_placement(patch, touches.lines[mine], rows, touches.points[mine], touches.directions[mine]))
    return found


def _placement(patch: Patch, lines: IntArray, rows: IntArray, points: Array, directions: Array) -> Placement:
    """Places (m, 3), and lines where there are ways (m, 3), beside taxels: a line is met in the tangent plane."""
    centres, normals, tangents = (
        part[rows] for part in (patch.taxels.positions_link, patch.taxels.normals_link, patch.taxels.tangents_link)
    )
    is_line, slope = directions.any(axis=1), (directions * normals).sum(axis=1)
    known = ~is_line | (np.abs(slope) >= MIN_INCIDENCE_SINE)
    height = ((points - centres) * normals).sum(axis=1)
    places = points - (height / np.where(is_line & known, slope, np.inf))[:, None] * directions
    axes = np.stack((tangents, np.cross(normals, tangents), normals), axis=1)
    off = (axes @ (places - centres)[:, :, None])[:, :, 0]
    off[is_line, 2] = np.nan
    return Placement(patch, lines[known], rows[known], places[known], off[known], lines[~known])


def _robust(directions: Array, off: Array, far: float) -> tuple[Array, Array]:
    """The parameters (k,) of ``off (m, 2) = ways (m, 2, k) @ parameters`` and their standard errors.

    Least squares in which a pair that is left off by ``far`` counts half (Cauchy's weights), from the medians on.
    """
    found = np.zeros(directions.shape[2])
    found[:2] = np.median(off, axis=0)
    for _ in range(REWEIGHTING_STEPS):
        squares = ((off - directions @ found) ** 2).sum(axis=1)
        weights = 1 / (1 + squares / far**2)
        normal = np.einsum("mik,m,mil->kl", directions, weights, directions)
        found = np.linalg.solve(normal, np.einsum("mik,m,mi->k", directions, weights, off))
    spread = (weights * squares).sum() / max(2 * len(off) - len(found), 1)
    return found, np.sqrt(spread * np.diag(np.linalg.inv(normal)))


def flat_places(patch: Patch, cells: IntArray) -> Array:
    """Where cells (n, 2) of a sheet or of boards lie before these are laid on a link (n, 2) [m]: x along the rows.

    Cells are named as in the patch's ``index``, whether the patch has them or not.
    """
    i, j = cells.T.astype(float)
    if patch.kind == "hexagons":
        return patch.pitch[0] * np.column_stack((i + j / 2, np.sqrt(0.75) * j))
    return np.column_stack((patch.pitch[1] * j, _hand(patch) * patch.pitch[0] * i))


def _hand(patch: Patch) -> float:
    """1 where the next row of a sheet lies to the left of a row, -1 where it lies to the right."""
    taxels = patch.taxels
    row_of = {cell: row for row, cell in enumerate(map(tuple, taxels.index.tolist()))}
    pairs = [(row, row_of[i + 1, j]) for (i, j), row in row_of.items() if (i + 1, j) in row_of]
    if not pairs:
        return 1.0
    here, there = np.array(pairs).T
    residuals = np.cross(taxels.normals_link[here], taxels.tangents_link[here])
    rows_apart = taxels.positions_link[there] - taxels.positions_link[here]
    return 1.0 if (residuals * rows_apart).sum() > 0 else -1.0


def other_order(placement: Placement) -> str | None:
    """In words, the order in which a sheet's channels run if the touches fit that instead; None if not."""
    patch = placement.patch
    rows, columns = patch.shape
    taxels = patch.taxels
    if patch.kind != "sheet" or len(taxels.ids) != rows * columns:
        return None
    known = ~np.isnan(placement.off[:, 2])
    if known.sum() < MIN_TOUCHES:
        return None
    places, touched = placement.places[known], placement.rows[known]
    i, j = taxels.index[touched].T
    number = i * columns + j
    by_rows, by_columns = (i, j), (number % rows, number // rows)
    best, description = ORDER_GAIN * _mean(taxels.positions_link[touched] - places), None
    row_at = np.empty((rows, columns), np.int64)
    row_at[tuple(taxels.index.T)] = np.arange(len(taxels.ids))
    for name, (a, b) in (("", by_rows), ("column by column", by_columns)):
        for flip_rows in (False, True):
            for flip_columns in (False, True):
                other = row_at[rows - 1 - a if flip_rows else a, columns - 1 - b if flip_columns else b]
                mean = _mean(taxels.positions_link[other] - places)
                if mean < best and mean < max(patch.pitch):
                    flips = [n for n, is_so in (("rows", flip_rows), ("columns", flip_columns)) if is_so]
                    ends = f"{' and '.join(flips)} counted from the other end" if flips else ""
                    best, description = mean, ", ".join(part for part in (name, ends) if part)
    return description


def _listed(items: list[str]) -> str:
    return "; ".join(items[:MAX_TOUCHES_NAMED]) + (
        f"; and {len(items) - MAX_TOUCHES_NAMED} more" if len(items) > MAX_TOUCHES_NAMED else ""
    )


def _mean(ends: Array) -> float:
    return float(np.linalg.norm(ends, axis=1).mean())
