r"""Turn wrenches of the skin into joint torques, combine tasks by priority, and move servos by torques.

Symbols: joint velocities :math:`\dot{q}` (n,) [rad/s], joint torques :math:`\tau` (n,) [N m], inertia matrix :math:`M`
(n, n) [kg m^2]. A Jacobian (6, n) has the velocity of the origin of a link, then its angular velocity, both along the
axes of the world, such as ``LOCAL_WORLD_ALIGNED`` of pinocchio, or ``mj_jac`` of MuJoCo at the origin of the link.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from .checks import Array, BoolArray, finite, not_negative

# [1] Fraction of the largest mobility of a task, below which the joints cannot move a direction of it. Larger: near a
# singular pose lower tasks disturb that direction; smaller: rounding errors of a Jacobian block lower tasks.
MIN_MOBILITY = 1e-4
# [1] Difference of an inertia matrix from its transpose, relative to its largest value, from which on it is refused.
# Larger: matrices with one triangle only, as of some libraries, pass; smaller: rounding errors are refused.
MAX_ASYMMETRY = 1e-6


def contact_torques(
    wrenches: Mapping[str, Any], poses: Mapping[str, Array], jacobian: Callable[[str], Array], joints: int
) -> Array:
    r"""Return the joint torques (k, n) of k wrenches on links of a robot (thesis eq. 3.20 to 3.24, corrected).

    .. math::
        \boldsymbol{\tau}_i = J_i^T \begin{bmatrix} R_i & 0 \\ 0 & R_i \end{bmatrix} \mathbf{w}_i

    The thesis leaves out the rotation in eq. 3.22. Only links with a wrench need a Jacobian, so the cost increases with
    the links in contact. A wrench that is zero or not known (not finite) has no row. The sum of the rows is the torque
    that yields to all contacts. The rows are also the Jacobian of this task, see :func:`prioritized`.

    Parameters
    ----------
    wrenches : mapping of str to array, shape (6,) or (c, 6)
        Of a link, or of each contact on it, about the origin of the link and along its axes [N, N m], such as
        ``frame.wrench``, ``contact.wrench`` or those of :mod:`.wrench`. An empty list is no contact.
    poses : mapping of str to array, shape (4, 4)
        ``T_world_link``, such as ``BodyFrame.poses``.
    jacobian : callable
        Returns the Jacobian (6, n) of a link.
    joints : int
        n.

    Returns
    -------
    array, shape (k, n)
        In the order of the links and of their wrenches [N m].

    Raises
    ------
    ValueError
        If a wrench has not six numbers, a Jacobian or a pose has another shape, or one of these is not finite.
    KeyError
        If a link with a wrench has no pose.
    """
    rows: dict[str, Array] = {}
    for link, given in wrenches.items():
        each = np.asarray(given, float)
        each = np.atleast_2d(each) if each.size else np.empty((0, 6))
        if each.ndim != 2 or each.shape[1] != 6:
            raise ValueError(f"the wrench of {link!r} has shape {np.shape(given)}, expected (6,) or (c, 6)")
        each = each[np.isfinite(each).all(axis=1) & each.any(axis=1)]
        if len(each):
            matrix, pose = np.asarray(jacobian(link), float), np.asarray(poses[link], float)
            if matrix.shape != (6, joints):
                raise ValueError(f"the Jacobian of {link!r} has shape {matrix.shape}, expected (6, {joints})")
            if pose.shape != (4, 4):
                raise ValueError(f"the pose of {link!r} has shape {pose.shape}, expected (4, 4)")
            rows[link] = (each.reshape(-1, 2, 3) @ pose[:3, :3].T).reshape(-1, 6) @ matrix
    torques = np.concatenate((np.empty((0, joints)), *rows.values()))
    if not np.isfinite(torques).all():
        wrong = [link for link, some in rows.items() if not np.isfinite(some).all()]
        raise ValueError(f"the Jacobian or the pose of {wrong[0]!r} has values that are not finite numbers")
    return torques


def prioritized(tasks: Iterable[tuple[Any, Any]], inertia: Any) -> Array:
    r"""Return the sum (n,) of joint torques of which none accelerates a task of higher priority (thesis eq. 3.7-3.11).

    .. math::
        \boldsymbol{\tau} = \sum_i N_i \boldsymbol{\tau}_i , \qquad
        N_{i+1} = N_i - \hat{J}_i^T (\hat{J}_i M^{-1} \hat{J}_i^T)^{+} \hat{J}_i M^{-1} N_i , \qquad
        \hat{J}_i = J_i N_i^T , \qquad N_1 = 1 .

    The torques of task i then change no velocity :math:`J_j \dot{q}` of a task j < i. The function computes this with
    orthonormal directions of :math:`M^{-1/2} J^T`, which stays exact for tasks that depend on each other. A task whose
    Jacobian has no rows, such as that of no contact, blocks nothing.

    Parameters
    ----------
    tasks : iterable of (torque, Jacobian)
        Highest priority first. A torque (n,) [N m], and a Jacobian (m, n) with m >= 0, whose units do not matter. For
        a task that yields to wrenches, the rows of :func:`contact_torques` are the Jacobian, and their sum the torque.
    inertia : array, shape (n, n)
        :math:`M`, symmetric and positive definite. Where damping decides the motion, as in a :class:`TorqueResolver`
        that moves slowly, pass the damping matrix :math:`D`: lower tasks then change no velocity of a higher one.

    Raises
    ------
    ValueError
        If a number of joints does not match, a torque, a Jacobian or the inertia has values that are not finite, or the
        inertia is not symmetric.
    numpy.linalg.LinAlgError
        If the inertia matrix is not positive definite.
    """
    factor = np.linalg.cholesky(_symmetric(inertia, np.shape(inertia)))
    n = len(factor)
    inverse = np.linalg.inv(factor)
    taken, total = np.empty((0, n)), np.zeros(n)  # directions of higher tasks, scaled by the inertia; scaled torque
    for torque, given in tasks:
        torque, rows = np.asarray(torque, float), np.asarray(given, float)
        rows = np.atleast_2d(rows) if rows.size else np.empty((0, n))
        if not np.isfinite(rows).all():
            raise ValueError("a Jacobian has values that are not finite numbers")
        if torque.shape != (n,) or rows.ndim != 2 or rows.shape[1] != n:
            raise ValueError(f"a task with torque {torque.shape} and Jacobian {rows.shape} does not fit {n} joints")
        if not np.isfinite(torque).all():
            raise ValueError("a task has a torque that is not a finite number")
        scaled = inverse @ torque
        total += scaled - taken.T @ (taken @ scaled)
        rows = rows @ inverse.T
        sizes = np.sqrt((rows * rows).sum(axis=1))
        rows = rows[sizes > 0] / sizes[sizes > 0, None]
        free = rows - rows @ taken.T @ taken
        if len(free):
            _, strengths, directions = np.linalg.svd(free, full_matrices=False)
            taken = np.concatenate((taken, directions[strengths > MIN_MOBILITY]))
    return factor @ total


def attraction(
    position: Any, velocity: Any, goal: Any, stiffness: float, damping: float, max_speed: float = math.inf
) -> Array:
    r"""Return the force (d,) that moves a point to a goal with a limited speed (thesis eq. 3.42 to 3.44).

    .. math::
        \mathbf{f} = -k_v (\dot{\mathbf{x}} - \nu \dot{\mathbf{x}}_d) , \qquad
        \dot{\mathbf{x}}_d = \frac{k_p}{k_v} (\mathbf{x}_d - \mathbf{x}) , \qquad
        \nu = \min\left( 1,\; \frac{V_{\max}}{\lVert \dot{\mathbf{x}}_d \rVert} \right)

    Against an obstacle that does not move, the force is at most :math:`k_v V_{\max}`.

    Parameters
    ----------
    position, velocity, goal : array, shape (d,)
        Of the point [m], [m/s], and where it must go [m], along the same axes; or angles.
    stiffness, damping : float
        :math:`k_p` [N/m] and :math:`k_v` [N s/m], above zero.
    max_speed : float
        :math:`V_{\max}` [m/s], zero or more.

    Raises
    ------
    ValueError
        If one of these is not in its range, not finite, or has another shape than the position.
    """
    if not (0 < stiffness < math.inf and 0 < damping < math.inf and max_speed >= 0):
        values = f"stiffness {stiffness} and damping {damping} must be above zero and finite"
        raise ValueError(f"{values}, speed {max_speed} not below zero")
    given = {"the position": position, "the velocity": velocity, "the goal": goal}
    position, velocity, goal = (finite(name, value, np.shape(position)[:1]) for name, value in given.items())
    wanted = stiffness / damping * (goal - position)
    speed = math.sqrt(float(wanted @ wanted))
    limited = wanted * (max_speed / speed) if speed > max_speed else wanted
    return -damping * (velocity - limited)


class TorqueResolver:
    r"""Move servos as if torques drove the joints: :math:`M \ddot{q} + D \dot{q} = \tau` (thesis figure 10).

    So a robot with position or velocity servos yields. The step is implicit in the damping. Without a torque and with a
    constant inertia the kinetic energy never increases, for any time step. The torques by which a changing inertia
    moves the joints (Coriolis) are left out, so the damping must be large enough that the motion is slow.

    Parameters
    ----------
    angles : array, shape (n,)
        At the start [rad].
    damping : float or array, shape (n,)
        :math:`D` [N m s/rad]. Larger: slower motions.
    limits : array, shape (n, 2), optional
        Smallest and largest angles [rad]; a joint stops there, as by an impact without rebound.

    Raises
    ------
    ValueError
        If an angle or a damping is not a finite number, a damping is below zero, or an angle is not within its limits.
    """

    def __init__(self, angles: Any, damping: Any, limits: Any = None):
        self.angles = np.array(angles, float)
        self.velocities = np.zeros_like(self.angles)
        self._damping = np.broadcast_to(np.asarray(damping, float), self.angles.shape)
        self._limits = None if limits is None else np.asarray(limits, float)
        if not (np.isfinite(self.angles).all() and np.isfinite(self._damping).all() and (self._damping >= 0).all()):
            raise ValueError("angles and damping must be finite numbers, and no damping may be below zero")
        if self._limits is not None:
            if self._limits.shape != (*self.angles.shape, 2):
                raise ValueError(f"limits have shape {self._limits.shape}, expected {(*self.angles.shape, 2)}")
            low, high = self._limits.T
            if not ((low <= self.angles) & (self.angles <= high)).all():
                raise ValueError(f"the angles {self.angles} are not within the limits {self._limits.tolist()}")

    def step(self, torque: Any, inertia: Any, period: float) -> Array:
        """Return the angles (n,) of the servos after a period [rad].

        Parameters
        ----------
        torque : array, shape (n,)
            Of the tasks, without gravity [N m].
        inertia : array, shape (n, n)
            At these angles [kg m^2].
        period : float
            [s].

        Raises
        ------
        ValueError
            If one of these is not finite, has another shape, the inertia is not symmetric, or the period is below zero;
            the joints then stay as they are.
        """
        mass = _symmetric(inertia, 2 * self.angles.shape)
        torque, period = finite("the torque", torque, self.angles.shape), not_negative("the period", period)
        momentum = mass @ self.velocities + period * torque
        self.velocities = np.linalg.solve(mass + period * np.diag(self._damping), momentum)
        self.angles = self.angles + period * self.velocities
        if self._limits is not None:
            inside = np.clip(self.angles, *self._limits.T)
            stopped = inside != self.angles
            if stopped.any():
                self.velocities = _stopped(self.velocities, mass, stopped)
            self.angles = inside
        return self.angles


def _symmetric(inertia: Any, shape: tuple[int, ...]) -> Array:
    """Return an inertia matrix after checks of its shape and values."""
    matrix = finite("the inertia matrix", inertia, shape)
    if np.abs(matrix - matrix.T).max(initial=0.0) > MAX_ASYMMETRY * np.abs(matrix).max(initial=0.0):
        raise ValueError("the inertia matrix is not symmetric; some libraries fill one triangle only")
    return matrix


def _stopped(velocities: Array, mass: Array, stopped: BoolArray) -> Array:
    """Return the velocities (n,) after impulses on the joints that stop: the momentum of the others is kept."""
    free = ~stopped
    after = np.zeros_like(velocities)
    coupled = mass[np.ix_(free, stopped)] @ velocities[stopped]
    after[free] = velocities[free] + np.linalg.solve(mass[np.ix_(free, free)], coupled)
    return after
