"""Wrenches (6,): force, then moment about a named point, in the axes of a named frame [N, N m].

A frame's ``wrench`` is about the origin of its link and along the link's axes, which is what a Jacobian of that origin
needs: ``tau = J.T @ turned(wrench, R)`` with J in the link's origin and the world's axes and R the link's rotation
(thesis 3.20 and 3.22, where each wrench needs the rotation of its own link).
"""

import math
from typing import Any

import numpy as np

from ..common.arrays import Array
from .geometry import SkinGeometry
from .plane import cross

# A wrench spread over less than this has no pressure to speak of: half of a small cell [m^2].
LEAST_AREA = 2.5e-5


def about(wrench: Array, point: Any) -> Array:
    """The same wrench with its moment about another point (3,) of the frame [m]."""
    return np.concatenate((wrench[:3], wrench[3:] - cross(np.asarray(point, float), wrench[:3])))


def turned(wrench: Array, rotation: Array) -> Array:
    """The same wrench along the axes of another frame, which ``rotation`` (3, 3) takes it to (thesis 3.21)."""
    return np.concatenate((rotation @ wrench[:3], rotation @ wrench[3:]))


def carried(wrench: Array, pose: Array) -> Array:
    """A wrench about a link's origin along its axes, about another frame's origin and along that frame's axes.

    Parameters
    ----------
    wrench : array, shape (6,)
    pose : array, shape (4, 4)
        Of the link in the other frame, e.g. ``T_world_link``.
    """
    moved = turned(wrench, pose[:3, :3])
    return np.concatenate((moved[:3], moved[3:] + cross(pose[:3, 3], moved[:3])))


def line_of_action(wrench: Array) -> tuple[Array, float] | None:
    """The point (3,) of a wrench's line nearest to the frame's origin [m], and the moment along that line [N m].

    ``E = F x N / |F|^2``: the paper's (6) to (9) without its 0/0; the moment along the force, which a real wrench
    has and the paper forgets, stays as a free moment. None without a force.
    """
    force, moment = wrench[:3], wrench[3:]
    size = math.sqrt(float(force @ force))
    if not size > 0:
        return None
    direction = force / size
    return cross(direction, moment) / size, float(direction @ moment)


def pressure_driven(wrench: Array, area: float, gain: float, least: float = LEAST_AREA) -> Array:
    """The wrench that answers pressure, ``gain / area`` times what presses (thesis 3.26, 3.27).

    Strong for a fingertip, weak for a palm. One threshold decides which cells count, so that there is an area where
    there is a wrench; a floor keeps a sliver from making it infinite.

    Parameters
    ----------
    wrench : array, shape (6,)
    area : float
        Of the cells in contact [m^2].
    gain : float
        The area over which the wrench stays what it is [m^2].
    least : float
        Smaller areas count as this one [m^2].
    """
    return wrench * (gain / max(area, least))


def distances_of(readings: Any, reach: float, full: float) -> Array:
    """Distances (n,) [m] of sensors that send more the nearer something is, ``full`` at no distance.

    Infinite where a sensor sends 0, which means that nothing is in reach, not that it touches; NaN where it sends no
    number.
    """
    nearness = np.asarray(readings, float) / full
    return np.where(nearness <= 0, np.inf, reach * (1 - np.minimum(nearness, 1.0)))


def proximity_wrench(skin: SkinGeometry, distances: Any, reach: float, stiffness: float) -> Array:
    """The wrench (6,) of springs between the taxels and what is near (thesis 3.30 to 3.32, 4.26).

    About the link's origin and along its axes. Each taxel is pushed in, against its normal, by ``stiffness * area *
    (reach - distance)``: per area, so that a finer skin does not push harder.

    Parameters
    ----------
    skin : SkinGeometry
        ``Skin.geometry``.
    distances : array, shape (n,)
        From each taxel along its normal [m]; infinite, or NaN, where nothing is seen.
    reach : float
        Distance from which on nothing pushes [m].
    stiffness : float
        Per area of skin [N/m^3].
    """
    distances = np.nan_to_num(np.asarray(distances, float), nan=np.inf, posinf=np.inf, neginf=np.inf)
    return (stiffness * skin.areas * np.clip(reach - distances, 0.0, reach)) @ skin.wrenches


def temperature_wrench(skin: SkinGeometry, temperatures: Any, limit: float, gain: float) -> Array:
    """The wrench (6,) that draws the link away from heat (thesis 3.34 to 3.37, with a gain that makes it newtons).

    About the link's origin and along its axes. Each taxel is pushed in by ``gain * area * (temperature - limit)``.

    Parameters
    ----------
    skin : SkinGeometry
    temperatures : array, shape (n,)
        In the unit of ``limit``; NaN where a sensor sends no number.
    limit : float
        Temperature up to which nothing pushes.
    gain : float
        Per area of skin [N/(K m^2)].
    """
    above = np.nan_to_num(np.asarray(temperatures, float) - limit, nan=0.0, posinf=0.0, neginf=0.0)
    return (gain * skin.areas * np.maximum(above, 0.0)) @ skin.wrenches


def sole_wrench(touched: bool | None, real: Array, virtual: Array) -> Array:
    """What a landing foot answers: the virtual wrench until it touches, then the real one alone (thesis 4.30).

    Switched by the contact state, which has hysteresis, and not by a wrench being exactly zero. Where contact is not
    known (None) it stays with the virtual one, the only one there is.
    """
    return real if touched else virtual


def lands_early(virtual: Array, threshold: float) -> bool:
    """Whether what is near pushes a swinging foot hard enough to stop it: ``|f_p| > threshold`` [N] (thesis 4.31)."""
    return math.sqrt(float(virtual[:3] @ virtual[:3])) > threshold
