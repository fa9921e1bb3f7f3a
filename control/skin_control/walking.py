r"""Compute walking references of the linear inverted pendulum (thesis 4.1.3, 4.1.4): DCM, desired ZMP, CoM commands.

Symbols: CoM :math:`x`, divergent component of motion (DCM) :math:`\xi`, ZMP :math:`p`, virtual repellent point
:math:`r`, step time :math:`T`, frequency :math:`\omega`. Points are arrays (..., d) [m] of two or three numbers in one
frame; the third axis points up. What follows from a coordinate that is not known (NaN) is not known, either. The thesis
prints eq. 4.14 and 4.15 with wrong signs. Here they are the solutions of eq. 4.12.
"""

from typing import Any

import numpy as np

from .checks import Array, IntArray, positive

GRAVITY = 9.81  # [m/s^2] on Earth. Contract: the documented default


def pendulum_frequency(height: float, gravity: float = GRAVITY) -> float:
    r"""Return the frequency of the inverted pendulum, :math:`\omega = \sqrt{g / z_x}` [1/s].

    Parameters
    ----------
    height : float
        Of the CoM over the ground, :math:`z_x` [m].
    gravity : float
        :math:`g` [m/s^2].

    Raises
    ------
    ValueError
        If an argument is not positive and finite, as in all functions here; the message names the argument.
    """
    return float(np.sqrt(positive("gravity", gravity) / positive("height", height)))


def divergent_component(position: Any, velocity: Any, omega: float) -> Array:
    r"""Return the DCM, :math:`\xi = x + \dot{x} / \omega` (thesis eq. 4.9, 4.27).

    Parameters
    ----------
    position, velocity : array, shape (..., d)
        Of the CoM [m], [m/s].
    omega : float
        [1/s].
    """
    return _points("position", position) + _points("velocity", velocity) / positive("omega", omega)


def com_velocity(position: Any, dcm: Any, omega: float) -> Array:
    r"""Return the velocity with which the CoM follows the DCM, :math:`\dot{x} = -\omega (x - \xi)` (thesis eq. 4.10).

    Parameters
    ----------
    position, dcm : array, shape (..., d)
        Of the CoM, and the DCM [m].
    omega : float
        [1/s].

    Returns
    -------
    array, shape (..., d)
        [m/s].
    """
    return -positive("omega", omega) * (_points("position", position) - _points("dcm", dcm))


def dcm_velocity(dcm: Any, repellent: Any, omega: float) -> Array:
    r"""Return the velocity of the DCM, :math:`\dot{\xi} = \omega (\xi - r)` (thesis eq. 4.12).

    The DCM moves away from the virtual repellent point; in the plane, from the ZMP.

    Parameters
    ----------
    dcm, repellent : array, shape (..., d)
        :math:`\xi` and :math:`r` [m].
    omega : float
        [1/s].

    Returns
    -------
    array, shape (..., d)
        [m/s].
    """
    return positive("omega", omega) * (_points("dcm", dcm) - _points("repellent", repellent))


def repellent_points(footsteps: Any, height: float) -> Array:
    """Return the virtual repellent points over footsteps, ``r_i = foot_i + (0, 0, z_x)`` (thesis eq. 4.13).

    Parameters
    ----------
    footsteps : array, shape (..., d)
        Positions of the feet [m]. With d = 2 the result is the same points.
    height : float
        Of the CoM over the ground, z_x [m].
    """
    points = _points("footsteps", footsteps)
    lift = np.zeros(points.shape[-1])
    lift[2:] = positive("height", height)
    return points + lift


def dcm_waypoints(repellents: Any, step_time: float, omega: float, last: Any = None) -> Array:
    r"""Return the DCM at the end of each step (thesis eq. 4.14, signs corrected).

    .. math::
        \xi_i = r_{i+1} + e^{-\omega T} (\xi_{i+1} - r_{i+1})

    Parameters
    ----------
    repellents : array, shape (n, d)
        Repellent point :math:`r_i` of each step [m].
    step_time : float
        :math:`T` [s].
    omega : float
        [1/s].
    last : array, shape (d,), optional
        DCM at the end of the last step [m]. Default: its repellent point, at which the CoM stops.

    Returns
    -------
    array, shape (n, d)
        Row i is the DCM at the end of step i, which is the start of the next step [m].
    """
    r = _steps("repellents", repellents)
    decay = np.exp(-positive("omega", omega) * positive("step_time", step_time))
    ends = np.empty_like(r)
    ends[-1] = r[-1] if last is None else _alike("last", last, r[-1])
    for i in range(len(r) - 2, -1, -1):
        ends[i] = r[i + 1] + decay * (ends[i + 1] - r[i + 1])
    return ends


