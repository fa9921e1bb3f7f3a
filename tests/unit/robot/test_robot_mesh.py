"""Meshes of the links of a URDF: find files, scale, rotate, mirror and join them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skin_calib_addon.common.errors import CalibrationFormatError, InvalidMesh, UnknownLink
from skin_calib_addon.geometry.mesh.triangle_mesh import save_mesh, weld
from skin_calib_addon.robot.link_mesh import find_file, load_link
from skin_calib_addon.robot.urdf import read_robot
from tests.shapes import box, same_mesh, together

BLOCK = box((0, 0, 0), (100.0, 50, 25))  # in millimetres
PIN = box((0.1, 0, 0), (0.11, 0.01, 0.01))


def shape(mesh, use="visual", origin="", scale=""):
    """Return an element of a link."""
    at = f"<origin {origin}/>" if origin else ""
    times = f' scale="{scale}"' if scale else ""
    return f'<{use}>{at}<geometry><mesh filename="{mesh}"{times}/></geometry></{use}>'


@pytest.fixture
def package(tmp_path):
    """Return a function that writes a URDF into a package with meshes, and returns its path."""
    (tmp_path / "bot" / "meshes").mkdir(parents=True)
    (tmp_path / "bot" / "urdf").mkdir()
    save_mesh(BLOCK, tmp_path / "bot" / "meshes" / "block.ply")
    save_mesh(PIN, tmp_path / "bot" / "meshes" / "pin.ply")

    def write(*shapes, name="arm"):
        path = tmp_path / "bot" / "urdf" / "bot.urdf"
        path.write_text(f'<robot name="bot"><link name="{name}">{"".join(shapes)}</link><link name="base"/></robot>')
        return path

    return write


def loaded(urdf, link="arm", use="visual"):
    return load_link(urdf, read_robot(urdf), link, use)


MM = "0.001 0.001 0.001"


def test_mesh_without_origin_keeps_its_numbers(package):
    """Exactly."""
    assert same_mesh(loaded(package(shape("package://bot/meshes/pin.ply"))), PIN)


def test_origin_and_scale_are_applied(package):
    """First the scale, then the angles about fixed axes, then the translation, in metres."""
    urdf = package(shape("package://bot/meshes/block.ply", origin='xyz="0.1 -0.2 0.3" rpy="0.4 -0.5 2"', scale=MM))
    turn = Rotation.from_euler("xyz", (0.4, -0.5, 2.0)).as_matrix()
    expected = weld((BLOCK.vertices * 1e-3) @ turn.T + (0.1, -0.2, 0.3), BLOCK.faces)
    np.testing.assert_allclose(loaded(urdf).vertices, expected.vertices, atol=1e-15)
    assert (loaded(urdf).faces == expected.faces).all()


@pytest.mark.parametrize("scale", ["0.001 -0.001 0.001", "-0.001 -0.001 -0.001", "0.001 0.002 0.001"])
def test_mirrored_mesh_has_outward_normals(package, scale):
    """For the other arm, faces are reversed, so that the volume stays positive."""
    mesh = loaded(package(shape("package://bot/meshes/block.ply", scale=scale)))
    a, b, c = mesh.triangles.transpose(1, 0, 2)
    factor = abs(np.prod([float(word) for word in scale.split()]))
    np.testing.assert_allclose((a * np.cross(b, c)).sum() / 6, 100 * 50 * 25 * factor, rtol=1e-9)


def test_meshes_of_one_use_are_joined(package):
    """All visual meshes of a link are one mesh; the collision meshes are another."""
    urdf = package(
        shape("package://bot/meshes/block.ply", scale=MM),
        shape("package://bot/meshes/pin.ply"),
        shape("package://bot/meshes/pin.ply", use="collision"),
    )
    assert same_mesh(loaded(urdf), together(weld(BLOCK.vertices * 0.001, BLOCK.faces), PIN))
    assert same_mesh(loaded(urdf, use="collision"), PIN)


ADDRESSES = (
    *("package://bot/meshes/pin.ply", "model://bot/meshes/pin.ply", "../meshes/pin.ply", "..\\meshes\\pin.ply"),
    *("package://renamed/meshes/pin.ply", "file://{root}/bot/meshes/pin.ply"),
)


@pytest.mark.parametrize("address", ADDRESSES)
def test_address_is_resolved(package, tmp_path, address):
    """Packages above the URDF, also under another name, relative paths of both systems, and absolute ones."""
    assert same_mesh(loaded(package(shape(address.format(root=tmp_path)))), PIN)


@pytest.mark.parametrize("linked", ["urdf", "urdf/bot.urdf"])
def test_package_is_found_through_a_symbolic_link(package, tmp_path, linked):
    """The folder of the URDF, or the file itself, has a link elsewhere."""
    urdf, link = package(), tmp_path / "work" / "linked.urdf"
    link.parent.mkdir()
    link.symlink_to(tmp_path / "bot" / linked)
    found = find_file("package://renamed/meshes/pin.ply", link if link.is_file() else link / urdf.name)
    assert found == tmp_path / "bot" / "meshes" / "pin.ply"


def test_package_near_the_urdf_has_priority_over_ros(package, tmp_path, monkeypatch):
    """Then the search paths of ROS, then the folder of the URDF; the error states where to put the package."""
    urdf = package()
    (tmp_path / "ros" / "share" / "bot" / "meshes").mkdir(parents=True)
    installed, near = tmp_path / "ros/share/bot/meshes/pin.ply", tmp_path / "bot/meshes/pin.ply"
    adjacent = urdf.parent / "pin.ply"
    for path in (installed, adjacent):
        path.write_bytes(near.read_bytes())
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "ros"))
    address = "package://bot/meshes/pin.ply"
    assert find_file(address, urdf) == near
    near.unlink()
    assert find_file(address, urdf) == installed
    monkeypatch.setenv("AMENT_PREFIX_PATH", "")
    for folder in ("ros/share", "ros/share/bot"):
        monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / folder))
        assert find_file(address, urdf) == installed
    installed.unlink()
    assert find_file(address, urdf) == adjacent
    adjacent.unlink()
    with pytest.raises(
        InvalidMesh, match="the mesh file package://bot/meshes/pin.ply of bot.urdf was not found. Put its package"
    ):
        find_file(address, urdf)


BAD = {
    "no link": ((), "leg", UnknownLink, 'bot.urdf has no link "leg"'),
    "no mesh": (
        (),
        "arm",
        InvalidMesh,
        "bot.urdf has no visual mesh for arm. Boxes, cylinders and spheres carry no skin",
    ),
    "other use": (
        (shape("p.stl", "collision"),),
        "arm",
        InvalidMesh,
        "no visual mesh for arm. Use its collision mesh",
    ),
    "two numbers": ((shape("package://bot/meshes/pin.ply", scale="1 1"),), "arm", CalibrationFormatError, "2 numbers"),
    "no size": (
        (shape("package://bot/meshes/pin.ply", scale="0 1 1"),),
        "arm",
        InvalidMesh,
        "has a scale of 0. Correct the scale",
    ),
    "no format": (
        (shape("bot.urdf"),),
        "arm",
        InvalidMesh,
        "bot.urdf has an unknown format. Use one of stl, ply, obj, off",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_link_that_cannot_be_loaded_is_refused(package, case):
    """One line that states what is missing."""
    shapes, link, kind, message = BAD[case]
    with pytest.raises(kind, match=message):
        loaded(package(*shapes), link)
