"""Binary glTF files, written here: nodes, instances, damage, and what has another shape than its triangles."""

import json
import struct

import numpy as np
import pytest
import trimesh

from skin_calib_addon.common.errors import InvalidMesh
from skin_calib_addon.geometry.mesh.triangle_mesh import load_mesh, read_mesh

CORNERS = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3]], np.float32)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.uint16)
STRIP = np.array([0, 2, 1, 3, 0, 2], np.uint16)  # the same faces as triangles of a strip
VOLUME = 0.1 * 0.2 * 0.3 / 6
FLOATS, SHORTS, LINES, STRIPS, FANS = 5126, 5123, 1, 5, 6


def glb(document, content):
    """Return a file of two parts, each filled up to a multiple of four bytes."""
    head = json.dumps(document).encode()
    head += b" " * (-len(head) % 4)
    content += b"\0" * (-len(content) % 4)
    parts = struct.pack("<II", len(head), 0x4E4F534A) + head + struct.pack("<II", len(content), 0x004E4942) + content
    return struct.pack("<III", 0x46546C67, 2, 12 + len(parts)) + parts


def written(folder, index=FACES, mode=4, nodes=({"mesh": 0},), **changes):
    """Write a tetrahedron with other indices, a mode, nodes, or other members of the document."""
    views = [{"buffer": 0, "byteLength": CORNERS.nbytes}]
    views += [{"buffer": 0, "byteOffset": CORNERS.nbytes, "byteLength": index.nbytes}]
    accessors = [{"bufferView": 0, "componentType": FLOATS, "count": 4, "type": "VEC3"}]
    accessors += [{"bufferView": 1, "componentType": SHORTS, "count": index.size, "type": "SCALAR"}]
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [k for k, node in enumerate(nodes) if not node.get("inner")]}],
        "nodes": [{key: value for key, value in node.items() if key != "inner"} for node in nodes],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": mode}]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": CORNERS.nbytes + index.nbytes}],
    }
    path = folder / "link.glb"
    path.write_bytes(glb(document | changes, CORNERS.tobytes() + index.tobytes()))
    return path


def volume(mesh):
    """Return the signed volume: positive if the normals point outward."""
    return np.linalg.det(mesh.triangles).sum() / 6


def same_points(mesh, points):
    found, known = (np.unique(np.asarray(k, float).round(6), axis=0) for k in (mesh.vertices, points))
    return np.array_equal(found, known)


@pytest.mark.parametrize(("index", "mode"), [(FACES, 4), (STRIP, STRIPS)])
def test_coordinates_are_those_of_the_file(tmp_path, index, mode):
    """In metres, and not turned from the y axis of glTF to another one."""
    mesh = load_mesh(written(tmp_path, index, mode))
    assert len(mesh.faces) == 4 and same_points(mesh, CORNERS)
    assert volume(mesh) == pytest.approx(VOLUME)


def test_nodes_place_their_meshes(tmp_path):
    """A mesh is placed twice: turned and moved below another node, and mirrored; all normals point outward."""
    half = np.sqrt(0.5)
    nodes = [
        {"children": [1], "translation": [1, 0, 0]},
        {"mesh": 0, "rotation": [0, 0, half, half], "inner": True},  # a quarter turn about z
        {"mesh": 0, "scale": [-1, 1, 1], "translation": [-1, 0, 0]},
    ]
    mesh = read_mesh(written(tmp_path, nodes=nodes))
    turned = CORNERS @ np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]) + (1, 0, 0)
    assert same_points(mesh, np.concatenate((turned, CORNERS * (-1, 1, 1) - (1, 0, 0))))
    assert len(mesh.faces) == 8 and volume(mesh) == pytest.approx(2 * VOLUME)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mode": FANS}, "triangle fans"),
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "needs the extension KHR_draco_mesh_compression"),
        ({"extensionsRequired": ["KHR_mesh_quantization"]}, "needs the extension KHR_mesh_quantization"),
        ({"skins": [{"joints": [0]}]}, "bones"),
        ({"nodes": ({"mesh": 0, "weights": [0, 0.5]},)}, "morph targets"),
        ({"accessors": [{"componentType": FLOATS, "count": 4, "type": "VEC3", "sparse": {}}]}, "sparse accessors"),
        ({"buffers": [{"byteLength": 72, "uri": "other.bin"}]}, "not a valid GLB file"),
        ({"nodes": ()}, "no faces"),
        ({"scenes": []}, "it has no scene"),
        ({"mode": LINES}, "no faces"),
    ],
)
def test_other_shapes_are_refused(tmp_path, changes, message):
    """The message names what the file has; other files are not read, even where they exist."""
    (tmp_path / "other.bin").write_bytes(CORNERS.tobytes() + FACES.tobytes())
    with pytest.raises(InvalidMesh, match=message):
        read_mesh(written(tmp_path, **changes))


def test_faces_that_the_library_leaves_out_are_noticed(tmp_path, monkeypatch):
    """Their number follows from the file alone; a mesh at two nodes counts twice."""
    path = written(tmp_path, nodes=({"mesh": 0}, {"mesh": 0, "translation": [1, 0, 0]}))
    whole = trimesh.load(path, force="mesh", process=False)
    monkeypatch.setattr(
        trimesh, "load", lambda *_, **__: trimesh.Trimesh(whole.vertices, whole.faces[1:], process=False)
    )
    with pytest.raises(InvalidMesh, match="it announces 8 faces, but 7 were found"):
        read_mesh(path)


def test_appearance_is_of_no_matter(tmp_path):
    """Extensions of materials and textures may be required; missing pictures are not read."""
    path = written(
        tmp_path, extensionsRequired=["KHR_materials_unlit", "KHR_texture_transform"], images=[{"uri": "lost.png"}]
    )
    assert len(read_mesh(path).faces) == 4


def test_nodes_in_a_circle_end(tmp_path):
    """Nodes that are children of each other: each mesh is there once."""
    nodes = [{"children": [1], "mesh": 0}, {"children": [0], "inner": True}]
    assert len(read_mesh(written(tmp_path, nodes=nodes)).faces) == 4


@pytest.mark.parametrize("size", [0, 3, 12, 19, 100, -200, -1])
def test_truncated_files_are_refused(tmp_path, size):
    """In words: it is empty, has no header, or fewer bytes than its header announces."""
    path = written(tmp_path)
    path.write_bytes(path.read_bytes()[:size])
    why = "empty" if size == 0 else "not a valid GLB file: it " + ("does not have" if 0 < size < 20 else "is truncated")
    with pytest.raises(InvalidMesh, match=rf"link\.glb is {why}"):
        read_mesh(path)
