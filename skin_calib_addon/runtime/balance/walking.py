"""Walking references of the linear inverted pendulum: DCM, way-points, desired ZMP, commands (thesis 4.1.3, 4.1.4).

Points are arrays (..., d) [m] of two or three numbers, all in one frame whose third axis, if there is one, points up.
Equations (4.14) and (4.15) are printed with wrong signs; here they are the solutions of (4.12).
"""

from typing import Any

import numpy as np

from ...common.arrays import Array, IntArray

GRAVITY = 9.81  # [m/s^2]


def pendulum_frequency(height: float, gravity: float = GRAVITY) -> float:
    """Frequency of the inverted pendulum, ``omega = sqrt(g / z_x)`` [1/s].

    Parameters
    ----------
    height : float
        Of the CoM above the ground, z_x [m].
    gravity : float
        [m/s^2]

    Raises
    ------
    ValueError
        Names the argument that is not above zero, as all functions here do.
    """
    return float(np.sqrt(_positive("gravity", gravity) / _positive("height", height)))


def divergent_component(position: Any, velocity: Any, omega: float) -> Array:
    """DCM of the CoM, ``xi = x + x' / omega`` (4.9), (4.27)."""
    return _points("position", position) + _points("velocity", velocity) / _positive("omega", omega)


def com_velocity(position: Any, dcm: Any, omega: float) -> Array:
    """How the CoM follows the DCM, ``x' = -omega (x - xi)`` (4.10) [m/s]."""
    return -_positive("omega", omega) * (_points("position", position) - _points("dcm", dcm))


def dcm_velocity(dcm: Any, repellent: Any, omega: float) -> Array:
    """How the DCM runs away from the ZMP or the virtual repellent point, ``xi' = omega (xi - p)`` (4.12) [m/s]."""
    return _positive("omega", omega) * (_points("dcm", dcm) - _points("repellent", repellent))


def repellent_points(footsteps: Any, height: float) -> Array:
    """Virtual repellent points over footsteps, ``r_i = wr_i + (0, 0, z_x)`` (4.13); the same points in the plane."""
    points = _points("footsteps", footsteps)
    lift = np.zeros(points.shape[-1])
    lift[2:] = _positive("height", height)
    return points + lift


def dcm_waypoints(repellents: Any, step_time: float, omega: float, last: Any = None) -> Array:
    """Where the DCM must be when each step ends, ``xi_i = r_(i+1) + exp(-omega T) (xi_(i+1) - r_(i+1))`` (4.14).

    Parameters
    ----------
    repellents : array, shape (n, d)
        The point that repels during each step.
    step_time : float
        T [s]
    omega : float
        [1/s]
    last : array, shape (d,), optional
        The DCM at the end of the last step; by default over its repellent point, where the CoM comes to rest.

    Returns
    -------
    array, shape (n, d)
        Row i is the DCM at the end of step i, which is the start of the next.
    """
    r = _steps("repellents", repellents)
    decay = np.exp(-_positive("omega", omega) * _positive("step_time", step_time))
    ends = np.empty_like(r)
    ends[-1] = r[-1] if last is None else _alike("last", last, r[-1])
    for i in range(len(r) - 2, -1, -1):
        ends[i] = r[i + 1] + decay * (ends[i + 1] - r[i + 1])
    return ends


def dcm_reference(time: Any, repellents: Any, ends: Any, step_time: float, omega: float) -> Array:
    """The DCM on its way, ``xi_r = r_i + exp(omega (t - T)) (xi_i - r_i)`` (4.15), t from the start of step i.

    Parameters
    ----------
    time : array, shape (...)
        From the start of the first step [s]; after the last step the DCM stays.
    repellents, ends : array, shape (n, d)
        The point that repels during each step, and the DCM when it ends; see `dcm_waypoints`.
    step_time : float
        T [s]
    omega : float
        [1/s]

    Returns
    -------
    array, shape (..., d)
    """
    r = _steps("repellents", repellents)
    xi = _alike("ends", ends, r)
    i, within, _ = _in_step(time, len(r), _positive("step_time", step_time))
    growth = np.exp(_positive("omega", omega) * (within - step_time))[..., None]
    return r[i] + growth * (xi[i] - r[i])


def zmp_reference(time: Any, repellents: Any, ends: Any, step_time: float) -> Array:
    """The point that repels the DCM at a time: that of the step, and after the last step the DCM, which it holds.

    Parameters and shapes as of `dcm_reference`.
    """
    r = _steps("repellents", repellents)
    xi = _alike("ends", ends, r)
    i, _, after = _in_step(time, len(r), _positive("step_time", step_time))
    return np.where((after > 0)[..., None], xi[-1], r[i])


