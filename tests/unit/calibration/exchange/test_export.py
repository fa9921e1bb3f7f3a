"""Files for other programs, format by format, checked with other readers or with simple slow ones."""

import csv
import dataclasses
import io
import struct
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose

from skin_calib_addon.calibration.exchange import FORMATS, READABLE, WRITABLE, read_taxels
from skin_calib_addon.calibration.exchange.link_taxels import taxels_of
from skin_calib_addon.calibration.exchange.mjcf import triangles
from skin_calib_addon.calibration.exchange.rsdf import hull
from skin_calib_addon.calibration.exchange.table import write_taxel_set
from skin_calib_addon.calibration.exchange.xml_text import rotations, rpy
from skin_calib_addon.common.errors import CalibrationFormatError
from tests.samples import boards, seven_boards, sheet, small_calibration
from tests.shapes import Motion


def written(name, **changes):
    """Return a calibration of a sheet and seven boards as a file of a format."""
    calibration = small_calibration(**({"patches": (sheet(2, 3, 0.01), seven_boards(6))} | changes))
    return FORMATS[name].write(calibration), taxels_of(calibration)


def renamed(patch, **changes):
    """Return a patch with other columns of taxels."""
    return dataclasses.replace(patch, taxels=dataclasses.replace(patch.taxels, **changes))


# --- iCub


def test_positions_file_is_what_the_skin_reads():
    """The iCub reader ignores the last row; the id of a taxel is its row, and each taxel represents itself."""
    content, taxels = written("icub", patches=(renamed(sheet(2, 3, 0.01), channels=np.array([7, 2, 0, 3, 4, 5])),))
    lines = content.decode().split("\n")
    assert lines[:2] == ["name\tforearm", "spatial_sampling\ttaxel"]
    start = lines.index("[calibration]") + 1
    rows = np.array([[float(word) for word in row.split()] for row in lines[start:-1]])
    taken = {i: row for i, row in enumerate(rows[:-1]) if row.any()}  # as the loop of the reader
    assert list(taken) == [0, 2, 3, 4, 5, 7] == taxels.channels.tolist()
    assert_allclose(list(taken.values()), np.column_stack((taxels.positions, taxels.normals)), rtol=0, atol=0)
    assert not rows[-1].any() and len(rows) == 9
    table = [int(word) for word in lines[2].removeprefix("taxel2Repr (").removesuffix(")").split()]
    assert table == [0, -1, 2, 3, 4, 5, -1, 7, -1]


@pytest.mark.parametrize("link", ["fore arm", "arm#1", 'arm"', "(arm)", "[calibration]"])
def test_positions_file_needs_a_link_of_one_word(link):
    """Names that its reader would truncate or read as a list are an error."""
    with pytest.raises(CalibrationFormatError, match="must be one word without quotes.* Rename the link"):
        written("icub", link=link)


@pytest.mark.parametrize(("name", "highest"), [("icub", 99_998), ("tum", 16_381)])
def test_channels_too_high_are_refused(name, highest):
    """A row for each channel, or an id of 14 bits: the highest channel is written, the next is an error."""
    for channel, fits in ((highest, True), (highest + 1, False)):
        patch = renamed(boards(), channels=np.array([0, channel]))
        if fits:
            assert written(name, patches=(patch,))
        else:
            with pytest.raises(CalibrationFormatError, match=f"channel {channel} .*lower channels"):
                written(name, patches=(patch,))


# --- TUM


def matrix_of(node):
    """Return the matrix of an element, as the driver does."""
    found = np.zeros((int(node.get("rows")), int(node.get("cols"))))
    for element in node:
        found[int(element.get("row")), int(element.get("col"))] = float(element.text)
    return found


def transform(node):
    """Return translation and rotation of an element."""
    found = np.eye(4)
    found[:3, 3:], found[:3, :3] = matrix_of(node.find("pos/matrix")), matrix_of(node.find("rot/matrix"))
    return found


