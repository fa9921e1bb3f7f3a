"""Compute what depends only on which taxels are active: components, area, supporting polygons."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..common.arrays import IntArray
from .balance.polygon import EMPTY_POLYGON, Polygon, from_grid
from .components import components
from .geometry import GroundGeometry, SkinGeometry


@dataclass(frozen=True, eq=False)
class SupportingPolygon:
    """Three supporting polygons, in the coordinates of the ground. They differ because the cells are large.

    ``outer`` contains the true contact. The hull of the true contact contains ``guaranteed``. On simulated soles
    ``outer`` extends up to 27 mm too far, ``guaranteed`` never does.
    """

    outer: Polygon  # hull of the corners of the active cells
    nominal: Polygon  # hull of the centres of the active cells
    guaranteed: Polygon  # nominal, with each edge moved inward by the size of a cell


class Footprint:
    """The active taxels of a skin. Each result is computed when it is first used, once."""

    def __init__(self, skin: SkinGeometry, ground: GroundGeometry | None, rows: IntArray):
        self.skin, self.ground, self.rows = skin, ground, rows

    @cached_property
    def groups(self) -> IntArray:
        """Number (a,) of the contact of each active taxel."""
        return components(self.rows, self.skin.neighbours, self.skin.scratch)

    @cached_property
    def ordered(self) -> tuple[IntArray, IntArray]:
        """The rows sorted by contact, and the index at which each contact starts."""
        if not np.count_nonzero(self.groups):
            return self.rows, np.zeros(min(len(self.rows), 1), np.int64)
        order = self.groups.argsort(kind="stable")
        groups = self.groups.take(order)
        return self.rows.take(order), groups.searchsorted(np.arange(groups[-1] + 1))

    @cached_property
    def area(self) -> float:
        """Sum of the areas of the active cells [m^2]; on flat ground 1.06 times the true area."""
        return float(self.skin.areas.take(self.rows).sum())

    @cached_property
    def polygon(self) -> SupportingPolygon:
        """Supporting polygons on the ground (thesis eq. 4.24); empty if the skin has no ground."""
        ground = self.ground
        if ground is None:
            return SupportingPolygon(EMPTY_POLYGON, EMPTY_POLYGON, EMPTY_POLYGON)
        rows = self.rows[ground.can_stand.take(self.rows)]
        hulls = ground.corner_hull.hull(rows), ground.centre_hull.hull(rows)
        last_hulls, polygon = ground.last_polygons
        if hulls != last_hulls:
            outer = from_grid(hulls[0], ground.corner_hull.step)
            nominal = from_grid(hulls[1], ground.centre_hull.step)
            polygon = SupportingPolygon(outer, nominal, nominal.eroded(ground.cell))
            ground.last_polygons = hulls, polygon
        return polygon
