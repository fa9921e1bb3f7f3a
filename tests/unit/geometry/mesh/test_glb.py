"""Binary glTF files, written here: nodes, instances, damage, and what has another shape than its triangles."""

import json
import struct

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose

from skin_calib_addon.common.arrays import unit as to_unit
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


def test_fan_is_around_its_first_corner(tmp_path):
    """The first three faces of the tetrahedron have it."""
    mesh = read_mesh(written(tmp_path, np.array([0, 2, 1, 3, 2], np.uint16), FANS))
    assert_allclose(sorted_triangles(mesh.triangles), sorted_triangles(CORNERS[FACES[:3]]), atol=1e-6)


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


def test_random_scenes_are_those_of_another_reader(tmp_path):
    """Poses as matrices or in three parts, several levels, strips, and parts without indices."""
    rng = np.random.default_rng(0)
    for k in range(20):
        nodes = [{"children": [1, 2], "rotation": to_unit(rng.normal(size=4)).tolist()}]
        nodes += [{"mesh": 0, "children": [3], "scale": rng.uniform(-2, 2, 3).tolist(), "inner": True}]
        nodes += [{"mesh": 0, "matrix": pose(rng).T.ravel().tolist(), "inner": True}]
        nodes += [{"mesh": 0, "translation": rng.normal(size=3).tolist(), "inner": True}]
        path = written(tmp_path, *((FACES, 4) if k % 2 else (STRIP, STRIPS)), nodes)
        mesh, other = read_mesh(path), trimesh.load(path, force="mesh", process=False)
        assert_allclose(sorted_triangles(mesh.triangles), sorted_triangles(np.array(other.triangles)), atol=1e-6)


def pose(rng):
    """Return a random affine pose."""
    return np.vstack((rng.normal(size=(3, 4)), (0, 0, 0, 1)))


def sorted_triangles(triangles):
    """Return triangles (f, 3, 3) with area in one order, each from its first corner on."""
    triangles = triangles.round(7)
    turned = [np.roll(t, -int(np.lexsort(t.T[::-1])[0]), axis=0) for t in triangles]
    return np.array(sorted(t.tolist() for t in turned))


def test_small_files_do_not_grow(tmp_path):
    """Parts are repeated 2.5 million times, or there are no numbers for 300 million rows."""
    nodes = [{"children": [1] * 90}, {"children": [2] * 90, "inner": True}, {"children": [3] * 9, "inner": True}]
    with pytest.raises(InvalidMesh, match="more than 20000 nodes"):
        read_mesh(written(tmp_path, nodes=[*nodes, {"mesh": 0, "inner": True}]))
    repeated = written(tmp_path, np.tile(FACES, (200, 1)), nodes=[{"children": [1] * 5000}, {"mesh": 0, "inner": True}])
    with pytest.raises(InvalidMesh, match="repeats parts, and has 4000000 faces"):
        read_mesh(repeated)
    empty = [{"componentType": FLOATS, "count": 300_000_000, "type": "VEC3"}]
    with pytest.raises(InvalidMesh, match="accessor without numbers"):
        read_mesh(written(tmp_path, accessors=empty))


@pytest.mark.parametrize(
    "change",
    [{"count": 5}, {"count": -1}, {"type": "VEC2"}, {"componentType": SHORTS}, {"byteOffset": -4}, {"bufferView": 7}],
)
def test_numbers_outside_of_the_file_are_refused(tmp_path, change):
    """Or of another type."""
    views = {"bufferView": 0, "componentType": FLOATS, "count": 4, "type": "VEC3"}
    index = {"bufferView": 1, "componentType": SHORTS, "count": 12, "type": "SCALAR"}
    assert len(read_mesh(written(tmp_path, accessors=[views, index])).faces) == 4
    long = {"count": 10**9} if "count" in change else {}
    with pytest.raises(InvalidMesh, match="not a valid GLB file"):
        read_mesh(written(tmp_path, accessors=[views | change | long, index]))


def test_appearance_is_of_no_matter(tmp_path):
    """Extensions of materials and textures may be required; missing pictures are not read."""
    path = written(
        tmp_path, extensionsRequired=["KHR_materials_unlit", "KHR_texture_transform"], images=[{"uri": "lost.png"}]
    )
    assert len(read_mesh(path).faces) == 4


def test_nodes_in_a_circle_end(tmp_path):
    """Nodes that are children of each other are refused."""
    nodes = [{"children": [1], "mesh": 0}, {"children": [0], "inner": True}]
    with pytest.raises(InvalidMesh, match="in a circle"):
        read_mesh(written(tmp_path, nodes=nodes))


@pytest.mark.parametrize("size", [0, 3, 12, 19, 100, -200, -1])
def test_truncated_files_are_refused(tmp_path, size):
    """In words: it is empty, has no header, or fewer bytes than its header announces."""
    path = written(tmp_path)
    path.write_bytes(path.read_bytes()[:size])
    why = "empty" if size == 0 else "not a valid GLB file: it " + ("does not have" if 0 < size < 20 else "is truncated")
    with pytest.raises(InvalidMesh, match=rf"link\.glb is {why}"):
        read_mesh(path)
