"""Points of touch of a tool at measured poses: where its mesh is nearest to that of the link."""

from dataclasses import replace

import numpy as np

from ..common.errors import CalibrationFormatError
from ..geometry.blas_threads import one_blas_thread
from ..geometry.mesh.approach import SignedDistance, Tool
from ..geometry.mesh.cover import CoverSpec, cut_cover
from ..geometry.mesh.triangle_mesh import TriangleMesh, at_rims, load_mesh
from ..validation.tool import ToolContacts, ToolPoses

# [m] median distance of a tool from the link above which its poses are in another frame. Larger: touches in a wrong
# frame are errors one by one.
MAX_TOOL_DISTANCE = 0.01
MAX_TRIED = 10  # [1] touches with which other meanings of the columns are tried. Larger: more time.


@one_blas_thread()
def tool_contacts(poses: ToolPoses, link: TriangleMesh) -> ToolContacts:
    """Return the points of touch of a tool on the mesh of a link.

    Faces of the link that cannot be seen from outside do not count: a wall has an inner side, too.
    """
    mesh = load_mesh(poses.file, poses.unit)
    tool, distance = Tool(mesh), SignedDistance(cut_cover(link, CoverSpec("seen")))
    if (away := _away(poses, tool, distance)) > MAX_TOOL_DISTANCE:
        message = f"The tool of {poses.file.name} is {away * 1e3:.0f} mm (median) from the surface of the link"
        some = np.linspace(0, len(poses.lines) - 1, min(MAX_TRIED, len(poses.lines))).astype(int)
        for words, other in poses.alternatives():
            other = replace(
                other, lines=other.lines[some], positions=other.positions[some], rotations=other.rotations[some]
            )
            if (then := _away(other, tool, distance)) < MAX_TOOL_DISTANCE / 2:
                raise CalibrationFormatError(
                    f"{message}, and {then * 1e3:.0f} mm if the columns have {words}. Correct it."
                )
        without = " and of the link, whose pose is missing" if poses.of_link is None else " and of the link"
        raise CalibrationFormatError(f"{message}. Check the frames of the tool{without}, and the unit of its mesh.")
    return _contacts(poses, tool, distance, not at_rims(mesh.faces, len(mesh.vertices)).any())


def _contacts(poses: ToolPoses, tool: Tool, distance: SignedDistance, is_closed: bool) -> ToolContacts:
    found = [tool.approach(distance, *pose) for pose in zip(poses.rotations, poses.positions)]
    inside = np.array([k for k, one in enumerate(found) if one.centroid is not None], np.int64)
    centroids = np.array([one.centroid for one in found if one.centroid is not None]).reshape(-1, 3)
    return ToolContacts(
        poses,
        points=np.array([one.point for one in found]),
        distances=np.array([one.distance for one in found]),
        spreads=np.array([one.spread for one in found]),
        at_rim=np.array([one.is_at_rim for one in found]),
        intersecting=inside,
        centroids=centroids,
        centroid_distances=distance(centroids)[0] if len(inside) else np.empty(0),
        is_closed=is_closed,
    )


def _away(poses: ToolPoses, tool: Tool, distance: SignedDistance) -> float:
    """Return the median distance of the tool from the surface of the link [m]."""
    return float(np.median([abs(tool.distance(distance, *pose)) for pose in zip(poses.rotations, poses.positions)]))
