"""Hand-placed planes in a scene: placed, changed in lists, sketched; an axis through two sections."""

import json

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose

from skin_calib_addon.geometry.mesh.clustering import COARSE_FACES
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh
from tests.blender.conftest import look
from tests.shapes import box, together


@pytest.fixture
def placed(bpy, link):
    """Return a link with hand-placed planes."""
    bpy.ops.skin_calib.planes_place()
    return bpy.context.object


def points(listed):
    """Return the points of the planes of a list."""
    return np.array([tuple(plane.point) for plane in listed])


def test_placed_planes_are_those_of_the_grid(bpy, placed, fit_scene):
    """Their number is the same, they are closed, and a fit along them is as good."""
    grid = placed.skin_calib.grid
    assert (grid.kind, grid.closed, len(grid.u), len(grid.v)) == ("planes", True, 5, 6)
    table = json.loads(fit_scene())
    assert table["surfaces"][0]["errors"]["surface_to_mesh"]["mean"] < 2e-4
    with pytest.raises(RuntimeError, match="placed by hand already"):
        bpy.ops.skin_calib.planes_place()


def test_lists_are_changed_by_buttons_each_in_one_step(bpy, placed):
    """Planes are added, spread, mirrored and removed; undo restores each step."""
    grid = placed.skin_calib.grid
    seen = [points(grid.u)]
    grid.u_index = 1
    bpy.ops.ed.undo_push(message="start")
    for name, words in [
        ("plane_add", {}),
        ("planes_spread", {}),
        ("planes_mirror", {}),
        ("plane_remove", {"index": 0}),
    ]:
        assert getattr(bpy.ops.skin_calib, name)("EXEC_DEFAULT", True, family="u", **words) == {"FINISHED"}
        seen.append(points(bpy.context.object.skin_calib.grid.u))
    assert_allclose(seen[1][2], (seen[0][1] + seen[0][2]) / 2, atol=1e-7)
    assert_allclose(np.diff(seen[2][:, 2], 2), 0, atol=1e-6)
    assert len(seen[3]) == 5 and len(seen[4]) == 4
    for expected in reversed(seen[:4]):
        bpy.ops.ed.undo()
        assert_allclose(points(bpy.context.object.skin_calib.grid.u), expected)


def test_point_of_the_link_adds_and_removes_planes(bpy, link, fit_scene):
    """The grid becomes planes by hand; the new ones go through the point, and the fit has them; each is one step."""
    place = (0.0, 0.03, 0.047)
    bpy.ops.ed.undo_push(message="start")
    assert bpy.ops.skin_calib.plane_place("EXEC_DEFAULT", True, family="u", point=place) == {"FINISHED"}
    grid = bpy.context.object.skin_calib.grid
    assert (grid.kind, len(grid.u), len(grid.v)) == ("planes", 6, 6)
    new = grid.u[grid.u_index]
    assert abs(np.dot(np.subtract(place, new.point), new.normal)) < 1e-7 and (np.diff(points(grid.u)[:, 2]) > 0).all()
    assert bpy.ops.skin_calib.plane_place("EXEC_DEFAULT", True, family="v", point=place) == {"FINISHED"}
    grid = bpy.context.object.skin_calib.grid
    new = grid.v[grid.v_index]
    assert len(grid.v) == 7 and bpy.context.object.skin_calib.held == "V"
    assert abs(np.dot(np.subtract(place, new.point), new.normal)) < 1e-7
    assert json.loads(fit_scene())["surfaces"][0]["errors"]["surface_to_mesh"]["mean"] < 2e-4
    for count in (7, 6):
        assert len(bpy.context.object.skin_calib.grid.v) == count
        bpy.ops.ed.undo()
    assert bpy.context.object.skin_calib.grid.kind == "tube"


def test_first_plane_is_at_the_cursor(bpy, link):
    """An empty list can be filled; operators on planes report an empty list."""
    grid = link.skin_calib.grid
    with pytest.raises(RuntimeError, match="Place the planes by hand first"):
        bpy.ops.skin_calib.plane_add(family="u")
    grid.kind = "planes"
    for name in ("planes_spread", "planes_mirror"):
        with pytest.raises(RuntimeError, match="no v-planes yet"):
            getattr(bpy.ops.skin_calib, name)(family="v")
    bpy.context.scene.cursor.location = (0.01, 0.02, 0.03)
    for family in "uv":
        bpy.ops.skin_calib.plane_add(family=family)
        assert_allclose(points(getattr(grid, family)), [(0.01, 0.02, 0.03)], atol=1e-7)
    with pytest.raises(RuntimeError, match="There is no u-plane 4"):
        bpy.ops.skin_calib.plane_remove(family="u", index=4)


def test_wrong_planes_are_reported_while_they_are_placed(bpy, placed, updates, state_of):
    """A plane can miss the mesh, be twice there, or have no normal; a cut can remove all or nothing."""
    grid = placed.skin_calib.grid
    look(updates)
    sketch = state_of(placed).sketch
    assert not sketch.wrong and {("U", 4), ("V", 5)} < sketch.arms.keys()
    grid.u[4].point[2] += 1
    grid.v[0].normal = (0, 0, 0)
    grid.u[3].point = tuple(grid.u[1].point)
    for point, normal in [((0, 0, 1), (0, 0, 1)), ((0, 0, -1), (0, 0, 1))]:
        bpy.ops.skin_calib.cut_add()
        cut = placed.skin_calib.cover.cuts[-1]
        cut.point, cut.normal = point, normal
    look(updates)
    wrong = state_of(placed).sketch.wrong
    assert wrong["U", 4].startswith("misses the mesh; distance 9") and wrong["V", 0] == "has a normal of length zero"
    assert wrong["U", 3] == "does not follow u-plane 1, or is the same"
    assert wrong["CUT", 0] == "removes the complete mesh. Flip its normal"
    assert wrong["CUT", 1].startswith("removes nothing; distance 1")


