"""Readers of STL, PLY, OBJ and OFF: each form of a file gives the same mesh, or one line that says what is wrong."""

import struct

import numpy as np
import pytest
import trimesh

from skin_calib_addon.common.errors import InvalidMesh
from skin_calib_addon.geometry.mesh.polygons import triangulated
from skin_calib_addon.geometry.mesh.triangle_mesh import read_mesh, save_mesh, weld
from tests.shapes import cylinder

POINTS = [(x, y, z) for z in (0.0, 0.25) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1), (-0.5, 0.5))]
# A prism: two pentagons, four quadrilaterals, one of them as two triangles.
POLYGONS = [
    (4, 3, 2, 1, 0),
    (5, 6, 7, 8, 9),
    (0, 1, 6, 5),
    (1, 2, 7, 6),
    (2, 3, 8, 7),
    (3, 4, 9, 8),
    (4, 0, 5),
    (4, 5, 9),
]
COUNTS = [len(polygon) for polygon in POLYGONS]
PRISM = weld(POINTS, triangulated(np.array(POINTS), sum(POLYGONS, ()), COUNTS))


def text(rows, form="{}"):
    return "".join(" ".join(form.format(x) for x in row) + "\n" for row in rows)


def obj(corner="{}", vertex="v {} {} {}", first=1):
    faces = text([[p + first for p in polygon] for polygon in POLYGONS], corner)
    return "".join(vertex.format(*p) + "\n" for p in POINTS) + "".join(f"f {face}\n" for face in faces.splitlines())


def off(header="OFF\n10 8 0\n", more="", colour=""):
    return (
        header
        + "".join(f"{x} {y} {z}{more}\n" for x, y, z in POINTS)
        + text([(len(p), *p) for p in POLYGONS], "{}" + colour)
    )


def ply(order="<", count="uchar", index="int", number="float", newline=b"\n", name="vertex_indices"):
    """Write any form of PLY, with further properties of vertices and faces, and a further element."""
    code = dict(zip(["char", "uchar", "short", "ushort", "int", "uint", "float", "double"], "bBhHiIfd"))
    kind = {"<": "binary_little_endian", ">": "binary_big_endian", "": "ascii"}[order]
    header = f"""ply
format {kind} 1.0
comment end_header is below
element material 1
property uchar red
property list uchar short names
element vertex {len(POINTS)}
property {number} x
property uchar red
property {number} y
property {number} z
element face {len(POLYGONS)}
property uchar flags
property list {count} {index} {name}
property list uchar float texcoord
end_header
"""

    def pack(form, *values):
        return struct.pack(order + form, *values) if order else (" ".join(map(str, values)) + " ").encode()

    data = pack("BBhh", 7, 2, 1, 2)
    data += b"".join(pack(f"{code[number]}B2{code[number]}", x, 9, y, z) for x, y, z in POINTS)
    for polygon in POLYGONS:
        n = len(polygon)
        data += pack(f"B{code[count]}{n}{code[index]}B2f", 3, n, *polygon, 2, 0.5, 1.5)
    return header.replace("\n", newline.decode()).encode() + data


def stl(names=("a facet", "b"), case=str, ends=("endsolid",) * 2):
    """Write text: the faces in two solids."""
    half = len(PRISM.faces) // 2
    parts = []
    for name, end, faces in zip(names, ends, (PRISM.triangles[:half], PRISM.triangles[half:])):
        loops = ("".join(f"vertex {x!r} {y!r} {z!r}\n" for x, y, z in face.tolist()) for face in faces)
        facets = (f"facet normal nan 0 0\nouter loop\n{loop}endloop\nendfacet\n" for loop in loops)
        parts.append(f"solid {name}\n{''.join(facets)}{end} {name}\n")
    return case("".join(parts))


def binary_stl(begin=b"solid x", attribute=0x7FFF):
    faces = b"".join(struct.pack("<12fH", 0, 0, 0, *face.ravel(), attribute) for face in PRISM.triangles)
    return begin.ljust(80) + struct.pack("<I", len(PRISM.faces)) + faces


def relative():
    """Write an OBJ file in which each polygon is a group with its own vertices, and counts them from the last one."""
    lines = []
    for k, polygon in enumerate(POLYGONS):
        lines += [
            f"g part{k}",
            "usemtl red#1",
            *("v {} {} {}".format(*POINTS[i]) for i in polygon),
            "vt 0 0",
            "vn 0 0 1",
        ]
        lines.append("f " + " ".join(f"{i - len(polygon)}/-1/-1" for i in range(len(polygon))))
    return "\n".join(lines)


