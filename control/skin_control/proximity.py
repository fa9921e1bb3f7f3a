"""Predict where a foot will stand before it lands: supporting polygons from distances."""

from typing import Any

from skin_calib_addon.runtime import GroundGeometry, Polygon, convex_hull

from .checks import Array, distances_in


def preemptive_polygon(ground: GroundGeometry, distances: Any, height: float) -> Polygon:
    """Return the hull of the cells whose distance is below a height, in the coordinates of the ground.

    Cell i counts if ``d_i < height`` (thesis 4.2.7, which prints the opposite sign).

    Parameters
    ----------
    ground : GroundGeometry
        ``Skin.ground``.
    distances : array, shape (n,), or ModalityValues
        From each taxel along its normal [m], such as ``frame.modalities["proximity"]``; infinity, NaN or masked if the
        sensor detects nothing, minus infinity if something is too near to be measured (REP 117 of ROS).
    height : float
        Upper limit of the distances [m].

    Raises
    ------
    ValueError
        If there is not one distance for each taxel.
    """
    near = distances_in(distances, len(ground.can_stand)) < height  # NaN is not near
    return convex_hull(ground.corners[near & ground.can_stand].reshape(-1, 2))


def height_contours(ground: GroundGeometry, distances: Any, heights: Array) -> tuple[Polygon, ...]:
    """Return :func:`preemptive_polygon` for several heights: contour lines of the ground below a swinging foot.

    Parameters
    ----------
    ground : GroundGeometry
        ``Skin.ground``.
    distances : array, shape (n,), or ModalityValues
        As for :func:`preemptive_polygon` [m].
    heights : array, shape (k,)
        Upper limits of the distances [m].
    """
    return tuple(preemptive_polygon(ground, distances, float(h)) for h in heights)
