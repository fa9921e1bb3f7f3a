"""Limits of proposals: an input just within passes, one just beyond does not."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.geometry import AcrossGrid, fit_surface
from skin_calib_addon.geometry.grid.axis import Axis
from skin_calib_addon.geometry.grid.grids import Sector, Tube, sector_frame
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh
from skin_calib_addon.proposal import skins
from skin_calib_addon.proposal.link_points import LinkPoints
from skin_calib_addon.proposal.links import plan_path
from skin_calib_addon.proposal.skins import parse_skin, skin_on
from skin_calib_addon.proposal.surfaces import bounded_region, propose_surfaces
from skin_calib_addon.proposal.trial import opened
from tests.shapes import sheet

UP = np.array((0.0, 0.0, 1.0))
Z_AXIS = Axis((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))


def plate(width, depth):
    """A flat plate with one side."""
    return sheet(lambda x, y: 0 * x, (width, depth))


def test_boundary_is_within_2_5_mm_of_a_rim():
    """A disc: the sites of the boundary are 2 mm apart."""
    angles, radius = np.deg2rad(2 * np.arange(180)), 0.04
    rim = radius * np.column_stack((np.cos(angles), np.sin(angles), 0 * angles))
    fan = np.array([(0, 1 + i, 1 + (i + 1) % 180) for i in range(180)])
    mesh = TriangleMesh(np.concatenate((np.zeros((1, 3)), rim)), fan)
    (found,) = propose_surfaces(mesh, LinkPoints.of(mesh))
    (loop,) = found.surface.grid.region.boundary
    assert np.abs(np.linalg.norm(loop, axis=1) - radius).max() < 2.5e-3


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


@pytest.mark.parametrize(("length", "is_kept"), [(100, True), (101, False)])
def test_names_of_100_characters_are_names_of_files(length, is_kept):
    """Longer ones end with a checksum."""
    path = plan_path(Path(), length * "a")
    assert (path.name == length * "a" + ".plan.json") == is_kept


def test_sheet_has_the_size_that_its_author_states():
    """Along either side of a plate of 100 x 80 mm; one that is too large is refused, with the size that fits."""
    fit = fit_surface(plate(0.1, 0.08), AcrossGrid(6, 6, tuple(UP), (1, 0, 0)))
    for size in ("4x6x10mm", "6x4x10mm"):
        skin, taxels = skin_on(parse_skin(f"sheet:{size}"), fit, "top")
        rows, columns = map(int, size.split("x")[:2])
        assert (skin.lattice.rows, skin.lattice.columns, len(taxels.ids)) == (rows, columns, rows * columns)
    with pytest.raises(InvalidPlan, match="The sheet has 9 x 9 cells, and [79] x [79] fit. State a smaller one."):
        skin_on(parse_skin("sheet:9x9x10mm"), fit, "top")


def test_sheet_that_does_not_lie_is_tried_across(monkeypatch):
    """Along the longer side, then across it; then the last problem is reported."""
    tried = []

    def refuse(skin, fit, number):
        tried.append(np.abs(skin.direction).round(1).tolist())
        raise InvalidPlan("folds")

    monkeypatch.setattr(skins, "place_skin", refuse)
    fit = fit_surface(plate(0.1, 0.08), AcrossGrid(6, 6, tuple(UP), (1, 0, 0)))
    with pytest.raises(InvalidPlan, match="folds"):
        skin_on(parse_skin("sheet:4x6x5mm"), fit, "top")
    assert tried == [[1, 0, 0], [0, 1, 0]]
