"""Write a MuJoCo model of a robot with all its skins."""

import re
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Container, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..calibration.exchange.mjcf import write_mjcf
from ..calibration.model import LinkCalibration
from ..common.errors import InvalidMesh, SkinCalibError
from ..common.findings import show
from ..common.packages import optional_package
from ..common.text import NumberError, read_text, real
from ..geometry.mesh.triangle_mesh import MAX_MESH_SIZE, TriangleMesh, read_mesh
from .link_mesh import check_triple, find_file, scaled
from .urdf import Robot

MAX_STL_FACES = 200_000  # Format: MuJoCo accepts no more in an STL file
MARK = b"# skin-calib"  # first bytes of each mesh that this program writes: such a file can be replaced
# Height of taxels above a collision shape of their link below which it is switched off [m]. Larger: shapes farther
# below the skin are switched off, too. Smaller: the shape takes a part of the force of a press.
MIN_PROTRUSION = 1e-3
PARTS = ("link", "joint", "material")  # Format: what MuJoCo needs of a URDF; others are of simulators and controllers
WORLD = "world"  # Format: name of the body of MuJoCo that carries all others; a first link of this name is this body
INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")  # Format: attributes in a URDF
MOMENTS = ("ixx", "iyy", "izz")  # Format: those of them that are positive
INERTIA_PRECISION = 1e-4  # Format: [1] of inertias in a URDF. Larger: more changes of them are not stated
MASS_PRECISION = 1e-3  # Format: [1] of masses in the models that MuJoCo writes. Larger: another mass is not stated
# [1] of the trace: least second moment of a flat part. Larger: a less exact inertia; smaller: the six digits of the
# model that MuJoCo writes make it impossible.
INERTIA_MARGIN = 2e-5
MAX_DEAD = 0.5  # [1] of the taxels of a link that feel no press, above which the export fails
# How MuJoCo compiles the robot. Links stay bodies of their own, also if they are fixed. What is left of impossible
# inertias is balanced, and masses of zero become positive.
COMPILER = {
    "fusestatic": "false",
    "discardvisual": "false",
    "strippath": "false",
    "balanceinertia": "true",
    "boundmass": "1e-6",  # [kg]
    "boundinertia": "1e-9",  # [kg m^2]
}


@dataclass(frozen=True)
class RobotModel:
    """A model of MuJoCo with its meshes."""

    text: bytes  # of the MJCF file
    meshes: dict[str, bytes]  # files by name: STL, or OBJ for large meshes; each begins with MARK
    sources: tuple[Path, ...]  # mesh files of the robot
    problems: tuple[str, ...]  # meshes and skins that the model does not have, a line each
    uncovered: tuple[str, ...]  # bodies with a collision shape that is switched off, because it would hide a skin
    covered: Mapping[tuple[str, str], int]  # taxels of a link below collision shapes of another one
    dead: tuple[str, ...]  # links most of whose taxels feel no press, a line each
    balanced: tuple[str, ...]  # links whose inertia no rigid body can have; the model has the nearest possible one
    assumed: tuple[str, ...]  # moving links whose mass or inertia the URDF does not state, with their mass in the model


