"""Write planar surfaces of a robot for mc_rtc, such as the outline of a sole, in metres and radians."""

import numpy as np

from ...common.arrays import MIN_DIRECTION_LENGTH, Array, unit
from ...common.errors import CalibrationFormatError
from ...common.findings import show
from ..model import LinkCalibration, Patch
from .xml_text import HEAD, numbers, quoted, rpy

# Distance of corners from the plane [m]: as uncertain as the position of a mounted skin. Larger: more curved patches
# are written.
FLATNESS_TOLERANCE = 1e-3


def write_rsdf(calibration: LinkCalibration) -> bytes:
    """Write a surface for each patch: the convex outline of its cells, counter-clockwise.

    The z axis of its frame points **into** the robot, and therefore upwards for a foot on the ground. The x axis is
    parallel to the tangents.
    """
    link = quoted(calibration.link)
    lines = [f"{HEAD}<robot name={link}>"]
    for patch in calibration.patches:
        origin, axes, outline = _plane(patch)
        lines += [
            f"<planar_surface name={quoted(patch.name)} link={link}>",
            f'<origin xyz="{numbers(origin)}" rpy="{numbers(rpy(axes[None])[0])}"/>',
            "<points>",
            *(f'<point xy="{numbers(corner)}"/>' for corner in outline),
            '</points>\n<material name="plastic"/>\n</planar_surface>',
        ]
    return ("\n".join(lines) + "\n</robot>\n").encode()


def _plane(patch: Patch) -> tuple[Array, Array, Array]:
    """Return origin (3,) [m] and axes (3, 3) of the plane of a patch, and its outline in the plane (k, 2) [m]."""
    taxels = patch.taxels
    inwards, along = -taxels.normals_link.mean(axis=0), taxels.tangents_link.mean(axis=0)
    z = unit(inwards)
    x = along - along @ z * z
    origin, corners = taxels.positions_link.mean(axis=0), taxels.corners_link.reshape(-1, 3)
    off = np.abs((corners - origin) @ z).max()
    if (
        np.linalg.norm(inwards) < MIN_DIRECTION_LENGTH
        or np.linalg.norm(x) < MIN_DIRECTION_LENGTH
        or off > FLATNESS_TOLERANCE
    ):
        raise CalibrationFormatError(
            f"patch {show(patch.name)} is not flat: its cells deviate up to {off * 1e3:.1f} mm from their plane, and "
            f"rsdf contains only surfaces that are planar within {FLATNESS_TOLERANCE * 1e3:g} mm. Select the flat "
            "patches (--patch)."
        )
    x = unit(x)
    axes = np.stack((x, np.cross(z, x), z), axis=1)
    return origin, axes, hull((corners - origin) @ axes[:, :2])


def hull(points: Array) -> Array:
    """Return the convex hull of points (n, 2), counter-clockwise, without points on its edges."""
    chains: list[list[Array]] = [[], []]
    order = points[np.lexsort((points[:, 1], points[:, 0]))]
    tiny = 1e-12 * float(np.ptp(points, axis=0).max()) ** 2
    for chain, run in zip(chains, (order, order[::-1])):
        for p in run:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], p) <= tiny:
                chain.pop()
            chain.append(p)
    return np.array(chains[0][:-1] + chains[1][:-1])


def _turn(a: Array, b: Array, c: Array) -> float:
    """Return twice the signed area of a triangle, positive for a left turn."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
