"""Read binary glTF files (GLB) of robots."""

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from ...common.arrays import Array, IntArray

MAGIC = b"glTF"  # first bytes. Format
HEADER = struct.Struct("<4sIIII")  # those, version, bytes of the file, bytes and kind of its first part, JSON. Format
# Extensions of the appearance only; a file may require them. Others may compress or change the shape.
APPEARANCE = ("KHR_materials_", "KHR_texture_", "EXT_texture_")
TRIANGLES, STRIP = 4, 5  # modes of primitives with triangles. Format
FAN = 6  # mode of primitives that trimesh leaves out. Format


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
    import trimesh  # it takes longer than reading

    # Without a resolver trimesh finds no other file.
    raw: Any = trimesh.load(io.BytesIO(content), file_type="glb", process=False, force="mesh", skip_materials=True)
    faces = np.asarray(raw.faces)
    if len(faces) != (announced := face_count(document)):
        raise ValueError(f"it announces {announced} faces, but {len(faces)} were found")
    return np.asarray(raw.vertices, float), faces


def face_count(document: dict[str, Any]) -> int:
    """Return the number of triangles of the meshes at all nodes of the scene."""
    counts = {TRIANGLES: lambda corners: corners // 3, STRIP: lambda corners: max(corners - 2, 0)}
    sizes = [
        sum(
            counts[mode](document["accessors"][part.get("indices", part["attributes"]["POSITION"])]["count"])
            for part in mesh["primitives"]
            if (mode := part.get("mode", TRIANGLES)) in counts
        )
        for mesh in document.get("meshes", ())
    ]
    nodes = list(document["scenes"][document.get("scene", 0)].get("nodes", ()))
    for node in nodes:  # grows
        nodes += [child for child in document["nodes"][node].get("children", ()) if child not in nodes]
    return sum(sizes[document["nodes"][node]["mesh"]] for node in nodes if "mesh" in document["nodes"][node])


def refuse_other_shapes(document: dict[str, Any]) -> None:
    """Refuse what trimesh would leave out or read as another shape."""
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
    if any(part.get("mode") == FAN for mesh in meshes for part in mesh["primitives"]):
        raise ValueError("it has triangle fans; export it with triangles")
