"""The reader of plain files of triangles gives what the general reader gives, or leaves the file to it."""

import numpy as np
import pytest
import trimesh

from skin_calib_addon.geometry.mesh.triangle_files import read_triangles
from skin_calib_addon.geometry.mesh.triangle_mesh import save_mesh
from tests.shapes import cylinder


@pytest.fixture
def general():
    """A mesh of the general reader, with single precision as most programs write it."""
    mesh = cylinder(around=12, along=4)
    return trimesh.Trimesh(mesh.vertices.astype("f4"), mesh.faces, process=False)


def triangles(vertices, faces):
    return np.asarray(vertices, float)[np.asarray(faces)]


@pytest.mark.parametrize("kind", ["stl", "ply"])
def test_same_triangles_as_the_general_reader(tmp_path, general, kind):
    """To the bit, and in the order of the file; normals and other data of vertices do not matter."""
    path = tmp_path / f"tube.{kind}"
    path.write_bytes(general.export(file_type=kind, **({"vertex_normal": True} if kind == "ply" else {})))
    read = trimesh.load(path, process=False)
    np.testing.assert_array_equal(triangles(*read_triangles(path, kind)), triangles(read.vertices, read.faces))


def test_own_ply_file_needs_no_general_reader(tmp_path):
    """``save_mesh`` writes double precision."""
    mesh = cylinder(around=12, along=4)
    save_mesh(mesh, tmp_path / "tube.ply")
    np.testing.assert_array_equal(triangles(*read_triangles(tmp_path / "tube.ply", "ply")), mesh.triangles)


def quads(content):
    """Change the number of corners of the last face."""
    return content[:-13] + b"\4" + content[-12:]


FORMS = {
    "text": lambda mesh: mesh.export(file_type="ply", encoding="ascii"),
    "four corners": lambda mesh: quads(mesh.export(file_type="ply")),
    "truncated": lambda mesh: mesh.export(file_type="ply")[:-1],
    "no x": lambda mesh: mesh.export(file_type="ply").replace(b"float x", b"float q"),
    "no type": lambda mesh: mesh.export(file_type="ply").replace(b"float x", b"long x"),
    "name twice": lambda mesh: mesh.export(file_type="ply").replace(b"float y", b"float x"),
    "stl in text": lambda mesh: mesh.export(file_type="stl_ascii").encode(),
    "truncated stl": lambda mesh: mesh.export(file_type="stl")[:-1],
    "tail of stl": lambda mesh: mesh.export(file_type="stl") + b"x",
    "other": lambda mesh: mesh.export(file_type="off").encode(),
}


@pytest.mark.parametrize("form", FORMS)
def test_other_forms_are_for_the_general_reader(tmp_path, general, form):
    """It reads them, or says what is wrong with them."""
    path = tmp_path / "tube"
    path.write_bytes(FORMS[form](general))
    kind = "stl" if "stl" in form else "off" if form == "other" else "ply"
    assert read_triangles(path, kind) is None
