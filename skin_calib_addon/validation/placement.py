"""Deviation of taxels from measured touches, and the motion of the skin that explains most of it.

The position of a touch can be anywhere in the cell of the taxel that felt it. A single distance of half a cell is
therefore no error, but a mean over many touches is.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np

from ..calibration.model import LinkCalibration, Patch
from ..common.arrays import Array, BoolArray, IntArray
from ..common.errors import MAX_NAMED
from ..common.warnings import Place, Warning
from .directions import directions_of
from .flat import along_skin, flat_places
from .registration import Evidence, Motion, Posterior, motion_of, novelty, posterior, rigid_motion
from .touches import Touches, lines_of_action
from .wiring import FAR, Wiring, judge

# Smallest number of touches for a motion. Larger: no motion for fewer touches.
MIN_TOUCHES = 4
# A touch farther off than this multiple of the usual distance is an outlier, ...
OUTLIER_FACTOR = 3.0
# ... if it is farther off than this number of cells, too. Larger: fewer outliers.
OUTLIER_CELLS = 1.5
# [1] Fraction of the touches that may be unexplained. Larger: states motions for more wrong channels.
MAX_UNEXPLAINED = 0.3
# [fraction of the strongest reading] of a taxel that felt a touch. Larger: fewer centroids. Smaller: noise moves them.
MIN_READING = 0.05
# [pitch] Distance from the strongest taxel within which others felt the same touch: the eight or six cells around it.
NEAR_CELLS = 1.6
# [1] Regularity of touches from which on a warning about a raster is given, and the logarithm of the probability that
# random touches are so by chance. Larger: fewer warnings.
MIN_REGULARITY, RANDOM_LIMIT = 0.5, 7.0
# [cell size] Least and largest spacing of a raster. A wider range: other rasters have a warning, and more touches by
# chance.
RASTER_CELLS = (0.5, 3.0)
MIN_RASTER_STEPS = 3  # [1] of the touches. Fewer: touches of a small part of the skin are on a raster.
RASTER_SAMPLES = 8  # [1] spacings per touched length. More: more exact. Fewer: misses rasters.
# [1] of the largest regularity: a raster is also one of half the spacing. Smaller: states a multiple of the spacing.
SAME_REGULARITY = 0.95
OFFSET_STEP = 1e-3  # [N] of a derivative. Larger: less exact.
# Median height of touches above or below the taxels from which on a warning is given [m]: half of the distance at which
# a single touch is an error. Larger: fewer warnings.
HEIGHT_LIMIT = 2.5e-3


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
    readings: Array  # (m, n) of the taxels of the patch; empty without
    noise: Array  # (m,) known error of the position, per axis [m]
    planned: Array  # (3,) motion that returns the patch to where the plan had it: along, across [m], rotation [rad]
    slopes: Array  # (m, 2, 3) of the offsets with an offset of the force sensor, along and across [m/N]
    offset_covariance: Array  # (3, 3) of this offset [N^2]; zero if nothing is corrected

    @cached_property
    def distances(self) -> Array:
        """Distance of each touch from its taxel along the skin, shape (m,) [m]."""
        return np.linalg.norm(self.offsets[:, :2], axis=1)

    @cached_property
    def heights(self) -> Array:
        """Heights of the touches above the skin, as far as they are known [m]."""
        return self.offsets[~np.isnan(self.offsets[:, 2]), 2]

    @property
    def _uncommon_heights(self) -> Array:
        """Heights of all touches (m,) relative to their median; NaN where they are not known [m]."""
        return self.offsets[:, 2] - (np.median(self.heights) if len(self.heights) else 0.0)

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
    def evidence(self) -> Evidence:
        """What the touches report of the position of the skin."""
        size = float(np.sqrt(self.patch.taxels.areas.mean()))
        offsets = np.where(self._is_there[:, None], self.offsets[:, :2], FAR)
        cells = Evidence.of_cells(self.patch, self.rows, offsets, self.planned, novelty(offsets, size), self.noise)
        axes, centroids, borders = felt_by_several(self.patch, self.rows, self.readings)
        return replace(cells, axes=axes, centroids=centroids, borders=borders)

    @cached_property
    def _is_there(self) -> BoolArray:
        """Whether height and direction of each touch (m,) allow that its taxel felt it."""
        side = np.sign((self.directions * self.patch.taxels.normals_link[self.rows]).sum(axis=1))
        return ~(np.abs(self._uncommon_heights) > max(self.patch.pitch)) & (side * np.sign(side.sum()) >= 0)

    @cached_property
    def posterior(self) -> Posterior | None:
        """Distribution of the motions that explain the touches; None for imported taxels, and for too few touches."""
        if self.patch.kind == "imported" or len(self.rows) < MIN_TOUCHES:
            return None
        found = posterior(self.evidence)
        moves = rigid_motion(self.flat, self.slopes)  # by an offset of the force sensor
        return replace(found, covariance=found.covariance + moves @ self.offset_covariance @ moves.T)

    @cached_property
    def motion(self) -> Motion | None:
        """Motion of the skin that explains the touches."""
        return None if self.posterior is None else motion_of(self.posterior, self.flat.mean(axis=0))

    @cached_property
    def raster(self) -> float | None:
        """Spacing of the raster that the touches are on, along the rows or across [m]; None if they are on none.

        The regularity for a spacing is the length of the mean of unit vectors whose angles are the positions in units
        of the spacing: 0 at random, 1 on the raster. For m random vectors and one of k spacings it is above r with a
        probability of at most k exp(-m r^2) (Rayleigh). The size of the cells is one spacing, others are many.
        """
        found = [(0.0, 0.0)]
        sizes = np.ptp(self.patch.taxels.flat_corners, axis=1).mean(axis=0)
        for x, size in zip((self.flat + self.offsets[:, :2]).T, sizes.tolist()):
            span = max(float(np.ptp(x)) if len(x) else 0.0, MIN_RASTER_STEPS * RASTER_CELLS[0] * size)
            least = max(1 / (RASTER_CELLS[1] * size), MIN_RASTER_STEPS / span)
            others = 1 / np.arange(least, 1 / (RASTER_CELLS[0] * size), 1 / (RASTER_SAMPLES * span))
            for spacings in (others, np.array([size])):
                if len(x) == 0 or len(spacings) == 0:
                    continue
                regularity = np.abs(np.exp(2j * np.pi * x[:, None] / spacings).mean(axis=0))
                limit = np.sqrt((RANDOM_LIMIT + np.log(len(spacings))) / len(x))
                if regularity.max() > max(MIN_REGULARITY, limit):
                    largest = spacings[regularity > SAME_REGULARITY * regularity.max()].max()
                    regularity[spacings < 0.9 * largest] = 0.0
                    found.append((float(regularity.max()), float(spacings[regularity.argmax()])))
        return max(found)[1] or None

    @cached_property
    def residuals(self) -> Array:
        """Distances along the skin after the motion, shape (m,) [m]."""
        if self.motion is None:
            return self.distances
        return np.linalg.norm(self.offsets[:, :2] - self.motion.at(self.flat), axis=1)

    def warnings(self) -> Iterator[Warning]:
        """Yield warnings for the author: order of channels, grazing touches, wrong taxels, height."""
        name, place = self.patch.name, Place(skin=self.patch.name)
        yield from self._about_the_order()
        if len(self.rows) >= MIN_TOUCHES and self.wiring.order.words:
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
        if self.patch.kind != "imported" and self.raster is not None:
            message = (
                f"The touches of {name} are on a raster of {self.raster * 1e3:.1f} mm, at few positions in their cells."
            )
            yield Warning("raster-touches", "warning", message, place, self.raster, "Touch random positions.")
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

    def _about_the_order(self) -> Iterator[Warning]:
        """Yield warnings about the order of the channels."""
        if len(self.rows) < MIN_TOUCHES:
            return
        name, place, wiring = self.patch.name, Place(skin=self.patch.name), self.wiring
        if 1 - wiring.explained > MAX_UNEXPLAINED:
            count = round((1 - wiring.explained) * len(self.rows))
            message = f"{count} of {len(self.rows)} touches of {name} fit neither its taxels nor another known order."
            advice = "Check the channels, and the frame of the touches."
            yield Warning("unexplained-touches", "warning", message, place, float(count), advice)
        elif not wiring.is_certain:
            message = f"The touches of {name} fit several orders of its channels: {_listed(wiring.candidates)}."
            advice = "Touch both ends of its rows and columns."
            yield Warning("channel-order", "warning", message, place, wiring.odds, advice)
        elif wiring.order.words:
            order = f"{wiring.order.words} (odds {odds_in_words(wiring.odds)})"
            message = f"The touches of {name} fit another order of its channels: {order}."
            yield Warning("channel-order", "warning", message, place, wiring.odds, "Correct the order of the channels.")

    @cached_property
    def _far(self) -> Array:
        """Distance (m,) of each touch that neither the motion nor a common height explains [m]."""
        return np.hypot(self.residuals, np.nan_to_num(self._uncommon_heights))

    @cached_property
    def wiring(self) -> Wiring:
        """The order of the channels that explains the touches best."""
        return judge(self.patch, self.rows, self.places, self.directions, self.planned, self.noise)

    @cached_property
    def unexplained(self) -> BoolArray:
        """Touches (m,) that the motion of the skin does not explain in the planned order."""
        return self.evidence.explained(self.posterior) < 0.5

    @property
    def is_explained(self) -> bool:
        """Whether the planned order explains most touches, so that the motion says something."""
        return bool(self.unexplained.sum() <= MAX_UNEXPLAINED * len(self.rows)) and not self.wiring.order.words

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
        distances = np.linalg.norm(taxels.positions_link - self.places[i], axis=1)
        mine = int(self.rows[i])
        text = f"line {self.lines[i]}, {taxels.ids[mine]}, {distances[mine] * 1e3:.1f} mm"
        if np.isnan(self.offsets[i, 2]):
            return text
        return f"{text} ({taxels.ids[int(distances.argmin())]} is there)"


def placements(
    calibration: LinkCalibration, touches: Touches, planned: Mapping[str, Array] = MappingProxyType({})
) -> list[Placement]:
    """Return the touches of each touched patch, compared with its taxels; taxels without a patch are left out.

    ``planned`` has the motions (3,) that return patches to where the plan had them, by their names.
    """
    directions, touches = directions_of(calibration, touches)
    covariance = directions.offset_covariance if directions and directions.is_of_sensor else np.zeros((3, 3))
    found = (
        _placement(patch, touches, planned.get(patch.name, np.zeros(3)), covariance) for patch in calibration.patches
    )
    return [placement for placement in found if placement is not None]


def _placement(patch: Patch, touches: Touches, planned: Array, offset_covariance: Array) -> Placement | None:
    """Compare the touches of a patch with their taxels; None without any."""
    row_of = {name: row for row, name in enumerate(patch.taxels.ids)}
    mine = [i for i, name in enumerate(touches.taxels) if name in row_of]
    if not mine:
        return None
    rows = np.array([row_of[touches.taxels[i]] for i in mine])
    points, directions, lines = touches.points[mine], touches.directions[mine], touches.lines[mine]
    offsets, places, _, known = along_skin(patch, rows, points, directions)
    slopes = np.zeros((len(rows), 2, 3))
    if offset_covariance.any():
        is_line = directions.any(axis=1)[:, None]
        for k, step in enumerate(OFFSET_STEP * np.eye(6)[:3]):
            other, along = lines_of_action(touches.wrenches[mine] - step)
            moved = along_skin(patch, rows, np.where(is_line, other, points), np.where(is_line, along, 0.0)).offsets
            slopes[:, :, k] = (moved - offsets)[:, :2] / OFFSET_STEP
    noise = touches.tool.sigma[mine] if touches.tool else np.zeros(len(mine))
    column = {name: k for k, name in enumerate(touches.felt)}
    columns = [column[name] for name in patch.taxels.ids] if patch.taxels.ids[0] in column else []
    return Placement(
        patch=patch,
        lines=lines[known],
        rows=rows[known],
        places=places[known],
        offsets=offsets[known],
        directions=directions[known],
        grazing=lines[~known],
        readings=touches.readings[np.ix_(mine, columns)][known] if columns else np.empty((int(known.sum()), 0)),
        noise=noise[known],
        planned=planned,
        slopes=slopes[known],
        offset_covariance=offset_covariance,
    )


def felt_by_several(patch: Patch, rows: IntArray, readings: Array) -> tuple[Array, Array, Array]:
    """Return axes, centroids and borders of `Evidence` for touches with readings (m, n)."""
    axes, centroids, borders = np.zeros((len(rows), 2, 2)), np.zeros((len(rows), 2)), np.zeros((len(rows), 2))
    if readings.shape[1] == 0:
        return axes, centroids, borders
    taxels, is_flat = patch.taxels, patch.kind != "imported"
    flat = flat_places(patch, taxels.index)
    pitch = np.array((patch.pitch[1], patch.pitch[0]) if patch.kind == "sheet" else (patch.pitch[0],) * 2)
    for k, (row, felt) in enumerate(zip(rows.tolist(), readings)):
        arms = (
            flat - flat[row]
            if is_flat
            else (taxels.positions_link - taxels.positions_link[row]) @ taxels.axes_link[row].T
        )
        near = (((arms / pitch) ** 2).sum(axis=1) < NEAR_CELLS**2) & (felt > MIN_READING * felt[row])
        if near.sum() < 2:
            continue
        cells = arms[near]
        centroids[k] = felt[near] @ cells / felt[near].sum()
        if patch.kind == "sheet":  # a border between rows, between columns, or both
            low, high = cells.min(axis=0), cells.max(axis=0)
            borders[k] = (low + high) / 2
            axes[k] = np.diag((high - low > pitch / 2).astype(float))
        else:
            borders[k] = cells.mean(axis=0)
            _, sizes, directions = np.linalg.svd(cells - borders[k], full_matrices=True)
            axes[k, : int((sizes > pitch[0] / 4).sum())] = directions[: int((sizes > pitch[0] / 4).sum())]
    return axes, centroids, borders


def odds_in_words(odds: float) -> str:
    """Return odds in words from their logarithm."""
    return f"{np.exp(odds):.0f} to 1" if odds < np.log(1000) else "above 1000 to 1"


def _listed(items: list[str]) -> str:
    return "; ".join(items[:MAX_NAMED]) + (f"; and {len(items) - MAX_NAMED} more" if len(items) > MAX_NAMED else "")
