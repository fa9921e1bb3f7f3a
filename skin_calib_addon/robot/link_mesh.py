"""The mesh of a link as its robot has it: found on the disk, scaled, turned and placed in the link frame."""

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
# Where ROS looks for packages, and the folder under each place that holds them.
PACKAGE_PATHS = {"ROS_PACKAGE_PATH": "", "AMENT_PREFIX_PATH": "share"}


def meshes_of(robot: Robot, link: str, use: str) -> tuple[LinkMesh, ...]:
    """What of a link is a mesh.

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
        others = [f"take its {other} mesh" for other in USES if any(m.use == other for m in robot.links[link])]
        raise InvalidMesh(f"{robot.file} has no {use} mesh for {link}; {(*others, 'boxes and cylinders are none')[0]}")
    return meshes


def load_link(urdf: Path, robot: Robot, link: str, use: str = "visual") -> TriangleMesh:
    """All meshes that a link has for one use as one, in metres in the link frame.

    Raises
    ------
    UnknownLink, InvalidMesh
        As :func:`meshes_of`; or if a file is missing, unreadable or no surface.
    CalibrationFormatError
        If a scale or an origin has not three numbers.
    """
    placed = [_placed(mesh, read_mesh(find_file(mesh.address, urdf))) for mesh in meshes_of(robot, link, use)]
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in placed)])
    faces = [faces + start for (_, faces), start in zip(placed, starts)]
    return weld(np.concatenate([vertices for vertices, _ in placed]), np.concatenate(faces))


def _placed(mesh: LinkMesh, raw: TriangleMesh) -> tuple[Array, IntArray]:
    """Vertices in the link frame [m] and faces that still look outward."""
    for name, values in (("scale", mesh.scale), ("xyz", mesh.place), ("rpy", mesh.angles)):
        if len(values) != 3:
            raise CalibrationFormatError(f"{mesh.address} has {len(values)} numbers in its {name}; three are needed")
    scale, turn = np.array(mesh.scale), rotations(np.array([mesh.angles]))[0]
    if not scale.all():
        raise InvalidMesh(f"{mesh.address} is scaled to nothing; correct its scale in the URDF")
    vertices = raw.vertices * scale
    if any(mesh.angles):  # what lies as it is keeps its numbers
        vertices = vertices @ turn.T
    mirrored = scale.prod() < 0
    return vertices + mesh.place, raw.faces[:, ::-1] if mirrored else raw.faces


def find_file(address: str, urdf: Path) -> Path:
    """The file that an address in a URDF means: a path from its folder, or in a package.

    A package is the folder of that name beside the URDF or above it, or where ROS looks for it; else the URDF's own
    folder, or one above, may be the package under another name; at last the folder of the URDF is looked into.

    Raises
    ------
    InvalidMesh
        If there is no such file.
    """
    for place in _places(address, urdf.absolute()):
        if os.path.isfile(place):  # Path.is_file raises where a name is too long
            return place
    raise InvalidMesh(f"no mesh file for {address} of {urdf.name}; put its package's folder beside or above the URDF")


def _places(address: str, urdf: Path) -> Iterator[Path]:
    scheme, _, rest = address.rpartition("://")
    if scheme in ("", "file"):
        yield urdf.parent / (unquote(rest) if scheme else rest)
    else:
        package, _, inner = rest.partition("/")
        yield from (folder / package / inner for folder in urdf.parents)
        for variable, share in PACKAGE_PATHS.items():
            for entry in filter(None, os.environ.get(variable, "").split(os.pathsep)):
                folder = Path(entry) / share
                if folder.name == package:
                    yield folder / inner
                yield folder / package / inner
        yield from (folder / inner for folder in urdf.parents)
    yield urdf.parent / rest.rpartition("/")[2]
