"""Meshes: one canonical order, metres, and one line for every file that is no surface."""

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from skin_calib_addon.common.errors import InvalidMesh
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh, load_mesh, read_mesh, save_mesh, weld
from tests.shapes import Motion, box, cylinder, same_mesh, shuffled, wrist

TRIANGLE = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]])
FORMATS = ("stl", "ply", "obj", "off")
BLOCK = box((0, 0, 0), (0.1, 0.05, 0.025))  # its coordinates are the same in single precision


def write(mesh, path, scale=1.0):
    """Let trimesh write a mesh in any format."""
    trimesh.Trimesh(mesh.vertices * scale, mesh.faces, process=False).export(path)
    return path


@given(seed=st.integers(0, 2**32 - 1))
def test_weld_does_not_see_the_order(seed):
    """Vertices and faces in any order, faces from any corner: the same mesh to the bit, and the same hash."""
    mesh = wrist()
    again = weld(*shuffled(mesh, seed))
    assert same_mesh(again, mesh)
    assert again.sha256 == mesh.sha256


def test_weld_merges_vertices_that_each_face_brings_along():
    """A soup of triangles becomes the mesh it came from."""
    mesh = cylinder(around=12, along=4)
    assert same_mesh(weld(mesh.triangles.reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3)), mesh)


def test_weld_takes_minus_zero_for_zero():
    """The sign of a zero makes no second vertex and no other hash."""
    flipped = np.where(TRIANGLE == 0, -0.0, TRIANGLE)
    assert weld(flipped, [[0, 1, 2]]).sha256 == weld(TRIANGLE, [[0, 1, 2]]).sha256
    assert len(weld(np.concatenate((TRIANGLE, flipped)), [[0, 1, 2], [3, 4, 5]]).faces) == 1


def test_weld_keeps_each_face_once_and_no_degenerate_one():
    """Repeated faces count once whatever their first corner; faces with two equal corners and lone vertices go."""
    vertices = np.concatenate((TRIANGLE, TRIANGLE[:1], [[5.0, 5, 5]]))
    mesh = weld(vertices, [[0, 1, 2], [1, 2, 0], [2, 3, 1], [0, 3, 1], [1, 1, 1]])
    assert mesh.vertices.tolist() == sorted(TRIANGLE.tolist())
    assert len(mesh.faces) == 1


def test_weld_keeps_the_winding():
    """A face turned over is another face: both sides of something thin are kept, each with its normal."""
    mesh = weld(TRIANGLE, [[0, 1, 2], [0, 2, 1]])
    assert sorted(mesh.face_normals[:, 2]) == [-1, 1]
    assert (weld(TRIANGLE, [[1, 2, 0]]).face_normals == [[0, 0, 1]]).all()


def test_mesh_measures_are_those_of_the_box():
    """Size, areas and normals of a box of 100 x 50 x 25 mm."""
    areas = np.abs(BLOCK.face_normals).T @ BLOCK.face_areas
    np.testing.assert_allclose(areas, [2 * 0.05 * 0.025, 2 * 0.1 * 0.025, 2 * 0.1 * 0.05], rtol=1e-14)
    np.testing.assert_allclose(BLOCK.size, np.sqrt(0.1**2 + 0.05**2 + 0.025**2), rtol=1e-14)
    np.testing.assert_allclose(Motion(3, 2.0).mesh(BLOCK).size, 2 * BLOCK.size, rtol=1e-14)  # however it lies
    outward = BLOCK.triangles.mean(axis=1) - BLOCK.vertices.mean(axis=0)
    assert ((BLOCK.face_normals * outward).sum(axis=1) > 0).all()


