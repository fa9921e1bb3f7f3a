"""Compute what depends only on which taxels are touched: components, area, supporting polygons."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..common.arrays import BoolArray, IntArray, lock
from .components import components
from .geometry import GroundGeometry, SkinGeometry
from .polygon import EMPTY_POLYGON, Polygon


@dataclass(frozen=True, eq=False)
class SupportingPolygon:
    """Three supporting polygons, in the coordinates of the ground. They differ because the cells are large.

    The hull of the true contact contains ``guaranteed``. ``outer`` contains every cell with more than the detection
    limit of its taxel. A probability is that of one frame; it is None where the noise of the skin is not known.
    """

    outer: Polygon  # hull of the corners of the cells that are possibly touched
    nominal: Polygon  # hull of the centres of the active cells
    guaranteed: Polygon  # hull of the centres of the cells that are surely touched, each edge moved in by a cell
    outer_probability: float | None = None  # that outer contains a cell at its detection limit
    guaranteed_probability: float | None = None  # that each cell of guaranteed is touched


NO_POLYGON = SupportingPolygon(EMPTY_POLYGON, EMPTY_POLYGON, EMPTY_POLYGON)


class Footprint:
    """The active taxels of a skin. Each result is computed when it is first used, once."""

    def __init__(self, skin: SkinGeometry, ground: GroundGeometry | None, active: BoolArray):
        self.skin, self.ground, self.active, self.rows = skin, ground, active, active.nonzero()[0]
        lock(self.active, self.rows)

    def of(self, active: BoolArray) -> "Footprint":
        """Return the footprint of these active taxels (n,): this one if they are its own."""
        return Footprint(self.skin, self.ground, active) if np.count_nonzero(active != self.active) else self

    @cached_property
    def groups(self) -> IntArray:
        """Number (a,) of the contact of each active taxel."""
        groups = components(self.rows, self.skin.neighbours, self.skin.scratch)
        lock(groups)
        return groups

    @cached_property
    def ordered(self) -> tuple[IntArray, list[int]]:
        """The rows sorted by contact, and the index at which each contact starts; then their number."""
        rows, groups = self.rows, self.groups
        if not np.count_nonzero(groups):
            return rows, [0, len(rows)] if len(rows) else [0]
        rows = rows[groups.argsort(kind="stable")]
        lock(rows)
        return rows, [0, *np.add.accumulate(np.bincount(groups)).tolist()]

    @cached_property
    def area(self) -> float:
        """Sum of the areas of the active cells [m^2]; on flat ground 1.06 times the true area."""
        return float(self.skin.areas.take(self.rows).sum())

    @cached_property
    def is_full(self) -> bool:
        """Whether all taxels that can stand on the ground are active."""
        return self.ground is not None and bool(self.ground.is_full(self.active))


def supporting_polygon(
    ground: GroundGeometry, possible: BoolArray, active: BoolArray, sure: BoolArray, probabilities: tuple
) -> SupportingPolygon:
    """Return the supporting polygons on the ground (thesis eq. 4.24)."""
    core = ground.sure_hull.hull(sure)
    nominal = core if sure is active else ground.centre_hull.hull(active)
    last_core, guaranteed = ground.last_eroded
    if core is not last_core:
        guaranteed = core.eroded(ground.cell)
        ground.last_eroded = core, guaranteed
    return SupportingPolygon(ground.corner_hull.hull(possible), nominal, guaranteed, *probabilities)
