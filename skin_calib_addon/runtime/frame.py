"""Give the results of one reading: contacts, wrench, CoP, ZMP and supporting polygons."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..common.arrays import Array, BoolArray, lock, locked
from .contacts import Contact
from .footprint import NO_POLYGON, Footprint, SupportingPolygon, supporting_polygon
from .geometry import GroundGeometry, Terms, products_of
from .modalities import ModalityValues
from .noise import GUARANTEED_PROBABILITY, OUTER_PROBABILITY, Noise
from .touched import Touched
from .trusted import NOT_GUARANTEED, Trusted, trusted_of

# [N] Load below which there is no CoP while the noise is not known.
# Larger: a foot that carries little has no CoP; smaller: its CoP is noisier.
MIN_LOAD = 5.0


@dataclass(frozen=True, eq=False)
class Frame:
    """The state of the skin at one time. CoP, ZMP and polygons are computed when they are first used.

    Its arrays are read-only, because later frames use some of them.

    ``flags`` names every problem, and :attr:`trusted` says what it takes away. The page "Runtime" of the documentation
    has the meaning of each flag.
    """

    time: float  # [s]
    forces: Array  # (n,) on each taxel [N]; 0 if it is unknown
    known: BoolArray  # (n,) whether the taxel has a valid force
    saturated: BoolArray  # (n,) whether the force may be larger
    stuck: BoolArray  # (n,) whether the reading of an active taxel has not changed for too long
    contacts: tuple[Contact, ...]
    # (6,) about the origin of the link [N, N m]; NaN with a problem. With learned noise of all taxels, each with its
    # weight, also outside of contacts; otherwise of the active taxels
    wrench: Array
    flags: frozenset[str]
    problem: str | None  # why the wrench is not known: the reading was refused, or too much of it is missing
    footprint: Footprint | None  # the active taxels; None if they are unknown
    sets: Touched | None = None  # which taxels are touched, surely and possibly, and their weights in the sums
    noise: Noise | None = None  # None if it is unknown
    terms: Terms | None = None  # of the sums
    pushes: Array | None = None  # (n,) part of each taxel in the sums [N], see Touched
    sums: Array | None = None  # (12,) of :attr:`.Terms.sums`
    deviations: Callable[[], Array] | None = None  # computes force_sigmas
    modalities: Mapping[str, ModalityValues] = field(default_factory=dict)  # all that the calibration names
    lost: Array | None = None  # (n,) what a taxel without a valid force may carry [N]; None: all forces are valid

    def __post_init__(self) -> None:
        lock(self.forces, self.known, self.saturated, self.stuck, self.wrench, self.pushes, self.sums, self.lost)

    @property
    def touched(self) -> bool | None:
        """Whether there is a contact or a load; None if that is unknown, which is not the same as no contact.

        It is unknown, too, if nothing else is touched and a taxel without a valid reading was touched at its last one,
        or has had none yet. See :attr:`problem`.
        """
        if self.sets is not None and (self.contacts or self.sets.stands):
            return True
        return None if self.problem is not None else False

    @property
    def trusted(self) -> Trusted:
        """Which statements of the frame hold, and which flags take the others away. It is true if all hold."""
        return trusted_of(self.flags, self.touched)

    @property
    def active(self) -> BoolArray:
        """Whether each taxel is part of a contact, (n,)."""
        return np.zeros(len(self.forces), bool) if self.footprint is None else self.footprint.active.copy()

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
        standing, sure = ground.can_stand, sets.sure if NOT_GUARANTEED.isdisjoint(self.flags) else None
        has_probability = sure is not None and sets.stands is not None
        probabilities = (OUTER_PROBABILITY, GUARANTEED_PROBABILITY) if has_probability else (None, None)
        nominal = sets.active & standing
        if sure is sets.active:  # with thresholds of the caller
            sure = nominal
        elif sure is None:
            sure = np.zeros(len(nominal), bool)
        else:
            sure = sure & standing
            nominal |= sure
        possible = sets.possible if self.problem is None else sets.possible | ~self.known  # all that is lost may press
        return supporting_polygon(ground, possible & standing, nominal, sure, probabilities)

    @cached_property
    def _is_complete(self) -> bool:
        """Whether all taxels have a valid force."""
        return np.count_nonzero(self.known) == len(self.known)

    @cached_property
    def _on_ground(self) -> list[float]:
        """Sums of :attr:`.GroundGeometry.terms`, weighted by the forces."""
        return [math.nan] * 6 if self.sums is None else self.sums[6:].tolist()

    @property
    def moments(self) -> Terms | None:
        """Terms of the sums with the moments within the cells; None if the sums do not have them."""
        return None if self.terms is None or not self.terms.has_moments else self.terms

    @cached_property
    def _gradient(self) -> list[float]:
        """Moments of the pressure gradient in the cells that :attr:`_on_ground` leaves out, lift x and lift y [N m]."""
        assert self.ground is not None
        return [0.0, 0.0] if self.moments is not None else self.ground.gradient.dot(self.pushes).tolist()

    @property
    def load(self) -> float:
        """Vertical force of the ground on the taxels that can stand on it [N]; NaN if the wrench is not known."""
        return self._on_ground[0]

    @property
    def stands(self) -> bool:
        """Whether the link stands on its ground: it has a load that is not noise."""
        return self.reason is None

    @property
    def reason(self) -> str | None:
        """Why there is no CoP, as a sentence; None if there is one."""
        if self.problem is not None or self.footprint is None or self.sets is None:
            return self.problem or "no taxel has a valid reading"
        if self.footprint.ground is None:
            return "the skin is not flat and has no ground; pass one to load()"
        if is_standing(self.load, self.sets.stands):
            return None
        if self.sets.stands is None:
            return f"the load is {self.load:.2g} N; a CoP needs {MIN_LOAD:g} N"
        limit = 0.0 if self.noise is None else float(f"{self.noise.load_limit:.2g}")
        return f"no load differs from the noise, which hides loads up to {limit:g} N"

    @cached_property
    def cop(self) -> Array | None:
        r"""Centre of pressure (2,) in the coordinates of the ground [m] (thesis eq. 4.21); None with a :attr:`reason`.

        With the lift :math:`\ell_i = -f_i\, n_{i,z}` [N] of each taxel that can stand on the ground:

        .. math::
            \mathbf{p}_{\mathrm{CoP}} = \frac{\sum \ell_i\, (x_i, y_i)}{\sum \ell_i} .

        This assumes that each force acts at the centre of its cell. If all taxels that can stand are in contact, the
        sums of CoP, ZMP and wrench also have the moments of the pressure gradient within the cells.
        """
        return None if self.sums is None or self.reason is not None else locked(cop_of(self.sums))

    @cached_property
    def zmp(self) -> Array | None:
        r"""Zero moment point (2,) in the coordinates of the ground [m]; None with a :attr:`reason`.

        It uses the complete wrench :math:`[\mathbf{f}; \boldsymbol{\tau}]` about the origin of the ground, with heights
        and lateral forces (thesis eq. 4.21 in its general form):

        .. math::
            \mathbf{p}_{\mathrm{ZMP}} = \left( -\frac{\tau_y}{f_z} ,\; \frac{\tau_x}{f_z} \right) .

        If all taxels are in the ground plane and all normals are vertical, it equals the CoP.
        """
        return (
            None if self.sums is None or self.reason is not None or not self.sums[9] > 0 else locked(zmp_of(self.sums))
        )

    @cached_property
    def force_sigmas(self) -> Array | None:
        """Standard deviation (n,) of the force of each taxel [N]; infinite where it is unknown; None without noise."""
        if self.deviations is None:
            return None
        sigmas = self.deviations()
        return locked(sigmas if self._is_complete else np.where(self.known, sigmas, np.inf))

    @cached_property
    def _variances(self) -> tuple[Array, float] | None:
        """Variance (n,) of each weighted force by noise [N^2]; that of a moment by the place in the cells [(N m)^2].

        The force of a cell whose neighbours carry less acts anywhere in it. An unknown taxel may carry :attr:`lost`.
        The variances have to be multiplied by :attr:`.Noise.common` squared.
        """
        sigmas, pushes = self.force_sigmas, self.pushes
        if sigmas is None or pushes is None or self.sets is None or self.footprint is None:
            return None
        skin = self.footprint.skin
        if not self._is_complete:
            sigmas = np.where(self.known, sigmas, 0.0)
        variances, left_out = self.sets.weights * sigmas, (1 - self.sets.weights) * self.forces
        variances *= variances
        left_out *= left_out
        variances += left_out
        if self.lost is not None:
            variances += self.lost**2
        rows = (pushes > 0).nonzero()[0]
        uneven = np.maximum(pushes[rows] - skin.mean_around(pushes, rows), 0.0)
        uneven *= uneven
        return variances, float(uneven.dot(skin.areas[rows])) / 12  # a square has a second moment of 1/12 per area

    @cached_property
    def _covariances(self) -> list[float] | None:
        """Covariances (10,) by noise of the sums of :attr:`.Terms.products`; None if they are not known."""
        if self._variances is None or self.ground is None or self.terms is None or self.noise is None:
            return None
        covariances = self.noise.common**2 * self.terms.products.dot(self._variances[0])
        if self.lost is not None:  # all that is lost may carry its load at the same time
            covariances += products_of(self.lost @ self.terms.ground)
        return covariances.tolist()

    @cached_property
    def _hidden_load(self) -> float:
        """Load that may press although no load differs from the noise, as its sum shows [N]."""
        if self.noise is None or self.sets is None or self.sets.stands is not False:
            return 0.0
        return math.hypot(max(self.sets.excess, 0.0), self.noise.load_sigma)

    @cached_property
    def wrench_sigma(self) -> Array | None:
        """Standard deviations (6,) of the wrench by noise and place in the cells [N, N m]; None if not known."""
        if self._variances is None or self.footprint is None or self.noise is None:
            return None
        terms = self.footprint.skin.terms[5:]
        variances, placed = self._variances
        squares = terms**2 @ variances * self.noise.common**2 + np.repeat((0.0, placed), 3)
        if self.lost is not None:
            squares += (terms @ self.lost) ** 2
        if self._hidden_load:
            squares += (self._hidden_load * self.footprint.skin.mean_wrench) ** 2
        if self.moments is None and self.ground is not None:  # the moments of the pressure gradient are left out
            squares += ((self.ground.in_cell.link[5:] - terms) @ self.pushes) ** 2
        return locked(np.sqrt(squares))

    @property
    def load_sigma(self) -> float | None:
        """Standard deviation of :attr:`load` by noise [N]; None if it is not known."""
        return None if self._covariances is None else math.hypot(math.sqrt(self._covariances[0]), self._hidden_load)

    @cached_property
    def cop_sigma(self) -> Array | None:
        """Standard deviations (2,) of the CoP by noise and by place in the cells [m]; None if they are not known."""
        if self.cop is None or self._covariances is None:
            return None
        cll, cxx, cyy, cxl, cyl, *_ = self._covariances
        return self._point_sigma(self.cop, self._on_ground[0], cll, (cxx, cyy), (cxl, cyl))

    @cached_property
    def zmp_sigma(self) -> Array | None:
        """Standard deviations (2,) of the ZMP by noise and by place in the cells [m]; None if they are not known."""
        if self.zmp is None or self._covariances is None:
            return None
        *_, cff, cxx, cyy, cxf, cyf = self._covariances
        return self._point_sigma(self.zmp, self._on_ground[3], cff, (cyy, cxx), (-cyf, cxf))

    def _point_sigma(
        self, point: Array, load: float, of_load: float, of_moments: tuple[float, float], mixed: tuple[float, float]
    ) -> Array:
        r"""Return standard deviations (2,) of a point, which is a ratio of sums :math:`x = m / f`.

        .. math::
            \sigma_x^2 = \frac{1}{f^2} \left( C_{mm} - 2 x\, C_{mf} + x^2 C_{ff} + p + g^2 \right)

        with the covariance :math:`C` of the sums, the variance :math:`p` by the place in the cells, and the moment
        :math:`g` of the pressure gradient in the cells, where it is left out.
        """
        assert self._variances is not None
        placed, sigmas = self._variances[1], []
        for x, cmm, cmf, g in zip(point.tolist(), of_moments, mixed, self._gradient):
            noise = max(cmm - 2 * x * cmf + x * x * of_load, 0.0)
            sigmas.append(math.sqrt(noise + placed + g * g) / load)
        return locked(np.array(sigmas))


TURN = np.array((-1.0, 1.0))  # the moment about y moves the ZMP along -x, that about x along y


def is_standing(load: Any, has_load: Any) -> Any:
    """Return whether a link stands (...): by the load alone [N] (...), or if the noise says that there is one (...)."""
    return load >= MIN_LOAD if has_load is None else (load > 0) & has_load


def cop_of(sums: Array) -> Array:
    """Return the CoP (..., 2) [m] of :attr:`Frame.sums` (..., 12), see :attr:`Frame.cop`."""
    return sums[..., 7:9] / sums[..., 6:7]


def zmp_of(sums: Array) -> Array:
    """Return the ZMP (..., 2) [m] of :attr:`Frame.sums` (..., 12), see :attr:`Frame.zmp`."""
    return sums[..., 11:9:-1] / (sums[..., 9:10] * TURN)


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
        Coordinates along the x and y axes [m]; None if the force on the plane is not positive, or too small for them.
    """
    fx, fy, fz, tx, ty, _ = wrench.tolist()
    if not fz > 0:
        return None
    x, y = (-ty + height * fx) / fz, (tx + height * fy) / fz
    return np.array((x, y)) if math.isfinite(x) and math.isfinite(y) else None