def dcm_reference(time: Any, repellents: Any, ends: Any, step_time: float, omega: float) -> Array:
    r"""Return the reference of the DCM at a time (thesis eq. 4.15, signs corrected).

    .. math::
        \xi_r(t) = r_i + e^{\omega (t - T)} (\xi_i - r_i) ,

    with :math:`t` from the start of step i and :math:`\xi_i` at its end.

    Parameters
    ----------
    time : array, shape (...)
        From the start of the first step [s]; after the last step the DCM does not move.
    repellents, ends : array, shape (n, d)
        Repellent point of each step, and the DCM at its end [m]; see :func:`dcm_waypoints`.
    step_time : float
        :math:`T` [s].
    omega : float
        [1/s].

    Returns
    -------
    array, shape (..., d)
        [m].
    """
    r = _steps("repellents", repellents)
    xi = _alike("ends", ends, r)
    i, within, _ = _in_step(time, len(r), positive("step_time", step_time))
    growth = np.exp(positive("omega", omega) * (within - step_time))[..., None]
    return r[i] + growth * (xi[i] - r[i])


def zmp_reference(time: Any, repellents: Any, ends: Any, step_time: float) -> Array:
    """Return the reference of the ZMP: the repellent point of the step; after the last step the DCM, which then stays.

    Parameters
    ----------
    time : array, shape (...)
        From the start of the first step [s].
    repellents, ends : array, shape (n, d)
        As for :func:`dcm_reference` [m].
    step_time : float
        [s].

    Returns
    -------
    array, shape (..., d)
        [m].
    """
    r = _steps("repellents", repellents)
    xi = _alike("ends", ends, r)
    i, _, after = _in_step(time, len(r), positive("step_time", step_time))
    return np.where((after > 0)[..., None], xi[-1], r[i])


def com_reference(time: Any, repellents: Any, ends: Any, start: Any, step_time: float, omega: float) -> Array:
    r"""Return the reference of the CoM, which follows the reference of the DCM: the solution of eq. 4.10 with eq. 4.15.

    In step i, which starts at the CoM :math:`x_i`, with :math:`D = \xi_i - r_i` and :math:`t` from its start:

    .. math::
        x(t) = r_i + \tfrac{1}{2} D e^{\omega (t - T)} +
        \left( x_i - r_i - \tfrac{1}{2} D e^{-\omega T} \right) e^{-\omega t}

    After the last step the CoM converges to the DCM.

    Parameters
    ----------
    time : array, shape (...)
        From the start of the first step [s].
    repellents, ends : array, shape (n, d)
        As for :func:`dcm_reference` [m].
    start : array, shape (d,)
        CoM at time zero [m].
    step_time : float
        :math:`T` [s].
    omega : float
        [1/s].

    Returns
    -------
    array, shape (..., d)
        [m].
    """
    r = _steps("repellents", repellents)
    xi = _alike("ends", ends, r)
    T, w = positive("step_time", step_time), positive("omega", omega)
    decay, half = np.exp(-w * T), (xi - r) / 2
    starts = np.empty((len(r) + 1, r.shape[1]))
    starts[0] = _alike("start", start, r[0])
    for k in range(len(r)):
        starts[k + 1] = r[k] + half[k] + (starts[k] - r[k] - half[k] * decay) * decay
    i, within, after = _in_step(time, len(r), T)
    growing, falling = np.exp(w * (within - T))[..., None], np.exp(-w * within)[..., None]
    x = r[i] + half[i] * growing + (starts[i] - r[i] - half[i] * decay) * falling
    converging = xi[-1] + (starts[-1] - xi[-1]) * np.exp(-w * after)[..., None]
    return np.where((after > 0)[..., None], converging, x)


