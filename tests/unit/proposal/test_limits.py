"""Limits of proposals: an input just within passes, one just beyond does not.

The numbers are written out, so that a limit does not change unnoticed.
"""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.geometry import AcrossGrid, fit_surface
from skin_calib_addon.geometry.grid.axis import Axis
from skin_calib_addon.geometry.grid.grids import Across, Sector, Tube, sector_frame
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh
from skin_calib_addon.geometry.mesh.visibility import view_frames
from skin_calib_addon.proposal import skins
from skin_calib_addon.proposal.candidates import Candidate, face_directions
from skin_calib_addon.proposal.link_points import LinkPoints
from skin_calib_addon.proposal.links import plan_path
from skin_calib_addon.proposal.proposal import propose_link, propose_twin
from skin_calib_addon.proposal.skins import parse_skin, skin_on
from skin_calib_addon.proposal.surfaces import bounded_region, propose_surfaces
from skin_calib_addon.proposal.trial import opened, region_size, whole
from skin_calib_addon.robot.keep_out import KeepOut
from skin_calib_addon.robot.mirrored import Twin
from skin_calib_addon.robot.urdf import Robot
from tests.shapes import box, sheet, subdivided, together, welded

UP = np.array((0.0, 0.0, 1.0))
Z_AXIS = Axis((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))


def tilted(degrees, around=(1.0, 0.0, 0.0), towards=UP):
    """A unit vector at an angle to another one."""
    side = np.cross(towards, around)
    angle = np.deg2rad(degrees)
    return np.cos(angle) * np.asarray(towards) + np.sin(angle) * side / np.linalg.norm(side)


def points_with(normals):
    """Points of a link with these normals, of 1 m^2 each."""
    normals = np.array(normals, float)
    count = len(normals)
    nothing = np.zeros((2, count), bool)
    return LinkPoints(0 * normals, normals, np.ones(count), float(count), np.ones(count, bool), *nothing, 0 * normals)


def plate(width, depth):
    """A flat plate with one side."""
    return sheet(lambda x, y: 0 * x, (width, depth))


def test_rays_at_60_degrees_to_a_normal_can_cover_its_point():
    """Of two points with 59 and 61 degrees, the bound has one."""
    assert Candidate(Across(normal=(0, 0, 1)), "").bound(points_with((tilted(59), tilted(61)))) == 1.0


def test_24_directions_of_faces_are_tried():
    """A ball has many more."""
    half = view_frames()[:, 2]
    assert len(face_directions(points_with(np.concatenate((half, -half))))) == 24


@pytest.mark.parametrize(("degrees", "together"), [(24, True), (26, False)])
def test_faces_within_25_degrees_of_a_direction_give_their_mean(degrees, together):
    """Two faces at equal angles to a direction that is tried."""
    direction = view_frames()[7, 2]
    found = face_directions(points_with([tilted(sign * degrees, towards=direction) for sign in (-1, 1)]))
    assert bool(found[0] @ direction > np.cos(np.deg2rad(1))) == together


@pytest.mark.parametrize(("degrees", "is_one"), [(15, True), (17, False)])
def test_directions_within_8_degrees_are_tried_once(degrees, is_one):
    """Two faces and their mean, which comes first and is half of the angle from both."""
    assert (len(face_directions(points_with([tilted(0), tilted(degrees)]))) == 1) == is_one


def test_points_of_a_link_are_2_5_mm_apart():
    """By the mean area of a point; the faces are larger."""
    corners = np.array(((0, 0, 0), (0.1, 0, 0), (0.1, 0.08, 0), (0, 0.08, 0)), float)
    on = LinkPoints.of(TriangleMesh(corners, np.array(((0, 1, 2), (0, 2, 3)))))
    assert 2.0e-3 < np.sqrt(on.areas.mean()) < 3.0e-3


@pytest.mark.parametrize(("depth", "is_open"), [(0.02, True), (0.04, False)])
def test_points_with_a_fifth_of_the_view_are_in_the_open(depth, is_open):
    """In the middle of the bottom of a groove of 11 mm: its walls leave the sine of the angle to its edges."""
    low = -depth - 0.01
    walls = [box((x, 0, low), (x + 0.02, 0.08, 0)) for x in (0.0, 0.031)]
    x, y, z = LinkPoints.of(together(box((0, 0, low), (0.05, 0.08, -depth)), *walls)).points.T
    bottom = (np.abs(z + depth) < 1e-6) & (np.abs(x - 0.0255) < 0.002) & (np.abs(y - 0.04) < 0.02)
    assert bottom.any() == is_open


def test_boundary_is_within_2_5_mm_of_a_rim():
    """A disc: the sites of the boundary are 2 mm apart."""
    angles, radius = np.deg2rad(2 * np.arange(180)), 0.04
    rim = radius * np.column_stack((np.cos(angles), np.sin(angles), 0 * angles))
    fan = np.array([(0, 1 + i, 1 + (i + 1) % 180) for i in range(180)])
    mesh = TriangleMesh(np.concatenate((np.zeros((1, 3)), rim)), fan)
    (found,) = propose_surfaces(mesh, LinkPoints.of(mesh))
    (loop,) = found.surface.grid.region.boundary
    assert np.abs(np.linalg.norm(loop, axis=1) - radius).max() < 2.5e-3


