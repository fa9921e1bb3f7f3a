"""COLLADA files: units, axes, nodes, damage and malice; trimesh's own reading of the scene is the independent truth."""

import sys

import numpy as np
import pytest

from skin_calib_addon.common.errors import InvalidMesh
from skin_calib_addon.geometry.mesh import expansion
from skin_calib_addon.geometry.mesh.triangle_mesh import read_mesh

pytest.importorskip("collada")
POINTS = "0 0 0 0.1 0 0 0 0.2 0 0 0 0.3"
FACES = "0 2 1 0 1 3 0 3 2 1 2 3"
GEOMETRY = """<geometry id="{name}"><mesh>
<source id="{name}-p"><float_array id="{name}-a" count="12">{points}</float_array><technique_common>
<accessor source="#{name}-a" count="4" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
</accessor></technique_common></source>
<vertices id="{name}-v"><input semantic="POSITION" source="#{name}-p"/></vertices>
{faces}</mesh></geometry>"""
POINT = '<input semantic="VERTEX" source="#{name}-v" offset="0"/>'
TRIANGLES = '<triangles count="4"><input semantic="VERTEX" source="#{name}-v" offset="0"/><p>{p}</p></triangles>'
FILE = """<?xml version="1.0"?>{before}
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="u" meter="{metre}"/><up_axis>{up}</up_axis></asset>{other}
<library_geometries>{geometries}</library_geometries>{nodes}
<library_visual_scenes><visual_scene id="scene">{scene}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#scene"/></scene></COLLADA>"""
INSTANCE = '<node>{at}<instance_geometry url="#a"/></node>'
CORNERS = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3]])


def geometry(name="a", points=POINTS, faces=TRIANGLES, p=FACES):
    return GEOMETRY.format(name=name, points=points, faces=faces.format(name=name, p=p))


def written(folder, before="", metre=1, up="Z_UP", other="", geometries=None, nodes="", scene=None, at=""):
    """Write a tetrahedron, with changes."""
    path = folder / "link.dae"
    scene = INSTANCE.format(at=at) if scene is None else scene
    geometries = geometry() if geometries is None else geometries
    parts = {"before": before, "metre": metre, "up": up, "other": other, "nodes": nodes}
    path.write_text(FILE.format(**parts, geometries=geometries, scene=scene))
    return path


def ordered(points):
    return points[np.lexsort(points.round(6).T[::-1])]


def vertices(path):
    """Return the vertices, sorted."""
    return ordered(read_mesh(path).vertices)


def test_tetrahedron(tmp_path):
    mesh = read_mesh(written(tmp_path))
    np.testing.assert_allclose(vertices(written(tmp_path)), ordered(CORNERS), atol=1e-8)
    a, b, c = mesh.triangles.transpose(1, 0, 2)
    np.testing.assert_allclose((a * np.cross(b, c)).sum() / 6, 0.1 * 0.2 * 0.3 / 6, rtol=1e-6)


@pytest.mark.parametrize("up", ["X_UP", "Y_UP", "Z_UP"])
@pytest.mark.parametrize("metre", [1, 0.01, 0.0254])
def test_unit_counts_and_up_axis_does_not(tmp_path, metre, up):
    """As in RViz and Gazebo."""
    np.testing.assert_allclose(vertices(written(tmp_path, metre=metre, up=up)), ordered(CORNERS * metre), rtol=1e-7)


def test_nodes_are_placed(tmp_path):
    """Translation, rotation, scale and matrix, nested, and a node that is instanced twice."""
    library = f'<library_nodes><node id="n">{INSTANCE.format(at="<scale>2 2 2</scale>")}</node></library_nodes>'
    turn = '<rotate>0 0 1 90</rotate><instance_node url="#n"/>'
    matrix = '<matrix>1 0 0 0 0 1 0 0 0 0 1 5 0 0 0 1</matrix><instance_node url="#n"/>'
    scene = f"<node><translate>1 0 0</translate><node>{turn}</node></node><node>{matrix}</node>"
    found = vertices(written(tmp_path, nodes=library, scene=scene))
    turned = CORNERS[:, [1, 0, 2]] * (-2, 2, 2) + (1, 0, 0)
    np.testing.assert_allclose(found, ordered(np.concatenate((turned, CORNERS * 2 + (0, 0, 5)))), atol=1e-6)


def test_polygons_are_split(tmp_path):
    """A quadrilateral is two triangles; lines are left out."""
    points = "0 0 0 1 0 0 1 1 0 0 1 0"
    quad = (
        '<polylist count="1"><input semantic="VERTEX" source="#{name}-v" offset="0"/><vcount>4</vcount><p>0 1 2 3</p>'
        '</polylist><lines count="1"><input semantic="VERTEX" source="#{name}-v" offset="0"/><p>0 2</p></lines>'
    )
    mesh = read_mesh(written(tmp_path, geometries=geometry(points=points, faces=quad)))
    assert len(mesh.faces) == 2 and mesh.face_areas.sum() == 1


