"""Diagnosis of a mesh: shapes whose parts, holes, edges and winding are known."""

import numpy as np
import pytest

from skin_calib_addon.common.warnings import Warning
from skin_calib_addon.geometry.mesh.defects import diagnose, edges_at
from skin_calib_addon.geometry.mesh.triangle_mesh import weld
from tests.shapes import RADIUS, Motion, box, cylinder, dome, keep, sheet, shuffled, together, turned, with_hole, wrist

BLOCK = box((0, 0, 0), (0.1, 0.05, 0.025))
INNER = box((-0.01, -0.01, 0.03), (0.01, 0.01, 0.07))
NEAR = box((0.05, -0.01, 0.03), (0.06, 0.01, 0.07))


def seen(mesh):
    """The diagnosis of a mesh that is welded already."""
    return diagnose(mesh.vertices, mesh.faces)


def findings(found):
    """Messages, and whether each is a warning."""
    return {finding.message: finding.severity == "warning" for finding in found.findings()}


def test_closed_box_is_sound():
    """One part without a hole; nothing matters and there is nothing to do."""
    found = seen(BLOCK)
    assert found.findings() == (
        Warning("mesh-size", "note", "12 faces, 100 x 50 x 25 mm"),
        Warning("parts", "note", "One connected part"),
        Warning("holes", "note", "No hole"),
    )
    assert (found.parts, found.inner, found.joined) == (1, 0, 1) and not len(found.edges())


def test_ends_of_a_tube_are_two_holes_of_known_length():
    """Open ends are reported without a warning; their lengths are those of the polygons."""
    found = seen(cylinder(around=24, along=5))
    round_it = 24 * 2 * RADIUS * np.sin(np.pi / 24)
    np.testing.assert_allclose(found.holes(), [round_it, round_it], rtol=1e-12)
    assert (
        len(found.edges()) == 48
        and findings(found)[f"2 holes, circumference {round_it * 1e3:.4g}, {round_it * 1e3:.4g} mm"] is False
    )


def test_hole_in_the_skin_matters():
    """A third rim is not an end of a tube."""
    found = seen(with_hole(wrist(), (0.0375, 0.0, 0.05), 0.008))
    assert len(found.holes()) == 3 and [m for w, m in findings(found).items() if "holes" in w] == [True]


def test_inner_part_is_counted_and_its_holes_are_not():
    """A servo inside the tube, without its lid, and a bracket next to it."""
    open_box = keep(INNER, lambda centres: centres[:, 2] < 0.07 - 1e-9)
    found = seen(together(cylinder(), open_box, NEAR))
    assert (found.parts, found.inner) == (3, 1)
    assert len(found.holes()) == 2 and found.seen.sum() == len(cylinder().faces) + 12
    assert "3 connected parts, 1 of them mostly within the convex hull of others" in findings(found)


def test_part_in_front_of_a_hollow_side_is_not_said_to_be_inside():
    """A block in the notch of an L is outside, but within the hull: as the cover, the finding is about the hull."""
    bracket = together(box((0, 0, 0), (0.1, 0.02, 0.05)), box((0, 0.021, 0), (0.02, 0.1, 0.05)))
    found = seen(together(bracket, box((0.03, 0.03, 0.02), (0.04, 0.04, 0.03))))
    (about,) = [finding for finding in found.findings() if finding.code == "parts"]
    assert about.message == "3 connected parts, 1 of them mostly within the convex hull of others"
    assert about.advice.startswith("Outer leaves these out, also where they can be seen.")


def test_holes_that_touch_are_one():
    """Two missing faces with a common corner are one opening; two without are two."""
    mesh = dome()
    middle = np.linalg.norm(mesh.vertices - (0.05, 0.04, 0.02), axis=1).argmin()
    around = np.flatnonzero((mesh.faces == middle).any(axis=1))
    touching = next(f for f in around[1:] if len(np.intersect1d(mesh.faces[f], mesh.faces[around[0]])) == 1)
    apart = np.linalg.norm(mesh.triangles.mean(axis=1) - (0.02, 0.04, 0.02), axis=1).argmin()
    for other, holes in ((touching, 1), (apart, 2)):
        found = diagnose(mesh.vertices, np.delete(mesh.faces, [around[0], other], axis=0))
        assert len(found.holes()) == holes + 1  # and the rim of the dome


def test_edge_of_three_faces_splits_parts():
    """A fin on a box: its edge joins none of its three faces, and the fin is a part of its own."""
    fin = weld([[0, 0, 0.025], [0.1, 0, 0.025], [0.05, 0, 0.05]], [[0, 1, 2]])
    found = seen(together(BLOCK, fin))
    assert found.mesh.vertices[found.branching[0]].tolist() == [[0, 0, 0.025], [0.1, 0, 0.025]]
    assert (len(found.branching), found.parts, found.joined) == (1, 2, 1)
    assert findings(found)["1 edge with more than two faces"] is True


def test_edge_of_four_faces_that_splits_nothing_does_not_matter():
    """A tube that is pinched till two opposite edges meet is one part all the same."""
    tube = cylinder(around=24, along=5)
    x, y, z = tube.vertices.T
    pinched = (np.abs(y) < 1e-9) & (z > 0.01) & (z < 0.06)
    assert pinched.sum() == 4
    found = diagnose(np.where(pinched[:, None], (0, 0, 1) * tube.vertices, tube.vertices), tube.faces)
    assert (len(found.branching), found.parts, found.joined) == (1, 1, 1)
    assert findings(found)["1 edge with more than two faces"] is False