def test_planes_and_lines_are_12_mm_apart():
    """Over a plate of 100 x 70 mm: 9 and 6 steps, and 3 for a cubic."""
    mesh = plate(0.1, 0.07)
    parametrization = whole(Across(normal=(0.0, 0.0, 1.0)), mesh)
    assert sorted(region_size(parametrization, LinkPoints.of(mesh))) == [6 + 3, 9 + 3]


@pytest.mark.parametrize(("width", "stays"), [(8, False), (12, True)])
def test_parts_narrower_than_10_mm_are_left_out(width, stays):
    """A strip of sites that are a millimetre apart."""
    points = np.stack(np.meshgrid(1e-3 * np.arange(60), 1e-3 * np.arange(60), [0.0], indexing="ij"), -1)[:, :, 0]
    mask = np.zeros((60, 60), bool)
    mask[20 : 20 + width] = True
    assert opened(mask, points, False).any() == stays


@pytest.mark.parametrize(("width", "stays"), [(2, False), (8, True)])
def test_narrow_parts_next_to_wide_ones_are_inside_the_boundary(width, stays):
    """A tongue of 30 mm at a plate."""
    wide, tongue = plate(0.06, 0.05), plate(0.03, 1e-3 * width)
    vertices = np.concatenate((wide.vertices, tongue.vertices + (0.06, 0.02, 0.0)))
    mesh = TriangleMesh(vertices, np.concatenate((wide.faces, tongue.faces + len(wide.vertices))))
    on = LinkPoints.of(mesh)
    (found,) = propose_surfaces(mesh, on)
    end = on.points[:, 0] > 0.08
    assert found.covered[end].mean() == pytest.approx(0.8 if stays else 0.0, abs=0.2)


@pytest.mark.parametrize(("size", "count"), [((0.016, 0.03), 0), ((0.018, 0.03), 1)])
def test_surface_of_5_cm2_is_proposed(size, count):
    """A plate of 4.8 cm^2 has none, one of 5.4 cm^2 has one."""
    mesh = plate(*size)
    assert len(propose_surfaces(mesh, LinkPoints.of(mesh))) == count


@pytest.mark.parametrize(("degrees", "is_sector"), [(5.9, False), (6.1, True)])
def test_sector_continues_3_degrees_beyond_its_part_of_a_tube(degrees, is_sector):
    """A part with a gap of less than both is a full turn."""
    turn = np.deg2rad(360 - degrees)
    angles = np.linspace(0, turn, 4000)
    frame = sector_frame(Z_AXIS)
    points = 0.04 * frame.rays(angles)
    trial = SimpleNamespace(points=points[None], good=np.ones((1, len(points)), bool), parametrization=None)
    region = bounded_region(Tube(Z_AXIS), trial, ())
    assert isinstance(region, Sector) == is_sector
    if is_sector:
        assert np.rad2deg(region.stop - region.start) == pytest.approx(360 - degrees + 2 * 3, abs=0.01)


@pytest.mark.parametrize(("area", "is_enough"), [(29.5e-4, False), (30.5e-4, True)])
def test_link_with_30_cm2_gets_skin(area, is_enough):
    """A cube."""
    side = float(np.sqrt(area / 6))
    proposal = propose_link("a", box((0, 0, 0), 3 * (side,)), Path("a.ply"), "m", parse_skin("hexagons:8mm"))
    assert (not proposal.reasons[-1].startswith("Less than 30 cm^2")) == is_enough


@pytest.mark.parametrize(("factor", "is_twin"), [(1.08, True), (1.13, False), (0.93, True), (0.88, False)])
def test_twin_has_nine_tenths_of_the_free_area(factor, is_twin):
    """As if the former link had more or less."""
    mesh, choice = subdivided(subdivided(welded(box((0, 0, 0), (0.06, 0.05, 0.04))))), parse_skin("sheet:2x2x10mm")
    former = propose_link("a", mesh, Path("a.ply"), "m", choice)
    found = propose_twin(
        replace(former, free=factor * former.free),
        Twin("a", np.eye(4), 0.0),
        "b",
        mesh,
        Path("a.ply"),
        choice,
        KeepOut(Robot("robot.urdf", {"b": ()}, "robot", {}), {"b": mesh}),
    )
    assert (found is not None) == is_twin


@pytest.mark.parametrize(("length", "is_kept"), [(100, True), (101, False)])
def test_names_of_100_characters_are_names_of_files(length, is_kept):
    """Longer ones end with a checksum."""
    path = plan_path(Path(), length * "a")
    assert (path.name == length * "a" + ".plan.json") == is_kept


def test_sheet_that_does_not_lie_is_tried_with_three_quarters(monkeypatch):
    """Of its rows and columns, again and again, down to one cell; then the last problem is reported."""
    tried = []

    def refuse(skin, fit, number):
        tried.append((skin.lattice.rows, skin.lattice.columns))
        raise InvalidPlan("folds")

    monkeypatch.setattr(skins, "place_skin", refuse)
    fit = fit_surface(plate(0.1, 0.08), AcrossGrid(6, 6, tuple(UP), (1, 0, 0)))
    with pytest.raises(InvalidPlan, match="folds"):
        skin_on(parse_skin("sheet:4x8x5mm"), fit, "top")
    assert [tuple(sorted(size)) for size in tried] == [(4, 8), (3, 6), (2, 4), (1, 3), (1, 2), (1, 1)]
