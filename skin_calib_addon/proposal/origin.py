"""What a proposal was made from, in its plan, to name later what has changed."""

import contextlib
import hashlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ..common.errors import SkinCalibError, listed
from ..common.file_hash import file_hash
from ..plan.plan import Plan
from ..robot.keep_out import paths_from
from ..robot.link_mesh import find_file, is_urdf
from ..robot.urdf import Robot, read_robot
from ..robot.zones import load_zones
from .skins import SkinChoice

PROPOSAL_FROM = "x_proposal_from"  # Format: member of a proposed plan
DIGITS = 16  # of a checksum. Larger: longer plans.


def made_from(file: Path, link: str, choice: SkinChoice | None, mirror: str = "") -> dict[str, Any]:
    """Return what a proposal depends on: checksums of joints, and of the meshes of links, by name; zones, and the skin.

    They are those of a link of a robot, and of the links that cover it somewhere in the ranges of the joints, and the
    same for the mirror image that has its layout. The plan also has the hash of its own mesh.
    """
    both = (link, mirror) if mirror else (link,)
    skin: dict[str, Any] = {}
    if choice is not None:
        skin = {"skin": choice.text, "skin_checksum": _checksum(repr(choice.template))}
    zones = tuple(zone for name in both for zone in load_zones(file, name))
    skin |= {"zones": _checksum(repr(zones))} if zones else {}
    if not is_urdf(file):
        return {**skin, "joints": {}, "links": {}}
    robot = read_robot(file)
    skin |= {"mirror": mirror} if mirror else {}
    paths = [path for name in both if name in robot.links for path in paths_from(robot, name)]
    joints = sorted({joint for _, path in paths for joint, _ in path}, key=lambda joint: joint.name)
    links = sorted({*both, *(other for other, _ in paths)})
    return {
        **skin,
        "joints": {joint.name: _checksum(repr(joint)) for joint in joints},
        "links": {other: _checksum(_shapes(robot, other, file)) for other in links if robot.links.get(other)},
    }


def _shapes(robot: Robot, link: str, file: Path) -> str:
    """Return the visual meshes and shapes of a link with the hashes of their files, as a text."""
    meshes, hashes = [mesh for mesh in robot.links[link] if mesh.use == "visual"], []
    for mesh in meshes:
        with contextlib.suppress(SkinCalibError):  # a missing file has no hash
            hashes.append(file_hash(find_file(mesh.address, file)))
    return repr((meshes, hashes, robot.shapes.get(link, ())))


def _checksum(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:DIGITS]


def mirror_of(plan: Plan) -> str:
    """Return the link that has the mirrored layout, as a plan says itself; empty without one."""
    former = plan.extra.get(PROPOSAL_FROM)
    name = former.get("mirror") if isinstance(former, dict) else None
    return name if isinstance(name, str) else ""


def changes(plan: Plan, now: Mapping[str, Any]) -> Iterator[str]:
    """Yield what has changed since a plan was proposed, as sentences; nothing for a plan without this record."""
    former = plan.extra.get(PROPOSAL_FROM)
    if not isinstance(former, dict):
        return
    for name, words in (("joints", "joint"), ("links", "mesh of the link")):
        old, new = former.get(name), now[name]
        old = old if isinstance(old, dict) else {}
        changed = sorted(key for key in {*old, *new} if old.get(key) != new.get(key) and key != plan.link)
        if changed:
            plural = words.replace("mesh", "meshes") + "s" if len(changed) > 1 else words
            verb = "have" if len(changed) > 1 else "has"
            yield f"The {plural} {listed(changed)} {verb} changed since the plan was proposed: other places are free."
    if former.get("zones") != now.get("zones"):
        yield "The zones of the link have changed since the plan was proposed."
    if "skin" in now and any(former.get(name) != now[name] for name in ("skin", "skin_checksum")):
        yield f"The plan was proposed for the skin {former.get('skin')}."