def com_reference(time: Any, repellents: Any, ends: Any, start: Any, step_time: float, omega: float) -> Array:
    """The CoM that follows the DCM's reference from ``start`` (d,): the solution of (4.10) with (4.15).

    In step i, from x_i on and with D = xi_i - r_i,
    ``x = r_i + D exp(omega (t - T)) / 2 + (x_i - r_i - D exp(-omega T) / 2) exp(-omega t)``.

    Other parameters, and shapes, as of `dcm_reference`; after the last step the CoM comes to rest at the DCM.
    """
    r = _steps("repellents", repellents)
    xi = _alike("ends", ends, r)
    T, w = _positive("step_time", step_time), _positive("omega", omega)
    decay, half = np.exp(-w * T), (xi - r) / 2
    starts = np.empty((len(r) + 1, r.shape[1]))
    starts[0] = _alike("start", start, r[0])
    for k in range(len(r)):
        starts[k + 1] = r[k] + half[k] + (starts[k] - r[k] - half[k] * decay) * decay
    i, within, after = _in_step(time, len(r), T)
    growing, falling = np.exp(w * (within - T))[..., None], np.exp(-w * within)[..., None]
    x = r[i] + half[i] * growing + (starts[i] - r[i] - half[i] * decay) * falling
    settling = xi[-1] + (starts[-1] - xi[-1]) * np.exp(-w * after)[..., None]
    return np.where((after > 0)[..., None], settling, x)


def desired_zmp(reference: Any, dcm_reference: Any, dcm: Any, gain: float, omega: float) -> Array:
    """The ZMP that brings the DCM back, ``p_d = p_r - (1 + k / omega) (xi_r - xi)`` (4.18), (4.28).

    The error then shrinks as ``exp(-k t)``, as far as the ZMP can be there: keep it in the supporting polygon.

    Parameters
    ----------
    reference : array, shape (..., d)
        p_r, the ZMP or repellent point of the plan.
    dcm_reference, dcm : array, shape (..., d)
        xi_r and xi, the planned and the actual DCM.
    gain : float
        k [1/s]
    omega : float
        [1/s]
    """
    lead = 1 + _positive("gain", gain) / _positive("omega", omega)
    return _points("reference", reference) - lead * (_points("dcm_reference", dcm_reference) - _points("dcm", dcm))


def zmp_tracking_velocity(zmp: Any, zmp_velocity: Any, desired: Any, gain: float) -> Array:
    """Velocity of the CoM that makes the ZMP follow, ``x'_r = p' + k_p (p - p_d)`` (4.20) [m/s].

    For a reference of the CoM without jerk, where ``p'_d = x'_r``; ``p'`` is to be filtered.
    """
    off = _points("zmp", zmp) - _points("desired", desired)
    return _points("zmp_velocity", zmp_velocity) + _positive("gain", gain) * off


def com_velocity_command(zmp: Any, desired: Any, com: Any, com_desired: Any, zmp_gain: float, com_gain: float) -> Array:
    """Velocity command of the CoM from ZMP feedback, ``x'_d = k_f (p - p_d) + k_x (x_d - x)`` (4.29) [m/s].

    Parameters
    ----------
    zmp, desired : array, shape (..., d)
        p as measured, and p_d.
    com, com_desired : array, shape (..., d)
        x as measured, and x_d.
    zmp_gain, com_gain : float
        k_f and k_x [1/s]. Of a CoM that obeys, the distance to a goal that stands dies out if k_f < k_x.
    """
    feedback = _positive("zmp_gain", zmp_gain) * (_points("zmp", zmp) - _points("desired", desired))
    return feedback + _positive("com_gain", com_gain) * (_points("com_desired", com_desired) - _points("com", com))


def _in_step(time: Any, count: int, step_time: float) -> tuple[IntArray, Array, Array]:
    """The step that runs at each time, the time since its start, and that since the end of the last step [s]."""
    time = np.asarray(time, float)
    if not (time >= 0).all():
        raise ValueError("time must be zero or more, from the start of the first step")
    i = np.minimum(np.floor(time / step_time), count - 1).astype(np.int64)
    within = np.clip(time - i * step_time, 0.0, step_time)
    return i, within, np.maximum(time - count * step_time, 0.0)


def _points(name: str, value: Any) -> Array:
    points = np.asarray(value, float)
    if points.ndim == 0 or points.shape[-1] not in (2, 3):
        raise ValueError(f"{name} must hold points of 2 or 3 numbers, not an array of shape {points.shape}")
    return points


def _steps(name: str, value: Any) -> Array:
    points = _points(name, value)
    if points.ndim != 2 or len(points) == 0:
        raise ValueError(f"{name} must hold one point for each step, at least one, not an array of {points.shape}")
    return points


def _alike(name: str, value: Any, like: Array) -> Array:
    points = np.asarray(value, float)
    if points.shape != like.shape:
        raise ValueError(f"{name} must have the shape {like.shape} that goes with the steps, not {points.shape}")
    return points


def _positive(name: str, value: float) -> float:
    if not 0 < value < np.inf:
        raise ValueError(f"{name} must be above zero and finite, not {value}")
    return float(value)
