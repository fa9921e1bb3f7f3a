"""A ROS 2 package with the skin of a robot: description, calibrations, latched messages, launch file, view of RViz."""

import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from .. import __version__
from ..calibration.model import LinkCalibration
from ..common.errors import CalibrationFormatError
from ..common.findings import show
from ..runtime import Skin
from .cdr import encode
from .content import layout_message
from .definitions import FOLDER, PACKAGE, full_name
from .markers import McapView, cells_message
from .mcap_file import TRANSIENT_LOCAL, topic_of
from .scene import SceneMaker

TEMPLATE = Path(__file__).parent / "ros_template"
URDF = "urdf/robot.urdf"  # in the package
# What the launch file starts, and what its messages are of.
DEPENDS = (
    *("joint_state_publisher", "launch", "launch_ros", "rclpy", "robot_state_publisher", "rosidl_runtime_py", "rviz2"),
    *(PACKAGE, "visualization_msgs"),
)
PACKAGE_NAME = re.compile("[a-z][a-z0-9_]*")  # Format: of names in package.xml
DISPLAY = """    - Class: rviz_default_plugins/MarkerArray
      Name: {name}
      Enabled: true
      Value: true
      Topic:
        Depth: {depth}
        Durability Policy: {durability}
        History Policy: Keep Last
        Reliability Policy: Reliable
        Value: {topic}"""


def package_name(name: str) -> str:
    """Return the name of the package of a robot or a link: lower-case letters, digits, single underscores."""
    word = re.sub("[^a-z0-9]+", "_", name.lower()).strip("_") or "robot"
    return f"{'robot_' * word[0].isdigit()}{word}_skin"


def _check_topics(links: Iterable[str]) -> None:
    """Refuse links whose topics would be the same."""
    known: dict[str, str] = {}
    for link in links:
        if (other := known.setdefault(topic_of(link, "layout"), link)) != link:
            raise CalibrationFormatError(
                f"the links {show(other)} and {show(link)} would have the same topic {topic_of(link, 'layout')}: "
                "topics have only letters, digits and underscores. Rename one of them"
            )


def message_files(calibrations: Iterable[LinkCalibration]) -> dict[str, bytes]:
    """Return the layout and the cells of each skin as bytes, and the list of their topics."""
    topics, files = {}, {}
    for calibration in calibrations:
        skin = Skin(calibration)
        cells = cells_message(SceneMaker(calibration, skin), skin.link)
        for name, message in (("layout", layout_message(calibration, skin)), ("cells", cells)):
            kind, topic = McapView.topics[name][0], topic_of(skin.link, name)
            file = topic.removeprefix("/skin/").replace("/", ".") + ".cdr"
            topics[topic] = full_name(kind).replace("/", "/msg/"), file
            files[file] = encode(kind, message)
    return {"topics.json": (json.dumps(topics, indent=2) + "\n").encode()} | files


def package_files(
    name: str,
    root: str,
    calibrations: Mapping[str, LinkCalibration],
    files: Mapping[str, bytes],
    depends: Iterable[str],
) -> dict[str, bytes]:
    """Return all files of a package and of ``skin_calib_msgs``, by their paths.

    ``root`` is the link of RViz, ``files`` are those of the folders ``calibration``, ``urdf`` and ``meshes``, and
    ``depends`` names packages that have meshes.
    """
    _check_topics(calibrations)
    messages = {f"messages/{file}": data for file, data in message_files(calibrations.values()).items()}
    displays = [
        DISPLAY.format(
            name=json.dumps(f"{link} {topic}", ensure_ascii=False),
            depth=depth,
            durability="Transient Local" if durability == TRANSIENT_LOCAL else "Volatile",
            topic=topic_of(link, topic),
        )
        for link in calibrations
        for topic, (_, depth, durability) in McapView.topics.items()
        if topic in ("cells", "scene")
    ]
    needed = sorted({*DEPENDS, *filter(PACKAGE_NAME.fullmatch, depends)} - {name})
    words = {
        "PACKAGE": name,
        "VERSION": __version__,
        "DEPENDS": "\n".join(f"  <exec_depend>{package}</exec_depend>" for package in needed),
        "FOLDERS": " ".join(sorted({"launch", "messages", "rviz", *(file.partition("/")[0] for file in files)})),
        "DISPLAYS": "\n".join(displays),
        "ROOT": json.dumps(root, ensure_ascii=False),  # in YAML, too
    }
    places = {"skin.launch.py": "launch/", "skin.rviz": "rviz/", "publish_skin": "scripts/"}
    for path in sorted(TEMPLATE.glob("*.in")):
        text = re.sub("@([A-Z]+)@", lambda found: words[found[1]], path.read_text("utf-8"))
        messages[places.get(path.stem, "") + path.stem] = text.encode()
    ours = {f"{name}/{path}": data for path, data in {**files, **messages}.items()}
    definitions = (FOLDER.parent / "CMakeLists.txt", FOLDER.parent / "package.xml", *sorted(FOLDER.glob("*.msg")))
    return ours | {f"{PACKAGE}/{path.relative_to(FOLDER.parent).as_posix()}": path.read_bytes() for path in definitions}
