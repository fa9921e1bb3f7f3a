"""Patches of hexagonal skin cells: the ``SkinConfig`` XML of TUM's skin driver, metres and rotation matrices."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ...common.arrays import Array
from ...common.errors import CalibrationFormatError
from ...common.findings import Finding, error, warning
from ...common.text import MAX_TAXELS, NumberError, real
from ..model import LinkCalibration
from .link_taxels import LinkTaxels, taxels_of
from .taxel_set import Draft, line
from .xml_nodes import Node, XmlError, children_of_root
from .xml_text import HEAD, quoted

ROOT = "SkinConfig"
ROOT_TO_BASE, BASE_TO_DH = "tf_rootCell_base", "tf_base_dh"
NO_NEIGHBOUR = (0, 16383)  # ids at a port without a neighbour
ROTATION_TOLERANCE = 1e-4  # how far a matrix may be off a rotation: files give six decimals and more
Pose = tuple[Array, Array]  # translation (3,) [m] and rotation (3, 3)


@dataclass(frozen=True, eq=False)
class Cell:
    """One board, in the frame of its patch's root cell."""

    line: int
    id: int
    patch: str
    pose: Pose
    ports: tuple[int, ...]  # ids of its neighbours


@dataclass
class Patches:
    """What is said of all patches of a file."""

    cells: list[Cell] = field(default_factory=list)
    frames: dict[str, str] = field(default_factory=dict)  # base frame of each patch
    bases: dict[str, Pose] = field(default_factory=dict)  # of its root cell in that frame


def read_tum(text: str) -> Draft:
    """Cells in the base frame: position, z axis as normal, x axis as tangent, neighbours at the ports.

    The channel of a cell is its place among the cells of the file.
    """
    draft, patches = Draft(normals=[], tangents=[], neighbours=[]), Patches()
    try:
        for node in children_of_root(text, ROOT):
            draft.findings += _take(patches, node)
    except XmlError as problem:
        draft.findings.append(problem.finding)
    if not patches.cells and not draft.broken:
        draft.findings.append(error("no-taxels", "", "has no cell; check that it is the right file"))
    if not draft.broken:
        _place(draft, patches)
        draft.findings += _missing_references(patches)
    return draft


def _take(patches: Patches, node: Node) -> Iterator[Finding]:
    """Put a child of the root into the patches."""
    if node.tag == "cell":
        if len(patches.cells) == MAX_TAXELS:
            raise XmlError("size", node.line, f"opens one cell too many; at most {MAX_TAXELS} are read")
        ports = tuple(port.whole("id") for port in node.child("neighbors").children)
        cell = Cell(node.line, node.whole("id"), node.attributes.get("patch", ""), _pose(node), ports)
        patches.cells.append(cell)
    elif node.tag == "patchExtrinsics":
        patch = node.attribute("patchId")
        patches.frames[patch] = node.attributes.get("baseFrame", "")
        patches.bases[patch] = _pose(node.child(ROOT_TO_BASE))
        shift, turn = _pose(node.child(BASE_TO_DH))
        if shift.any() or (turn != np.eye(3)).any():
            message = f"opens patch {patch}, whose {BASE_TO_DH} is not applied: its cells are given in the base frame"
            yield warning("unused-transform", line(node.line), message)


def _place(draft: Draft, patches: Patches) -> None:
    """Put the cells into the draft, in the base frame of their patch."""
    assert draft.normals is not None and draft.tangents is not None and draft.neighbours is not None
    names = set(patches.frames.values())
    draft.frame = names.pop() or None if len(names) == 1 else None
    known = {cell.id for cell in patches.cells}
    for channel, cell in enumerate(patches.cells):
        position, rotation = cell.pose
        if cell.patch in patches.bases:
            shift, turn = patches.bases[cell.patch]
            position, rotation = turn @ position + shift, turn @ rotation
        draft.lines.append(cell.line)
        draft.labels.append(str(cell.id))
        draft.channels.append(channel)
        draft.positions.append(tuple(position.tolist()))
        draft.normals.append(tuple(rotation[:, 2].tolist()))
        draft.tangents.append(tuple(rotation[:, 0].tolist()))
        draft.neighbours.append(tuple(str(i) for i in dict.fromkeys(cell.ports) if i in known and i != cell.id))


def _missing_references(patches: Patches) -> Iterator[Finding]:
    """Neighbours that the file does not hold, and patches whose place it does not tell."""
    known = {cell.id for cell in patches.cells}
    beyond = [cell for cell in patches.cells if set(cell.ports) - known - set(NO_NEIGHBOUR)]
    if beyond:
        ids = sorted({i for cell in beyond for i in cell.ports} - known - set(NO_NEIGHBOUR))
        message = f"opens a cell whose neighbours are not all in this file; {len(ids)} are not, cell {ids[0]} the first"
        yield warning("unknown-neighbour", line(beyond[0].line), message, len(ids))
    lost = [cell for cell in patches.cells if cell.patch not in patches.bases]
    if lost:
        message = "opens a cell of a patch without patchExtrinsics: it stays in the frame of its root cell"
        yield warning("no-frame", line(lost[0].line), message, len(lost))
    frames = sorted(set(patches.frames.values()))
    if len(frames) > 1:
        yield warning(
            "frames", "", f"has patches in {len(frames)} base frames; they are read as if it were one", frames
        )


