"""Give the results of one reading: contacts, wrench, CoP, ZMP and supporting polygons."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..common.arrays import Array, BoolArray
from .balance.polygon import EMPTY_POLYGON
from .contacts import Contact
from .footprint import Footprint, SupportingPolygon
from .geometry import GroundGeometry

# [N] Load below which there is no CoP: it would be the noise of the taxels.
# Larger: a foot that carries little has no CoP; smaller: its CoP is noisier.
MIN_LOAD = 5.0


@dataclass(frozen=True, eq=False)
class Frame:
    """The state of the skin at one time. CoP, ZMP and polygons are computed when they are first used.

    ``flags`` has every problem. Of the reading: ``wrong_type``, ``wrong_length``, ``not_finite`` (some taxels sent NaN
    or infinity), ``too_large`` (some forces are impossible), ``blind`` (no taxel has a force), ``saturated``,
    ``stuck``. Of the time: ``time_not_finite``, ``time_still``, ``time_back``, ``time_jump``, ``dropped``.
    """

    time: float  # [s]
    forces: Array  # (n,) on each taxel [N]; 0 if it is unknown
    known: BoolArray  # (n,) whether the taxel has a valid force
    saturated: BoolArray  # (n,) whether the force may be larger
    stuck: BoolArray  # (n,) whether the reading of an active taxel has not changed for 30 s
    contacts: tuple[Contact, ...]
    wrench: Array  # (6,) of all contacts about the origin of the link [N, N m]; NaN if it is unknown
    flags: frozenset[str]
    problem: str | None  # why the complete reading was refused
    footprint: Footprint | None  # the active taxels; None if they are unknown

    @property
    def touched(self) -> bool | None:
        """Whether there is a contact; None if that is unknown, which is not the same as no contact."""
        return None if self.footprint is None else bool(self.contacts)

    @property
    def active(self) -> BoolArray:
        """Whether each taxel is part of a contact, (n,)."""
        active = np.zeros(len(self.forces), bool)
        if self.footprint is not None:
            active[self.footprint.rows] = True
        return active

    @property
    def area(self) -> float:
        """Area of the active cells [m^2] (thesis eq. 4.22, with the area of each cell): ``A = sum(A_i)``."""
        return 0.0 if self.footprint is None else self.footprint.area

    @property
    def ground(self) -> GroundGeometry | None:
        """The ground of the skin. CoP, ZMP and polygons have its coordinates."""
        return None if self.footprint is None else self.footprint.ground

    @cached_property
    def polygon(self) -> SupportingPolygon:
        """Outer, nominal and guaranteed supporting polygon in the coordinates of the ground; empty without contact."""
        if self.footprint is None:
            return SupportingPolygon(EMPTY_POLYGON, EMPTY_POLYGON, EMPTY_POLYGON)
        return self.footprint.polygon

    @cached_property
    def _on_ground(self) -> list[float]:
        """Sums of :attr:`.GroundGeometry.terms`, weighted by the forces."""
        if self.footprint is None or self.footprint.ground is None:
            return [0.0] * 6
        rows = self.footprint.rows
        return (self.forces.take(rows) @ self.footprint.ground.terms.take(rows, axis=0)).tolist()

    @property
    def load(self) -> float:
        """Vertical force of the ground on the taxels that can stand on it [N]."""
        return self._on_ground[0]

    @property
    def reason(self) -> str | None:
        """Why there is no CoP, as a sentence; None if there is one."""
        if self.footprint is None:
            return self.problem or "no taxel has a valid reading"
        if self.footprint.ground is None:
            return "the skin is not flat and has no ground; pass one to load()"
        if self.load < MIN_LOAD:
            return f"the load is {self.load:.2g} N; a CoP needs {MIN_LOAD:g} N"
        return None

    @cached_property
    def cop(self) -> Array | None:
        r"""Centre of pressure (2,) in the coordinates of the ground [m] (thesis eq. 4.21); None with a :attr:`reason`.

        With the lift :math:`\ell_i = -f_i\, n_{i,z}` [N] of each taxel that can stand on the ground:

        .. math::
            \mathbf{p}_{\mathrm{CoP}} = \frac{\sum \ell_i\, (x_i, y_i)}{\sum \ell_i} .

        This assumes that each force acts at the centre of its cell. If all taxels that can stand are in contact, the
        forces within the cells are corrected by :attr:`.GroundGeometry.full_contact_correction`.
        """
        if self.reason is not None:
            return None
        assert self.footprint is not None and self.footprint.ground is not None
        ground, rows = self.footprint.ground, self.footprint.rows
        lift, lift_x, lift_y, *_ = self._on_ground
        cop = np.array((lift_x / lift, lift_y / lift))
        if (
            ground.full_contact_correction is None
            or len(rows) < ground.standing_count
            or np.count_nonzero(ground.can_stand[rows]) < ground.standing_count
        ):
            return cop
        centre, correction = ground.full_contact_correction
        return centre + correction @ (cop - centre)

    @cached_property
    def zmp(self) -> Array | None:
        r"""Zero moment point (2,) in the coordinates of the ground [m]; None with a :attr:`reason`.

        It uses the complete wrench :math:`[\mathbf{f}; \boldsymbol{\tau}]` about the origin of the ground, with heights
        and lateral forces (thesis eq. 4.21 in its general form):

        .. math::
            \mathbf{p}_{\mathrm{ZMP}} = \left( -\frac{\tau_y}{f_z} ,\; \frac{\tau_x}{f_z} \right) .

        If all taxels are in the ground plane and all normals are vertical, it equals the CoP.
        """
        *_, fz, tx, ty = self._on_ground
        return np.array((-ty / fz, tx / fz)) if self.reason is None and fz > 0 else None


def zero_moment_point(wrench: Array, height: float = 0.0) -> Array | None:
    r"""Return the point (2,) of a plane at which a wrench has no moment along the plane (thesis eq. 4.21, corrected).

    .. math::
        \mathbf{p}_{\mathrm{ZMP}} = \left( \frac{-\tau_y + h f_x}{f_z} ,\; \frac{\tau_x + h f_y}{f_z} \right)

    The thesis leaves out the terms with :math:`h`.

    Parameters
    ----------
    wrench : array, shape (6,)
        About a point, along axes whose z is the normal of the plane [N, N m].
    height : float
        Height h of the plane over this point [m].

    Returns
    -------
    array, shape (2,), or None
        Coordinates along the x and y axes [m]; None if the force on the plane is not positive.
    """
    fx, fy, fz, tx, ty, _ = wrench.tolist()
    return np.array((-ty + height * fx, tx + height * fy)) / fz if fz > 0 else None
