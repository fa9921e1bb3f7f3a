"""What follows from which taxels are active, whatever they feel: groups, areas, supporting polygons."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..common.arrays import IntArray
from .balance.polygon import NOTHING, Polygon, of_grid
from .components import components
from .geometry import GroundGeometry, SkinGeometry


@dataclass(frozen=True, eq=False)
class SupportingPolygon:
    """Three answers to where a foot is supported, for cells are large; in the ground's coordinates.

    The true contact lies within ``outer`` and holds ``guaranteed``: on simulated soles ``outer`` goes up to 27 mm
    too far, ``guaranteed`` never.
    """

    outer: Polygon  # hull of the corners of the active cells
    nominal: Polygon  # hull of their centres
    guaranteed: Polygon  # the nominal polygon less a cell all round


class Footprint:
    """Active taxels of a skin; everything else is worked out when it is asked for, once."""

    def __init__(self, skin: SkinGeometry, ground: GroundGeometry | None, rows: IntArray):
        self.skin, self.ground, self.rows = skin, ground, rows

    @cached_property
    def groups(self) -> IntArray:
        """Number of the contact of each active taxel (a,)."""
        return components(self.rows, self.skin.beside, self.skin.place)

    @cached_property
    def ordered(self) -> tuple[IntArray, IntArray]:
        """The rows sorted by contact, and where each contact begins among them."""
        if not np.count_nonzero(self.groups):
            return self.rows, np.zeros(min(len(self.rows), 1), np.int64)
        order = self.groups.argsort(kind="stable")
        groups = self.groups.take(order)
        return self.rows.take(order), groups.searchsorted(np.arange(groups[-1] + 1))

    @cached_property
    def area(self) -> float:
        """Of the active cells [m^2], whole cells: on flat ground 1.06 times the true area."""
        return float(self.skin.areas.take(self.rows).sum())

    @cached_property
    def polygon(self) -> SupportingPolygon:
        """The supporting polygons on the ground; empty where the skin has no ground."""
        ground = self.ground
        if ground is None:
            return SupportingPolygon(NOTHING, NOTHING, NOTHING)
        rows = self.rows[ground.under.take(self.rows)]
        hulls = ground.corner_hull.hull(rows), ground.centre_hull.hull(rows)
        known, polygon = ground.supporting
        if hulls != known:
            outer = of_grid(hulls[0], ground.corner_hull.step)
            nominal = of_grid(hulls[1], ground.centre_hull.step)
            polygon = SupportingPolygon(outer, nominal, nominal.eroded(ground.cell))
            ground.supporting = hulls, polygon
        return polygon