FORMS = {
    "obj": obj(),
    "obj, textures": obj("{}/1"),
    "obj, normals": obj("{}//1"),
    "obj, both": obj("{}/1/1"),
    "obj, weights": obj(vertex="v {} {} {} 1.0"),
    "obj, colours": obj(vertex="v {} {} {} 0.1 0.2 0.3"),
    "obj, comments": obj(vertex="v {} {} {} # a vertex") + "# the end\nl 1 2\np 1\ns off\n",
    "obj, lines go on": obj(vertex="v {} \\\n{} {}"),
    "obj, ends in a line that goes on": obj() + "f 10 10 10 \\",
    "obj, from the end": obj(first=-len(POINTS)),
    "obj, relative in groups": relative(),
    "off": off(),
    "off, small letters": off("off\n10 8 0\n"),
    "off, counts in the first line": off("OFF 10 8 0\n"),
    "off, no blank": off("OFF10 8 0\n"),
    "off, counts in lines of their own": off("OFF\n\n# many\n10\n8\n0\n"),
    "off, no edges": off("OFF\n10 8\n"),
    "off, comments": off("OFF # x\n10 8 0 # y\n", " # z"),
    "off, colours": off("COFF\n10 8 0\n", " 255 0 0 255"),
    "off, normals": off("NOFF\n10 8 0\n", " 0 0 1"),
    "ply, text": ply(""),
    "ply, little end": ply("<"),
    "ply, big end": ply(">"),
    "ply, other types": ply("<", "int", "ushort", "double", name="vertex_index"),
    "ply, elements without rows": ply().replace(b"element vertex", b"element edge 0\nelement none 9\nelement vertex"),
    "ply, signed": ply(">", "char", "short"),
    "ply, lines of Windows": ply("<", newline=b"\r\n"),
    "stl, two solids": stl(),
    "stl, capitals": stl(case=str.upper),
    "stl, binary with the header of text": binary_stl(),
    "stl, colours": binary_stl(b"COLOR=", 0x1234),
}


def written(folder, form, content):
    path = folder / f"x.{form.partition(',')[0]}"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize("form", FORMS)
def test_each_form_is_the_same_mesh(tmp_path, form):
    """To the bit."""
    mesh = read_mesh(written(tmp_path, form, FORMS[form]))
    np.testing.assert_array_equal(mesh.vertices, PRISM.vertices)
    assert sorted(mesh.face_areas) == pytest.approx(sorted(PRISM.face_areas)) and len(mesh.faces) == len(PRISM.faces)
    volume = (mesh.triangles[:, 0] * np.cross(mesh.triangles[:, 1], mesh.triangles[:, 2])).sum() / 6
    assert volume == pytest.approx(0.25 * 1.25)  # every face outwards, none missing


@pytest.mark.parametrize("form", [form for form, content in FORMS.items() if isinstance(content, str)])
@pytest.mark.parametrize("newline", ["\r\n", "\r"])
def test_text_may_have_other_line_ends_and_a_byte_order_mark(tmp_path, form, newline):
    path = written(tmp_path, form, "\ufeff" + FORMS[form].replace("\n", newline))
    assert len(read_mesh(path).faces) == len(PRISM.faces)


WRONG = {
    "obj, index 0": (obj(first=0), 'line 11 is no face of three or more vertices before it: "f 4 3 2 1 0"'),
    "obj, too far back": (obj(first=-11), "line 11 is no face of three or more"),
    "obj, too large": (obj(first=2), "A face refers to vertex 10, but the mesh has 10 vertices"),
    "obj, two corners": (obj() + "f 1 2\n", 'line 19 is no face of three or more vertices before it: "f 1 2"'),
    "obj, ends in a face that goes on": (obj() + "f 1 2 \\", "line 19 is no face of three or more"),
    "obj, no number": (obj() + "v 1,5 0 0\n", 'line 19 is no vertex of three coordinates: "v 1,5 0 0"'),
    "obj, surface": (obj() + "surf 0 1 0 1 1 2\n", 'line 19 has the element "surf", which is not supported'),
    "off, truncated": (off()[:-10], "10 vertices and 8 faces, but 17 lines follow; it is truncated, or"),
    "off, more": (off() + "3 0 1 2\n", "but 19 lines follow"),
    "off, four coordinates": (off("4OFF\n10 8 0\n", " 1"), 'it begins with "4OFF"; only text that begins with OFF'),
    "off, binary": (off("OFF BINARY\n10 8 0\n"), 'it begins with "OFF BINARY"'),
    "off, short face": (off().replace("\n5 4 3 2 1 0", "\n6 4 3 2 1 0"), "a face with less corners than it announces"),
    "off, no number": (off().replace("0.25", "0,25", 1), 'it has "0,25" instead of a number'),
    "ply, truncated": (ply()[:-1], "it is truncated: its header announces 8 rows of face; export it again"),
    "ply, truncated text": (ply("")[:-4], "it is truncated: its header announces 8 rows of face"),
    "ply, more": (ply() + b"\0", "it has more data than its header announces"),
    "ply, strips": (ply().replace(b"material", b"tristrip").replace(b"names", b"vertex_indices"), "element tristrip"),
    "ply, no x": (ply().replace(b"float x", b"float q"), "its vertices have no coordinate x"),
    "ply, type": (ply().replace(b"float x", b"long x"), 'its header has the unknown line "property long x"'),
    "ply, negative": (ply().replace(b"face 8", b"face -8"), 'unknown line "element face -8"'),
    "ply, twice": (ply().replace(b"float y", b"float x"), 'its header has the unknown line "property float x"'),
    "ply, form": (ply().replace(b"little_endian", b"middle"), 'unknown line "format binary_middle 1.0"'),
    "stl, tail": (binary_stl() + b"x" * 37, "it has 37 bytes after the 16 faces that its header announces"),
    "stl, cut": (binary_stl()[:-1], "it is truncated: its header announces 16 faces, but 15 were found"),
    "stl, cut text": (stl()[:-60], 'its face 16 is incomplete, or no triangle: "facet normal nan 0 0"'),
    "stl, no end": (
        stl(names=("a", ""), ends=("endsolid", "")),
        "it is truncated: it has no 'endsolid' after its 16 faces",
    ),
    "stl, quadrilateral": (
        stl().replace("endloop", "vertex 0 0 0\nendloop", 1),
        "its face 1 is incomplete, or no triangle",
    ),
    "stl, no number": (stl().replace("0.25", "0,25", 1), 'it has "0,25" instead of a number'),
}