def desired_zmp(reference: Any, dcm_reference: Any, dcm: Any, gain: float, omega: float) -> Array:
    r"""Return the ZMP that controls the DCM (thesis eq. 4.18, 4.28).

    .. math::
        p_d = p_r - \left( 1 + \frac{k}{\omega} \right) (\xi_r - \xi)

    The error of the DCM then decreases as :math:`e^{-k t}`. This needs a ZMP in the supporting polygon: limit it with
    ``polygon.closest``.

    Parameters
    ----------
    reference : array, shape (..., d)
        :math:`p_r`, the reference of the ZMP or repellent point [m].
    dcm_reference, dcm : array, shape (..., d)
        :math:`\xi_r` and :math:`\xi`, the reference and the actual DCM [m].
    gain : float
        :math:`k` [1/s].
    omega : float
        [1/s].

    Returns
    -------
    array, shape (..., d)
        :math:`p_d` [m].
    """
    lead = 1 + positive("gain", gain) / positive("omega", omega)
    return _points("reference", reference) - lead * (_points("dcm_reference", dcm_reference) - _points("dcm", dcm))


def zmp_tracking_velocity(zmp: Any, zmp_velocity: Any, desired: Any, gain: float) -> Array:
    r"""Return the velocity of the CoM with which the ZMP follows a desired one (thesis eq. 4.20).

    .. math::
        \dot{x}_r = \dot{p} + k_p (p - p_d)

    It is for a reference of the CoM without jerk, for which :math:`\dot{p}_d = \dot{x}_r` (thesis eq. 4.19, in which a
    dot is missing).

    Parameters
    ----------
    zmp, desired : array, shape (..., d)
        :math:`p` and :math:`p_d` [m].
    zmp_velocity : array, shape (..., d)
        :math:`\dot{p}` [m/s], filtered.
    gain : float
        :math:`k_p` [1/s].

    Returns
    -------
    array, shape (..., d)
        [m/s].
    """
    off = _points("zmp", zmp) - _points("desired", desired)
    return _points("zmp_velocity", zmp_velocity) + positive("gain", gain) * off


def com_velocity_command(zmp: Any, desired: Any, com: Any, com_desired: Any, zmp_gain: float, com_gain: float) -> Array:
    r"""Return the velocity command of the CoM from ZMP feedback (thesis eq. 4.29).

    .. math::
        \dot{x}_d = k_f (p - p_d) + k_x (x_d - x)

    Parameters
    ----------
    zmp, desired : array, shape (..., d)
        :math:`p`, measured, and :math:`p_d` [m].
    com, com_desired : array, shape (..., d)
        :math:`x`, measured, and :math:`x_d` [m].
    zmp_gain, com_gain : float
        :math:`k_f` and :math:`k_x` [1/s]. For a constant goal the error converges to zero if :math:`k_f < k_x`.

    Returns
    -------
    array, shape (..., d)
        [m/s].
    """
    feedback = positive("zmp_gain", zmp_gain) * (_points("zmp", zmp) - _points("desired", desired))
    return feedback + positive("com_gain", com_gain) * (_points("com_desired", com_desired) - _points("com", com))


def _in_step(time: Any, count: int, step_time: float) -> tuple[IntArray, Array, Array]:
    """Return the index of the step at each time, the time since its start, and since the end of the last step [s]."""
    time = np.asarray(time, float)
    if not (time >= 0).all():
        raise ValueError("time must be zero or more; it counts from the start of the first step")
    i = np.minimum(np.floor(time / step_time), count - 1).astype(np.int64)
    within = np.clip(time - i * step_time, 0.0, step_time)
    return i, within, np.maximum(time - count * step_time, 0.0)


def _points(name: str, value: Any) -> Array:
    points = np.asarray(value, float)
    if points.ndim == 0 or points.shape[-1] not in (2, 3):
        raise ValueError(f"{name} must be points of 2 or 3 numbers, not an array of shape {points.shape}")
    return points


def _steps(name: str, value: Any) -> Array:
    points = _points(name, value)
    if points.ndim != 2 or len(points) == 0:
        raise ValueError(f"{name} must have one point for each step, at least one, not the shape {points.shape}")
    return points


def _alike(name: str, value: Any, like: Array) -> Array:
    points = np.asarray(value, float)
    if points.shape != like.shape:
        raise ValueError(f"{name} must have the shape {like.shape}, as the other points, not {points.shape}")
    return points
