"""The calibrations of all links of a robot: ``robot.json`` in the folder of the calibrations."""

import json
import os
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from ..common.atomic_file import write_bytes_safely
from ..common.errors import CalibrationFormatError
from ..common.file_hash import file_hash
from ..common.findings import Finding, child, error, in_short, repeated, show, warning
from ..common.schema_check import check, read_schema
from ..common.strict_json import parse, read
from ..common.warnings import Warning
from .chains import chain_channels
from .file import load_calibration
from .model import LinkCalibration

FILE = "robot.json"  # Contract: name of the file
FORMAT = "skin-robot"  # Format
ROBOT_VERSION = 1  # Format: version of these files


@dataclass(frozen=True)
class Chain:
    """Boards of a link that are connected: one cable."""

    first_channel: int  # lowest channel
    boards: int
    bus: str | None = None  # None: that of the link


@dataclass(frozen=True)
class RobotLink:
    """One link with a skin."""

    link: str
    calibration: str  # file in the folder
    sha256: str  # of the bytes of this file
    parent: str | None = None  # link that carries this link
    first_channel: int | None = None  # lowest channel; None without taxels
    bus: str | None = None  # electronics whose readings contain the channels; None: of this link alone
    chains: tuple[Chain, ...] = ()  # of its boards

    def buses(self, calibration: LinkCalibration) -> dict[int, str | None]:
        """Return the bus of each channel of its calibration: that of its chain, or of the link."""
        named = {chain.first_channel: chain.bus for chain in self.chains}
        found = {int(c): self.bus for patch in calibration.patches for c in patch.taxels.channels}
        for channels in chain_channels(calibration):
            found |= dict.fromkeys(channels.tolist(), named.get(int(channels.min())) or self.bus)
        return found


@dataclass(frozen=True)
class UrdfFile:
    """The URDF with which the links were compared."""

    file: str  # path relative to the folder
    sha256: str


@dataclass(frozen=True)
class RobotSet:
    """The skins of a robot; paths are relative to the folder of the file."""

    robot: str
    urdf: UrdfFile | None
    links: tuple[RobotLink, ...]


def load_robot_set(path: str | os.PathLike[str]) -> RobotSet:
    """Read ``robot.json``, or the one of a folder. The calibrations are not read."""
    file = robot_file(path)
    if os.path.isdir(path) and not os.path.lexists(file):
        raise CalibrationFormatError(
            f"cannot read '{path}': it is a folder without {FILE}, which lists the calibrations of a robot. "
            f"It is written by skin-calib fit PLANS -o {path}, also for calibrations that are up to date."
        )
    document, findings = parse(read(file))
    findings = tuple(findings) or check_robot_document(document)
    if findings:
        raise CalibrationFormatError(f"'{file}' is invalid: {in_short(findings)}", findings)
    urdf = document["urdf"]
    links = tuple(
        RobotLink(**link | {"chains": tuple(Chain(**chain) for chain in link.get("chains", ()))})
        for link in document["links"]
    )
    return RobotSet(document["robot"], UrdfFile(**urdf) if urdf else None, links)


def save_robot_set(robot: RobotSet, folder: Path) -> None:
    """Write ``robot.json`` to the folder of the calibrations in one step."""
    write_bytes_safely(folder / FILE, robot_bytes(robot))


def robot_bytes(robot: RobotSet) -> bytes:
    """Return the content of ``robot.json``."""
    links = [asdict(link) | {"chains": [asdict(chain) for chain in link.chains]} for link in robot.links]
    links = [{name: link[name] for name in link if name != "chains" or link["chains"]} for link in links]
    document = {"format": FORMAT, "version": ROBOT_VERSION, **asdict(robot), "links": links}
    if findings := check_robot_document(document):
        raise CalibrationFormatError(f"{FILE} cannot be written: {in_short(findings)}", findings)
    return (json.dumps(document, indent=2, ensure_ascii=False) + "\n").encode()