def test_patch_is_what_the_driver_reads():
    """One patch: poses of cells in the root cell, pose of the root cell in the base, neighbours at six ports."""
    content, taxels = written("tum", link="fore<arm>")
    root = ElementTree.fromstring(content)
    assert root.get("numberOfCells") == "13" and root.find("patchExtrinsics").get("baseFrame") == "fore<arm>"
    base = transform(root.find("patchExtrinsics/tf_rootCell_base"))
    assert (transform(root.find("patchExtrinsics/tf_base_dh")) == np.eye(4)).all()
    cells = root.findall("cell")
    assert [int(cell.get("id")) for cell in cells] == (taxels.channels + 1).tolist()
    assert {cell.findtext("rootCellId") for cell in cells} == {"1"}
    assert (transform(cells[0]) == np.eye(4)).all()
    for cell, position, axes in zip(cells, taxels.positions, taxels.axes):
        placed = base @ transform(cell)
        assert_allclose(placed[:3, 3], position, rtol=0, atol=1e-15)
        assert_allclose(placed[:3, :3], axes, rtol=0, atol=1e-15)
    middle, first = ([int(n.get("id")) for n in cells[i].find("neighbors")] for i in (6, 7))
    assert middle == [8, 9, 10, 11, 12, 13] and first == [0, 0, 9, 7, 13, 0]
    assert [n.get("port") for n in cells[6].find("neighbors")] == list("123456")


# --- tables


def test_table_of_gentact_has_its_header():
    """Index, position, normal, radius of a disc with the area of the cell, link, patch."""
    content, taxels = written("gentact", link="/panda/link5")
    rows = list(csv.reader(io.StringIO(content.decode())))
    assert ",".join(rows[0]) == "Index,X,Y,Z,NormX,NormY,NormZ,Radius,Parent,Object Name in Blender"
    assert [int(row[0]) for row in rows[1:]] == taxels.channels.tolist()
    assert_allclose([[float(x) for x in row[1:4]] for row in rows[1:]], taxels.positions, rtol=0, atol=0)
    assert_allclose([np.pi * float(row[7]) ** 2 for row in rows[1:]], taxels.areas, rtol=1e-12)
    assert [row[8:] for row in rows[1:]] == [["/panda/link5", patch] for patch in taxels.patches]


def test_table_names_neighbours_by_channel():
    """Also across patches; neighbours in patches that are not written are left out."""
    first = renamed(boards(20), neighbours=(("h1", "s0.0"), ("h0",)))
    content, taxels = written("csv", patches=(sheet(1, 2, 0.01), first))
    rows = {row["id"]: row for row in csv.DictReader(io.StringIO(content.decode()))}
    assert rows["h0"]["neighbours"] == "21 0" and rows["s0.0"]["neighbours"] == "1"
    assert [float(row["area"]) for row in rows.values()] == taxels.areas.tolist()
    assert (rows["h0"]["patch"], rows["h0"]["link"], rows["h0"]["channel"]) == ("boards", "forearm", "20")
    content, _ = written("csv", patches=(first,))
    assert next(csv.DictReader(io.StringIO(content.decode())))["neighbours"] == "21"


@pytest.mark.parametrize("name", READABLE)
def test_table_of_a_set_is_the_same_set(tmp_path, name):
    """A table that is written from any format is read back unchanged."""
    path = tmp_path / "first"
    path.write_bytes(written(name)[0])
    first = read_taxels(path)
    path.write_bytes(write_taxel_set(first))
    again = read_taxels(path)
    for field in ("labels", "frame", "neighbours"):
        assert getattr(again, field) == getattr(first, field)
    assert (again.positions == first.positions).all() and again.channels.tolist() == first.channels.tolist()
    assert_allclose(again.normals, first.normals, rtol=0, atol=1e-15)
    assert (again.tangents is None) == (first.tangents is None) and again.findings == ()


# --- clouds