@pytest.mark.parametrize("seed", [0, 1])
def test_turned_faces_are_found(seed):
    """Whichever they are, as long as they are the lesser part; turned over, all is well."""
    mesh = wrist()
    chosen = np.random.default_rng(seed).random(len(mesh.faces)) < 0.2
    invalid = turned(mesh, chosen)
    found = seen(invalid)
    assert found.flipped.sum() == chosen.sum() and found.inward == ()
    assert findings(found)[f"{chosen.sum()} faces with a flipped normal"] is True
    assert not seen(turned(invalid, found.flipped)).flipped.any()


TURNED = {"box": BLOCK, "tube": cylinder(), "wrist": wrist()}


@pytest.mark.parametrize("name", TURNED)
def test_part_that_looks_inward_is_found(name):
    """Closed or open, in any position; with correct normals there is no finding."""
    mesh = Motion(3).mesh(TURNED[name])
    assert seen(mesh).inward == ()
    inward = seen(turned(mesh, np.ones(len(mesh.faces), bool)))
    assert inward.inward == (0,) and not inward.flipped.any() and findings(inward)["1 part with inward normals"] is True


def test_flat_part_faces_neither_side():
    """The sides of a plate are indistinguishable, and those of a slightly bent one nearly so."""
    for plate in (sheet(lambda x, y: 0 * x), dome()):
        assert seen(plate).inward == seen(turned(plate, np.ones(len(plate.faces), bool))).inward == ()


def test_inner_part_may_face_either_side():
    """The wall of a cavity looks inward, and rightly."""
    cavity = turned(INNER, np.ones(12, bool))
    found = seen(together(cylinder(), cavity))
    assert found.inward == () and found.inner == 1 and not found.flipped.any()


def test_moebius_strip_has_one_side():
    """No winding is right; no face is blamed."""
    n = 40
    angle = 2 * np.pi * np.arange(n) / n
    direction = np.column_stack((np.cos(angle), np.sin(angle), 0 * angle))
    across = np.cos(angle / 2)[:, None] * direction + np.sin(angle / 2)[:, None] * (0, 0, 1.0)
    ends = np.stack((0.05 * direction - 0.01 * across, 0.05 * direction + 0.01 * across), axis=1).reshape(-1, 3)
    i = np.arange(n)
    a, b, c, d = 2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 3
    c[-1], d[-1] = 1, 0  # half a turn
    found = diagnose(ends, np.concatenate((np.column_stack((a, b, c)), np.column_stack((b, d, c)))))
    assert found.one_sided == 1 and not found.flipped.any() and len(found.holes()) == 1
    assert findings(found)["1 part with one side only"] is True


def test_faces_without_use_are_counted():
    """Two equal corners, repeated, as thin as a line, back to back."""
    corners = [*BLOCK.vertices.tolist(), [0.05, 0.0, 0.0], [0, 0, 0]]
    edge = [BLOCK.vertices.tolist().index(p) for p in ([0, 0, 0], [0.1, 0, 0])]
    faces = BLOCK.faces.tolist()
    useless = [[faces[0][1], faces[0][2], faces[0][0]], [8, 9, edge[0]], [*edge, 8], faces[0][::-1]]
    found = diagnose(corners, [*faces, *useless])
    assert (found.dropped, found.flat, found.doubled.sum()) == (2, 1, 2)
    said = findings(found)
    assert said["2 faces without area or repeated, left out"] is False and said["2 faces back to back"] is True


@pytest.mark.parametrize("fraction, matters", [(0.007, False), (0.014, True)])
def test_doubled_faces_matter_from_one_percent_of_the_area(fraction, matters):
    """Some of many equal faces are there twice, back to back: 0.7 or 1.4 % of the area."""
    mesh = cylinder()
    count = round(fraction * len(mesh.faces) / 2)
    found = diagnose(mesh.vertices, np.concatenate((mesh.faces, mesh.faces[:count, ::-1])))
    assert found.doubled.sum() == 2 * count
    assert findings(found)[f"{2 * count} faces back to back"] == matters


def test_diagnosis_does_not_see_the_order():
    """Vertices and faces in any order: the same words."""
    mesh = together(with_hole(cylinder(around=48, along=20), (RADIUS, 0.0, 0.05), 0.008), INNER)
    vertices, faces = shuffled(mesh, 0)
    assert diagnose(vertices, faces).findings() == seen(mesh).findings()


def test_edges_are_found_again_where_they_lie():
    """In either direction, among vertices that lie twice in one place; ends that are near are not the same."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [-0.0, 1, 0], [1, 0, 0], [1, 1e-9, 0]])
    edges = np.array([[0, 1], [2, 0], [3, 0], [0, 4], [1, 2], [1, 3]])
    places = np.array([[[1, 0, 0], [0, -0.0, 0]], [[0, 1, 0], [0, 0, 0]]])
    assert edges_at(places, vertices, edges).tolist() == [True, True, True, False, False, False]
    assert not edges_at(np.empty((0, 2, 3)), vertices, edges).any()