def _pose(node: Node) -> Pose:
    """Position and rotation that a node holds."""
    shift, turn = _matrix(node, "pos", 1)[:, 0], _matrix(node, "rot", 3)
    with np.errstate(all="ignore"):  # absurd numbers overflow, and are no rotation
        proper = np.abs(turn @ turn.T - np.eye(3)).max() <= ROTATION_TOLERANCE and np.linalg.det(turn) > 0
    if not proper:
        raise XmlError("rotation", node.child("rot").line, "opens a rot that is no rotation; export it again")
    return shift, turn


def _matrix(node: Node, name: str, columns: int) -> Array:
    """The numbers of a matrix of three rows."""
    found = np.full((3, columns), np.nan)
    holder = node.child(name).child("matrix")
    for element in holder.children:
        i, j = element.whole("row"), element.whole("col")
        if not (0 <= i < 3 and 0 <= j < columns):
            raise XmlError("size", element.line, f"holds element ({i}, {j}) of a {name}, which is 3 x {columns}")
        try:
            found[i, j] = real(element.text.strip())
        except NumberError as problem:
            raise XmlError(problem.code, element.line, str(problem)) from problem
    if np.isnan(found).any():
        i, j = (int(k) for k in np.argwhere(np.isnan(found))[0])
        raise XmlError("missing", holder.line, f"opens a matrix without element ({i}, {j})")
    return found


def write_tum(calibration: LinkCalibration) -> bytes:
    """One patch of all taxels as cells: its root cell is the first, its base frame is that of the link.

    The id of a cell is its channel and one, for 0 stands for no neighbour. Boards have the six ports of their sides;
    what else is beside a taxel follows. The driver takes one patch from a file.

    Raises
    ------
    CalibrationFormatError
        If channels run too high for the ids of cells.
    """
    taxels = taxels_of(calibration)
    if taxels.channels[-1] + 1 >= NO_NEIGHBOUR[1]:
        raise CalibrationFormatError(
            f"channel {taxels.channels[-1]} cannot be written: ids of cells end at {NO_NEIGHBOUR[1] - 1}. "
            "Use lower channels."
        )
    ids = (taxels.channels + 1).tolist()
    at, turn = taxels.positions[0], taxels.axes[0]
    shifts, turns = (taxels.positions - at) @ turn, turn.T @ taxels.axes
    lines = [
        f'{HEAD}<!DOCTYPE scfg>\n<SkinConfig numberOfCells="{len(ids)}" numberOfPatchDriverSettings="1" '
        'numberOfPatchExtrinsics="1">',
        '<patchDriverSettings patchId="1" prefix="/"/>',
        f'<patchExtrinsics patchId="1" baseFrame={quoted(taxels.link)} dhFrame="" jointId="0">',
        f"<{ROOT_TO_BASE}>{_pose_text(at, turn)}</{ROOT_TO_BASE}>",
        f"<{BASE_TO_DH}>{_pose_text(np.zeros(3), np.eye(3))}</{BASE_TO_DH}>",
        "</patchExtrinsics>",
    ]
    for cell, beside, shift, rotation in zip(ids, _sides(taxels), shifts, turns):
        ports = "".join(f'<neighbor port="{port}" id="{other}"/>' for port, other in enumerate(beside, 1))
        lines.append(f'<cell id="{cell}" patch="1" segment="1"><rootCellId>{ids[0]}</rootCellId>')
        lines.append(f'<neighbors id="{cell}" size="{len(beside)}">{ports}</neighbors>')
        lines.append(f"{_pose_text(shift, rotation)}</cell>")
    return ("\n".join(lines) + "\n</SkinConfig>\n").encode()


def _sides(taxels: LinkTaxels) -> Iterator[list[int]]:
    """The cells at the ports of each: 0 where there is none, and those of patches that are not written are none."""
    number = {taxel: channel + 1 for taxel, channel in zip(taxels.ids, taxels.channels.tolist())}
    for ports, neighbours in zip(taxels.ports, taxels.neighbours):
        others = [other for other in neighbours if other not in ports and other in number]
        yield [number.get(other or "", 0) for other in (*ports, *others)]


def _pose_text(shift: Array, turn: Array) -> str:
    parts = (("pos", shift.reshape(3, 1).tolist()), ("rot", turn.tolist()))
    return "".join(f"<{name}>{_matrix_text(rows)}</{name}>" for name, rows in parts)


def _matrix_text(rows: list[list[float]]) -> str:
    elements = "".join(
        f'<element row="{i}" col="{j}">{value!r}</element>' for i, row in enumerate(rows) for j, value in enumerate(row)
    )
    return f'<matrix rows="3" cols="{len(rows[0])}">{elements}</matrix>'
