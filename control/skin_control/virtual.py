"""Compute virtual wrenches: what pressure, distances and temperatures ask a link to do.

A wrench (6,) is a force, then a moment about the origin of the link, along its axes [N, N m]. Add it to the felt one.
"""

import math
from typing import Any

import numpy as np

from skin_calib_addon.runtime import SkinGeometry

from .checks import Array, distances_in, not_negative, positive, unmasked, values_in

# [m^2] Smallest area of a pressure-driven wrench: half of a small cell. Larger: small contacts get weaker wrenches;
# smaller: a contact of a fraction of a cell gets a very large one.
MIN_CONTACT_AREA = 2.5e-5


def pressure_driven(wrench: Array, area: float, gain: float, min_area: float = MIN_CONTACT_AREA) -> Array:
    """Return the wrench that responds to pressure (thesis eq. 3.26, 3.27, corrected).

    It is strong for a fingertip and weak for a palm::

        w_P = gain / max(area, min_area) * w

    The thesis has one threshold for the wrench and another for the area. Here the same cells count for both, and the
    minimum area keeps the result finite.

    Parameters
    ----------
    wrench : array, shape (6,)
        Of the contact [N, N m].
    area : float
        Of the cells in contact [m^2].
    gain : float
        The area at which the wrench does not change [m^2].
    min_area : float
        Smaller areas count as this one [m^2].

    Raises
    ------
    ValueError
        If the gain or the minimum area is not positive and finite.
    """
    factor = positive("gain", gain) / max(area, positive("min_area", min_area))
    return np.asarray(wrench, float) * factor


def distances_of(readings: Any, detection_range: float, full_scale: float) -> Array:
    """Return the distances (n,) [m] of proximity sensors whose reading increases when something is nearer.

    The distance is ``detection_range * (1 - reading / full_scale)``. It is infinite for the reading 0, which means that
    nothing is in range, not a contact. It is NaN for a reading that is not a number.

    Parameters
    ----------
    readings : array, shape (n,)
        One reading for each taxel.
    detection_range : float
        Largest distance that a sensor detects [m].
    full_scale : float
        Reading at distance zero.

    Raises
    ------
    ValueError
        If the range or the reading at distance zero is not positive and finite.
    """
    nearness = unmasked(readings) / positive("full_scale", full_scale)
    span = positive("detection_range", detection_range)
    return np.where(nearness <= 0, np.inf, span * (1 - np.minimum(nearness, 1.0)))


def proximity_wrench(skin: SkinGeometry, distances: Any, detection_range: float, stiffness: float) -> Array:
    r"""Return the wrench (6,) of virtual springs between the taxels and near objects (thesis eq. 3.30 to 3.32, 4.26).

    It is about the origin of the link, along its axes. Each taxel is pushed against its outward normal with the force

    .. math::
        f_i = k A_i \, \operatorname{clip}(d_{\mathrm{range}} - d_i,\; 0,\; d_{\mathrm{range}}) .

    The thesis pushes along the sensing direction, without a limit, and per taxel. Here the force is per area, so that
    the wrench does not depend on the resolution of the skin.

    Parameters
    ----------
    skin : SkinGeometry
        ``Skin.geometry``.
    distances : array, shape (n,), or ModalityValues
        :math:`d_i` from each taxel along its normal [m], such as ``frame.modalities["proximity"]``; infinity, NaN or
        masked if the sensor detects nothing, minus infinity if something is too near to be measured (REP 117 of ROS),
        which pushes fully. A modality at the far end of its response detects nothing.
    detection_range : float
        :math:`d_{\mathrm{range}}`, distance from which on there is no force [m].
    stiffness : float
        :math:`k` per area of skin [N/m^3].

    Raises
    ------
    ValueError
        If there is not one distance for each taxel, the range is not positive and finite, or the stiffness is negative
        or not finite.
    """
    positive("detection_range", detection_range)
    not_negative("stiffness", stiffness)
    distances = distances_in(distances, len(skin.areas))
    distances = np.where(np.isnan(distances), np.inf, distances)
    return (stiffness * skin.areas * np.clip(detection_range - distances, 0.0, detection_range)) @ skin.wrenches


def temperature_wrench(skin: SkinGeometry, temperatures: Any, limit: float, gain: float) -> Array:
    r"""Return the wrench (6,) that moves the link away from heat (thesis eq. 3.34 to 3.37, corrected).

    It is about the origin of the link, along its axes. Each taxel is pushed against its outward normal with the force

    .. math::
        f_i = k A_i \max(0,\; \kappa_i - \kappa_{\mathrm{limit}}) .

    The thesis leaves out the gain :math:`k`, and its force is in kelvin.

    Parameters
    ----------
    skin : SkinGeometry
        ``Skin.geometry``.
    temperatures : array, shape (n,), or ModalityValues
        :math:`\kappa_i`, in the unit of ``limit``, such as ``frame.modalities["temperature"]``; NaN, infinite or
        masked if a sensor has no reading.
    limit : float
        Temperature up to which there is no force.
    gain : float
        :math:`k` per area of skin [N/(K m^2)].

    Raises
    ------
    ValueError
        If there is not one temperature for each taxel, the limit is not finite, or the gain is negative or not finite.
    """
    if not math.isfinite(limit):
        raise ValueError(f"the limit {limit} of the temperature is not a finite number")
    not_negative("gain", gain)
    known = values_in(temperatures, len(skin.areas), "K", "degC")
    above = np.nan_to_num(known - limit, nan=0.0, posinf=0.0, neginf=0.0)
    return (gain * skin.areas * np.maximum(above, 0.0)) @ skin.wrenches


def sole_wrench(touched: bool | None, real: Array, virtual: Array) -> Array:
    """Return the wrench for a landing foot: the virtual one before contact, the real one in contact (thesis eq. 4.30).

    The contact state has hysteresis. The thesis compares a wrench with zero instead.

    Parameters
    ----------
    touched : bool or None
        ``Frame.touched``; if it is unknown (None), the result is the virtual wrench.
    real, virtual : array, shape (6,)
        Of the contacts, and of :func:`proximity_wrench` [N, N m].
    """
    return real if touched else virtual


def lands_early(virtual: Array, threshold: float) -> bool:
    """Return whether near objects push a swinging foot so hard that it must stop (thesis eq. 4.31): ``|f_p| > eps``.

    A force that is not known (NaN) does not stop it.

    Parameters
    ----------
    virtual : array, shape (6,)
        Of :func:`proximity_wrench` [N, N m].
    threshold : float
        eps [N].

    Raises
    ------
    ValueError
        If the threshold is negative or not finite.
    """
    not_negative("threshold", threshold)
    return math.sqrt(float(virtual[:3] @ virtual[:3])) > threshold