def test_hash_distinguishes_meshes():
    """A vertex moved by the last bit, a face turned over, and a face less each give another hash."""
    moved = BLOCK.vertices.copy()
    moved[3, 0] = np.nextafter(moved[3, 0], 1)
    turned = BLOCK.faces.copy()
    turned[0] = turned[0, ::-1]
    hashes = {weld(moved, BLOCK.faces).sha256, weld(BLOCK.vertices, turned).sha256}
    hashes |= {weld(BLOCK.vertices, BLOCK.faces[1:]).sha256, BLOCK.sha256}
    assert len(hashes) == 4


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (TRIANGLE, [], "^The mesh has no faces"),
        (np.empty((0, 3)), [], "^The mesh has no faces"),
        (TRIANGLE, [[0, 1, 3]], "^A face refers to vertex 3, but the mesh has 3 vertices"),
        (TRIANGLE, [[0, 1, 2], [0, -1, 1]], "^A face refers to vertex -1, but the mesh has 3 vertices"),
        (TRIANGLE, [[0, 1, 1], [2, 2, 2]], "^Every face of the mesh is degenerate"),
        (np.where(TRIANGLE == 0.1, np.nan, TRIANGLE), [[0, 1, 2]], r"^Vertex 1 of the mesh is not finite \(2 such\)"),
        (np.where(TRIANGLE == 0.1, np.inf, TRIANGLE), [[0, 1, 2]], r"^Vertex 1 of the mesh is not finite \(2 such\)"),
    ],
)
def test_weld_refuses_what_is_no_surface(vertices, faces, message):
    """No faces, an index out of range on either side, only degenerate faces, NaN, infinity."""
    with pytest.raises(InvalidMesh, match=message):
        weld(vertices, faces)


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize(("unit", "scale"), [("m", 1), ("mm", 1000), ("cm", 100), ("in", 1 / 0.0254)])
def test_load_mesh_reads_metres_from_each_unit(tmp_path, kind, unit, scale):
    """Every format gives the same mesh, whatever the unit of its numbers."""
    path = write(BLOCK, tmp_path / f"block.{kind}", scale)
    mesh = load_mesh(path, unit)
    np.testing.assert_allclose(mesh.vertices, BLOCK.vertices, rtol=0, atol=3e-9)  # STL and PLY hold single precision
    assert (mesh.faces == BLOCK.faces).all()


@pytest.mark.parametrize(
    ("unit", "scale", "other"),
    [
        ("m", 1000, r'"cm" \(1146 mm\) or "mm" \(114.6 mm\) or "in" \(2910 mm\)\.'),
        ("m", 100, r'"cm" \(114.6 mm\) or "mm" \(11.46 mm\) or "in" \(291 mm\)\.'),
        ("mm", 1, r'"m" \(114.6 mm\) or "in" \(2.91 mm\)\.'),
    ],
)
def test_load_mesh_refuses_the_wrong_unit(tmp_path, unit, scale, other):
    """The message names the size, and that in each unit that is possible: centimetres are not taken for millimetres."""
    path = write(BLOCK, tmp_path / "block.ply", scale)
    size = f"{BLOCK.size * scale * {'m': 1, 'mm': 1e-3}[unit]:.4g} m"
    with pytest.raises(
        InvalidMesh,
        match=f'block.ply has a diameter of {size} when read in "{unit}". Set "unit" to that of its numbers: {other}',
    ):
        load_mesh(path, unit)


@pytest.mark.parametrize(("unit", "scale"), [("m", 0.001), ("mm", 1e6)])
def test_load_mesh_proposes_no_unit_that_is_worse(tmp_path, unit, scale):
    """A mesh too small in metres is smaller still in millimetres: scale it."""
    with pytest.raises(InvalidMesh, match=r"diameter .*\. Scale it to its real size\.$"):
        load_mesh(write(BLOCK, tmp_path / "block.off", scale), unit)


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize(
    "data",
    [b"", b"\0", b"this is no mesh\nnot at all\n", bytes(range(256)) * 4, b"solid x\nfacet", b"ply\n", b"OFF\n3 1 0\n"],
    ids=["empty", "nul", "text", "bytes", "stl", "ply", "off"],
)
def test_read_mesh_refuses_garbage(tmp_path, kind, data):
    """Whatever the bytes are: one line that names the file."""
    path = tmp_path / f"bad.{kind}"
    path.write_bytes(data)
    with pytest.raises(InvalidMesh, match=r"bad\.") as caught:
        read_mesh(path)
    assert "\n" not in str(caught.value)


