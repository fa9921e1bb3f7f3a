"""Load the mesh of a plan; of a link of a URDF: find its files, scale them, and transform them to the link frame."""

import contextlib
import itertools
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from urllib.parse import unquote

import numpy as np

from ..calibration.exchange.xml_text import rotations
from ..common.arrays import Array, IntArray
from ..common.errors import CalibrationFormatError, InvalidMesh, SkinCalibError, UnknownLink, counted, listed
from ..common.findings import did_you_mean, show
from ..common.schema_types import matcher
from ..geometry.mesh.dae import has_other_axis
from ..geometry.mesh.triangle_mesh import (
    MAX_MESH_SIZE,
    MIN_MESH_SIZE,
    TriangleMesh,
    load_mesh,
    read_mesh,
    simple_shape,
    stacked,
    weld,
    without_gaps,
)
from ..plan import Plan
from ..plan.keys import NAME as PLAN_NAME
from .urdf import MAX_NUMBER, LinkMesh, LinkShape, Robot, read_robot

USES = ("visual", "collision")
NAME = matcher(PLAN_NAME.schema["pattern"])
URDF = ".urdf"  # Contract: ending of a mesh of a plan that is a robot
# Environment variables with search paths of ROS packages, and the folder of the packages below each path.
PACKAGE_PATHS = {"ROS_PACKAGE_PATH": "", "AMENT_PREFIX_PATH": "share"}


def load_plan_mesh(plan: Plan) -> TriangleMesh:
    """Load the mesh of a plan: its file, or all visual meshes of its link if the file is a URDF.

    The vertices of a link of a URDF are rounded to single precision, because Blender keeps no more. The calibration is
    therefore the same through every interface.
    """
    if not is_urdf(plan.mesh):
        return load_mesh(plan.mesh, plan.unit)
    return load_urdf_mesh(plan.mesh, plan.link)


def load_urdf_mesh(urdf: Path, link: str) -> TriangleMesh:
    """Load all visual meshes of a link, rounded to single precision, and check their size."""
    return _single_precision(urdf, read_robot(urdf), link)


def load_urdf_meshes(urdf: Path, robot: Robot) -> tuple[dict[str, TriangleMesh], dict[str, str]]:
    """Load the meshes of all links as :func:`load_urdf_mesh` does; a broken link does not stop the others."""
    meshes: dict[str, TriangleMesh] = {}
    problems: dict[str, str] = {}
    for link in links_with_mesh(robot):
        try:
            meshes[link] = _single_precision(urdf, robot, link)
        except SkinCalibError as problem:
            problems[link] = str(problem)
    return meshes, problems


def shapes_of(robot: Robot) -> dict[str, TriangleMesh]:
    """Return the visual boxes, cylinders, spheres and capsules of links as meshes, in the frames of these links [m]."""
    return {link: TriangleMesh(*stacked([_shape(s) for s in shapes])) for link, shapes in robot.shapes.items()}


def _shape(shape: LinkShape) -> tuple[Array, IntArray]:
    """Return vertices in the link frame [m], and faces, of a box, cylinder, sphere or capsule."""
    vertices, faces = simple_shape(shape.kind, shape.size)
    return vertices @ rotations(np.array([shape.angles]))[0].T + shape.position, faces


def _single_precision(urdf: Path, robot: Robot, link: str) -> TriangleMesh:
    vertices, faces = _triangles(urdf, robot, link, "visual")
    mesh = without_gaps(weld(vertices.astype(np.float32), faces))
    if not MIN_MESH_SIZE <= mesh.size <= MAX_MESH_SIZE:
        raise InvalidMesh(
            f"{link} has a diameter of {mesh.size:.4g} m in {urdf.name}. Correct the scale of its mesh in the URDF."
        )
    return mesh


def links_with_mesh(robot: Robot) -> list[str]:
    """Return the links that have a visual mesh, in the order of the URDF."""
    return [link for link, meshes in robot.links.items() if any(mesh.use == "visual" for mesh in meshes)]


def plan_mesh_files(plan: Plan) -> tuple[Path, ...]:
    """Return the files that :func:`load_plan_mesh` reads."""
    if not is_urdf(plan.mesh):
        return (plan.mesh,)
    meshes = meshes_of(read_robot(plan.mesh), plan.link, "visual")
    return plan.mesh, *dict.fromkeys(find_file(mesh.address, plan.mesh) for mesh in meshes)


def links_without_files(robot: Robot, urdf: Path) -> list[str]:
    """Return the links with a visual mesh whose file is not found."""
    found = []
    for link, meshes in robot.links.items():
        try:
            for mesh in meshes:
                if mesh.use == "visual":
                    find_file(mesh.address, urdf)
        except InvalidMesh:
            found.append(link)
    return found


def axis_warning(file: Path, robot: Robot | None = None, links: Iterable[str] = (), use: str = "visual") -> str:
    """Return a warning if DAE files state another upward axis than z, which only some programs turn."""
    ending = "It is ignored, as in RViz. If the picture is turned by 90 degrees, turn the meshes."
    if robot is None:
        return f"{file.name} states an <up_axis> that is not Z_UP. {ending}" if has_other_axis(file) else ""
    turned = []
    for link in links:
        with contextlib.suppress(InvalidMesh, OSError):  # the link fails with a message
            if any(has_other_axis(find_file(mesh.address, file)) for mesh in meshes_of(robot, link, use)):
                turned.append(link)
    if not turned:
        return ""
    of = f"{counted(len(turned), 'link')} of {file.name}"
    return f"The DAE files of {of} state an <up_axis> that is not Z_UP: {listed(turned)}. {ending}"