def test_ply_is_what_trimesh_reads():
    """Vertices, normals and channels, also with names beyond ASCII in its comments."""
    content, taxels = written("ply", link="前腕")
    cloud = trimesh.load(io.BytesIO(content), file_type="ply")
    assert_allclose(cloud.vertices, taxels.positions, rtol=0, atol=0)
    data = cloud.metadata["_ply_raw"]["vertex"]["data"]
    normals = np.column_stack([np.ravel(data[name]) for name in ("nx", "ny", "nz")])
    assert_allclose(normals, taxels.normals, rtol=0, atol=1e-15)
    assert np.ravel(data["channel"]).astype(int).tolist() == taxels.channels.tolist()


def test_pcd_is_what_another_reader_takes(tmp_path):
    """Points, normals and channels of ours, in single precision as declared; and we take what it writes."""
    pypcd4 = pytest.importorskip("pypcd4")
    content, taxels = written("pcd", link="前腕")
    (tmp_path / "ours.pcd").write_bytes(content)
    cloud = pypcd4.PointCloud.from_path(tmp_path / "ours.pcd")
    assert cloud.fields == ("x", "y", "z", "normal_x", "normal_y", "normal_z", "channel")
    numbers = cloud.numpy(cloud.fields)
    vectors = np.column_stack((taxels.positions, taxels.normals))
    assert_allclose(numbers[:, :6], vectors, rtol=1e-7, atol=1e-9)
    assert numbers[:, 6].tolist() == taxels.channels.tolist()
    for encoding in (pypcd4.Encoding.ASCII, pypcd4.Encoding.BINARY):
        cloud.save(tmp_path / "its.pcd", encoding=encoding)
        back = read_taxels(tmp_path / "its.pcd")
        assert_allclose(np.column_stack((back.positions, back.normals)), vectors, rtol=0, atol=1e-7)
        assert back.channels.tolist() == taxels.channels.tolist() and back.findings == ()
    cloud.save(tmp_path / "its.pcd", encoding=pypcd4.Encoding.BINARY_COMPRESSED)
    with pytest.raises(CalibrationFormatError, match="save it as ascii or binary"):
        read_taxels(tmp_path / "its.pcd")


# --- Isaac


def test_poses_are_what_isaac_reads():
    """Floats (n, 3, 4) with the normal as third axis, and different pixels, without pickle."""
    content, taxels = written("npz")
    with np.load(io.BytesIO(content), allow_pickle=False) as file:
        assert file.files == ["poses", "taxel2pixel", "channel", "id"], "no array that the page does not describe"
        poses, pixels = file["poses"], file["taxel2pixel"]
        assert file["id"].tolist() == list(taxels.ids) and (file["channel"] == taxels.channels).all()
    assert poses.shape == (13, 3, 4) and pixels.shape == (13, 2) and pixels.dtype.kind == "i"
    assert (poses[:, :, 3] == taxels.positions).all() and (poses[:, :, 2] == taxels.normals).all()
    assert_allclose(np.linalg.det(poses[:, :, :3]), 1, rtol=1e-12)
    assert pixels[:6].tolist() == [[r, c] for r in (0, 1) for c in (0, 1, 2)]
    assert pixels.min() == 0 and len(np.unique(pixels, axis=0)) == 13 and pixels[6:, 0].min() == 2


# --- URDF


@pytest.mark.parametrize("pitch", [0.5, -np.pi / 2, np.pi / 2, np.pi / 2 - 1e-9])
def test_angles_of_urdf_give_the_rotation(pitch):
    """Also at a pitch of 90 degrees, where roll and yaw have the same axis."""
    angles = np.array([[0.3, pitch, -1.2], [3.0, pitch, 3.1]])
    (a, b, c), (A, B, C) = np.cos(angles[0]), np.sin(angles[0])
    about_z, about_y = np.array([[c, -C, 0], [C, c, 0], [0, 0, 1]]), np.array([[b, 0, B], [0, 1, 0], [-B, 0, b]])
    about_x = np.array([[1, 0, 0], [0, a, -A], [0, A, a]])
    assert_allclose(rotations(angles)[0], about_z @ about_y @ about_x, rtol=0, atol=1e-15)
    assert_allclose(rotations(rpy(rotations(angles))), rotations(angles), rtol=0, atol=1e-15)


