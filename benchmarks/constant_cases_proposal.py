"""Cases of ``constants.py`` for proposals and the layout of boards: links of a real robot.

Each case proposes the plan of one link: surfaces, and skins on them. With all cases, a variation takes about 45 s. One
that has an effect ends with the first case, after 3 s.
"""

import pickle
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from constant_cases import PREPARATIONS, SHARED, Result, case

URDF = SHARED / "robots" / "g1_description" / "g1_29dof_rev_1_0.urdf"
LINKS = (
    "left_elbow_link",
    "left_hip_roll_link",
    "left_ankle_roll_link",
    "left_knee_link",
    "head_link",
    "torso_link",
)
MODULES = "proposal", "skin/boards"
TWIN = "right_elbow_link"


@PREPARATIONS.append
def robot(folder: Path) -> None:
    """Write the robot, with what its links cover of each other, so that not every process finds this."""
    from skin_calib_addon.proposal.links import robot_of

    if URDF.exists():
        whole = robot_of(URDF)
        (folder / "robot.pickle").write_bytes(pickle.dumps((whole.robot, whole.keep_out, whole.twins)))


@cache
def robot_in(folder: Path) -> tuple[Any, Any, Any]:
    """Return the robot, its keep-out areas and its mirrored links, as they were written."""
    return pickle.loads((folder / "robot.pickle").read_bytes())


@cache
def proposal(folder: Path, link: str, skin: str) -> Any:
    """Return the proposal of a link, and its mesh."""
    from skin_calib_addon.proposal.proposal import joint_axes, propose_link
    from skin_calib_addon.proposal.skins import parse_skin
    from skin_calib_addon.robot.link_mesh import load_urdf_mesh

    whole, keep_out, _ = robot_in(folder)
    mesh = load_urdf_mesh(URDF, link)
    axes = tuple(joint_axes(whole, link))
    return propose_link(link, mesh, URDF, "m", parse_skin(skin), axes, keep_out), mesh


def described(found: Any, mesh: Any) -> Result:
    """Return what a proposal covers, and how far its cells are from the mesh; the cells are placed again."""
    from skin_calib_addon.geometry.mesh.distance import closest
    from skin_calib_addon.pipeline import calibrate

    result: Result = {
        "taxels": found.taxels,
        "covered [cm^2]": np.array([1e4 * found.covered]),
        "cells [cm^2]": np.array([1e4 * found.cells]),
    }
    if found.plan is None:
        return result | {"surfaces": 0}
    patches = calibrate(found.plan, mesh).calibration.patches
    positions, normals, corners = (
        np.concatenate([getattr(patch.taxels, name).reshape(-1, 3) for patch in patches])
        for name in ("positions_link", "normals_link", "corners_link")
    )
    distances, faces, _ = closest(mesh, positions)
    cosines = np.abs((mesh.face_normals[faces] * normals).sum(axis=1))
    return result | {
        "surfaces": len(found.plan.surfaces),
        "largest distance [mm]": np.array([1e3 * distances.max()]),
        "largest distance of a corner [mm]": np.array([1e3 * closest(mesh, corners)[0].max()]),
        "largest angle [degrees]": np.rad2deg(np.arccos(np.clip([cosines.min()], -1, 1))),
        "positions [mm]": 1e3 * positions,
    }


def add_boards(link: str) -> None:
    """Add the case of one link with the default skin."""

    @case(f"G1 {link}", real=True, only=MODULES)
    def boards(folder: Path) -> Result:
        return described(*proposal(folder, link, "hexagons"))


for name in LINKS:
    add_boards(name)


@case("G1 left_elbow_link, sheet", real=True, only=MODULES)
def sheet(folder: Path) -> Result:
    """The same link with a sheet, which must be made smaller."""
    return described(*proposal(folder, LINKS[0], "sheet:12x44x5mm"))


@case(f"G1 {TWIN}, mirrored", real=True, only=("proposal",))
def mirrored(folder: Path) -> Result:
    """The mirror image of a link."""
    from skin_calib_addon.proposal.proposal import propose_twin
    from skin_calib_addon.proposal.skins import parse_skin
    from skin_calib_addon.robot.link_mesh import load_urdf_mesh

    _, keep_out, twins = robot_in(folder)
    former, mesh = proposal(folder, twins[TWIN].link, "hexagons")[0], load_urdf_mesh(URDF, TWIN)
    found = propose_twin(former, twins[TWIN], TWIN, mesh, URDF, parse_skin("hexagons"), keep_out)
    return {"of its own": 1} if found is None else described(found, mesh)
