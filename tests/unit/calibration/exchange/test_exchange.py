"""Taxel files of other programs: they are read unchanged, with warnings, or give errors with line numbers."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.calibration.exchange import READABLE, TaxelSet, icub, read_taxels, reading, table, tum, xml_nodes
from skin_calib_addon.common import text
from skin_calib_addon.common.errors import CalibrationFormatError
from tests.exchange_samples import (
    CELLS,
    SENSOR,
    csv_text,
    icub_text,
    matrix,
    pcd_text,
    ply_text,
    points_round,
    robot_text,
    tum_text,
)

ROUND, OUTWARD = points_round(12)
BARE_PLY = ply_text(ROUND).replace("element face 1\nproperty list uchar int vertex_indices\n", "")[: -len("3 0 1 2\n")]


@pytest.fixture
def read(tmp_path):
    """Return a function that reads a text as a file."""

    def run(content, format=None, only=None):
        path = tmp_path / "taxels"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_taxels(path, format, only)

    return run


def codes(taxels):
    """Return the location of each finding by its code."""
    return {finding.code: finding.pointer for finding in taxels.findings}


def value(taxels, code):
    """Return the value of the only finding with a code."""
    (found,) = (finding.value for finding in taxels.findings if finding.code == code)
    return found


def error_of(read, content, *change, format=None):
    """Replace each first text of a pair in a content, and return the first error that its reader finds."""
    for old, new in zip(change[::2], change[1::2]):
        assert old in content
        content = content.replace(old, new, -1 if old in ("SkinConfig", "rot>") else 1)
    with pytest.raises(CalibrationFormatError) as refused:
        read(content, format)
    found = [f for f in refused.value.findings if f.severity == "error"]
    assert str(found[0]) in str(refused.value) and "\n" not in str(refused.value)
    return found[0]


# --- iCub


def test_icub_rows_keep_their_index_as_channel(read):
    """Rows of zeros use a channel without taxel; they are counted, without other warnings."""
    rows = np.column_stack((ROUND, OUTWARD))
    rows[[0, 5, 6]] = 0
    taxels = read(icub_text(rows, "3 " * 12))
    kept = [1, 2, 3, 4, 7, 8, 9, 10, 11]
    assert taxels.channels.tolist() == kept
    assert taxels.labels == tuple(map(str, kept))
    assert (taxels.positions == ROUND[kept]).all()
    assert_allclose(taxels.normals, OUTWARD[kept], rtol=0, atol=1e-12)
    assert codes(taxels) == {"no-taxel": "line 5", "no-position": "line 3"}
    assert value(taxels, "no-taxel") == 3 and value(taxels, "no-position") == 3
    assert taxels.neighbours is None and taxels.tangents is None


@pytest.mark.parametrize(
    ("head", "frame"),
    [
        ("name\tl_upper_leg\n", "l_upper_leg"),
        ("name l_forearm\nframe  l_forearm_dh_frame\n", "l_forearm_dh_frame"),
        ("# a comment\n\nspatial_sampling\ttaxel\n", None),
        ("name\n", None),
    ],
)
def test_icub_frame_is_the_one_named(read, head, frame):
    """The frame, or else the link; a comment and a name without value are ignored."""
    assert read(icub_text(np.column_stack((ROUND, OUTWARD)), head=head)).frame == frame


def test_icub_table_is_compared_with_the_rows(read):
    """Thermal pads, unused rows, marked rows with position, and a table of another length give warnings only."""
    rows = np.column_stack((ROUND, OUTWARD))
    rows[[2, 3]] = 0
    taxels = read(icub_text(rows, "3 3 -2 -1 3 -2 3 3"))
    assert len(taxels.labels) == 10
    assert {f.code: f.value for f in taxels.findings} == {
        "table-length": [8, 12],
        "thermal-pad": 2,
        "unused": 1,
        "no-taxel": 2,
    }
    (short,) = (f for f in taxels.findings if f.code == "table-length")
    assert short.pointer == "line 3" and "4 taxels without entry are used" in short.message
    (thermal,) = (f for f in taxels.findings if f.code == "thermal-pad")
    assert "1 of them have a position and are used, the first in line 10" in thermal.message
    longer = read(icub_text(rows, "3 " * 15))
    assert value(longer, "table-length") == [15, 12]


def test_icub_reader_stops_at_the_next_section(read):
    """Comments, empty lines and other blocks are not rows."""
    rows = np.column_stack((ROUND, OUTWARD))
    content = icub_text(rows).replace("[calibration]\n", "[calibration]\n# x y z\n\n") + "[other]\n1 2\n"
    assert len(read(content).labels) == 12
    assert len(read(content.replace("\n", "\r\n")).labels) == 12


# --- TUM


def test_tum_cells_have_full_frames(read):
    """Positions and axes are transformed to the base frame; ports give the neighbours in the file."""
    taxels = read(tum_text(CELLS, base=(matrix(90), (1.0, 2.0, 0.5))))
    turn, shift = matrix(90), np.array((1.0, 2.0, 0.5))
    assert_allclose(taxels.positions, [turn @ c.position + shift for c in CELLS], rtol=0, atol=1e-12)
    assert_allclose(taxels.normals, [turn @ c.rotation[:, 2] for c in CELLS], rtol=0, atol=1e-9)
    assert_allclose(taxels.tangents, [turn @ c.rotation[:, 0] for c in CELLS], rtol=0, atol=1e-9)
    assert taxels.labels == ("5", "6", "7") and taxels.channels.tolist() == [0, 1, 2]
    assert taxels.neighbours == (("6",), ("5", "7"), ("6",))
    assert taxels.frame == "world"
    assert list(codes(taxels)) == ["unknown-neighbour"] and value(taxels, "unknown-neighbour") == 1


def test_tum_transform_from_base_to_dh_is_reported(read):
    """It is not applied, because its frame has no name or another name than the base frame."""
    moved = tum_text(CELLS, beyond=(matrix(0), (0, 0, 0.1)))
    assert "unused-transform" in codes(read(moved))
    assert (read(moved).positions == read(tum_text(CELLS)).positions).all()


def test_tum_patches_in_two_frames_are_reported(read):
    """The frame is unknown; each patch has the pose of its extrinsics."""
    content = tum_text(CELLS).replace('<cell id="7" patch="2"', '<cell id="7" patch="3"')
    start, stop = content.index("<patchExtrinsics"), content.index("</patchExtrinsics>") + len("</patchExtrinsics>")
    place = content[start:stop].replace('patchId="2" baseFrame="world"', 'patchId="3" baseFrame="arm"')
    raised = place.replace('row="2" col="0">0.0<', 'row="2" col="0">0.3<', 1)
    taxels = read(content[:stop] + raised + content[stop:])
    assert taxels.frame is None and value(taxels, "frames") == ["arm", "world"]
    shifts = [(0, 0, 0.3 * (c.id == 7)) for c in CELLS]
    assert_allclose(taxels.positions, [c.position + s for c, s in zip(CELLS, shifts)], rtol=0, atol=1e-12)


def test_tum_patch_without_pose_stays_in_its_root_cell(read):
    """Without extrinsics, positions are relative to the root cell, with a warning."""
    content = tum_text(CELLS)
    start, stop = content.index("<patchExtrinsics"), content.index("</patchExtrinsics>") + len("</patchExtrinsics>")
    taxels = read(content[:start] + content[stop:])
    assert taxels.frame is None and value(taxels, "no-frame") == 3
    assert_allclose(taxels.positions, [c.position for c in CELLS], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        (("<!DOCTYPE scfg>", '<!DOCTYPE scfg [<!ENTITY a "b">]>'), "entity", "declares an entity"),
        (("</pos>", ""), "syntax", "is not XML at column"),
        (("SkinConfig", "Skin"), "syntax", 'starts "Skin"; the root element must be SkinConfig'),
        (("rot>", "tor>"), "missing", "starts an element tf_rootCell_base without rot"),
        (('<cell id="5"', "<cell"), "missing", "starts an element cell without the attribute id"),
        (('<cell id="5"', '<cell id="five"'), "number", 'has "five" instead of an integer (cell id)'),
        (('<cell id="6"', '<cell id="5"'), "duplicate-label", 'repeats the label "5" of line'),
        (('row="2" col="0">0.0<', 'row="3" col="0">0.0<'), "size", "contains element (3, 0) of pos, which is 3 x 1"),
        (('row="2" col="0">0.0<', 'row="1" col="0">0.0<'), "missing", "starts a matrix without element (2, 0)"),
        (('row="2" col="0">0.0<', 'row="2" col="0">NaN<'), "not-finite", 'has "NaN" instead of a finite number'),
        (('row="2" col="2">1.0<', 'row="2" col="2">-1.0<'), "rotation", "has a matrix rot that is not a rotation"),
        (('row="2" col="2">1.0<', 'row="2" col="2">1e300<'), "rotation", "has a matrix rot that is not a rotation"),
        (("0.0<", f"1.{'3' * 70}e-9<"), "number", "instead of a number of less than 64 characters"),
        (("0.0<", '0.0</element><element row="0" col="0">0.5<'), "syntax", "a matrix pos that repeats an element"),
        (("<cell", '<patchExtrinsics patchId="2"/><cell'), "syntax", 'second patchExtrinsics of patch "2"'),
    ],
)
def test_tum_reader_reports_errors_with_lines(read, change, code, words):
    """Each change gives one error with line and reason."""
    found = error_of(read, tum_text(CELLS), *change)
    assert found.code == code and words in found.message and found.pointer.startswith("line ")


def test_tum_declared_encoding_is_ignored(read):
    """The text is decoded as UTF-8 before it is parsed."""
    assert len(read(tum_text(CELLS).replace("UTF-8", "UTF-16")).labels) == 3


def test_tum_reader_has_limits(read, monkeypatch):
    """Depth, elements of one cell and number of cells are limited, to protect the memory."""
    deep = "<SkinConfig>" + "<a>" * 40
    many = "<SkinConfig><cell>" + "<a/>" * (xml_nodes.MAX_CHILD_NODES + 5)
    for content, code in ((deep, "depth"), (many, "size")):
        with pytest.raises(CalibrationFormatError) as refused:
            read(content)
        assert refused.value.findings[0].code == code
    monkeypatch.setattr(tum, "MAX_TAXELS", 2)
    with pytest.raises(CalibrationFormatError, match="exceeds the limit of 2 cells"):
        read(tum_text(CELLS))


# --- tables


@pytest.mark.parametrize(
    ("header", "channel", "label"),
    [
        ("x,y,z,nx,ny,nz", 0, "0"),
        ("Index,X,Y,Z,NormX,NormY,NormZ", 40, "40"),
        ("id,row,index,x,y,z,normal_x,normal_y,normal_z", 30, "a, b"),
        ("label,index,nz,ny,nx,z,y,x,remark", 40, "a, b"),
        (" Channel , Row ,X, Y,Z,NX,NY,NZ", 20, "20"),
    ],
)
def test_columns_are_found_by_name(read, header, channel, label):
    """In any order and case, with other columns; channel has priority over row, and row over index."""
    first = {"id": '"a, b"', "label": '"a, b"', "channel": 20, "row": 30, "index": 40, "remark": 7}
    first |= {"x": 0.1, "y": 0.2, "z": 0.3, "nx": 0.0, "ny": 0.6, "nz": 0.8}
    names = [name.strip().lower().replace("normal_", "n").replace("norm", "n") for name in header.split(",")]
    taxels = read(f"{header}\n" + ",".join(str(first[name]) for name in names))
    assert taxels.channels.tolist() == [channel] and taxels.labels == (label,)
    unknown = [finding.value for finding in taxels.findings]  # is named, because it could have a meaning
    assert unknown == ([["remark"]] if "remark" in header else [])
    assert taxels.positions.tolist() == [[0.1, 0.2, 0.3]]
    assert_allclose(taxels.normals, [[0, 0.6, 0.8]], rtol=0, atol=1e-12)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_separators_and_line_ends_are_accepted(read, separator, ending):
    """Those of spreadsheets, with a byte order mark, comments and empty lines."""
    content = "# made by hand\n\n" + csv_text(ROUND, tangents=OUTWARD).replace(",", separator) + "\n \n"
    taxels = read(b"\xef\xbb\xbf" + content.replace("\n", ending).encode())
    assert (taxels.positions == ROUND).all() and taxels.normals is None
    assert_allclose(taxels.tangents, OUTWARD, rtol=0, atol=1e-12)


def test_a_quotation_mark_in_a_comment_takes_no_rows(read):
    """A comment ends with its line; a line of a cell with quotation marks is no comment."""
    header, *rows = csv_text(ROUND).splitlines()
    rows.insert(3, '# old,"row')
    rows.insert(6, '# row",old')
    assert (read("\n".join((header, *rows))).positions == ROUND).all()
    taxels = read('x,y,z,note\n0,0,0.1,"two\n# lines"\n0,0,0.2,one\n')
    assert taxels.positions.tolist() == [[0, 0, 0.1], [0, 0, 0.2]]


def test_frame_of_a_table_is_the_one_that_all_rows_name(read):
    """The parent of GenTact; rows with different frames give a warning."""
    rows = [f"{i},{x},{y},{z},0.005,/panda/link5,skin" for i, (x, y, z) in enumerate(ROUND)]
    header = "Index,X,Y,Z,Radius,Parent,Object Name in Blender"
    assert read("\n".join((header, *rows))).frame == "/panda/link5"
    rows[7] = rows[7].replace("link5", "link6")
    taxels = read("\n".join((header, *rows)))
    assert taxels.frame is None and codes(taxels) == {"frames": "line 9"}


@pytest.mark.parametrize(
    ("change", "code", "place", "words"),
    [
        (("x,y,z,nx", "u,y,z,nx"), "missing-column", "line 1", 'has no column "x"'),
        (("nx,ny,nz", "nx,ny,nu"), "missing-column", "line 1", 'has no column "nz"; did you mean'),
        (("x,y,z,nx", "x,y,y,nx"), "duplicate-column", "line 1", 'names the column "y" twice'),
        (("\n", "\n,"), "row", "line 2", "has 7 columns, but the header has 6"),
        (("\n0.03", "\nabc"), "number", "line 2", 'has "abc'),
        (("\n0.03", "\n1_0.03"), "number", "line 2", 'has "1_0.03'),
        (("\n0.03", "\n０.03"), "number", "line 2", "instead of a number"),
        (("\n0.03,", "\n1e400,"), "not-finite", "line 2", 'has "1e400"'),
        (("\n0.03", "\n "), "number", "line 2", "instead of a number"),
        (("\n0.03,", "\nnan,"), "not-finite", "line 2", 'has "nan" instead of a finite number'),
        (("\n0.03,", "\n50,"), "units", "line 2", "divide lengths by 1000 if they are in millimetres"),
        (("\n0.03", '\n"0.03'), "syntax", "line 2", "is not a row of a table: unexpected end of data"),
    ],
)
def test_table_reader_reports_errors_with_lines(read, change, code, place, words):
    """Errors of header and rows have a line number."""
    found = error_of(read, csv_text(ROUND, normals=OUTWARD), *change, format="csv")
    assert (found.code, found.pointer) == (code, place) and words in found.message


@pytest.mark.parametrize(
    ("header", "row", "code", "words"),
    [
        ("channel,x,y,z", "-1,0,0,1", "channel", "has the channel -1; use 0 to 2147483647"),
        ("channel,x,y,z", "1.5,0,0,1", "number", 'has "1.5" instead of an integer'),
        ("channel,x,y,z", "7,0,0,1\n7,0,1,1", "duplicate-channel", "repeats the channel 7 of line 2"),
        ("id,x,y,z", "a,0,0,1\na,0,1,1", "duplicate-label", 'repeats the label "a" of line 2'),
        ("id,x,y,z", " ,0,0,1", "label", 'has the label ""; use 1 to 200 printable characters'),
        ("id,x,y,z", "a" * 300 + ",0,0,1", "label", "printable"),
        (
            "x,y,z,nx,ny,nz",
            "0,0,1,1e300,0,0",
            "direction",
            "has the component 1e+300 in a direction; the limit is 1e+06",
        ),
        ("x,y,z", "0,0,0\n0,0,0", "no-taxels", "contains only rows of zeros"),
        ("x,y,z", "", "no-taxels", "has no row below its header"),
    ],
)
def test_labels_channels_and_directions_must_be_usable(read, header, row, code, words):
    """One error that states what to do."""
    found = error_of(read, f"{header}\n{row}")
    assert found.code == code and words in found.message


def test_neighbours_of_a_table_are_channels(read):
    """They become labels; an unknown channel gives a warning, another word an error."""
    table = "channel,id,x,y,z,neighbours\n4,a,0,0,0.1,7 9\n7,b,0,0,0.2,4\n9,c,0,0,0.3,\n"
    taxels = read(table)
    assert taxels.neighbours == (("b", "c"), ("a",), ()) and taxels.findings == ()
    taxels = read(table.replace("7 9", "7 8"))
    assert taxels.neighbours == (("b",), ("a",), ()) and codes(taxels) == {"unknown-neighbour": "line 2"}
    with pytest.raises(CalibrationFormatError, match='line 2 has "b" instead of an integer'):
        read(table.replace("7 9", "b"))


# --- URDF

PLACES = {f"skin_{i}": tuple(place) for i, place in enumerate(ROUND.tolist())}


def test_frames_of_urdf_are_taxels(read):
    """Frames without children, in their order, with poses in the link that has a body."""
    taxels = read(robot_text(PLACES))
    assert taxels.labels == tuple(PLACES) and taxels.channels.tolist() == list(range(12))
    assert (taxels.positions == ROUND).all() and taxels.frame == "forearm"
    assert (taxels.tangents == [1, 0, 0]).all()


def test_intermediate_frames_are_skipped(read):
    """Poses refer to the parent link with a body; frames with children, joints or a body are not taxels."""
    more = (
        '<link name="palm"/><joint name="p" type="fixed"><origin xyz="0 0 0.1" rpy="0 0 1.5707963267948966"/>'
        '<parent link="forearm"/><child link="palm"/></joint><link name="tip"/><joint name="t" type="fixed">'
        '<origin xyz="0.02 0 0" rpy="0 1.5707963267948966 0"/><parent link="palm"/><child link="tip"/></joint>'
        '<link name="thumb"/><joint name="th" type="revolute"><parent link="palm"/><child link="thumb"/></joint>'
        '<link name="nail"><visual/></link><joint name="n" type="fixed"><parent link="palm"/>'
        '<child link="nail"/></joint>'
    )
    taxels = read(robot_text({}, more))
    assert taxels.labels == ("tip",) and taxels.frame == "forearm"
    assert_allclose(taxels.positions, [[0, 0.02, 0.1]], rtol=0, atol=1e-15)
    assert_allclose(taxels.normals, [[0, 1, 0]], rtol=0, atol=1e-15)
    assert_allclose(taxels.tangents, [[0, 0, -1]], rtol=0, atol=1e-15)


def test_frames_of_one_link_are_selected(read):
    """Two links in a file are an error with advice; for selected labels, channels start from 0."""
    hand = '<link name="hand"><visual/></link><link name="nail"/><joint name="n" type="fixed"><parent link="hand"/>'
    content = robot_text(PLACES, hand + '<child link="nail"/></joint>')
    with pytest.raises(
        CalibrationFormatError, match=r'has "nail" on "hand", but the previous taxels are on "forearm"; .*--only'
    ):
        read(content)
    taxels = read(content, only="skin_1*")
    assert taxels.labels == ("skin_1", "skin_10", "skin_11") and taxels.channels.tolist() == [0, 1, 2]
    assert read(content, only="nail").frame == "hand"
    with pytest.raises(
        CalibrationFormatError, match='no taxel whose label matches "thumb.*"; the first label is "skin_0"'
    ):
        read(content, only="thumb*")


def test_taxels_of_tactile_sensors_are_read(read):
    """Poses are relative to the link; the index is the channel; other sensors are ignored."""
    taxels = read(SENSOR)
    assert taxels.labels == ("cuff.4", "cuff.2") and taxels.channels.tolist() == [4, 2] and taxels.frame == "wrist"
    assert_allclose(taxels.positions, [[0, 0.03, 0.1], [-0.03, 0, 0.1]], rtol=0, atol=1e-15)
    assert_allclose(taxels.normals, [[0, 1, 0], [-1, 0, 0]], rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("content", "change", "code", "words"),
    [
        (robot_text(PLACES), ('xyz="0.03 0.0', 'xyz="${r} 0.0'), "number", 'has "${r}" instead of a number (xyz)'),
        (robot_text(PLACES), ('xyz="0.03 0.0', 'xyz="0.03'), "number", "has 2 numbers in xyz; it must have three"),
        (
            robot_text(PLACES),
            ('<link name="skin_3"/>', ""),
            "missing",
            'names the link "skin_3", which the file does not',
        ),
        (
            robot_text(PLACES),
            ('<link name="skin_3"', '<link name="skin_2"'),
            "duplicate-label",
            'repeats the link "skin_2"',
        ),
        (
            robot_text(PLACES),
            ('<child link="skin_3"', '<child link="skin_2"'),
            "syntax",
            'is a second joint of the link "skin_2"',
        ),
        (robot_text(PLACES), ('<child link="skin_3"/>', ""), "missing", "starts an element joint without child"),
        (robot_text({}), ("", ""), "no-taxels", "has no tactile sensor and no frame fixed to a link"),
        (SENSOR, ("<taxel", '<array rows="2" cols="2"/><taxel'), "array", "starts an array, which is not supported"),
        (
            robot_text(PLACES),
            ('rpy="0 0 0"', 'quat_xyzw="0 0 0 1"'),
            "unknown-attribute",
            'attribute "quat_xyzw" of origin',
        ),
        (SENSOR, ('rpy="0 1.57', 'quat="0 1.57'), "unknown-attribute", 'attribute "quat" of taxel'),
        (SENSOR, ('idx="4"', 'idx="2"'), "duplicate-channel", "repeats the channel 2 of line 4"),
    ],
)
def test_urdf_reader_reports_errors_with_lines(read, content, change, code, words):
    """Each change gives one error with its reason."""
    found = error_of(read, content, *change)
    assert found.code == code and words in found.message


def test_loop_of_frames_is_an_error(read):
    """A loop of joints has no parent link."""
    ring = "".join(
        f'<link name="{a}"/><joint name="j{a}" type="fixed"><parent link="{b}"/><child link="{a}"/></joint>'
        for a, b in (("a", "b"), ("b", "c"), ("c", "b2"), ("b2", "b"), ("t", "a"))
    )
    with pytest.raises(CalibrationFormatError, match="is part of a loop of joints"):
        read(f'<robot name="r">{ring}</robot>')


def test_many_taxels_in_one_sensor_are_read(read):
    """More elements than the limit for one cell of a patch."""
    taxel = '<taxel idx="{0}" xyz="0 0 {1!r}"><geometry><box size="1 1 1"/></geometry></taxel>'
    many = "".join(taxel.format(i, 0.001 * (i + 1)) for i in range(1500))
    assert len(read(SENSOR.split("<taxel")[0] + many + "</tactile></sensor></robot>").labels) == 1500


# --- clouds


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("kind", ["f4", "f8"])
def test_binary_ply_is_read(read, order, kind):
    """In both byte orders and precisions, with other columns, and with faces at the end."""
    name = {"f4": "float", "f8": "double"}[kind]
    form = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = f"ply\nformat {form} 1.0\nelement vertex 12\nproperty uchar red\n"
    head += "".join(f"property {name} {axis}\n" for axis in ("x", "y", "z", "nx", "ny", "nz"))
    head += "property ushort channel\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    table = np.zeros(12, [("red", "u1"), ("v", order + kind, 6), ("channel", order + "u2")])
    table["v"], table["channel"] = np.column_stack((ROUND, OUTWARD)), 300 + np.arange(12)
    taxels = read(head.encode() + table.tobytes() + b"\x03" + bytes(12))
    assert_allclose(taxels.positions, ROUND, rtol=0, atol=1e-8 if kind == "f4" else 0)
    assert taxels.channels.tolist() == list(range(300, 312)) and taxels.labels[0] == "300"
    assert codes(taxels) == {"faces": "line 12"} and 'announces "1" faces' in str(taxels.findings[0])
    assert read(head.replace("face 1", "face 0").encode() + table.tobytes()).findings == ()
    with pytest.raises(CalibrationFormatError, match="is truncated: the header announces 12 points, 11 were found"):
        read(head.encode() + table.tobytes()[:-1])
    table["v"][5, 1] = np.nan
    with pytest.raises(CalibrationFormatError, match="point 5 has a coordinate that is not finite"):
        read(head.encode() + table.tobytes())
    table["v"][5, 1] = 70
    with pytest.raises(CalibrationFormatError, match="point 5 is 70 m from the frame; divide lengths by 1000"):
        read(head.encode() + table.tobytes())


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_clouds_of_text_are_read(read, ending):
    """With all digits and both line ends; without a channel, the index is the channel."""
    for content in (ply_text(ROUND, OUTWARD), ply_text(ROUND), pcd_text(ROUND)):
        taxels = read(content.replace("\n", ending))
        assert (taxels.positions == ROUND).all() and taxels.channels.tolist() == list(range(12))
    assert_allclose(read(ply_text(ROUND, OUTWARD)).normals, OUTWARD, rtol=0, atol=1e-12)


def test_viewpoint_of_a_cloud_is_reported(read):
    """The viewpoint is not applied."""
    taxels = read(pcd_text(ROUND).replace("VIEWPOINT 0 0 0", "VIEWPOINT 0 0 1"))
    assert codes(taxels) == {"unused-transform": "line 9"} and (taxels.positions == ROUND).all()


@pytest.mark.parametrize(
    ("content", "change", "words"),
    [
        (ply_text(ROUND), ("end_header", "ende"), "has a header without end"),
        (ply_text(ROUND), ("format ascii", "format ebcdic"), "has a header without format or vertices"),
        (ply_text(ROUND), ("vertex 12", "vertex 20"), "is truncated: the header announces 20 points, 13 were found"),
        (ply_text(ROUND), ("vertex 12", "vertex 1e9"), 'line 4 announces "1e9" points; the limit is 100000'),
        (ply_text(ROUND), ("vertex 12", "vertex 0"), "contains no point"),
        (ply_text(ROUND), ("element vertex", "element edge 1\nelement vertex"), 'names "edge" before the vertices'),
        (ply_text(ROUND), ("property float x", "property list uchar int x"), "defines a list for vertices"),
        (ply_text(ROUND), ("property float x", "property real x"), 'has the type "real", which is invalid in PLY'),
        (ply_text(ROUND), ("float x", "float u"), 'has no column "x"; its columns are "u y z"'),
        (ply_text(ROUND), ("\n0.03 ", "\n0.03 1 "), "line 11 has more than 3 numbers, but the header names 3"),
        (pcd_text(ROUND), ("DATA ascii", "DATA binary_compressed"), "save it as ascii or binary"),
        (pcd_text(ROUND), ("DATA ascii", "data"), "has no line DATA"),
        (pcd_text(ROUND), ("POINTS 12\n", ""), "has a header without POINTS"),
        (pcd_text(ROUND), ("SIZE 4", "SIZE 3"), 'the field "x" of type "F", size "3"'),
        (pcd_text(ROUND), ("SIZE 4", "SIZE"), "has another number of fields than SIZE, TYPE or COUNT"),
        (pcd_text(ROUND, "x y channel"), ("", ""), 'has no column "z"; its columns are'),
        (pcd_text(ROUND), ("POINTS 12", "POINTS 11"), "line 23 is after the last point: .* 11 points, 12 were found"),
        (BARE_PLY, ("vertex 12", "vertex 11"), "line 20 is after the last point: .* 11 points, 12 were found"),
        (BARE_PLY, ("end_header", "element vertex 1\nend_header"), "line 8 names a second element vertex"),
        (BARE_PLY, ("float z", "float z\nproperty float x"), 'names the column "x" twice'),
        (ply_text(ROUND, OUTWARD), ("float nz", "float quality"), 'has a normal without the column "nz"'),
        (
            pcd_text(np.column_stack((ROUND, ROUND)), "x y z channel b c"),
            ("", ""),
            "line 12 has the channel 0.03; use 0",
        ),
    ],
)
def test_cloud_readers_report_errors_with_locations(read, content, change, words):
    """Errors of header, number of points and numbers are one line with reason and location."""
    assert re.search(words, str(error_of(read, content, *change)))


# --- all formats


@pytest.mark.parametrize("normal", [(1, 0, 0), (0.6, 0, 0.8)])
def test_one_normal_for_taxels_around_a_link_is_a_placeholder(read, normal):
    """In any direction: no normal of the file is used, and the warning has their number."""
    taxels = read(csv_text(ROUND, normals=np.tile(normal, (12, 1))))
    assert taxels.normals is None
    assert codes(taxels) == {"placeholder-normals": "line 2"} and value(taxels, "placeholder-normals") == 12


def test_a_few_placeholders_invalidate_all_normals(read):
    """Rows of (1, 0, 0) on both sides of the link, among valid ones; the one valid (1, 0, 0) counts, too."""
    normals = OUTWARD.copy()
    normals[[2, 8]] = 1, 0, 0
    taxels = read(csv_text(ROUND, normals=normals))
    assert taxels.normals is None and codes(taxels) == {"placeholder-normals": "line 2"}
    assert value(taxels, "placeholder-normals") == 3


@pytest.mark.parametrize("axis", range(3))
def test_one_normal_for_a_flat_patch_is_valid(read, axis):
    """A sole has one normal, as has a patch perpendicular to x, for which (1, 0, 0) is valid."""
    flat = np.roll(np.column_stack((0.1 * np.ones(12), ROUND[:, :2])), axis, axis=1)
    normals = np.tile(np.roll((1.0, 0, 0), axis), (12, 1))
    taxels = read(csv_text(flat, normals=normals))
    assert (taxels.normals == normals).all() and taxels.findings == ()


def test_missing_and_long_normals_are_reported(read):
    """With a zero normal, no normal is used; a normal of another length is normalized."""
    normals = OUTWARD.copy()
    normals[4] *= 2.5
    normals[8] *= 0.5
    taxels = read(csv_text(ROUND, normals=normals))
    assert_allclose(taxels.normals, OUTWARD, rtol=0, atol=1e-12)
    assert codes(taxels) == {"not-unit-normals": "line 6"} and value(taxels, "not-unit-normals") == 2
    normals[2] = 0
    taxels = read(csv_text(ROUND, normals=normals))
    assert taxels.normals is None and codes(taxels) == {"missing-normals": "line 4"}


def test_equal_positions_are_reported(read):
    """Three taxels at one position: the warning counts the second and third, and names the first."""
    places = ROUND.copy()
    places[7], places[11] = places[2], places[2]
    taxels = read(csv_text(places, normals=OUTWARD))
    (found,) = taxels.findings
    assert (found.code, found.pointer, found.value) == ("duplicate-position", "line 9", 2)
    assert "that of line 4" in found.message and len(taxels.labels) == 12


def test_format_is_detected_from_the_content(read, tmp_path):
    """Samples of all formats, without a format, with a wrong or unknown one, and other content."""
    rows = np.column_stack((ROUND, OUTWARD))
    samples = {"icub": icub_text(rows), "tum": tum_text(CELLS), "csv": csv_text(ROUND), "urdf": robot_text(PLACES)}
    samples |= {"ply": ply_text(ROUND), "pcd": pcd_text(ROUND)}
    assert set(samples) == set(READABLE) - {"gentact", "urdf-tactile"}  # which are read as csv and urdf
    for name, content in samples.items():
        assert (reading.cloud_format_of(content.encode()) or reading.format_of(content)) == name
        assert len(read(content).labels) == len(read(content, name).labels) > 0
        for other in samples.keys() - {name}:
            with pytest.raises(CalibrationFormatError):
                read(content, other)
    with pytest.raises(
        CalibrationFormatError, match="unknown taxel format 'cvs'. Supported: icub, tum, csv, .*; did you mean \"csv\""
    ):
        read(samples["csv"], "cvs")
    for content in ("hello", "\n\n", "a,b,c\n1,2,3\n", "x y z\n1 2 3\n", "\x01"):
        with pytest.raises(CalibrationFormatError, match="the taxel format of .* is unknown. Supported"):
            read(content)
        for name in READABLE:
            with pytest.raises(CalibrationFormatError):
                read(content, name)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"x,y,z\n\xff,0,0\n", "is not UTF-8 at byte 6. Save it as UTF-8"),
        (b'{"format": "skin-calibration"}', "is a JSON file, not a taxel file.* export wrote"),
        (
            b"x,y,z\n1,2,3\n" + b" " * (text.MAX_LINE_LENGTH + 1),
            "line 3 of .* has 1048577 characters; the limit is 1048576",
        ),
    ],
)
def test_invalid_text_is_an_error(read, content, words):
    """The error occurs before any reader is called."""
    with pytest.raises(CalibrationFormatError, match=words):
        read(content)


def test_sizes_are_limited(read, monkeypatch):
    """Bytes are limited before decoding, rows before parsing; files at the limit are read."""
    rows = np.column_stack((ROUND, OUTWARD))
    for module, content in ((icub, icub_text(rows)), (table, csv_text(ROUND))):
        monkeypatch.setattr(module, "MAX_TAXELS", 12)
        assert len(read(content).labels) == 12
        monkeypatch.setattr(module, "MAX_TAXELS", 11)
        with pytest.raises(CalibrationFormatError, match="exceeds the limit of 11 rows"):
            read(content)
    with pytest.raises(CalibrationFormatError, match="has more than 12 entries in taxel2Repr"):
        monkeypatch.setattr(icub, "MAX_TAXELS", 12)
        read(icub_text(rows, "3 " * 13))
    monkeypatch.setattr(text, "MAX_TEXT_LINES", 12)
    with pytest.raises(CalibrationFormatError, match="its 14 lines exceed the limit of 12"):
        read(csv_text(ROUND))
    monkeypatch.setattr(text, "MAX_TEXT_BYTES", 100)
    with pytest.raises(CalibrationFormatError, match="bytes exceed the limit of 100"):
        read(csv_text(ROUND))


def test_moved_set_is_transformed():
    """Positions and directions are transformed; the name of the frame is removed."""
    taxels = TaxelSet(ROUND, OUTWARD, tuple("abcdefghijkl"), np.arange(12), "link", tangents=OUTWARD)
    moved = taxels.moved(matrix(90), np.array((1.0, 0, 0)))
    assert_allclose(moved.positions, ROUND @ matrix(90).T + (1, 0, 0), rtol=0, atol=1e-15)
    assert_allclose(moved.normals, OUTWARD @ matrix(90).T, rtol=0, atol=1e-12)
    assert_allclose(moved.tangents, OUTWARD @ matrix(90).T, rtol=0, atol=1e-12)
    assert moved.frame is None and moved.labels == taxels.labels
