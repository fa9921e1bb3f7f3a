"""Check that measured touches are on the link: far ones are in another frame or unit, or are of another link."""

import numpy as np

from ..calibration.model import LinkCalibration
from ..common.arrays import Array
from ..common.errors import CalibrationFormatError, millimetres
from ..geometry.blas_threads import one_blas_thread
from ..geometry.surface.bspline import BSplineSurface
from ..geometry.surface.footpoints import footpoints
from ..skin.sheet.landmarks import MAX_POINT_DISTANCE
from ..validation.touches import Touches
from .calibrate import surface_of

# [1] sides of the grid of surface points from which the distance of a line is measured: 1 to 2 mm apart on a limb.
# Larger: more accurate, more time.
GRID_SIDE = 200


@one_blas_thread()
def check_touches(calibration: LinkCalibration, touches: Touches) -> None:
    """Check the distance of each touch from the surface of its skin, which is over the mesh.

    The distance counts from the height of the taxel that felt the touch, as skins can be thick. The distance of a line
    of action is that of its nearest point.
    """
    surfaces = {model.name: surface_of(model) for model in calibration.surfaces}
    for patch in calibration.patches:
        surface = surfaces.get(patch.surface)
        row = {name: i for i, name in enumerate(patch.taxels.ids)}
        mine = np.array([i for i, name in enumerate(touches.taxels) if name in row], np.int64)
        if surface is None or len(mine) == 0:
            continue
        felt = patch.taxels.positions_link[[row[touches.taxels[i]] for i in mine]]
        away = touch_distances(surface, touches.points[mine], touches.directions[mine]) - footpoints(surface, felt)[1]
        worst = int(np.argmax(away))
        if away[worst] > MAX_POINT_DISTANCE:
            i = mine[worst]
            what = "line of action through" if touches.directions[i].any() else "touch at"
            raise CalibrationFormatError(
                f"Line {touches.lines[i]}: the {what} {millimetres(touches.points[i])} is {away[worst] * 1e3:.1f} mm "
                f"from skin {patch.name!r}, more than {MAX_POINT_DISTANCE * 1e3:g} mm. "
                "Positions are in metres in the link frame. Correct them, or remove this touch.",
                distance=float(away[worst]),
            )


def touch_distances(surface: BSplineSurface, points: Array, directions: Array) -> Array:
    """Return the distance of points or lines from a surface, shape (n,) [m]."""
    distance = footpoints(surface, points)[1]
    even = np.linspace(0, 1, GRID_SIDE)
    grid = surface.grid_points(even, even).reshape(-1, 3)
    for i in np.flatnonzero(directions.any(axis=1)):
        distance[i] = np.linalg.norm(np.cross(grid - points[i], directions[i]), axis=1).min()
    return distance