QUAD = "0 0 0 1 0 0 1 1 0 0 1 0"
DART = "0 0 0 2 1 0 0 2 0 1 1 0"
PARTS = {
    "strip": (QUAD, f'<tristrips count="1">{POINT}<p>0 1 3 2</p></tristrips>', 2, 1),
    "strips": (QUAD, f'<tristrips count="2">{POINT}<p>0 1 3</p><p>3 1 2</p></tristrips>', 2, 1),
    "fan": (QUAD, f'<trifans count="1">{POINT}<p>0 1 2 3</p></trifans>', 2, 1),
    "polygons": (QUAD, f'<polygons count="2">{POINT}<p>0 1 2</p><p>2 3 0</p></polygons>', 2, 1),
    "concave": (DART, f'<polylist count="1">{POINT}<vcount>4</vcount><p>0 1 2 3</p></polylist>', 2, 1),
    "outline": (QUAD, TRIANGLES.replace("4", "1") + f'<linestrips count="1">{POINT}<p>0 1 2</p></linestrips>', 1, 0.5),
}


@pytest.mark.parametrize("case", PARTS)
def test_each_kind_of_faces(tmp_path, case):
    """All faces, each with its normal upwards."""
    points, part, faces, area = PARTS[case]
    mesh = read_mesh(written(tmp_path, geometries=geometry(points=points, faces=part, p="0 1 2")))
    assert len(mesh.faces) == faces and mesh.face_areas.sum() == pytest.approx(area)
    assert (mesh.face_normals[:, 2] == 1).all()


def test_defects_without_an_effect_on_the_shape_do_not_matter(tmp_path):
    """Materials, lights and images that are missing or damaged."""
    other = "<library_effects><effect/></library_effects><library_images><image/></library_images>"
    bind = '<bind_material><technique_common><instance_material symbol="m" target="#none"/></technique_common>'
    scene = f'<node><instance_geometry url="#a">{bind}</bind_material></instance_geometry></node>'
    scene += '<node><instance_light url="#none"/><instance_camera url="#none"/></node>'
    assert len(read_mesh(written(tmp_path, other=other, scene=scene)).faces) == 4


DOUBLING = "".join(
    f'<node id="n{k}"><instance_node url="#n{k - 1}"/><instance_node url="#n{k - 1}"/></node>' for k in range(1, 40)
)
LAUGHS = '<!DOCTYPE COLLADA [<!ENTITY a "1"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'
BAD = {
    "entities": ({"before": LAUGHS}, "it declares a document type, which may contain entities; remove it"),
    "external": ({"before": '<!DOCTYPE COLLADA SYSTEM "file:///etc/passwd">'}, "it declares a document type"),
    "nodes": (
        {"nodes": f'<library_nodes><node id="n0"/>{DOUBLING}</library_nodes>', "scene": '<instance_node url="#n39"/>'},
        "",
    ),
    "number": ({"geometries": geometry(points=POINTS.replace("0.2", "0.2x"))}, ""),
    "not finite": ({"geometries": geometry(points=POINTS.replace("0.2", "nan"))}, "vertices of a are not finite"),
    "fewer points": ({"geometries": geometry(points=POINTS[:-6])}, ""),
    "index": ({"geometries": geometry(p=FACES.replace("3", "9"))}, ""),
    "fewer faces": ({"geometries": geometry(p=FACES[:-6])}, "it announces 4 faces of a, but has 3"),
    "fewer strips": (
        {"geometries": geometry(faces=f'<tristrips count="2">{POINT}<p>0 1 2 3</p></tristrips>')},
        "it announces 2 strips or fans, but has 1",
    ),
    "polygon": (
        {"geometries": geometry(faces=f'<polylist count="1">{POINT}<vcount>4</vcount><p>0 1 2</p></polylist>')},
        "polygons of a are incomplete",
    ),
    "no geometry": ({"geometries": geometry("b")}, "Geometry #a not found"),
    "one of two": ({"geometries": geometry() + geometry("b", points="1 2")}, ""),
    "no face": ({"scene": "<node/>"}, "has no faces"),
    "unit": ({"metre": 0}, "degenerate"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_file_is_one_line(tmp_path, case):
    """Also where the reader would leave a part out without a word, and where a small file would fill the memory."""
    changes, words = BAD[case]
    if case == "nodes":
        changes = changes | {"scene": f"<node>{changes['scene']}</node>"}
        words = f"its scene has more than {expansion.MAX_NODES} nodes"
    with pytest.raises(InvalidMesh, match=f"link.dae.*{words}") as error:
        read_mesh(written(tmp_path, **changes))
    assert "\n" not in str(error.value)


def test_small_file_does_not_grow(tmp_path, monkeypatch):
    """Its geometry of four faces is there 9000 times."""
    monkeypatch.setattr(expansion, "MAX_REPEATED_FACES", 10_000)
    part, whole = 90 * '<instance_geometry url="#a"/>', 100 * '<instance_node url="#n"/>'
    nodes = f'<library_nodes><node id="n">{part}</node></library_nodes>'
    with pytest.raises(InvalidMesh, match="repeats parts"):
        read_mesh(written(tmp_path, nodes=nodes, scene=f"<node>{whole}</node>"))


def test_every_truncated_file_is_refused(tmp_path):
    """At 50 positions."""
    whole = written(tmp_path).read_bytes()
    for end in np.linspace(0, len(whole) - 12, 50).astype(int):
        (tmp_path / "cut.dae").write_bytes(whole[:end])
        words = "is not a valid DAE file" if end else "is empty"
        with pytest.raises(InvalidMesh, match=f"cut.dae {words}"):
            read_mesh(tmp_path / "cut.dae")


def test_without_the_package_the_message_states_how_to_install_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "collada", None)
    monkeypatch.delitem(sys.modules, "bpy", raising=False)  # of a test before
    with pytest.raises(
        InvalidMesh, match=r"link.dae cannot be read: this needs pycollada.*: pip install 'skin-calib.author"
    ):
        read_mesh(written(tmp_path))
