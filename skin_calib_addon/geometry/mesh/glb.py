"""Read binary glTF files (GLB) of robots."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ...common.arrays import Array, IntArray
from .expansion import check_faces, check_nodes

MAGIC = b"glTF"  # first bytes. Format
HEADER = struct.Struct("<4sIIII")  # those, version, bytes of the file, bytes and kind of its first part, JSON. Format
PART = struct.Struct("<II")  # bytes and kind of a further part; the numbers are in the second one. Format
NUMBERS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}  # Format
# Extensions of the appearance only; a file may require them. Others may compress or change the shape.
APPEARANCE = ("KHR_materials_", "KHR_texture_", "EXT_texture_")
TRIANGLES, STRIP, FAN = 4, 5, 6  # modes of primitives with triangles; others have points or lines. Format


def read_glb(path: str | Path) -> tuple[Array, IntArray]:
    """Read the triangles of a binary glTF file at the poses of its nodes: vertices (v, 3) [m] and faces (f, 3).

    The coordinates stay as they are in the file: glTF calls its y axis "up", but the meshes of robots are in the frame
    of their link.
    """
    content = Path(path).read_bytes()
    if len(content) < HEADER.size or not content.startswith(MAGIC):
        raise ValueError("it does not have the header of glTF")
    _, _, size, length, _ = HEADER.unpack_from(content)
    if size > len(content):
        raise ValueError(f"it is truncated: its header announces {size} bytes, but it has {len(content)}")
    document = json.loads(content[HEADER.size : HEADER.size + length])
    refuse_other_shapes(document)
    meshes = [mesh["primitives"] for mesh in document.get("meshes", ())]
    parts = [[_triangles(document, part, content[HEADER.size + length + PART.size :]) for part in m] for m in meshes]
    placed = [(part, pose) for mesh, pose in _placed(document) for part in parts[mesh]]
    check_faces(sum(len(faces) for (_, faces), _ in placed), len(content))
    vertices, triangles, count = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
    for (points, faces), pose in placed:
        vertices.append(points @ pose[:3, :3].T + pose[:3, 3])
        triangles.append((faces if np.linalg.det(pose[:3, :3]) >= 0 else faces[:, ::-1]) + count)
        count += len(points)
    return np.concatenate(vertices), np.concatenate(triangles)


def refuse_other_shapes(document: dict[str, Any]) -> None:
    """Refuse what would have another shape than the triangles of the file."""
    for name in document.get("extensionsRequired", ()):
        if not str(name).startswith(APPEARANCE):
            raise ValueError(f"it needs the extension {name}; export it without compression")
    if not document.get("scenes"):
        raise ValueError("it has no scene")
    if document.get("skins"):
        raise ValueError("it has a mesh with bones; export it without them")
    meshes = document.get("meshes", ())
    if any(any(part.get("weights", ())) for part in (*meshes, *document.get("nodes", ()))):
        raise ValueError("it has a mesh with morph targets; export it without them")
    if any("sparse" in accessor for accessor in document.get("accessors", ())):
        raise ValueError("it has sparse accessors; export it without them")
    if any("uri" in buffer for buffer in document.get("buffers", ())):
        raise ValueError("its numbers are in another file; export it as one file")


def _triangles(document: dict[str, Any], part: dict[str, Any], content: bytes) -> tuple[Array, IntArray]:
    """Return vertices (v, 3) and faces (f, 3) of a primitive; those of points and lines have no faces."""
    points = _numbers(document, part["attributes"]["POSITION"], 3, content).astype(float)
    order = np.arange(len(points))
    if "indices" in part:
        order = _numbers(document, part["indices"], 1, content).ravel().astype(np.int64)
    if len(order) and order.max() >= len(points):
        raise ValueError(f"a face refers to vertex {order.max()}, but its part has {len(points)} vertices")
    mode, k = part.get("mode", TRIANGLES), np.arange(max(len(order) - 2, 0))
    if mode == TRIANGLES:
        return points, order[: len(order) // 3 * 3].reshape(-1, 3)
    if mode == STRIP:  # every second triangle is wound against the others
        return points, order[np.column_stack((k, k + 1 + k % 2, k + 2 - k % 2))]
    if mode == FAN:
        return points, order[np.column_stack((np.zeros_like(k), k + 1, k + 2))]
    return points, np.zeros((0, 3), np.int64)


def _numbers(document: dict[str, Any], accessor: int, width: int, content: bytes) -> Array:
    """Return the rows (count, width) of an accessor, without a copy."""
    entry = document["accessors"][accessor]
    if "bufferView" not in entry:
        raise ValueError("it has an accessor without numbers; export it again")
    view, kind = document["bufferViews"][entry["bufferView"]], np.dtype(NUMBERS[entry["componentType"]])
    if (entry["type"], kind.kind) != (("VEC3", "f") if width == 3 else ("SCALAR", "u")):
        raise ValueError(f"an accessor has type {entry['type']} of {kind.name}; export it again")
    stride = view.get("byteStride", kind.itemsize * width)
    if stride < kind.itemsize * width or view.get("buffer", 0) != 0:
        raise ValueError("the layout of its numbers is wrong; export it again")
    start = view.get("byteOffset", 0) + entry.get("byteOffset", 0)
    try:
        return np.ndarray((entry["count"], width), kind, content, start, (stride, kind.itemsize))
    except (TypeError, ValueError):
        raise ValueError(f"it is truncated: an accessor announces {entry['count']} rows of numbers") from None


def _placed(document: dict[str, Any]) -> list[tuple[int, Array]]:
    """Return the meshes at the nodes of the scene, and their poses (4, 4)."""
    waiting = [(node, np.eye(4)) for node in document["scenes"][document.get("scene", 0)].get("nodes", ())]
    found, count = [], 0
    while waiting:
        check_nodes(count := count + 1)
        number, pose = waiting.pop()
        node = document["nodes"][number]
        pose = pose @ _pose(node)
        found += [(node["mesh"], pose)] if "mesh" in node else []
        waiting += [(child, pose) for child in node.get("children", ())]
    return found


def _pose(node: dict[str, Any]) -> Array:
    """Return the pose (4, 4) of a node in its parent, with its scale."""
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_quat(node.get("rotation", (0, 0, 0, 1))).as_matrix() * node.get("scale", (1, 1, 1))
    pose[:3, 3] = node.get("translation", (0, 0, 0))
    return pose