def load_links(path: str | os.PathLike[str]) -> tuple[dict[str, LinkCalibration], tuple[Warning, ...]]:
    """Read the calibrations of all links of a robot, and what is wrong with the set without making it unusable."""
    file = robot_file(path)
    robot = load_robot_set(path)
    calibrations, findings = calibrations_of(robot, file.parent)
    errors = tuple(finding for finding in findings if finding.severity == "error")
    if errors:
        advice = "Fit the plans into this folder again; calibrations that were edited stay as they are."
        raise CalibrationFormatError(f"'{file}': {in_short(errors)}. {advice}", findings)
    return calibrations, tuple(
        Warning(finding.code, "warning", f"{file}: {finding.sentence}.")
        for finding in (*findings, *unlisted(robot, file.parent))
    )


def examined(
    path: str | os.PathLike[str],
) -> tuple[RobotSet, Path, dict[str, LinkCalibration], tuple[Finding, ...]]:
    """Return a robot set, its folder, the calibrations that can be read, and all problems of links and folder."""
    robot, folder = load_robot_set(path), robot_file(path).parent
    calibrations, findings = calibrations_of(robot, folder)
    return robot, folder, calibrations, (*findings, *unlisted(robot, folder))


def calibrations_of(robot: RobotSet, folder: Path) -> tuple[dict[str, LinkCalibration], tuple[Finding, ...]]:
    """Return the calibrations that can be read, by the name of the link, and all problems."""
    calibrations: dict[str, LinkCalibration] = {}
    findings = []
    for k, link in enumerate(robot.links):
        where, name = child("", "links", k, "calibration"), f"({show(link.calibration)})"
        now = file_hash(folder / link.calibration)
        if now is None:
            findings.append(
                error("no-calibration", where, f"{name} does not exist, or cannot be read", link.calibration)
            )
            continue
        if now != link.sha256:
            findings.append(error("changed", where, f"{name} has changed since {FILE} was written", link.calibration))
        try:
            calibration = load_calibration(folder / link.calibration)
        except CalibrationFormatError as problem:
            findings.append(
                error("invalid", where, f"{name} is invalid: {in_short(problem.findings)}", link.calibration)
            )
            continue
        if calibration.link != link.link:
            message = f"{name} is of the link {show(calibration.link)}, not of {show(link.link)}"
            findings.append(error("link", where, message, link.calibration))
            continue
        first = _first_channel(calibration)
        if first != link.first_channel:
            message = f"is not the lowest channel of {show(link.link)}, which is {show(first)}"
            findings.append(error("first-channel", child("", "links", k, "first_channel"), message, link.first_channel))
        if link.chains and Counter(replace(one, bus=None) for one in link.chains) != Counter(_chains(calibration)):
            message = f"are not the chains of {show(link.link)}: first channels or numbers of boards differ"
            findings.append(error("chains", child("", "links", k, "chains"), message))
        calibrations[link.link] = calibration
    return calibrations, (*findings, *_used_twice(robot, calibrations))


def unlisted(robot: RobotSet, folder: Path) -> Iterator[Finding]:
    """Yield an error for each calibration in the folder that the set does not list: a loaded robot has no such skin."""
    listed = {link.calibration for link in robot.links}
    files = {link.link: link.calibration for link in robot.links}  # one of each link
    for path in sorted(folder.glob("*.calibration.json")):
        if path.name in listed:
            continue
        message = f"does not list {show(path.name)}"
        if (link := link_of(path)) is None:
            yield error("not-listed", "/links", f"{message}, which cannot be read; mend or remove it, and fit again")
        elif (other := files.setdefault(link, path.name)) != path.name:
            yield error(
                "same-link",
                "/links",
                f"{message}, which is of the link {show(link)}, as {show(other)} is; remove one, and fit again",
            )
        else:
            advice = "fit into this folder again, or remove it"
            yield error("not-listed", "/links", f"{message}, which is of the link {show(link)}; {advice}")


def changed_urdf(robot: RobotSet, folder: Path) -> Iterator[Finding]:
    """Yield a warning if the URDF is not the one with which the links were compared."""
    if robot.urdf is None:
        return
    now = file_hash(folder / robot.urdf.file)
    if now is None:
        yield warning("no-urdf", "/urdf/file", "does not exist: links were not compared with it", robot.urdf.file)
    elif now != robot.urdf.sha256:
        yield warning("outdated", "/urdf/file", "has changed; fit the plans again, with this URDF", robot.urdf.file)


