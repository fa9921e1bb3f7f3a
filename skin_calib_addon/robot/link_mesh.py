"""Load the mesh of a link of a URDF: find its files, scale them, and transform them to the link frame."""

import os
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

import numpy as np

from ..calibration.exchange.xml_text import rotations
from ..common.arrays import Array, IntArray
from ..common.errors import CalibrationFormatError, InvalidMesh, UnknownLink
from ..common.findings import did_you_mean, show
from ..geometry.mesh.triangle_mesh import TriangleMesh, read_mesh, weld
from .urdf import LinkMesh, Robot

USES = ("visual", "collision")
# Environment variables with search paths of ROS packages, and the folder of the packages below each path.
PACKAGE_PATHS = {"ROS_PACKAGE_PATH": "", "AMENT_PREFIX_PATH": "share"}


def meshes_of(robot: Robot, link: str, use: str) -> tuple[LinkMesh, ...]:
    """Return the meshes of a link.

    Parameters
    ----------
    robot : Robot
        Content of the URDF.
    link : str
        Name of the link.
    use : "visual" or "collision"
        Which meshes to return.

    Returns
    -------
    tuple of LinkMesh

    Raises
    ------
    UnknownLink
        If the robot has no such link.
    InvalidMesh
        If the link has no mesh for this use.
    """
    if link not in robot.links:
        raise UnknownLink(f"{robot.file} has no link {show(link)}{did_you_mean(link, robot.links)}")
    meshes = tuple(mesh for mesh in robot.links[link] if mesh.use == use)
    if not meshes:
        others = [f"Use its {other} mesh." for other in USES if any(m.use == other for m in robot.links[link])]
        advice = (*others, "Boxes and cylinders are not supported.")[0]
        raise InvalidMesh(f"{robot.file} has no {use} mesh for {link}. {advice}")
    return meshes


def load_link(urdf: Path, robot: Robot, link: str, use: str = "visual") -> TriangleMesh:
    """Load all meshes of a link for one use as one mesh.

    Parameters
    ----------
    urdf : Path
        File of the robot; mesh files are found relative to it.
    robot : Robot
        Its content.
    link : str
        Name of the link.
    use : "visual" or "collision"
        Which meshes to load.

    Returns
    -------
    TriangleMesh
        In the link frame [m].

    Raises
    ------
    UnknownLink, InvalidMesh
        As :func:`meshes_of`; or if a file is missing, unreadable, or not a surface.
    CalibrationFormatError
        If a scale or an origin does not have three numbers.
    """
    placed = [_placed(mesh, read_mesh(find_file(mesh.address, urdf))) for mesh in meshes_of(robot, link, use)]
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in placed)])
    faces = [faces + start for (_, faces), start in zip(placed, starts)]
    return weld(np.concatenate([vertices for vertices, _ in placed]), np.concatenate(faces))


def _placed(mesh: LinkMesh, raw: TriangleMesh) -> tuple[Array, IntArray]:
    """Return vertices in the link frame [m], and faces whose normals still point outwards."""
    for name, values in (("scale", mesh.scale), ("xyz", mesh.position), ("rpy", mesh.angles)):
        if len(values) != 3:
            raise CalibrationFormatError(
                f"{mesh.address} has {len(values)} numbers in its {name}. Write three numbers."
            )
    scale, turn = np.array(mesh.scale), rotations(np.array([mesh.angles]))[0]
    if not scale.all():
        raise InvalidMesh(f"{mesh.address} has a scale of 0. Correct the scale in the URDF.")
    vertices = raw.vertices * scale
    if any(mesh.angles):  # without rotation, the coordinates stay exact
        vertices = vertices @ turn.T
    mirrored = scale.prod() < 0
    return vertices + mesh.position, raw.faces[:, ::-1] if mirrored else raw.faces


def find_file(address: str, urdf: Path) -> Path:
    """Return the file of an address in a URDF: a path relative to its folder, or in a package.

    The package is searched in this order: folders of this name in the folder of the URDF or above; the search paths of
    ROS; the folder of the URDF and those above, under any name. The last candidate is the folder of the URDF itself.

    Parameters
    ----------
    address : str
        Path or URL, as ``package://name/path``.
    urdf : Path
        File of the robot.

    Returns
    -------
    Path

    Raises
    ------
    InvalidMesh
        If there is no such file.
    """
    for path in _candidates(address, urdf.absolute()):
        if os.path.isfile(path):  # Path.is_file raises for names that are too long
            return path
    raise InvalidMesh(
        f"the mesh file {address} of {urdf.name} was not found. Put its package next to or above the URDF."
    )


def _candidates(address: str, urdf: Path) -> Iterator[Path]:
    scheme, _, rest = address.rpartition("://")
    if scheme in ("", "file"):
        yield urdf.parent / (unquote(rest) if scheme else rest)
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