@pytest.mark.parametrize("form", WRONG)
def test_what_is_wrong_is_one_line(tmp_path, form):
    """It says where, and nothing is left out without a word."""
    content, message = WRONG[form]
    path = written(tmp_path, form, content)
    with pytest.raises(InvalidMesh) as caught:
        read_mesh(path)
    assert message in str(caught.value) and "\n" not in str(caught.value) and str(caught.value).startswith("x.")


@pytest.mark.parametrize("kind", ["stl", "ply", "obj", "off", "stl_ascii", "ply_ascii"])
def test_same_mesh_as_the_general_reader(tmp_path, kind):
    """Files of trimesh that it reads correctly: to the bit, and in the order of the file."""
    mesh = cylinder(around=12, along=4)
    solid = trimesh.Trimesh(mesh.vertices.astype("f4"), mesh.faces, process=False)
    end = kind.partition("_")[0]
    path = tmp_path / f"tube.{end}"
    solid.export(path, **({"encoding": "ascii"} if kind == "ply_ascii" else {"file_type": kind}))
    raw = trimesh.load(path, process=False)
    assert read_mesh(path).sha256 == weld(raw.vertices, raw.faces).sha256


def test_own_ply_file_has_double_precision(tmp_path):
    mesh = cylinder(around=12, along=4)
    save_mesh(mesh, tmp_path / "tube.ply")
    assert read_mesh(tmp_path / "tube.ply").sha256 == mesh.sha256


L = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
SHAPES = {
    "L": (L, 3),
    "U": ([(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)], 7),
    "dart": ([(0, 0), (2, 1), (0, 2), (1, 1)], 1),
    "straight corners": ([(0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2), (0, 1)], 3),
    "hole with a bridge": ([(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)], 12),
}


@pytest.mark.parametrize("start", [0, 1, 2, 3])
@pytest.mark.parametrize("shape", SHAPES)
def test_concave_polygons_are_divided_without_overlap(shape, start):
    """In space, from any first corner and in both directions: the areas of the triangles are that of the polygon."""
    outline, area = SHAPES[shape]
    turned = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    points = np.column_stack((np.roll(outline, -start, axis=0), np.ones(len(outline)))) @ turned
    for corners in (np.arange(len(points)), np.arange(len(points))[::-1]):
        a, b, c = points[triangulated(points, corners, [len(points)]).T]
        normals = np.cross(b - a, c - a) / 2
        assert np.linalg.norm(normals, axis=1).sum() == pytest.approx(area)
        assert np.linalg.norm(normals.sum(axis=0)) == pytest.approx(area)


def test_polygon_that_crosses_itself_is_refused():
    points = np.array([(0, 0, 0), (2, 2, 0), (2, 0, 0), (0, 1, 0)])
    with pytest.raises(ValueError, match="a polygon of 4 corners that crosses itself"):
        triangulated(points, [0, 1, 2, 3], [4])


def test_polygons_without_area_are_left_out():
    """Points and edges, which OFF files may list as faces."""
    assert triangulated(np.eye(3), [0, 0, 1, 0, 1, 2], [1, 2, 3]).tolist() == [[0, 1, 2]]


def test_files_that_would_take_minutes_are_refused(tmp_path):
    """A polygon of 2001 corners; a file of 513 MiB without content."""
    angle = np.arange(2001) * 2 * np.pi / 2001
    with pytest.raises(ValueError, match="a polygon of 2001 corners"):
        triangulated(np.column_stack((np.cos(angle), np.sin(angle), 0 * angle)), np.arange(2001), [2001])
    path = tmp_path / "holes.stl"
    with path.open("wb") as file:
        file.truncate(513 << 20)
    with pytest.raises(InvalidMesh, match="more than 512 MiB"):
        read_mesh(path)