def robot_mjcf(
    robot: Robot,
    urdf: Path,
    calibrations: Mapping[str, LinkCalibration],
    mesh_folder: str,
    free_base: bool = False,
    actuators: bool = False,
    tactile: bool = True,
) -> RobotModel:
    """Return a model of the robot, with a body for each skin that is fixed to its link.

    Names of a skin begin with the name of the link and a slash: ``data.sensor("arm/wrist.0.0")``. The root of the robot
    is fixed to the world, or free. Collision shapes that hide a taxel of their link, or of one that is fixed to it, are
    switched off: its cells collide instead. Bodies that overlap in the zero pose do not collide with each other.
    Actuators are motors with the names and the effort of the joints. Without ``tactile``, Newton accepts the model.
    """
    with optional_package("a model of the robot needs MuJoCo", "robots"):
        import mujoco
    description, meshes, sources, problems, impossible = _with_own_meshes(robot, urdf, calibrations, mujoco)
    skins = {
        link: write_mjcf(calibration, tactile).decode()
        for link, calibration in calibrations.items()
        if link in robot.links
    }
    problems += [f"{urdf.name} has no link {show(link)}" for link in calibrations if link not in robot.links]
    try:
        spec: Any = mujoco.MjSpec.from_string(description, assets=meshes)
        for mesh in spec.meshes:  # without volume, because meshes of robots are often open
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        for link, text in skins.items():
            skin = mujoco.MjSpec.from_string(text).body(link)
            spec.body(link).add_frame().attach_body(skin, f"{link}/", "")
        uncovered, covered, hidden = _uncover(spec, [f"{link}/{link}" for link in skins], mujoco)
        if free_base:
            _free(spec, urdf.name, mujoco)
        if actuators:
            _add_motors(spec, description, mujoco)
        spec.compile()
        spec.meshdir = mesh_folder
        text = spec.to_xml().replace("<compiler ", '<compiler balanceinertia="true" ', 1)  # MuJoCo does not write it
        files = {f"{mesh_folder}/{name}": content for name, content in meshes.items()}
        model = mujoco.MjModel.from_xml_string(text, files)
    except (ValueError, mujoco.FatalError) as error:
        raise SkinCalibError(f"MuJoCo does not accept {urdf.name}: {' '.join(str(error).split())}") from error
    masses = {model.body(i).name: float(model.body_mass[i]) for i in range(model.nbody)}
    assumed = _with_assumed_mass(robot, ET.fromstring(description), masses)
    dead = tuple(
        f"{count} of {calibrations[link].taxel_count} taxels of {link} feel no press: they are below collision shapes "
        f"of {', '.join(other for one, other in covered if one == link)}. Remove these shapes, or propose the skin anew"
        for link, count in hidden.items()
        if count > MAX_DEAD * calibrations[link].taxel_count
    )
    return RobotModel(text.encode(), meshes, sources, tuple(problems), uncovered, covered, dead, impossible, assumed)


def _free(spec: Any, urdf: str, mujoco: Any) -> None:
    """Let the robot move freely, with its first link at the origin."""
    first = spec.worldbody.first_body()
    if any(joint.type == mujoco.mjtJoint.mjJNT_FREE for joint in spec.joints):
        raise SkinCalibError(f"{urdf} has a floating joint: the robot is free without --free-base.")
    first.add_freejoint(name=f"{first.name}_free")


def _add_motors(spec: Any, description: str, mujoco: Any) -> None:
    """Add a motor for each joint that moves, except for those that follow others, with its effort as its limit."""
    stated = {joint.get("name"): joint for joint in ET.fromstring(description).findall("joint")}
    for joint in spec.joints:
        element = stated.get(joint.name)
        if element is None or element.find("mimic") is not None or joint.type == mujoco.mjtJoint.mjJNT_FREE:
            continue
        motor = spec.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        limit = element.find("limit")
        effort = abs(real(limit.get("effort", "0"))) if limit is not None else 0.0
        if effort > 0:
            motor.ctrllimited, motor.ctrlrange = True, [-effort, effort]


def _with_possible_inertias(root: ET.Element) -> tuple[str, ...]:
    """Replace inertias that no rigid body can have by the nearest possible, and return their links.

    An inertia is possible if the second moments of the mass, tr(I)/2 - I, are not negative; those of a flat part have a
    zero. Negative ones become as small as the six digits of a model allow. Links of flat parts, whose inertias are
    impossible by rounding, are not returned.
    """
    found = []
    for link in root.findall("link"):
        inertia = link.find("inertial/inertia")
        if inertia is not None:
            try:
                xx, xy, xz, yy, yz, zz = (real(inertia.get(name, "0").strip()) for name in INERTIA)
            except NumberError:  # MuJoCo refuses it with a message
                continue
            matrix = np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
            moments, axes = np.linalg.eigh(np.trace(matrix) / 2 * np.eye(3) - matrix)
            least = INERTIA_MARGIN * moments.sum()
            if moments[0] >= least:
                continue
            if moments[0] < -INERTIA_PRECISION * abs(moments).max() or moments[:2].sum() < 0:
                found.append(link.get("name", ""))
            if least > 0:
                moments = np.maximum(moments, least)
                possible = axes * (moments.sum() - moments) @ axes.T
                inertia.attrib.update(zip(INERTIA, map(repr, possible[np.triu_indices(3)].tolist())))
    return tuple(found)


def _with_assumed_mass(robot: Robot, root: ET.Element, masses: Mapping[str, float]) -> tuple[str, ...]:
    """Return the moving links that have another mass [kg] in the model than in the URDF, or no inertia in the URDF.

    Links that are fixed to each other count together: many are frames without mass. MuJoCo computes a mass from the
    shapes of a link without inertial, and has a lower limit of masses and inertias.
    """
    above = {joint.child: joint for joint in robot.joints.values()}
    groups: dict[str, list[str]] = {}
    for link in robot.links:
        first = link
        while first in above and above[first].type == "fixed":
            first = above[first].parent
        groups.setdefault(first, []).append(link)
    stated = {link.get("name", ""): _mass_and_inertia(link) for link in root.findall("link")}
    found = []
    for first, links in groups.items():
        mass, inertia = np.sum([stated.get(link, (0.0, 0.0)) for link in links], axis=0)
        model = sum(masses.get(link, 0.0) for link in links)
        rounding = MASS_PRECISION * mass + len(links) * float(COMPILER["boundmass"])
        if first in above and (mass <= 0 or inertia <= 0 or abs(model - mass) > rounding):
            found.append(f"{first} ({model:.3g} kg)")
    return tuple(found)


