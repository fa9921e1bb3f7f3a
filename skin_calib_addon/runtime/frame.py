"""What the skin of a link feels at one time."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..common.arrays import Array, BoolArray
from .balance.polygon import NOTHING
from .contacts import Contact
from .footprint import Footprint, SupportingPolygon
from .geometry import GroundGeometry

# Below this the CoP of a foot is the noise of its taxels [N].
LEAST_LOAD = 5.0


@dataclass(frozen=True, eq=False)
class Frame:
    """What the skin feels at one time; CoP, ZMP and polygons are worked out when they are asked for.

    ``flags`` holds every doubt: about the reading ``wrong_type``, ``wrong_length``, ``not_finite`` (some taxels gave
    no number), ``too_large`` (some gave a force that nothing bears), ``blind`` (no taxel gave one), ``saturated``,
    ``stuck``; about time ``time_not_finite``, ``time_still``, ``time_back``, ``time_jump``, ``dropped``.
    """

    time: float  # [s]
    forces: Array  # (n,) on each taxel [N]; 0 where it is not known
    known: BoolArray  # (n,) whether the taxel gave a force that can be
    saturated: BoolArray  # (n,) whether the force may be larger
    stuck: BoolArray  # (n,) whether a pressed taxel's reading has stood still for half a minute
    contacts: tuple[Contact, ...]
    wrench: Array  # (6,) of all contacts about the link's origin [N, N m]; NaN where nothing is known
    flags: frozenset[str]
    problem: str | None  # why the whole reading was refused
    footprint: Footprint | None  # the active taxels; None where nothing is known

    @property
    def touched(self) -> bool | None:
        """Whether something presses; None where that is not known: a blind skin is not a free one."""
        return None if self.footprint is None else bool(self.contacts)

    @property
    def active(self) -> BoolArray:
        """(n,) whether the taxel is part of a contact."""
        active = np.zeros(len(self.forces), bool)
        if self.footprint is not None:
            active[self.footprint.rows] = True
        return active

    @property
    def area(self) -> float:
        """Of the active cells [m^2] (thesis 4.22, with each cell's own area)."""
        return 0.0 if self.footprint is None else self.footprint.area

    @property
    def ground(self) -> GroundGeometry | None:
        """The ground the skin stands on, whose coordinates CoP, ZMP and polygons have."""
        return None if self.footprint is None else self.footprint.ground

    @cached_property
    def polygon(self) -> SupportingPolygon:
        """Outer, nominal and guaranteed supporting polygon in the ground's coordinates; empty without contact."""
        if self.footprint is None:
            return SupportingPolygon(NOTHING, NOTHING, NOTHING)
        return self.footprint.polygon

    @cached_property
    def _on_ground(self) -> list[float]:
        """Lift, lift x, lift y of the taxels that can stand; f_z, tau_x, tau_y of all, about the ground's origin."""
        if self.footprint is None or self.footprint.ground is None:
            return [0.0] * 6
        rows = self.footprint.rows
        return (self.forces.take(rows) @ self.footprint.ground.sums.take(rows, axis=0)).tolist()

    @property
    def load(self) -> float:
        """Force with which the ground lifts the taxels that can stand on it [N]."""
        return self._on_ground[0]

    @property
    def reason(self) -> str | None:
        """Why there is no CoP, in words; None where there is one."""
        if self.footprint is None:
            return self.problem or "no taxel gives a reading"
        if self.footprint.ground is None:
            return "the skin is not flat and was given no ground"
        if self.load < LEAST_LOAD:
            return f"{self.load:.2g} N press, of {LEAST_LOAD:g} N that a CoP needs"
        return None

    @cached_property
    def cop(self) -> Array | None:
        """Centre of pressure (2,) in the ground's coordinates [m] (thesis 4.21); None with a :attr:`reason`.

        The mean place of the taxels that can stand on the ground, weighted by how much each lifts. Where all of them
        are in contact, forces within the cells are made up for.
        """
        if self.reason is not None:
            return None
        assert self.footprint is not None and self.footprint.ground is not None
        ground, rows = self.footprint.ground, self.footprint.rows
        lift, along_x, along_y, *_ = self._on_ground
        cop = np.array((along_x / lift, along_y / lift))
        if (
            ground.stretch is None
            or len(rows) < ground.standing
            or np.count_nonzero(ground.under[rows]) < ground.standing
        ):
            return cop
        middle, stretch = ground.stretch
        return middle + stretch @ (cop - middle)

    @cached_property
    def zmp(self) -> Array | None:
        """Zero moment point (2,) in the ground's coordinates [m]: there the wrench has no moment along the ground.

        From the whole wrench, wherever its contacts are (thesis 4.21 in its general form); the CoP where
        all taxels lie in the ground and look straight down. None with a :attr:`reason`.
        """
        *_, fz, tx, ty = self._on_ground
        return np.array((-ty / fz, tx / fz)) if self.reason is None and fz > 0 else None


def zero_moment_point(wrench: Array, height: float = 0.0) -> Array | None:
    """The point (2,) of a plane where a wrench has no moment along the plane (thesis 4.21, corrected).

    Parameters
    ----------
    wrench : array, shape (6,)
        About a point and along axes whose z is the plane's normal [N, N m].
    height : float
        Of the plane over that point [m].

    Returns
    -------
    array, shape (2,), or None
        ``((-tau_y + h f_x) / f_z, (tau_x + h f_y) / f_z)``; None where nothing presses on the plane.
    """
    fx, fy, fz, tx, ty, _ = wrench.tolist()
    return np.array((-ty + height * fx, tx + height * fy)) / fz if fz > 0 else None
