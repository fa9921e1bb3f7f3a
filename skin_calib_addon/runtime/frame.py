"""Give the results of one reading: contacts, wrench, CoP, ZMP and supporting polygons."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..common.arrays import Array, BoolArray, lock, locked
from .contacts import Contact
from .footprint import NO_POLYGON, Footprint, SupportingPolygon, supporting_polygon
from .geometry import CellMoments, GroundGeometry
from .noise import GUARANTEED_PROBABILITY, OUTER_PROBABILITY, Noise
from .touched import Touched

# [N] Load below which there is no CoP while the noise is not known.
# Larger: a foot that carries little has no CoP; smaller: its CoP is noisier.
MIN_LOAD = 5.0

# Flags of frames that guarantee nothing: the readings of free taxels are no longer those at rest, or are old.
UNTRUSTED = frozenset({"drift", "frozen"})


@dataclass(frozen=True, eq=False)
class Frame:
    """The state of the skin at one time. CoP, ZMP and polygons are computed when they are first used.

    Its arrays are read-only, because later frames use some of them.

    ``flags`` has every problem. Of the reading: ``wrong_type``, ``wrong_length``, ``not_finite`` (some taxels sent NaN
    or infinity, or are masked in a masked array), ``too_large`` (some forces are impossible), ``blind`` (no taxel has a
    force), ``saturated``, ``stuck`` (the reading of an active taxel does not change, as noise or 30 s would demand).
    Of the noise: ``noise_unknown`` (nothing is guaranteed), ``dead`` (some taxels did not change at rest), ``drift``
    (nothing is guaranteed), ``frozen`` (all readings stay the same although they have noise; nothing is guaranteed),
    ``below_rest`` (some taxels read less than noise explains). Of the time: ``time_not_finite``, ``time_still``,
    ``time_back``, ``time_jump``, ``dropped``.
    """

    time: float  # [s]
    forces: Array  # (n,) on each taxel [N]; 0 if it is unknown
    known: BoolArray  # (n,) whether the taxel has a valid force
    saturated: BoolArray  # (n,) whether the force may be larger
    stuck: BoolArray  # (n,) whether the reading of an active taxel has not changed for too long
    contacts: tuple[Contact, ...]
    wrench: Array  # (6,) of all contacts about the origin of the link [N, N m]; NaN if it is unknown
    flags: frozenset[str]
    problem: str | None  # why the complete reading was refused
    footprint: Footprint | None  # the active taxels; None if they are unknown
    sets: Touched | None = None  # which taxels are touched, surely and possibly, and their weights in the sums
    noise: Noise | None = None  # None if it is unknown
    moments: CellMoments | None = None  # terms of the sums with the moments within the cells, where they count
    deviations: Callable[[], Array] | None = None  # computes force_sigmas

    def __post_init__(self) -> None:
        lock(self.forces, self.known, self.saturated, self.stuck, self.wrench)

    @property
    def touched(self) -> bool | None:
        """Whether there is a contact or a load; None if that is unknown, which is not the same as no contact."""
        return None if self.sets is None else bool(self.contacts) or bool(self.sets.stands)

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
        ground, sets = self.ground, self.sets
        if ground is None or sets is None:
            return NO_POLYGON
        standing, sure = ground.can_stand, sets.sure if UNTRUSTED.isdisjoint(self.flags) else None
        of_outer, of_nominal = ((which & standing).nonzero()[0] for which in (sets.possible, sets.active))
        of_guaranteed = of_nominal  # with thresholds of the caller
        if sure is not sets.active:
            of_guaranteed = of_nominal[:0] if sure is None else (sure & standing).nonzero()[0]
        has_probability = sure is not None and sets.stands is not None
        probabilities = (OUTER_PROBABILITY, GUARANTEED_PROBABILITY) if has_probability else (None, None)
        return supporting_polygon(ground, of_outer, of_nominal, of_guaranteed, probabilities)

    @cached_property
    def _pushes(self) -> Array:
        """Weighted force (n,) of each taxel [N]."""
        assert self.sets is not None
        return self.sets.weights * self.forces

    @cached_property
    def _terms(self) -> Array:
        """The terms (n, 6) of the ground that the sums use."""
        assert self.ground is not None
        return self.ground.terms if self.moments is None else self.moments.ground

    @cached_property
    def _on_ground(self) -> list[float]:
        """Sums of :attr:`.GroundGeometry.terms`, weighted by the forces."""
        return [0.0] * 6 if self.ground is None or self.sets is None else (self._pushes @ self._terms).tolist()

    @property
    def load(self) -> float:
        """Vertical force of the ground on the taxels that can stand on it [N]."""
        return self._on_ground[0]

    @property
    def stands(self) -> bool:
        """Whether the link stands on its ground: it has a load that is not noise."""
        return self.reason is None

    @property
    def reason(self) -> str | None:
        """Why there is no CoP, as a sentence; None if there is one."""
        if self.footprint is None or self.sets is None:
            return self.problem or "no taxel has a valid reading"
        if self.footprint.ground is None:
            return "the skin is not flat and has no ground; pass one to load()"
        if self.sets.stands is None:
            return f"the load is {self.load:.2g} N; a CoP needs {MIN_LOAD:g} N" if self.load < MIN_LOAD else None
        if self.load > 0:
            return None
        limit = 0.0 if self.noise is None else self.noise.load_limit
        return f"no load differs from the noise, which hides loads up to {limit:.2g} N"

    @cached_property
    def cop(self) -> Array | None:
        r"""Centre of pressure (2,) in the coordinates of the ground [m] (thesis eq. 4.21); None with a :attr:`reason`.

        With the lift :math:`\ell_i = -f_i\, n_{i,z}` [N] of each taxel that can stand on the ground:

        .. math::
            \mathbf{p}_{\mathrm{CoP}} = \frac{\sum \ell_i\, (x_i, y_i)}{\sum \ell_i} .

        This assumes that each force acts at the centre of its cell. If all taxels that can stand are in contact, the
        sums of CoP, ZMP and wrench also have the moments of the pressure gradient within the cells.
        """
        if self.reason is not None:
            return None
        lift, lift_x, lift_y, *_ = self._on_ground
        return locked(np.array((lift_x / lift, lift_y / lift)))

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
        return locked(np.array((-ty / fz, tx / fz))) if self.reason is None and fz > 0 else None

    @cached_property
    def force_sigmas(self) -> Array | None:
        """Standard deviation (n,) of the force of each taxel [N]; infinite where it is unknown; None without noise."""
        if self.deviations is None:
            return None
        return locked(np.where(self.known, self.deviations(), np.inf))

    @cached_property
    def _scatter(self) -> tuple[Array, Array, float] | None:
        """What makes sums uncertain: noise (n,) and force away from the centre (n,) of each taxel [N], common noise.

        The force of a cell whose neighbours carry less acts anywhere in it. An unknown taxel may carry the mean of its
        neighbours.
        """
        sigmas = self.force_sigmas
        if sigmas is None or self.sets is None or self.noise is None or self.footprint is None:
            return None
        skin, weights = self.footprint.skin, self.sets.weights
        pushes = np.append(self._pushes, 0.0)
        counts = np.maximum((skin.neighbours < len(weights)).sum(axis=0), 1)
        around = pushes.take(skin.neighbours).sum(axis=0) / counts
        scatter = np.where(self.known, weights * np.where(self.known, sigmas, 0.0), around)
        scatter = np.hypot(scatter, (1 - weights) * self.forces)  # what little weights leave out
        return scatter, np.clip(pushes[:-1] - around, 0.0, None), self.noise.common

    def _sigma(self, terms: Array, levers: Array) -> Array | None:
        """Return standard deviations (k,) of sums of forces with some terms; None without noise.

        Parameters
        ----------
        terms : array, shape (k, n)
            Of a force of 1 N on each taxel.
        levers : array, shape (k,)
            Change of the term for 1 m from the centre of its cell.
        """
        if self._scatter is None or self.footprint is None:
            return None
        noise, uneven, common = self._scatter
        placed = float(uneven**2 @ self.footprint.skin.areas) / 12  # a square has a second moment of 1/12 per area
        return locked(np.sqrt((terms * noise) ** 2 @ np.full(len(noise), common**2) + levers**2 * placed))

    @cached_property
    def wrench_sigma(self) -> Array | None:
        """Standard deviations (6,) of the wrench by noise and place in the cells [N, N m]; None if not known."""
        if self.footprint is None:
            return None
        return self._sigma(self.footprint.skin.terms[5:], np.repeat((0.0, 1.0), 3))

    @cached_property
    def load_sigma(self) -> float | None:
        """Standard deviation of :attr:`load` by noise [N]; None if it is not known."""
        sigma = None if self.ground is None else self._sigma(self._terms[:, :1].T, np.zeros(1))
        return None if sigma is None else float(sigma[0])

    @cached_property
    def cop_sigma(self) -> Array | None:
        """Standard deviations (2,) of the CoP by noise and by place in the cells [m]; None if they are not known."""
        if self.cop is None:
            return None
        terms = self._terms[:, 1:3] - self._terms[:, :1] * self.cop
        return self._with_gradient(self._sigma(terms.T / self.load, np.full(2, 1 / self.load)))

    @cached_property
    def zmp_sigma(self) -> Array | None:
        """Standard deviations (2,) of the ZMP by noise and by place in the cells [m]; None if they are not known."""
        if self.zmp is None:
            return None
        fz = self._on_ground[3]
        terms = self._terms[:, [5, 4]] * (-1.0, 1.0) - self._terms[:, 3:4] * self.zmp
        return self._with_gradient(self._sigma(terms.T / fz, np.full(2, 1 / fz)))

    def _with_gradient(self, sigma: Array | None) -> Array | None:
        """Return standard deviations (2,) of a point with the shift by the gradient in the cells, if it is left out."""
        if sigma is None or self.moments is not None or self.ground is None:
            return sigma
        moments = self._pushes @ (self.ground.in_cell.ground[:, 1:3] - self.ground.terms[:, 1:3])
        return locked(np.hypot(sigma, moments / self.load))


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