def _mass_and_inertia(link: ET.Element) -> tuple[float, float]:
    """Return the mass [kg] and the sum of the moments of inertia [kg m^2] that a URDF states of a link, or zero."""
    mass, inertia = link.find("inertial/mass"), link.find("inertial/inertia")
    moments = [] if inertia is None else [float(inertia.get(name, "0")) for name in MOMENTS]
    return 0.0 if mass is None else float(mass.get("value", "0")), sum(moments)


def _uncover(
    spec: Any, skins: list[str], mujoco: Any
) -> tuple[tuple[str, ...], dict[tuple[str, str], int], dict[str, int]]:
    """Switch off what would be touched instead of a skin, and contacts of the robot with itself at zero.

    MuJoCo collides with the convex hull of a mesh. That of a concave link is above its skin. Those of adjacent links
    overlap. Shapes of the same rigid body count, too: some robots have them on links of their own. Others stay. Return
    the bodies with such shapes, the taxels below others for each pair of links, and for each link.
    """
    trial = spec.copy()
    probe = trial.worldbody.add_body().add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[MIN_PROTRUSION, 0, 0])
    probe.contype = probe.conaffinity = 0
    model = trial.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_collision(model, data)
    bodies = [model.body(name).id for name in skins]
    of_skin = np.isin(range(model.nbody), bodies) | np.isin(model.body_parentid, bodies)
    collides = ((model.geom_contype | model.geom_conaffinity) != 0) & ~of_skin[model.geom_bodyid]
    hiding: set[int] = set()
    over: list[tuple[int, int, int]] = []  # taxels, their links, and shapes of others above them
    for site in np.flatnonzero(of_skin[model.site_bodyid]).tolist():
        place, skin = data.site_xpos[site], model.site_bodyid[site]
        link = model.body_parentid[skin if skin in bodies else model.body_parentid[skin]]
        data.geom_xpos[probe.id] = place
        is_near = np.linalg.norm(data.geom_xpos - place, axis=1) < model.geom_rbound + MIN_PROTRUSION
        for geom in np.flatnonzero(collides & is_near).tolist():
            if geom not in hiding and mujoco.mj_geomDistance(model, data, probe.id, geom, MIN_PROTRUSION, None) < 0:
                if model.body_weldid[model.geom_bodyid[geom]] == model.body_weldid[link]:
                    hiding.add(geom)
                else:
                    over.append((site, link, geom))
    for geom in hiding:  # geoms have the same order in both, because the body of the probe is the last
        spec.geoms[geom].contype = spec.geoms[geom].conaffinity = 0
    touching = {tuple(sorted(model.geom_bodyid[contact.geom].tolist())) for contact in data.contact}
    for one, other in sorted(touching):
        spec.add_exclude(bodyname1=model.body(one).name, bodyname2=model.body(other).name)
    # Only now it is known which shapes are switched off. A taxel below two shapes of one link counts once.
    below = {(site, link, int(model.geom_bodyid[geom])) for site, link, geom in over if geom not in hiding}
    covering = Counter((model.body(link).name, model.body(body).name) for _, link, body in sorted(below))
    hidden = Counter(model.body(link).name for _, link in sorted({(site, link) for site, link, _ in below}))
    names = tuple(dict.fromkeys(model.body(model.geom_bodyid[geom]).name for geom in sorted(hiding)))
    return names, dict(covering), dict(hidden)


def _free_in_the_world(root: ET.Element, robot: Robot, skins: Container[str]) -> None:
    """Call the empty first link above a floating joint the world, which alone carries such joints in MuJoCo."""
    floating = {joint.parent: joint for joint in robot.joints.values() if joint.type == "floating"}
    for link, joint in floating.items():
        shapes = [shape for element in root.findall("link") if element.get("name") == link for shape in element]
        if link == WORLD and link not in robot.parents:
            continue
        is_empty = link not in skins and not any(shape.tag in ("visual", "collision") for shape in shapes)
        if link in robot.parents or WORLD in robot.links or not is_empty:
            raise SkinCalibError(
                f"the joint {joint.name} of {robot.file} is floating, and {link} carries it. MuJoCo accepts this only "
                "below a first link without shapes and skin. Write another type for the joint."
            )
        for element in root.iter():
            name = {"link": "name", "parent": "link"}.get(element.tag, "")
            if element.get(name) == link:
                element.set(name, WORLD)