def halves():
    """Files cut off in the middle of their faces, by format."""
    solid = trimesh.Trimesh(BLOCK.vertices, BLOCK.faces, process=False)
    for kind in ("stl", "ply", "off"):
        data = solid.export(file_type=kind)
        yield pytest.param(kind, data.encode() if isinstance(data, str) else data, id=kind)
    yield pytest.param("ply", solid.export(file_type="ply", encoding="ascii"), id="ascii ply")
    yield pytest.param("stl", solid.export(file_type="stl_ascii").encode(), id="ascii stl")


@pytest.mark.parametrize(("kind", "data"), [*halves()])
def test_read_mesh_refuses_a_file_that_was_cut_off(tmp_path, kind, data):
    """A download that broke is no smaller mesh: the file says how much there should be."""
    path = tmp_path / f"block.{kind}"
    path.write_bytes(data[:-20])
    with pytest.raises(InvalidMesh, match="block"):
        read_mesh(path)


@pytest.mark.parametrize("kind", FORMATS)
def test_read_mesh_refuses_a_file_without_faces(tmp_path, kind):
    """A file that is sound and holds points only, or nothing."""
    contents = {
        "stl": b"\0" * 84,
        "ply": b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
        b"element face 0\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n",
        "obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\n",
        "off": b"OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n",
    }
    path = tmp_path / f"points.{kind}"
    path.write_bytes(contents[kind])
    with pytest.raises(InvalidMesh, match=rf"points\.{kind}"):
        read_mesh(path)


@pytest.mark.parametrize("kind", FORMATS)
def test_read_mesh_names_the_vertex_that_is_not_a_number(tmp_path, kind):
    """NaN in a file is found on reading."""
    vertices = BLOCK.vertices.copy()
    vertices[2, 1] = np.nan
    path = tmp_path / f"nan.{kind}"
    trimesh.Trimesh(vertices, BLOCK.faces, process=False).export(path)
    with pytest.raises(InvalidMesh, match=rf"nan\.{kind}: Vertex \d+ of the mesh is not finite"):
        read_mesh(path)


def test_read_mesh_refuses_vertices_of_two_numbers(tmp_path):
    """OBJ files of drawings have them."""
    path = tmp_path / "flat.obj"
    path.write_text("v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n")
    with pytest.raises(InvalidMesh, match=r"flat\.obj is not a valid OBJ file: line 1 is no vertex of three"):
        read_mesh(path)


def test_read_mesh_leaves_the_numbers_as_they_stand(tmp_path):
    """No unit, no size: what an author looks at before the unit is known."""
    path = write(BLOCK, tmp_path / "block.off", 1000)
    np.testing.assert_allclose(read_mesh(path).vertices, BLOCK.vertices * 1000, rtol=1e-7)


@given(seed=st.integers(0, 1000), exponent=st.integers(-300, 300))
def test_save_mesh_round_trip_is_to_the_bit(seed, exponent, tmp_path_factory):
    """Any doubles come back, tiny and huge ones too."""
    rng = np.random.default_rng(seed)
    mesh = weld(rng.normal(size=(12, 3)) * 2.0**exponent, rng.permutation(12).reshape(4, 3))
    path = tmp_path_factory.mktemp("mesh") / "m.ply"
    save_mesh(mesh, path)
    assert same_mesh(read_mesh(path), mesh)


def test_pairs_that_are_wound_against_each_other():
    """Just those of which one face is reversed; none of a mesh as it comes."""
    mesh = box((0, 0, 0), (1, 2, 3))
    assert not mesh.disagreeing.any()
    reversed_ = np.arange(len(mesh.faces)) % 3 == 0
    mixed = TriangleMesh(mesh.vertices, np.where(reversed_[:, None], mesh.faces[:, ::-1], mesh.faces))
    first, second = mixed.adjacency
    assert np.array_equal(mixed.disagreeing, reversed_[first] != reversed_[second]) and mixed.disagreeing.any()


def test_faces_around_a_face_have_a_common_vertex():
    """All of them, each once, and the face itself."""
    mesh = cylinder(around=7, along=3)
    chosen = np.array([5, 0, 5])
    row, face = mesh.around(chosen)
    common = [(mesh.faces[:, :, None] == mesh.faces[k]).any(axis=(1, 2)) for k in chosen]
    assert sorted(zip(row.tolist(), face.tolist())) == [(i, j) for i in range(3) for j in np.flatnonzero(common[i])]
