"""The parts of ``check`` that need the authoring packages: plans, robots with a URDF, and meshes."""

import os.path
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..calibration import robot_set
from ..common.errors import CalibrationFormatError, SkinCalibError, listed
from ..common.findings import Finding, did_you_mean, error, show, warning
from ..pipeline.sources import is_same_mesh as is_same_mesh
from ..plan import check_plan_wholly, load_plan
from ..plan.document import skins_from
from ..plan.skins import placed_anew
from ..proposal.links import plan_warnings
from ..robot.link_mesh import is_urdf, plan_mesh_files
from ..robot.urdf import read_robot


def plan_findings(path: Path, document: Any) -> tuple[Finding, ...]:
    """Return the errors of a plan; if it has none, what is missing or outdated around it."""
    return check_plan_wholly(document) or tuple(_plan_warnings(path, document))


def urdf_findings(robot: robot_set.RobotSet, urdf: robot_set.UrdfFile, folder: Path) -> Iterator[Finding]:
    """Yield the links of a robot that its URDF does not have, or has on another parent."""
    try:
        content = read_robot(folder / urdf.file)
    except CalibrationFormatError as problem:
        yield error("invalid", "/urdf/file", f"cannot be read: {problem}", urdf.file)
        return
    for k, link in enumerate(robot.links):
        parent = content.parents.get(link.link)
        if link.link not in content.links:
            message = f"({show(link.link)}) is not in {urdf.file}{did_you_mean(link.link, content.links)}"
            yield error("unknown-link", f"/links/{k}/link", message, link.link)
        elif link.parent != parent:
            message = f"({show(link.parent)}) does not carry {show(link.link)} in the URDF; write {show(parent)}"
            yield error("parent", f"/links/{k}/parent", message, link.parent)


def _plan_warnings(path: Path, document: dict[str, Any]) -> Iterator[Finding]:
    """Yield a warning for each missing file of a plan, and for each one of its proposal."""
    if not os.path.isfile(path.parent / document["mesh"]):
        yield warning("no-mesh", "/mesh", "does not exist; paths are relative to the folder of the plan")
    elif is_urdf(Path(document["mesh"])):
        try:
            plan_mesh_files(load_plan(path))
        except SkinCalibError as problem:
            yield warning("no-mesh", "/mesh", f"has no mesh for the link: {problem}")
    for sentence in plan_warnings(path):
        yield warning("proposal", "/x_proposal", f"warns: {sentence}")
    for k, skin in enumerate(skins_from(document["skins"])):
        if (changed := placed_anew(skin)) and skin.touches is not None:
            message = (
                f"are of {skin.touches.touched.date}: the skin was placed anew since, with another {listed(changed)}"
            )
            yield warning("placed-anew", f"/skins/{k}/touches", f"{message}; touch it again, or put it back")
    for k, skin in enumerate(document["skins"]):
        if skin["kind"] == "imported" and not os.path.isfile(path.parent / skin["file"]):
            message = "does not exist; paths are relative to the folder of the plan"
            yield warning("no-taxels", f"/skins/{k}/file", message, skin["file"])
