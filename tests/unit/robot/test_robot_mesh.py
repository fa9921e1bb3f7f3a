"""Meshes of the links of a URDF: find files, scale, rotate, mirror and join them."""

from urllib.parse import quote

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


@pytest.mark.parametrize("name", ["fore arm.ply", "fore%20arm.ply", "Glied ä.ply"])
@pytest.mark.parametrize("form", ["package://my%20bot/{}", "file://{root}/my%20bot/{}", "../my%20bot/{}"])
def test_escaped_addresses_are_found(tmp_path, name, form):
    """Blanks and other characters; a file whose name looks like an escaped one, too."""
    (tmp_path / "urdf").mkdir()
    (tmp_path / "my bot").mkdir()
    save_mesh(PIN, tmp_path / "my bot" / name)
    address = form.format(quote(name), root=quote(str(tmp_path)))
    assert find_file(address, tmp_path / "urdf" / "bot.urdf").samefile(tmp_path / "my bot" / name)
    urdf = tmp_path / "urdf" / "bot.urdf"
    urdf.write_text(f'<robot name="bot"><link name="arm">{shape(address)}</link></robot>')
    assert same_mesh(loaded(urdf), PIN) and read_robot(urdf).links["arm"][0].file == name


PART = "<visual>{}<geometry>{}</geometry></visual>"
MESH = '<mesh filename="pin.ply"/>'
QUATERNION = 'the attribute "quat_xyzw" of origin, which is not supported; use xyz, rpy'
UNKNOWN = {
    "quaternion": (PART.format('<origin xyz="0 0 0" quat_xyzw="0 0.7 0 0.7"/>', MESH), QUATERNION),
    "quaternion of an inertia": ('<inertial><origin quat_xyzw="0 0 0 1"/><mass value="1"/></inertial>', QUATERNION),
    "degrees": (
        PART.format('<origin xyz="0 0 0" rpy_degrees="0 90 0"/>', MESH),
        'the attribute "rpy_degrees" of origin',
    ),
    "two origins": (
        PART.format('<origin xyz="0 0 0"/><origin xyz="1 0 0"/>', MESH),
        "two elements origin in one visual",
    ),
    "unit": (PART.format("", '<mesh filename="pin.ply" unit="mm"/>'), 'the attribute "unit" of mesh'),
    "nested scale": (PART.format("", '<mesh filename="pin.ply"><scale>2</scale></mesh>'), '"scale" in mesh'),
    "shape": (
        PART.format("", '<ellipsoid size="1 1 1"/>'),
        '"ellipsoid" in geometry, which is not supported; write mesh',
    ),
    "side": (PART.format("", '<box size="1 1 1" radius="0.1"/>'), 'the attribute "radius" of box'),
    "no geometry": (f"<visual>{MESH}</visual>", '"mesh" in visual, which is not supported'),
    "no visual": (f"<geometry>{MESH}</geometry>", '"mesh" in geometry, which is not supported'),
}


@pytest.mark.parametrize("case", UNKNOWN)
def test_what_could_change_a_shape_and_is_not_known_is_refused(package, case):
    """With its line, instead of a shape in another place."""
    content, message = UNKNOWN[case]
    with pytest.raises(CalibrationFormatError, match=f"line 1 has {message}"):
        read_robot(package(content))


def test_quaternion_of_a_joint_is_refused(tmp_path):
    (tmp_path / "bot.urdf").write_text(
        '<robot name="bot"><link name="a"/><link name="b"/><joint name="j" type="fixed"><parent link="a"/>'
        '<child link="b"/><origin quat_xyzw="0 0 1 0"/></joint></robot>'
    )
    with pytest.raises(CalibrationFormatError, match=QUATERNION):
        read_robot(tmp_path / "bot.urdf")


def test_what_changes_no_shape_is_not_refused(package):
    """Materials, properties of simulators, other elements with an origin, names of shapes, and an empty geometry."""
    more = '<material name="red"/><verbose value="x"/>'
    urdf = package(
        f'<visual name="v">{more}<geometry><mesh name="m" filename="package://bot/meshes/pin.ply">'
        "<drake:declare_convex/></mesh></geometry></visual><visual><geometry/></visual>",
        '<sensor><origin quat_xyzw="0 0 0 1"/></sensor><collision><geometry><capsule radius="1" length="1"/></geometry>'
        "<max_contacts>10</max_contacts></collision>",
    )
    assert same_mesh(loaded(urdf), PIN)
