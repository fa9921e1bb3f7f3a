"""Read COLLADA files (DAE) of robots, as ROS does."""

import io
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ...common.arrays import Array, IntArray
from ...common.packages import how_to_install
from .expansion import check_faces, check_nodes
from .polygons import triangulated

# Elements without an effect on the shape. They are not read, so that defects in them do not matter.
OTHER_PARTS = {
    *("library_images", "library_effects", "library_materials", "library_animations", "library_lights"),
    *("library_cameras", "library_physics_scenes", "bind_material", "instance_light", "instance_camera", "extra"),
    *("lines", "linestrips"),
}
HEADER_BYTES = 65_536  # in which ``<up_axis>`` is found. Larger: slower; smaller: files with long comments are missed.


def read_dae(path: str | Path) -> tuple[Array, IntArray]:
    """Read the triangles of a COLLADA file: vertices (3 f, 3) [m] and faces (f, 3).

    As in RViz and Gazebo, the numbers are multiplied by ``<unit meter>``, and ``<up_axis>`` is ignored: the meshes of
    robots are in the frame of their link, whatever it states.
    """
    try:
        import collada
    except ImportError as error:
        raise ImportError(f"this needs pycollada, which is missing: {how_to_install('collada')}") from error
    with open(path, "rb") as file:
        root = ElementTree.parse(file, ElementTree.XMLParser(target=_Builder())).getroot()
    for parent in root.iter():
        for child in [child for child in parent if child.tag.rpartition("}")[2] in OTHER_PARTS]:
            parent.remove(child)
        if parent.tag.endswith("float_array") and parent.text:
            # pycollada makes zeros of NaN, also in vertices
            parent.text = re.sub("nan", "inf", parent.text, flags=re.I)
    document = collada.Collada(io.BytesIO(ElementTree.tostring(root)))
    if document.scene is None:
        raise ValueError("it has no scene")
    triangles = _triangles(document.scene.nodes, collada, Path(path).stat().st_size)
    metre = 1.0 if document.assetInfo.unitmeter is None else document.assetInfo.unitmeter
    vertices = np.concatenate([np.zeros((0, 3)), *triangles]) * metre
    return vertices, np.arange(len(vertices)).reshape(-1, 3)


def has_other_axis(path: str | Path) -> bool:
    """Return whether a file is a COLLADA file that states another upward axis than z, which has no effect."""
    if Path(path).suffix.lower() != ".dae":
        return False
    with open(path, "rb") as file:
        return re.search(rb"<up_axis>\s*[XY]_UP", file.read(HEADER_BYTES)) is not None


class _Builder(ElementTree.TreeBuilder):
    """Builds the tree of a document without a document type."""

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        """Refuse the document type."""
        raise ValueError("it declares a document type, which may contain entities; remove it from the file")


def _triangles(roots: list[Any], collada: Any, size: int) -> list[Array]:
    """Return the corners (3 k, 3) of all triangles below nodes of the scene of a file of ``size`` bytes."""
    found, count, faces = [], 0, 0
    nodes = [(root, np.eye(4)) for root in reversed(roots)]
    while nodes:
        node, pose = nodes.pop()
        check_nodes(count := count + 1)
        if isinstance(node, collada.scene.Node):
            pose = pose @ np.asarray(node.matrix, float)
            nodes += [(child, pose) for child in reversed(node.children)]
        elif isinstance(node, collada.scene.ControllerNode):
            raise ValueError("it has a mesh with bones; export it without them")
        elif isinstance(node, collada.scene.GeometryNode):
            for part in node.geometry.primitives:
                announced = _announced(part.xmlnode)
                check_faces(faces := faces + announced, size)
                if len(part) != announced:
                    raise ValueError(f"it announces {announced} faces of {node.geometry.id}, but has {len(part)}")
                if part.vertex is not None:
                    counts = getattr(part, "vcounts", np.full(len(part), 3))
                    corners = part.vertex_index.ravel()
                    if counts.sum() != len(corners):
                        raise ValueError(f"polygons of {node.geometry.id} are incomplete")
                    points = part.vertex.astype(float)
                    triangles = points[triangulated(points, corners, counts)].reshape(-1, 3)
                    if not np.isfinite(triangles).all():
                        raise ValueError(f"vertices of {node.geometry.id} are not finite")
                    found.append(triangles @ pose[:3, :3].T + pose[:3, 3])
    return found


def _announced(part: Any) -> int:
    """Return the number of faces of an element with faces; strips and fans announce how many they are themselves."""
    tags = [child.tag.rpartition("}")[2] for child in part]
    announced = int(part.get("count", tags.count("p")))
    if part.tag.rpartition("}")[2] not in ("tristrips", "trifans"):
        return announced
    strips = [child.text or "" for child, tag in zip(part, tags) if tag == "p"]
    if len(strips) != announced:
        raise ValueError(f"it announces {announced} strips or fans, but has {len(strips)}")
    width = 1 + max(int(child.get("offset", 0)) for child, tag in zip(part, tags) if tag == "input")
    return sum(len(strip.split()) // width - 2 for strip in strips)
