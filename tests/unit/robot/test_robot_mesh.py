"""Meshes of links as a URDF places them: files found, scaled, turned, mirrored, joined."""

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
    """An element of a link."""
    at = f"<origin {origin}/>" if origin else ""
    times = f' scale="{scale}"' if scale else ""
    return f'<{use}>{at}<geometry><mesh filename="{mesh}"{times}/></geometry></{use}>'


@pytest.fixture
def package(tmp_path):
    """Writes a URDF into a package beside its meshes; gives its path."""
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
    """To the bit."""
    assert same_mesh(loaded(package(shape("package://bot/meshes/pin.ply"))), PIN)


def test_origin_and_scale_are_honoured(package):
    """First the scale, then the angles about fixed axes, then the shift; in metres."""
    urdf = package(shape("package://bot/meshes/block.ply", origin='xyz="0.1 -0.2 0.3" rpy="0.4 -0.5 2"', scale=MM))
    turn = Rotation.from_euler("xyz", (0.4, -0.5, 2.0)).as_matrix()
    expected = weld((BLOCK.vertices * 1e-3) @ turn.T + (0.1, -0.2, 0.3), BLOCK.faces)
    np.testing.assert_allclose(loaded(urdf).vertices, expected.vertices, atol=1e-15)
    assert (loaded(urdf).faces == expected.faces).all()


@pytest.mark.parametrize("scale", ["0.001 -0.001 0.001", "-0.001 -0.001 -0.001", "0.001 0.002 0.001"])
def test_mirrored_mesh_looks_outward(package, scale):
    """The other arm: faces are turned over with the scale, so that the volume stays positive."""
    mesh = loaded(package(shape("package://bot/meshes/block.ply", scale=scale)))
    a, b, c = mesh.triangles.transpose(1, 0, 2)
    factor = abs(np.prod([float(word) for word in scale.split()]))
    np.testing.assert_allclose((a * np.cross(b, c)).sum() / 6, 100 * 50 * 25 * factor, rtol=1e-9)


def test_meshes_of_one_use_are_joined(package):
    """All that is seen of a link is one mesh; what it collides with is another."""
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
    """Packages above the URDF, under another name too, relative paths of either system, and whole ones."""
    assert same_mesh(loaded(package(shape(address.format(root=tmp_path)))), PIN)


def test_package_beside_the_urdf_comes_before_those_of_ros(package, tmp_path, monkeypatch):
    """Then where ROS looks, then a file beside the URDF; the message tells where to put it."""
    urdf = package()
    (tmp_path / "ros" / "share" / "bot" / "meshes").mkdir(parents=True)
    installed, near = tmp_path / "ros/share/bot/meshes/pin.ply", tmp_path / "bot/meshes/pin.ply"
    beside = urdf.parent / "pin.ply"
    for path in (installed, beside):
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
    assert find_file(address, urdf) == beside
    beside.unlink()
    with pytest.raises(InvalidMesh, match="no mesh file for package://bot/meshes/pin.ply of bot.urdf; put its package"):
        find_file(address, urdf)


BAD = {
    "no link": ((), "leg", UnknownLink, 'bot.urdf has no link "leg"'),
    "no mesh": ((), "arm", InvalidMesh, "bot.urdf has no visual mesh for arm; boxes and cylinders are none"),
    "other use": (
        (shape("p.stl", "collision"),),
        "arm",
        InvalidMesh,
        "no visual mesh for arm; take its collision mesh",
    ),
    "two numbers": ((shape("package://bot/meshes/pin.ply", scale="1 1"),), "arm", CalibrationFormatError, "2 numbers"),
    "no size": ((shape("package://bot/meshes/pin.ply", scale="0 1 1"),), "arm", InvalidMesh, "scaled to nothing"),
    "no format": (
        (shape("bot.urdf"),),
        "arm",
        InvalidMesh,
        "bot.urdf has an unknown format. Use one of stl, ply, obj, off",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_link_that_cannot_be_loaded_is_refused(package, case):
    """One line that says what is missing."""
    shapes, link, kind, message = BAD[case]
    with pytest.raises(kind, match=message):
        loaded(package(*shapes), link)