def _with_own_meshes(
    robot: Robot, urdf: Path, skins: Container[str], mujoco: Any
) -> tuple[str, dict[str, bytes], tuple[Path, ...], list[str], tuple[str, ...]]:
    """Return the text of a robot that names files of one folder, these files and their sources, and what is wrong.

    What is wrong are the meshes that are left out, and the links with impossible inertias.

    Scales are applied to the meshes, so that MuJoCo need not distinguish two scales of one file.
    """
    root = ET.fromstring(read_text(urdf))
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]  # some files have a namespace
    root[:] = [element for element in root if element.tag in PARTS]
    _free_in_the_world(root, robot, skins)
    made: dict[tuple[Path, str], tuple[str, bytes]] = {}  # name and content by file and scale
    problems: list[str] = []
    for link in root.findall("link"):
        for shape in [shape for shape in link if shape.find("geometry/mesh") is not None]:
            mesh = shape.find("geometry/mesh")
            assert mesh is not None
            address, scale = mesh.get("filename", "").replace("\\", "/"), mesh.attrib.pop("scale", "1 1 1")
            origin = shape.find("origin")
            try:
                for name, numbers in (origin.attrib if origin is not None else {}).items():
                    check_triple(tuple(map(real, numbers.split())), address, name)
                path = find_file(address, urdf)
                if (path, scale) in made:
                    name, data = made[path, scale]
                else:
                    content = scaled(read_mesh(path), tuple(map(real, scale.split())), address)
                    if content.size > MAX_MESH_SIZE:
                        raise InvalidMesh(f"{address} has a diameter of {content.size:.4g} m. Correct its scale.")
                    name, data = _new_name(path, content, dict(made.values())), _mesh_bytes(content)
                _check_mesh(name, data, shape.tag == "collision", mujoco)
                made[path, scale] = name, data
                mesh.set("filename", name)
            except SkinCalibError as problem:
                problems.append(f"{link.get('name')} is without its {shape.tag} mesh: {problem}")
                link.remove(shape)
    impossible = _with_possible_inertias(root)
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", COMPILER)
    sources = tuple(dict.fromkeys(path for path, _ in made))
    return ET.tostring(root, encoding="unicode"), dict(made.values()), sources, problems, impossible


def _check_mesh(name: str, data: bytes, collides: bool, mujoco: Any) -> None:
    """Refuse a mesh that MuJoCo does not accept, so that it does not refuse the whole robot."""
    alone = mujoco.MjSpec()
    alone.assets = {name: data}
    alone.add_mesh(name="mesh", file=name, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
    kind = mujoco.mjtGeom.mjGEOM_MESH
    alone.worldbody.add_geom(type=kind, meshname="mesh", contype=int(collides), conaffinity=int(collides))
    try:
        alone.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise InvalidMesh(f"MuJoCo does not accept {name}: {str(error).splitlines()[0]}") from error


def _new_name(path: Path, mesh: TriangleMesh, files: Mapping[str, bytes]) -> str:
    """Return a name for the file of a mesh whose stem no other file has, because it is also the name of the mesh."""
    stem = re.sub(r"[^\w.-]", "_", path.stem)
    taken = {name.rpartition(".")[0].lower() for name in files}
    number, free = 1, stem
    while free.lower() in taken:
        number += 1
        free = f"{stem}_{number}"
    return f"{free}.{'stl' if len(mesh.faces) <= MAX_STL_FACES else 'obj'}"


def _mesh_bytes(mesh: TriangleMesh) -> bytes:
    """Return a binary STL file, or an OBJ file for a mesh that is too large for MuJoCo's reader of STL."""
    if len(mesh.faces) > MAX_STL_FACES:
        points = (f"v {x!r} {y!r} {z!r}\n" for x, y, z in mesh.vertices.tolist())
        return MARK + "".join(("\n", *points, *(f"f {a} {b} {c}\n" for a, b, c in (mesh.faces + 1).tolist()))).encode()
    faces = np.zeros(len(mesh.faces), np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("colour", "<u2")]))
    faces["normal"], faces["corners"] = mesh.face_normals, mesh.triangles
    return MARK.ljust(80, b"\0") + np.array(len(faces), "<u4").tobytes() + faces.tobytes()
