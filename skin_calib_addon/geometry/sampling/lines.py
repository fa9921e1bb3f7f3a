"""The lines P_u ∩ P_v on which control points move."""

from dataclasses import dataclass

from ...common.arrays import Array, freeze
from ...common.warnings import Warning
from .planes import Planes


@dataclass(frozen=True, eq=False)
class LineGrid:
    """One line per control point: ``origins[i, j] + t * directions[i, j]`` lies in u-plane i and v-plane j.

    Lines are ordered so that for outward directions ``r_u x r_v`` points outward too: seen along the u-direction,
    those of a tube run clockwise.
    """

    planes_u: Planes
    origins: Array  # (n, m, 3) [m]
    directions: Array  # (n, m, 3) unit, out of the robot
    closed: bool  # whether the last line neighbours the first
    v_names: tuple[str, ...]  # what the author calls each v-line, for messages
    warnings: tuple[Warning, ...] = ()  # about the placement of the planes
    seam: Array | None = None  # (2, 3) of a closed one a point of the axis [m], and where angle zero is from there

    def __post_init__(self):
        n, m = len(self.planes_u), len(self.v_names)
        freeze(self, origins=(n, m, 3), directions=(n, m, 3))
        if self.seam is not None:
            freeze(self, seam=(2, 3))