def is_urdf(path: Path) -> bool:
    """Return whether the mesh of a plan is a robot."""
    return path.suffix.lower() == URDF


def meshes_of(robot: Robot, link: str, use: str) -> tuple[LinkMesh, ...]:
    """Return the meshes of a link."""
    if link not in robot.links:
        raise UnknownLink(f"{robot.file} has no link {show(link)}{did_you_mean(link, robot.links)}")
    if not NAME(link):
        raise InvalidMesh(f"{robot.file} has a link with the name {show(link)}. Give it one of printable characters.")
    meshes = tuple(mesh for mesh in robot.links[link] if mesh.use == use)
    if not meshes:
        others = [f"Use its {other} mesh." for other in USES if any(m.use == other for m in robot.links[link])]
        advice = (*others, "Boxes, cylinders and spheres carry no skin.")[0]
        raise InvalidMesh(f"{robot.file} has no {use} mesh for {link}. {advice}")
    return meshes


def load_link(urdf: Path, robot: Robot, link: str, use: str = "visual") -> TriangleMesh:
    """Load all meshes of a link for one use as one mesh."""
    return weld(*_triangles(urdf, robot, link, use))


def _triangles(urdf: Path, robot: Robot, link: str, use: str) -> tuple[Array, IntArray]:
    """Return vertices [m] and faces of all meshes of a link for one use, in the link frame."""
    return stacked([_placed(m, read_mesh(find_file(m.address, urdf))) for m in meshes_of(robot, link, use)])


def _placed(mesh: LinkMesh, raw: TriangleMesh) -> tuple[Array, IntArray]:
    """Return vertices in the link frame [m], and faces whose normals still point outwards."""
    for name, values in (("xyz", mesh.position), ("rpy", mesh.angles)):
        check_triple(values, mesh.address, name)
    in_metres = scaled(raw, mesh.scale, mesh.address)
    vertices = in_metres.vertices
    if any(mesh.angles):  # without rotation, the coordinates stay exact
        vertices = vertices @ rotations(np.array([mesh.angles]))[0].T
    return vertices + mesh.position, in_metres.faces


def scaled(mesh: TriangleMesh, scale: Sequence[float], address: str) -> TriangleMesh:
    """Return a mesh with the scale of a URDF; its normals still point outwards if the scale mirrors it."""
    check_triple(scale, address, "scale")
    factors = np.array(scale)
    if not factors.all():
        raise InvalidMesh(f"{address} has a scale of 0. Correct the scale in the URDF.")
    return TriangleMesh(mesh.vertices * factors, mesh.faces[:, ::-1] if factors.prod() < 0 else mesh.faces)


def check_triple(values: Sequence[float], address: str, name: str) -> None:
    """Refuse an origin or a scale that does not have three numbers, or one that is too large."""
    if len(values) != 3:
        raise CalibrationFormatError(f"{address} has {len(values)} numbers in its {name}. Write three numbers.")
    if max(map(abs, values)) > MAX_NUMBER:
        raise CalibrationFormatError(f"{address} has {max(values, key=abs):g} in its {name}. Correct it in the URDF.")


def find_file(address: str, urdf: Path) -> Path:
    """Return the file of an address in a URDF: a path relative to its folder, or in a package.

    The package is searched in this order: folders of this name in the folder of the URDF or above; the search paths of
    ROS; the folder of the URDF and those above, under any name. The last candidate is the folder of the URDF itself. If
    the path of the URDF has symbolic links, the search then repeats from the folder that they lead to. Escaped
    characters of an address, such as ``%20``, are searched as they are, and then as what they mean.
    """
    files = dict.fromkeys((urdf.absolute(), Path(os.path.realpath(urdf))))
    for form, file in itertools.product(dict.fromkeys((address, unquote(address))), files):
        for path in _candidates(form, file):
            if os.path.isfile(path):  # Path.is_file raises for names that are too long
                return path
    raise InvalidMesh(
        f"the mesh file {address} of {urdf.name} was not found. "
        + ("Check the path." if address.startswith("file:") else "Put its package next to or above the URDF.")
    )


def _candidates(address: str, urdf: Path) -> Iterator[Path]:
    scheme, _, rest = address.rpartition("://")
    if scheme in ("", "file"):
        yield urdf.parent / rest
    else:
        package, _, inner = rest.partition("/")
        yield from (folder / package / inner for folder in urdf.parents)
        for variable, subfolder in PACKAGE_PATHS.items():
            for entry in filter(None, os.environ.get(variable, "").split(os.pathsep)):
                folder = Path(entry) / subfolder
                if folder.name == package:
                    yield folder / inner
                yield folder / package / inner
        yield from (folder / inner for folder in urdf.parents)
    yield urdf.parent / rest.rpartition("/")[2]
