"""Skins on real robot links; they are not part of the project, so the tests run where the data lies."""

from dataclasses import replace

import numpy as np
import pytest

from skin_calib_addon.common.errors import InvalidPlan, SkinCalibError
from skin_calib_addon.geometry import AcrossGrid, AutoGrid, CoverSpec, TubeGrid, cut_cover, fit_grid, load_mesh
from skin_calib_addon.geometry.surface.distance import MeshDistance, closest_on_triangles
from skin_calib_addon.skin import HexLattice, SheetLattice, board_taxels, lay_boards, sheet_taxels, wrap_sheet
from tests.real.test_real_links import DATA, FACES, MESHES, fit_of

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not MESHES, reason=f"no real links here: {DATA} has no STL file"),
]

# Links without room for a board of 2 cm: pins all over a palm.
CROWDED = {"g1_left_palm_force_sensor"}
NARROW = {"talos_arm_5_forearm"}  # sections go all round for 14 mm of it: too little for boards of 2 cm, or just enough
STEEP = 0.5  # cosine to the nearest face below which that may be a wall
NEAR = 0.5e-3  # [m] a taxel nearer to the mesh has its nearest face under it


def flipped(taxels, fit, path):
    """Taxels over the mesh whose normal looks into it."""
    trusted = fit.is_trusted(taxels.uv)
    if path.stem in FACES:  # with walls and edges beside the surface, the author's direction is what counts
        looks = taxels.normals_link @ FACES[path.stem]
    else:
        distance, face, _ = MeshDistance(fit.mesh)(taxels.positions_link)
        trusted &= distance < NEAR
        looks = (taxels.normals_link * fit.mesh.face_normals[face]).sum(axis=1)
        for i in np.flatnonzero(
            trusted & (np.abs(looks) < STEEP)
        ):  # a wall of a step is the nearest: ask all under the cell
            place = np.broadcast_to(taxels.positions_link[i], fit.mesh.triangles.shape[::2])
            away = np.linalg.norm(closest_on_triangles(place, fit.mesh.triangles) - place, axis=1)
            reach = np.linalg.norm(taxels.corners_link[i] - taxels.positions_link[i], axis=1).max()
            under = fit.mesh.face_areas * (away < max(reach, distance[i] + NEAR))
            looks[i] = under @ (fit.mesh.face_normals @ taxels.normals_link[i])
    return trusted, trusted & (looks <= 0)


def sheet_on(fit):
    """A sheet over the middle, without the cells that fall off."""
    direction = fit.surface.derivatives(np.array([[0.5, 0.5]]))[0, 1, 0]
    return sheet_taxels(wrap_sheet(fit.surface, SheetLattice(8, 12, (0.005, 0.005)), None, direction, trim=True), "s")


def boards_on(fit, side=0.01):
    """All boards with sides of some length [m] that fit."""
    boards, overhang = lay_boards(fit.surface, HexLattice(side, 0.0), "all", None, None, fit=fit)
    return board_taxels(boards, "b", overhang=overhang)


@pytest.mark.parametrize("lay", [sheet_on, boards_on])
@pytest.mark.parametrize("path", MESHES, ids=lambda path: path.stem)
def test_no_normal_of_a_real_link_is_flipped(path, lay):
    """A sheet, and boards over as much of each link as they find: every taxel over the mesh looks out of it."""
    _, fit = fit_of(path)
    if isinstance(fit, SkinCalibError):
        pytest.skip(f"no surface to lay a skin on: {fit}")
    if lay is boards_on and path.stem in CROWDED:
        with pytest.raises(InvalidPlan, match="no board with sides of 10 mm fits completely in the region"):
            lay(fit)
        return
    taxels = boards_on(fit, 0.005) if lay is boards_on and path.stem in NARROW else lay(fit)
    normals, tangents = taxels.normals_link, taxels.tangents_link
    assert np.abs(np.linalg.norm(normals, axis=1) - 1).max() < 1e-12
    frames = np.stack((tangents, np.cross(normals, tangents), normals), axis=1)
    np.testing.assert_allclose(np.linalg.det(frames), 1, rtol=1e-12)
    counted, wrong = flipped(taxels, fit, path)
    assert not wrong.any(), [taxels.ids[i] for i in np.flatnonzero(wrong)]
    assert counted.any()
    turned = flipped(replace(taxels, normals_link=-normals), fit, path)
    assert (turned[1] == counted).all()  # each that is flipped is noticed


@pytest.mark.parametrize("stem", ["g1_left_ankle_roll_foot", "hrp4c_r_ankle_r_foot"])
def test_foot_soles_are_filled(stem):
    """More boards than the lattice as it lies, within half a millimetre of the mesh's edges and holes."""
    path = DATA / f"{stem}.stl"
    if not path.exists():
        pytest.skip(f"no {path.name} here")
    fit, lattice = fit_of(path)[1], HexLattice(0.0163, 0.0)
    filled, overhang = lay_boards(fit.surface, lattice, "fill", None, (1, 0, 0), fit=fit)
    plain, _ = lay_boards(fit.surface, lattice, "all", None, (1, 0, 0), fit=fit)
    assert len(filled.cells) > len(plain.cells) and overhang.max() <= 5e-4


@pytest.mark.parametrize("grid", [TubeGrid(8, 20), AutoGrid(1e-4)])
def test_thin_sheet_asks_for_its_side(grid):
    """The force sensor of a palm, 2 mm thick: which side carries the skin is the author's to say."""
    path = DATA / "g1_left_palm_force_sensor.stl"
    if not path.exists():
        pytest.skip(f"no {path.name} here")
    cover = cut_cover(load_mesh(path), CoverSpec())
    with pytest.raises(InvalidPlan, match='thin sheet, 2.0 mm thick .* with two sides: .* "normal"'):
        fit_grid(cover, grid, (3, 3))
    fit = fit_grid(cover, AcrossGrid(8, 8, (0, 0, 1)), (3, 3))
    assert (fit.surface.normals(np.random.default_rng(0).random((200, 2)))[:, 2] > 0.5).all()
