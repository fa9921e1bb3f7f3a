"""Real robot links, clean and ugly; they are not part of the project, so the tests run where the data lies."""

from pathlib import Path

import numpy as np
import pytest

from skin_calib_addon.common.errors import SkinCalibError
from skin_calib_addon.geometry import (
    AcrossGrid,
    CoverSpec,
    TubeGrid,
    cut_cover,
    fit_surface,
    load_mesh,
)
from skin_calib_addon.geometry.mesh.distance import closest
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.plan import load_plan

ROOT = Path(__file__).parents[2]
DATA = (ROOT / ".." / "shared" / "data" / "meshes").resolve()
MESHES = sorted(DATA.glob("*.stl"))
WRIST_PLAN = Path(__file__).with_name("hrp4c_wrist.plan.json")


pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not MESHES, reason=f"no real links here: {DATA} has no STL file"),
]

# What each is: a limb to go round, or a face to lie on, which looks along this direction.
FACES = {
    "g1_left_ankle_roll_foot": (0, 0, -1.0),
    "hrp4c_r_ankle_r_foot": (0, 0, -1.0),
    "icub27_l_foot_sole": (0, 0, -1.0),
    "g1_left_palm_force_sensor": (0, 0, 1.0),
}


def fit_of(path):
    """The cover of a link and the fit that an author tries first, or the error that answers."""
    cover = cut_cover(load_mesh(path), CoverSpec())
    grid = AcrossGrid(8, 8, FACES[path.stem]) if path.stem in FACES else TubeGrid(8, 20)
    try:
        return cover, fit_surface(cover, grid)
    except SkinCalibError as error:
        return cover, error


@pytest.mark.parametrize("path", MESHES, ids=lambda path: path.stem)
def test_real_link_is_fitted_or_says_why_not(path):
    """A surface that is where its errors say, looking out of the mesh, or one line of ours; never another exception."""
    cover, fit = fit_of(path)
    if isinstance(fit, SkinCalibError):
        assert len(str(fit)) > 40 and "\n" not in str(fit)
        return
    uv = np.random.default_rng(0).uniform(0.05, 0.95, (400, 2))
    normals = fit.surface.normals(uv)
    distance, face, _ = closest(cover, fit.surface.points(uv))
    if path.stem in FACES:  # with walls and edges near the surface, the author's direction decides
        looks = normals @ FACES[path.stem]
    else:
        looks = (normals * cover.face_normals[face]).sum(axis=1)[distance < 0.5e-3]
    assert (looks > 0).mean() > 0.95
    assert fit.errors.surface_to_mesh.mean <= fit.errors.surface_to_mesh.max <= fit.errors.hausdorff < cover.size


@pytest.mark.skipif(not WRIST_PLAN.exists(), reason=f"no {WRIST_PLAN}")
def test_paper_wrist_takes_the_sheet():
    """The link of the paper from the raw file, inner boxes and jagged ends included: the 6 x 22 sheet lies on it."""
    plan = load_plan(WRIST_PLAN)
    result = calibrate(plan)
    assert result.fit.errors.surface_to_mesh.mean <= 0.12e-3
    (patch,) = result.calibration.patches
    taxels = patch.taxels
    assert patch.shape == (6, 22) and len(taxels.ids) == 132
    axis = plan.surface.grid.region.axis
    outward = taxels.positions_link - axis.point
    along = np.array(axis.direction) / np.linalg.norm(axis.direction)
    outward -= (outward @ along)[:, None] * along
    assert ((taxels.normals_link * outward).sum(axis=1) > 0.5 * np.linalg.norm(outward, axis=1)).all()
    assert np.linalg.norm(outward, axis=1).min() > 0.02  # on the cover, not on the boxes in it
    distance, face, _ = closest(result.cover, taxels.positions_link)
    assert distance.max() < 1e-3
    assert ((taxels.normals_link * result.cover.face_normals[face]).sum(axis=1) > 0.8).all()
    assert np.abs(taxels.quality["strain"]).max() < 0.05


def test_errors_of_a_link_leave_out_what_is_hidden():
    """The mean from the mesh to the surface of the iCub's upper arm is at most a third of that with inner walls."""
    mesh = load_mesh(DATA / "icub27_r_upper_arm.stl")
    outer, seen = (fit_surface(cut_cover(mesh, CoverSpec(shell)), TubeGrid(8, 20)) for shell in ("outer", "seen"))
    assert seen.errors.mesh_to_surface.mean < outer.errors.mesh_to_surface.mean / 3
    assert seen.errors.surface_to_mesh.mean < outer.errors.surface_to_mesh.mean
