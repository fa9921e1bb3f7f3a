"""The lines P_u ∩ P_v on which control points move."""

from collections.abc import Callable
from dataclasses import dataclass

from ...common.arrays import Array, BoolArray, freeze
from ...common.warnings import Warning
from .planes import Planes


@dataclass(frozen=True, eq=False)
class LineGrid:
    """One line per control point: ``origins[i, j] + t * directions[i, j]`` is in u-plane i and v-plane j.

    The order of the lines makes ``r_u x r_v`` point outward for outward directions. Seen along the u-direction, the
    lines of a tube are in clockwise order.
    """

    planes_u: Planes
    origins: Array  # (n, m, 3) [m]
    directions: Array  # (n, m, 3) unit, out of the robot
    closed: bool  # whether the last line is next to the first
    v_names: tuple[str, ...]  # name of each v-line in messages
    warnings: tuple[Warning, ...] = ()  # about the placement of the planes
    centre: Array | None = None  # (3,) point of the mesh at the middle of the region [m]
    u_names: tuple[str, ...] = ()  # name of each u-plane in messages; empty: by their order
    # Whether points (..., 3) are inside the boundary; None: there is none.
    region: Callable[[Array], BoolArray] | None = None

    def __post_init__(self):
        n, m = len(self.planes_u), len(self.v_names)
        freeze(self, origins=(n, m, 3), directions=(n, m, 3))
        if self.centre is not None:
            freeze(self, centre=(3,))
        if not self.u_names:
            object.__setattr__(self, "u_names", tuple(f"u-plane {i}" for i in range(n)))
