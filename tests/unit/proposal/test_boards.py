"""Boards of different surfaces of a link: none is hidden, and no two overlap."""

from types import SimpleNamespace

import numpy as np
import pytest

from skin_calib_addon.geometry.mesh.triangle_mesh import weld
from skin_calib_addon.plan.skins import BoardSkin
from skin_calib_addon.proposal.boards import usable, with_cells
from skin_calib_addon.proposal.link_points import LinkPoints
from skin_calib_addon.skin.lattice import HexLattice
from tests.shapes import box

SIDE = 0.008


def flat_boards(shift):
    """Hexagons in the plane z = 0, as taxels."""
    lattice = HexLattice(SIDE, 0.0)
    cells = np.array([(q, r) for q in range(6) for r in range(4)])
    positions = np.column_stack((lattice.centres(cells), np.zeros(len(cells)))) + (*shift, 0)
    axes = (np.tile(axis, (len(cells), 1)) for axis in ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
    normals, tangents = axes
    corners = positions[:, None] + np.column_stack((lattice.corners, np.zeros(6)))
    return SimpleNamespace(
        ids=tuple(map(str, cells)),
        index=cells,
        positions_link=positions,
        normals_link=normals,
        tangents_link=tangents,
        corners_link=corners,
        ports=((None,) * 6,) * len(cells),
    )


def test_boards_of_two_skins_do_not_overlap_and_can_be_seen():
    """Polygons of another library do not overlap; boards below a cover plate are left out, and hardly any other."""
    shapely = pytest.importorskip("shapely")
    plate, cover = box((-0.05, -0.05, -0.004), (0.2, 0.15, 0)), box((-0.05, -0.05, 0.002), (0.04, 0.15, 0.004))
    mesh = weld(
        np.concatenate((plate.vertices, cover.vertices)),
        np.concatenate((plate.faces, cover.faces + len(plate.vertices))),
    )
    skins = [BoardSkin(name, HexLattice(SIDE, 0.0), "fill", (0, 0, 0), (1, 0, 0)) for name in "ab"]
    taxels = [flat_boards((0, 0)), flat_boards((0.03, 0.011))]
    kept = usable(mesh, LinkPoints.of(mesh), skins, taxels)
    shapes = [shapely.Polygon(c[:, :2]) for t, k in zip(taxels, kept) for c in t.corners_link[k]]
    areas = [a.intersection(b).area for i, a in enumerate(shapes) for b in shapes[:i]]
    assert max(areas) < 1e-3 * shapes[0].area
    for t, k in zip(taxels, kept):
        assert not k[t.positions_link[:, 0] < 0.035].any()
        assert with_cells(skins[0], t, k).count == k.sum()
    alone = usable(mesh, LinkPoints.of(mesh), skins[:1], taxels[:1])[0]
    assert alone[taxels[0].positions_link[:, 0] > 0.05].all()
    assert sum(map(np.sum, kept)) > alone.sum()