def test_angles_of_urdf_outlive_rounding():
    """A pitch of 90 degrees with rounding errors: the entries for roll and yaw are noise."""
    axes = np.array([[[3e-17, 0.6, 0.8], [-1e-17, 0.8, -0.6], [-1.0, 1e-17, -2e-17]]])
    assert_allclose(rotations(rpy(axes)), axes, rtol=0, atol=1e-15)


def test_urdf_has_one_list_of_names():
    """A patch with the name of the link is an error."""
    with pytest.raises(CalibrationFormatError, match='the name "sheet" would occur twice in URDF. Rename'):
        written("urdf", link="sheet")


def test_sensors_are_what_the_parser_of_tactile_toolbox_wants():
    """Parent, channel, and for each taxel index, pose and geometry, which its parser requires."""
    content, taxels = written("urdf-tactile", link='fore"arm')
    sensors = ElementTree.fromstring(content).findall("sensor")
    assert [s.get("name") for s in sensors] == ["sheet", "flower"]
    assert {s.find("parent").get("link") for s in sensors} == {s.find("tactile").get("channel") for s in sensors}
    found = [t for s in sensors for t in s.findall("tactile/taxel")]
    assert [int(t.get("idx")) for t in found] == taxels.channels.tolist()
    assert_allclose([[float(x) for x in t.get("xyz").split()] for t in found], taxels.positions, rtol=0, atol=0)
    angles = np.array([[float(x) for x in t.get("rpy").split()] for t in found])
    assert_allclose(rotations(angles), taxels.axes, rtol=0, atol=1e-15)
    boxes = [t.find("geometry/box").get("size").split() for t in found[:6]]
    assert_allclose([[float(x) for x in box[:2]] for box in boxes], 0.01, rtol=1e-9)
    discs = [float(t.find("geometry/cylinder").get("radius")) for t in found[6:]]
    assert_allclose(np.pi * np.square(discs), taxels.areas[6:], rtol=1e-12)


def test_oblong_cells_are_longest_along_their_rows():
    """The sizes of a cell are those along and across the tangent, in this order."""
    taxels = sheet(2, 3, 0.01).taxels
    arms = taxels.corners_link - taxels.positions_link[:, None]
    along = (arms * taxels.tangents_link[:, None]).sum(axis=2, keepdims=True) * taxels.tangents_link[:, None]
    _, made = written("urdf-tactile", patches=(renamed(sheet(2, 3, 0.01), corners_link=taxels.corners_link + along),))
    assert_allclose(made.sizes, np.tile((0.02, 0.01), (6, 1)), rtol=0.01)


# --- mc_rtc


def test_planar_surface_is_the_sole_from_above():
    """A downward sole has an upright frame; its outline is counter-clockwise and contains all corners."""
    down = Motion.none()
    down.rotation = np.diag((1.0, -1.0, -1.0))
    patch = seven_boards().taxels
    moved = {"positions_link": down.points(patch.positions_link), "corners_link": down.points(patch.corners_link)}
    moved |= {
        "normals_link": down.directions(patch.normals_link),
        "tangents_link": down.directions(patch.tangents_link),
    }
    content, taxels = written("rsdf", patches=(renamed(seven_boards(), **moved),))
    (surface,) = ElementTree.fromstring(content).findall("planar_surface")
    assert (surface.get("name"), surface.get("link")) == ("flower", "forearm")
    angles = np.array([float(x) for x in surface.find("origin").get("rpy").split()])
    assert_allclose(rotations(angles[None])[0], np.eye(3), rtol=0, atol=1e-15)
    origin = np.array([float(x) for x in surface.find("origin").get("xyz").split()])
    outline = np.array([[float(x) for x in p.get("xy").split()] for p in surface.findall("points/point")])
    assert len(outline) == 12 and surface.find("material") is not None
    sides = np.roll(outline, -1, axis=0) - outline
    turns = sides[:, 0] * np.roll(sides, -1, axis=0)[:, 1] - sides[:, 1] * np.roll(sides, -1, axis=0)[:, 0]
    assert (turns > 0).all()
    corners = moved["corners_link"].reshape(-1, 3)[:, :2] - origin[:2]
    away = corners[:, None] - outline
    assert (sides[:, 0] * away[..., 1] - sides[:, 1] * away[..., 0]).min() > -1e-12
    assert_allclose(origin, [0.05, -0.05, 0.1], rtol=0, atol=1e-12)


