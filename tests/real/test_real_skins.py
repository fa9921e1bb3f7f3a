"""Skins on real robot links; the links are not part of the project, so the tests run where the data is."""

from dataclasses import replace

import numpy as np
import pytest

from skin_calib_addon.common.errors import InvalidPlan, SkinCalibError
from skin_calib_addon.geometry import (
    AcrossGrid,
    AutoGrid,
    CoverSpec,
    TubeGrid,
    cut_cover,
    fit_grid,
    load_mesh,
)
from skin_calib_addon.geometry.mesh.distance import closest, closest_on_triangles
from skin_calib_addon.skin import HexLattice, SheetLattice, board_taxels, lay_boards, sheet_taxels, wrap_sheet
from tests.real.test_real_links import DATA, FACES, MESHES, fit_of

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not MESHES, reason=f"no real links here: {DATA} has no STL file"),
]

# Links without space for a board of 2 cm: pins on the complete palm.
CROWDED = {"g1_left_palm_force_sensor"}
NARROW = {"talos_arm_5_forearm"}  # its closed part is 14 mm long: the limit for boards of 2 cm
STEEP = 0.5  # cosine of the angle to the nearest face below which that may be a wall
NEAR = 0.5e-3  # [m] the nearest face of a taxel nearer to the mesh is under it


def flipped(taxels, fit, path):
    """Return the taxels over the mesh with an inward normal."""
    trusted = fit.is_trusted(taxels.uv)
    if path.stem in FACES:  # with walls and edges near the surface, the direction of the author counts
        looks = taxels.normals_link @ FACES[path.stem]
    else:
        distance, face, _ = closest(fit.mesh, taxels.positions_link)
        trusted &= distance < NEAR
        looks = (taxels.normals_link * fit.mesh.face_normals[face]).sum(axis=1)
        for i in np.flatnonzero(
            trusted & (np.abs(looks) < STEEP)
        ):  # the nearest face is a wall of a step: use all faces under the cell
            place = np.broadcast_to(taxels.positions_link[i], fit.mesh.triangles.shape[::2])
            distances = np.linalg.norm(closest_on_triangles(place, fit.mesh.triangles) - place, axis=1)
            cell_radius = np.linalg.norm(taxels.corners_link[i] - taxels.positions_link[i], axis=1).max()
            under = fit.mesh.face_areas * (distances < max(cell_radius, distance[i] + NEAR))
            looks[i] = under @ (fit.mesh.face_normals @ taxels.normals_link[i])
    return trusted, trusted & (looks <= 0)


def sheet_on(fit):
    """Return a sheet on the middle, without the cells outside the surface."""
    direction = fit.surface.derivatives(np.array([[0.5, 0.5]]))[0, 1, 0]
    return sheet_taxels(wrap_sheet(fit.surface, SheetLattice(8, 12, (0.005, 0.005)), None, direction, trim=True), "s")


def boards_on(fit, side=0.01):
    """Return all boards with sides of some length [m] that fit."""
    boards, overhang = lay_boards(fit.surface, HexLattice(side, 0.0), "all", None, None, fit=fit)
    return board_taxels(boards, "b", overhang=overhang)


@pytest.mark.nightly
@pytest.mark.parametrize("placed", [sheet_on, boards_on])
@pytest.mark.parametrize("path", MESHES, ids=lambda path: path.stem)
def test_no_normal_of_a_real_link_is_flipped(path, placed):
    """A sheet, and as many boards as fit each link: every taxel over the mesh points outward."""
    _, fit = fit_of(path)
    if isinstance(fit, SkinCalibError):
        pytest.skip(f"no surface for a skin: {fit}")
    if placed is boards_on and path.stem in CROWDED:
        with pytest.raises(InvalidPlan, match="no board with sides of 10 mm fits completely in the region"):
            placed(fit)
        return
    taxels = boards_on(fit, 0.005) if placed is boards_on and path.stem in NARROW else placed(fit)
    normals, tangents = taxels.normals_link, taxels.tangents_link
    assert np.abs(np.linalg.norm(normals, axis=1) - 1).max() < 1e-12
    frames = np.stack((tangents, np.cross(normals, tangents), normals), axis=1)
    np.testing.assert_allclose(np.linalg.det(frames), 1, rtol=1e-12)
    counted, wrong = flipped(taxels, fit, path)
    assert not wrong.any(), [taxels.ids[i] for i in np.flatnonzero(wrong)]
    assert counted.any()
    turned = flipped(replace(taxels, normals_link=-normals), fit, path)
    assert (turned[1] == counted).all()  # each flipped one is detected


@pytest.mark.parametrize("stem", ["g1_left_ankle_roll_foot", "hrp4c_r_ankle_r_foot"])
def test_foot_soles_are_filled(stem):
    """There are more boards than in the given pose, within half a millimetre of the edges and holes of the mesh."""
    path = DATA / f"{stem}.stl"
    if not path.exists():
        pytest.skip(f"no {path.name} here")
    fit, lattice = fit_of(path)[1], HexLattice(0.0163, 0.0)
    filled, overhang = lay_boards(fit.surface, lattice, "fill", None, (1, 0, 0), fit=fit)
    plain, _ = lay_boards(fit.surface, lattice, "all", None, (1, 0, 0), fit=fit)
    assert len(filled.cells) > len(plain.cells) and overhang.max() <= 5e-4


@pytest.mark.parametrize("grid", [TubeGrid(8, 20), AutoGrid(1e-4)])
def test_thin_sheet_asks_for_its_side(grid):
    """The force sensor of a palm is 2 mm thick: the author must choose the side of the skin."""
    path = DATA / "g1_left_palm_force_sensor.stl"
    if not path.exists():
        pytest.skip(f"no {path.name} here")
    cover = cut_cover(load_mesh(path), CoverSpec())
    with pytest.raises(InvalidPlan, match="thin sheet, 2.0 mm thick .* with two sides. Choose the side .* normal"):
        fit_grid(cover, grid, (3, 3))
    fit = fit_grid(cover, AcrossGrid(8, 8, (0, 0, 1)), (3, 3))
    assert (fit.surface.normals(np.random.default_rng(0).random((200, 2)))[:, 2] > 0.5).all()