def test_planes_of_a_partial_section_are_in_order_as_in_the_fit(bpy, link, updates, state_of):
    """Where a cut removes a part of a section, its middle moves to the side; planes that the fit takes are not red."""
    bpy.ops.skin_calib.cut_add()
    cut = link.skin_calib.cover.cuts[-1]
    cut.point, cut.normal = (0, 0, 0.06), (0, 0, 1)
    bpy.ops.skin_calib.planes_place()
    look(updates)
    assert state_of(link).sketch.wrong == {}
    assert bpy.ops.skin_calib.fit() == {"FINISHED"}


def test_face_of_a_closed_mesh_keeps_its_grid(bpy, plan_file, tmp_path):
    """Planes do not say which side of a closed mesh is meant; the grid that fits stays, and the reason says so."""
    face = {"kind": "patch", "n": 6, "lines": 6, "normal": [0, 0, 1], "margin": 0.004}
    path, mesh = plan_file("pad", grid=face, skins=[]), box((0.0, 0.0, 0.0), (0.06, 0.05, 0.02))
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(tmp_path / "pad.stl")
    bpy.ops.skin_calib.import_plan(filepath=str(path))
    assert bpy.ops.skin_calib.fit() == {"FINISHED"}
    for operator, words in ((bpy.ops.skin_calib.planes_place, {}), (bpy.ops.skin_calib.plane_place, {"family": "u"})):
        with pytest.raises(RuntimeError, match="The mesh has faces on both sides of the planes. Cut it so that one"):
            operator(**words)
    plan = bpy.context.object.skin_calib
    assert plan.grid.kind == "across" and not plan.grid.u and not plan.result.outdated


def test_cut_shows_the_removed_part(bpy, addon, updates, link, state_of):
    """Red triangles are on the far side of the plane only."""
    bpy.ops.skin_calib.cut_add()
    cut = link.skin_calib.cover.cuts[0]
    cut.point, cut.normal = (0, 0, 0.06), (0, 0, -1)
    look(updates)
    removed = next(a for a in state_of(link).sketch.layers if a.colours is not None)
    assert removed.points[:, 2].min() > 0.06 - 1e-6 and removed.points[:, 2].max() > 0.09
    bpy.ops.skin_calib.cut_remove(index=0)
    look(updates)
    assert state_of(link).sketch is None


def test_axis_goes_through_two_sections(bpy, link):
    """Given points replace clicks; the axis points from the first section to the second."""
    grid, vertices = link.skin_calib.grid, points_of(link)
    low, high = (vertices[np.argmin(np.abs(vertices[:, 2] - z))] for z in (0.04, 0.08))
    bpy.ops.skin_calib.axis_from_sections(first=low, second=high)
    assert not grid.auto_axis and grid.direction[2] > 0.99
    bpy.ops.skin_calib.axis_from_sections(first=high, second=low)
    assert grid.direction[2] < -0.99
    before = tuple(grid.point), tuple(grid.direction)
    with pytest.raises(RuntimeError, match="further apart"):
        bpy.ops.skin_calib.axis_from_sections(first=low, second=low)
    assert (tuple(grid.point), tuple(grid.direction)) == before


def points_of(link):
    """Return the vertices of the link's mesh, in metres in its frame."""
    return np.array([tuple(vertex.co) for vertex in link.data.vertices])


@pytest.mark.parametrize("coarse", [False, True])
def test_sketch_draws_what_is_removed_by_each_choice_of_the_shell(bpy, coarse):
    """A box in a box, cut in half: only "all" keeps the inner one, and "seen" removes it before the cut.

    While the cut moves, the faces it removes are those of a coarse mesh.
    """
    from skin_calib_addon.blender.live.sketch import sketch_of
    from skin_calib_addon.blender.scene.plane_lists import HandPlanes

    inner, outer = box((-0.01,) * 3, (0.01,) * 3), box((-0.04,) * 3, (0.04,) * 3)
    if coarse:
        for _ in range(6):
            outer = TriangleMesh(*trimesh.remesh.subdivide(outer.vertices, outer.faces))
    mesh = together(outer, inner)
    planes = {"CUT": (((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),), "U": (), "V": ()}
    removed = {}
    for shell in ("outer", "seen", "all"):
        layers = sketch_of(mesh, HandPlanes(planes, shell, True), coarse).layers
        (faces,) = [layer.points for layer in layers if layer.colours is not None]
        assert not coarse or len(faces) / 3 < COARSE_FACES < len(mesh.faces) / 4
        sides = np.float64(faces).reshape(-1, 3, 3)
        removed[shell] = (
            np.linalg.norm(np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]), axis=1).sum() / 2
        )
    half, exact = mesh.face_areas.sum() / 2, 0.03 if coarse else 1e-6  # clusters take the corners away
    np.testing.assert_allclose(removed["all"], half, rtol=exact)
    np.testing.assert_allclose(removed["outer"], half + inner.face_areas.sum() / 2, rtol=exact)
    np.testing.assert_allclose(removed["seen"], removed["outer"], rtol=1e-6)