def link_of(calibration: Path) -> str | None:
    """Return the link of a calibration file; None if it cannot be read."""
    try:
        return load_calibration(calibration).link
    except CalibrationFormatError:
        return None


def _used_twice(robot: RobotSet, calibrations: dict[str, LinkCalibration]) -> Iterator[Finding]:
    """Yield an error for each link with channels of an earlier link on a bus, and a warning for its ids.

    Without a bus, channels are a warning, too: each link has its own readings, or they are of two proposals.
    """
    channels: dict[tuple[str | None, int], str] = {}
    ids: dict[str, str] = {}
    for k, link in enumerate(robot.links):
        if link.link not in calibrations:
            continue
        taxels = [patch.taxels for patch in calibrations[link.link].patches]
        own_channels = {(bus, channel) for channel, bus in link.buses(calibrations[link.link]).items()}
        own_ids = {name for t in taxels for name in t.ids}
        if both := sorted(own_channels & channels.keys(), key=lambda key: (key[0] is None, key)):  # a bus first
            name, channel = both[0]
            other, bus = show(channels[both[0]]), f" of bus {name}" if name else ""
            message = f"({show(link.link)}) has channel {channel}{bus}, as {other} has; {len(both)} in all"
            if name:
                yield error("duplicate-channel", child("", "links", k), message)
            else:
                advice = "name their buses if each has its own readings"
                yield warning("duplicate-channel", child("", "links", k), f"{message}; {advice}")
        if again := sorted(own_ids & ids.keys()):
            other = show(ids[again[0]])
            message = f"({show(link.link)}) has a taxel {show(again[0])}, as {other} has; {len(again)} in all"
            yield warning("duplicate-id", child("", "links", k), message)
        channels.update(dict.fromkeys(own_channels, link.link))
        ids.update(dict.fromkeys(own_ids, link.link))


def same_link(links: Mapping[str, str]) -> str:
    """Return a clause that names two calibrations of one link; empty if each link has one."""
    for file, link, other in repeated(links.items()):
        return f"{other} and {file} are of the same link {show(link)}"
    return ""


def robot_link(folder: Path, name: str) -> RobotLink:
    """Return the entry of a calibration, without what the calibration does not have: parent and buses."""
    calibration = load_calibration(folder / name)
    first, chains = _first_channel(calibration), tuple(_chains(calibration))
    return RobotLink(calibration.link, name, file_hash(folder / name) or "", first_channel=first, chains=chains)


def _chains(calibration: LinkCalibration) -> Iterator[Chain]:
    """Yield the chains of the boards of a link, without buses."""
    for channels in chain_channels(calibration):
        yield Chain(int(channels.min()), len(channels))


def _first_channel(calibration: LinkCalibration) -> int | None:
    """Return the lowest channel of a calibration; None without taxels."""
    channels = [int(patch.taxels.channels.min()) for patch in calibration.patches if len(patch.taxels.ids)]
    return min(channels, default=None)


def check_robot_document(document: Any) -> tuple[Finding, ...]:
    """Return the errors of a document: of its form, and links or files that are named twice."""
    return check(document, _schema()) or tuple(_twice(document["links"]))


def is_robot(path: str | os.PathLike[str]) -> bool:
    """Return whether a path is that of ``robot.json``, or of a folder, which should have one."""
    return os.path.isdir(path) or (Path(path).name == FILE and os.path.isfile(path))


def robot_file(path: str | os.PathLike[str]) -> Path:
    """Return the path of ``robot.json``, given this path or that of its folder."""
    return Path(path) / FILE if os.path.isdir(path) else Path(path)


def _twice(links: list[dict[str, Any]]) -> Iterator[Finding]:
    for member in ("link", "calibration"):
        for k, name, _ in repeated((k, link[member]) for k, link in enumerate(links)):
            yield error("duplicate", child("", "links", k, member), f"({show(name)}) is named twice", name)


@cache
def _schema() -> dict[str, Any]:
    return read_schema(Path(__file__).with_name("robot_schema.json"))