def test_hull_of_a_square_with_points_on_its_sides_has_four_corners():
    """Points on an edge and inside are left out; the hull is counter-clockwise from any start."""
    i, j = np.indices((5, 5)) / 4
    found = hull(np.column_stack((i.ravel(), j.ravel())))
    assert found.tolist() == [[0, 0], [1, 0], [1, 1], [0, 1]]


def test_curved_patch_is_not_a_planar_surface():
    """The error has its name and its deviation from the plane."""
    with pytest.raises(
        CalibrationFormatError, match=r'patch "sheet" is not flat: .* up to 1\.\d mm from .*\(--patch\)'
    ):
        written("rsdf")


# --- all


def test_triangles_fill_a_sheet_and_a_flower():
    """Two for each square of cells and six around a board, counter-clockwise, without repetition."""
    for patch, count in ((sheet(4, 6, 0.01), 2 * 3 * 5), (seven_boards(), 6), (sheet(1, 5, 0.01), 3)):
        taxels = taxels_of(small_calibration(patches=(patch,)))
        faces = triangles(taxels, taxels.of(patch.name))
        assert len(faces) == count == len({frozenset(face) for face in faces.tolist()})
        a, b, c = taxels.positions[faces].transpose(1, 0, 2)
        if count != 3:
            assert ((np.cross(b - a, c - a) * taxels.normals[faces[:, 0]]).sum(axis=1) > 0).all()


def test_calibration_without_taxels_is_refused():
    """In one line, for all formats with taxels."""
    for name in set(WRITABLE) - {"rsdf"}:
        with pytest.raises(CalibrationFormatError, match='link "forearm" has 0 taxels; files may have 1 to 100000'):
            written(name, patches=())


def test_documentation_has_the_table():
    """Each format with ending, content, ids, and whether it can be read, in the order of the table."""
    text = (Path(__file__).parents[4] / "docs" / "reference" / "exports.md").read_text("utf-8")
    rows = [
        f"| `{f.name}` | `{f.ending}` | {f.what} | {f.labels} | {'yes' if f.readable else 'no'} |"
        for f in FORMATS.values()
    ]
    assert "\n".join(rows) in text


@pytest.mark.parametrize("name", ["mjcf", "tum", "urdf", "urdf-tactile", "rsdf"])
def test_character_that_xml_forbids_is_an_error(name):
    """Such a character cannot be escaped."""
    with pytest.raises(CalibrationFormatError, match="(U\\+FFFF, which XML forbids|printable characters).*Rename it"):
        written(name, link="a\uffff", patches=(seven_boards(),))


def test_binary_pcd_of_single_precision_is_read(tmp_path):
    """As PCL writes it, with colour and histogram first: columns are found by name."""
    _, taxels = written("pcd")
    head = "# .PCD v0.7\nVERSION 0.7\nFIELDS rgb h x y z normal_x normal_y normal_z\nSIZE 4 2 4 4 4 4 4 4\n"
    head += "TYPE F U F F F F F F\nCOUNT 1 3 1 1 1 1 1 1\nWIDTH 13\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n"
    head += "POINTS 13\nDATA binary\n"
    rows = np.column_stack((np.full(13, 7.0), taxels.positions, taxels.normals))
    path = tmp_path / "cloud.pcd"
    path.write_bytes(head.encode() + b"".join(struct.pack("<f3H6f", row[0], 1, 2, 3, *row[1:]) for row in rows))
    back = read_taxels(path)
    assert_allclose(back.positions, taxels.positions, rtol=0, atol=1e-8)
    assert back.channels.tolist() == list(range(13)) and back.frame is None and back.findings == ()
