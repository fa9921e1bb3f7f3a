"""Planar surfaces of a robot for mc_rtc: the outline of a sole, metres and radians."""

import numpy as np

from ...common.arrays import Array, unit
from ...common.errors import CalibrationFormatError
from ...common.findings import show
from ..model import LinkCalibration, Patch
from .xml_text import HEAD, numbers, quoted, rpy

FLATNESS_TOLERANCE = 0.02  # how far corners may stand off the plane, as a share of the patch's size
MIN_MEAN_LENGTH = 1e-6  # of a mean direction: below, the taxels look all ways


def write_rsdf(calibration: LinkCalibration) -> bytes:
    """A surface for each patch: the convex outline of its cells, counter-clockwise.

    The z axis of its frame leads **into** the robot, so that it stands upright under a foot on the ground; x runs along
    the tangents.

    Raises
    ------
    CalibrationFormatError
        If a patch is bent: a planar surface would not be where the skin is.
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
    """Origin (3,) [m] and axes (3, 3) of the plane of a patch, and the outline in it (k, 2) [m]."""
    taxels = patch.taxels
    inwards, along = -taxels.normals_link.mean(axis=0), taxels.tangents_link.mean(axis=0)
    z = unit(inwards)
    x = along - along @ z * z
    origin, corners = taxels.positions_link.mean(axis=0), taxels.corners_link.reshape(-1, 3)
    off = np.abs((corners - origin) @ z).max()
    size = float(np.linalg.norm(np.ptp(corners, axis=0)))
    if (
        np.linalg.norm(inwards) < MIN_MEAN_LENGTH
        or np.linalg.norm(x) < MIN_MEAN_LENGTH
        or off > FLATNESS_TOLERANCE * size
    ):
        raise CalibrationFormatError(
            f"patch {show(patch.name)} is bent: its cells stand up to {off * 1e3:.1f} mm off their plane, and rsdf "
            "holds planar surfaces; name the flat patches (--patch)"
        )
    x = unit(x)
    axes = np.stack((x, np.cross(z, x), z), axis=1)
    return origin, axes, hull((corners - origin) @ axes[:, :2])


def hull(points: Array) -> Array:
    """The convex outline of points (n, 2), counter-clockwise, without points on its sides."""
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
    """Twice the area of a triangle: positive where it turns left."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
