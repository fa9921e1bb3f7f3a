"""The URDF of a robot for ROS 2: its own, with the frames of all taxels, and with meshes that ROS finds."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from ..calibration.exchange.link_taxels import refuse_repeats
from ..calibration.exchange.urdf import frames_of
from ..calibration.exchange.xml_text import HEAD
from ..calibration.model import LinkCalibration
from ..common.errors import InvalidMesh
from ..common.text import read_text
from .link_mesh import find_file
from .urdf import Robot

MESHES = "meshes"  # folder in the package


@dataclass(frozen=True)
class RosUrdf:
    """A URDF, and what it needs."""

    text: bytes
    meshes: dict[str, bytes]  # files of the package, by their paths
    packages: tuple[str, ...]  # other packages that have meshes
    problems: tuple[str, ...]  # files that were not found


def with_taxels(urdf: Path, robot: Robot, calibrations: Mapping[str, LinkCalibration], package: str) -> RosUrdf:
    """Return the URDF of a robot with the frames LINK/ID of the taxels, for a package of this name.

    Addresses in packages stay. Other mesh files become files of the package.
    """
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    root = ElementTree.fromstring(read_text(urdf), parser)  # read before as ``robot``, which refuses entities
    files: dict[Path, str] = {}
    packages, problems = dict[str, None](), dict[str, None]()
    for part in (part for tag in ("mesh", "texture") for part in root.iter(tag) if "filename" in part.attrib):
        address = part.attrib["filename"].replace("\\", "/")
        scheme, _, rest = address.rpartition("://")
        if scheme not in ("", "file"):
            packages |= {rest.partition("/")[0]: None} if scheme == "package" else {}
            continue
        try:
            file = find_file(address, urdf)
        except InvalidMesh as problem:
            problems[str(problem)] = None
            continue
        name = re.sub(r"[^\w.-]", "_", file.name, flags=re.ASCII)
        if file not in files:
            files[file] = name if name not in files.values() else f"{len(files)}_{name}"
        part.set("filename", f"package://{package}/{MESHES}/{files[file]}")
    frames = [line for link, skin in calibrations.items() for line in frames_of(skin, f"{link}/")]
    added = ElementTree.fromstring("<robot>\n" + "\n".join(frames) + "\n</robot>")
    for names, tag in ((robot.links, "link"), (robot.joints, "joint")):
        refuse_repeats((*names, *(part.attrib["name"] for part in added.iter(tag))), "URDF")
    root.extend(added)
    text = HEAD + ElementTree.tostring(root, "unicode") + "\n"
    meshes = {f"{MESHES}/{name}": file.read_bytes() for file, name in files.items()}
    return RosUrdf(text.encode(), meshes, tuple(packages), tuple(problems))
