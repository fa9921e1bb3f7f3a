"""Make a URDF of a robot that MuJoCo describes, so that all other parts read one format."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..calibration.exchange.xml_text import HEAD, numbers, quoted, rpy
from ..common.arrays import Array, IntArray
from ..common.atomic_file import make_folder, write_bytes_safely
from ..common.errors import InvalidMesh
from ..common.packages import optional_package
from ..common.text import read_text
from ..geometry.mesh.triangle_mesh import TriangleMesh, save_mesh, simple_shape, stacked

MJCF_ROOT = re.compile(r"<mujoco\b")  # Format: first element of an MJCF file
FULL_TURN = "continuous"  # Format: type of a joint
NO_LIMIT = 1e9  # [m] of a prismatic joint. Larger: files with fewer readers


def as_urdf(file: Path, folder: Path) -> Path:
    """Return a file that is no MJCF as it is; of an MJCF, write a URDF and its meshes to a folder, and return that.

    Raise `InvalidMesh` for xacro, whose expressions are a program.
    """
    if file.suffix.lower() == ".xacro":
        stem = file.name.split(".")[0]
        raise InvalidMesh(
            f"{file.name} is a template of a URDF. Run: xacro {file} > {stem}.urdf, and name {stem}.urdf."
        )
    if file.suffix.lower() not in (".xml", ".mjcf"):
        return file
    if not MJCF_ROOT.search(read_text(file)):
        raise InvalidMesh(f"{file.name} has no <mujoco>. Name a URDF, an MJCF file or a mesh.")
    with optional_package(f"{file.name} is an MJCF file. Reading it needs MuJoCo", "robots"):
        import mujoco
    try:
        model = mujoco.MjModel.from_xml_path(str(file))
    except (ValueError, mujoco.FatalError) as error:
        raise InvalidMesh(f"MuJoCo does not accept {file.name}: {' '.join(str(error).split())}") from error
    meshes = folder / f"{file.stem}_meshes"
    for new in (folder, meshes):
        make_folder(new)
    path, text = folder / f"{file.stem}.urdf", "\n".join(_lines(model, mujoco, meshes))
    write_bytes_safely(path, text.encode())
    return path


def _lines(model: Any, mujoco: Any, meshes: Path) -> Iterator[str]:
    """Yield the lines of a URDF; write the meshes of its links."""
    names = {0: "world"} | {k: model.body(k).name or f"body_{k}" for k in range(1, model.nbody)}
    first = [k for k in range(1, model.nbody) if model.body_parentid[k] == 0]
    yield f"{HEAD}<robot name={quoted(names[first[0]] if len(first) == 1 else 'robot')}>"
    shown = (model.geom_contype | model.geom_conaffinity) == 0
    for k, name in names.items():
        if k or len(first) > 1:
            parts = _inertial(model, k) + _visual(model, k, name, shown, meshes) if k else ""
            yield f"<link name={quoted(name)}>{parts}</link>"
    for k in range(1, model.nbody):
        parent = model.body_parentid[k]
        if parent or len(first) > 1:
            yield from _joints(model, k, names[parent], names[k], mujoco)
    yield "</robot>\n"


def _joints(model: Any, body: int, parent: str, name: str, mujoco: Any) -> Iterator[str]:
    """Yield the joints above a body; links between them, as the axis of a URDF is at the frame of its child."""
    position, turn, at = model.body_pos[body], _matrix(model.body_quat[body]), np.zeros(3)
    kinds = {int(mujoco.mjtJoint.mjJNT_HINGE): "revolute", int(mujoco.mjtJoint.mjJNT_SLIDE): "prismatic"}
    joints = range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body])
    for number, j in enumerate(joints):
        kind, anchor = kinds.get(int(model.jnt_type[j])), model.jnt_pos[j]
        joint = model.joint(j).name or f"{name}_joint_{number}"
        if kind is None:  # free or a ball: the poses of such a link are not known
            yield _joint(joint, "floating", parent, name, position, turn)
            return
        low, high = model.jnt_range[j] - model.qpos0[model.jnt_qposadr[j]]
        if not model.jnt_limited[j]:
            kind, low, high = (FULL_TURN, 0, 0) if kind == "revolute" else (kind, -NO_LIMIT, NO_LIMIT)
        limits = "" if kind == FULL_TURN else f'<limit lower="{low:.9g}" upper="{high:.9g}" effort="0" velocity="0"/>'
        is_last = number + 1 == len(joints) and not anchor.any()
        child = name if is_last else f"{name}_after_{number}"
        axis = f'<axis xyz="{numbers(model.jnt_axis[j])}"/>{limits}'
        if not is_last:
            yield f"<link name={quoted(child)}/>"
        yield _joint(joint, kind, parent, child, position + turn @ (anchor - at), turn, axis)
        if is_last:
            return
        parent, position, turn, at = child, np.zeros(3), np.eye(3), anchor
    yield _joint(f"{name}_fixed", "fixed", parent, name, position - turn @ at, turn)


def _joint(name: str, kind: str, parent: str, child: str, position: Array, turn: Array, more: str = "") -> str:
    return (
        f"<joint name={quoted(name)} type={quoted(kind)}><parent link={quoted(parent)}/><child link={quoted(child)}/>"
        f'<origin xyz="{numbers(position)}" rpy="{numbers(rpy(turn[None])[0])}"/>{more}</joint>'
    )


def _visual(model: Any, body: int, name: str, shown: Array, meshes: Path) -> str:
    """Write the geoms of a body as one mesh, and return its element: those that do not collide, or all without any."""
    own = np.flatnonzero(model.geom_bodyid == body)
    own = own[shown[own]] if shown[own].any() else own
    parts = [part for geom in own.tolist() if (part := _triangles(model, geom)) is not None]
    if not parts:
        return ""
    mesh = TriangleMesh(*stacked(parts))
    path = meshes / f"{body}_{re.sub(r'[^A-Za-z0-9_.-]', '_', name)}.ply"  # two names can become one
    save_mesh(mesh, path)
    return f"<visual><geometry><mesh filename={quoted(f'{meshes.name}/{path.name}')}/></geometry></visual>"


def _triangles(model: Any, geom: int) -> tuple[Array, IntArray] | None:
    """Return vertices (n, 3) [m] in the frame of the body and faces (m, 3); None of planes and height fields."""
    import mujoco

    kinds = mujoco.mjtGeom
    kind, size = model.geom_type[geom], model.geom_size[geom]
    if kind == kinds.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        rows, faces = (
            slice(start[mesh], start[mesh] + count[mesh])
            for start, count in ((model.mesh_vertadr, model.mesh_vertnum), (model.mesh_faceadr, model.mesh_facenum))
        )
        part = model.mesh_vert[rows].astype(float), model.mesh_face[faces].astype(np.int64)
    elif kind == kinds.mjGEOM_BOX:
        part = simple_shape("box", tuple((2 * size).tolist()))
    elif kind == kinds.mjGEOM_SPHERE:
        part = simple_shape("sphere", (float(size[0]),))
    elif kind in (kinds.mjGEOM_CYLINDER, kinds.mjGEOM_CAPSULE):
        shape = "cylinder" if kind == kinds.mjGEOM_CYLINDER else "capsule"
        part = simple_shape(shape, (float(size[0]), 2 * float(size[1])))
    else:
        return None
    return part[0] @ _matrix(model.geom_quat[geom]).T + model.geom_pos[geom], part[1]


def _inertial(model: Any, body: int) -> str:
    if not model.body_mass[body]:
        return ""
    xx, yy, zz = model.body_inertia[body].tolist()
    angles = numbers(rpy(_matrix(model.body_iquat[body])[None])[0])
    return (
        f'<inertial><origin xyz="{numbers(model.body_ipos[body])}" rpy="{angles}"/>'
        f'<mass value="{model.body_mass[body]:.9g}"/>'
        f'<inertia ixx="{xx:.9g}" iyy="{yy:.9g}" izz="{zz:.9g}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def _matrix(quaternion: Array) -> Array:
    import mujoco

    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, quaternion)
    return turn.reshape(3, 3)
