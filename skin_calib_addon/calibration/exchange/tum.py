"""Read and write patches of hexagonal boards: the ``SkinConfig`` XML of the TUM skin driver, in metres."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ...common.arrays import Array
from ...common.errors import CalibrationFormatError
from ...common.findings import Finding, FoundError, show, warning
from ...common.text import MAX_TAXELS
from ..model import LinkCalibration
from .link_taxels import LinkTaxels, taxels_of
from .taxel_set import Draft, line
from .xml_nodes import Node, XmlError, children_of_root
from .xml_text import HEAD, quoted

ROOT = "SkinConfig"
ROOT_TO_BASE, BASE_TO_DH = "tf_rootCell_base", "tf_base_dh"
NO_NEIGHBOUR = (0, 16383)  # Format: ids at a port without neighbour
# Deviation of R R^T from the identity: files have six decimals or more. Larger: sheared matrices pass.
ROTATION_TOLERANCE = 1e-4
Pose = tuple[Array, Array]  # translation (3,) [m] and rotation (3, 3)


@dataclass(frozen=True, eq=False)
class Cell:
    """One board, in the frame of the root cell of its patch."""

    line: int
    id: int
    patch: str
    pose: Pose
    ports: tuple[int, ...]  # ids of the neighbours


@dataclass
class Patches:
    """Data of all patches of a file."""

    cells: list[Cell] = field(default_factory=list)
    frames: dict[str, str] = field(default_factory=dict)  # base frame of each patch
    bases: dict[str, Pose] = field(default_factory=dict)  # pose of the root cell in the base frame


def read_tum(text: str) -> Draft:
    """Read cells in the base frame: position, normal (z axis), tangent (x axis) and neighbours.

    The channel of a cell is its index in the file.
    """
    draft, patches = Draft(normals=[], tangents=[], neighbours=[]), Patches()
    for node in children_of_root(text, ROOT):
        draft.findings += _read_node(patches, node)
    if not patches.cells:
        raise FoundError("no-taxels", "", "has no cell; check that it is the correct file")
    _fill_draft(draft, patches)
    draft.findings += _missing_references(patches)
    return draft


def _read_node(patches: Patches, node: Node) -> Iterator[Finding]:
    """Copy a child of the root element into the patches."""
    if node.tag == "cell":
        if len(patches.cells) == MAX_TAXELS:
            raise XmlError("size", node.line, f"exceeds the limit of {MAX_TAXELS} cells")
        ports = tuple(port.whole("id") for port in node.child("neighbors").children)
        cell = Cell(node.line, node.whole("id"), node.attributes.get("patch", ""), _pose(node), ports)
        patches.cells.append(cell)
    elif node.tag == "patchExtrinsics":
        patch = node.attribute("patchId")
        if patch in patches.bases:
            raise XmlError("syntax", node.line, f"is a second patchExtrinsics of patch {show(patch)}; keep one")
        patches.frames[patch] = node.attributes.get("baseFrame", "")
        patches.bases[patch] = _pose(node.child(ROOT_TO_BASE))
        shift, turn = _pose(node.child(BASE_TO_DH))
        if shift.any() or (turn != np.eye(3)).any():
            message = f"starts patch {patch}, whose {BASE_TO_DH} is not applied: the cells stay in the base frame"
            yield warning("unused-transform", line(node.line), message)


def _fill_draft(draft: Draft, patches: Patches) -> None:
    """Copy the cells into the draft, in the base frame of their patch."""
    assert draft.neighbours is not None
    names = set(patches.frames.values())
    draft.frame = names.pop() or None if len(names) == 1 else None
    known = {cell.id for cell in patches.cells}
    for channel, cell in enumerate(patches.cells):
        position, rotation = cell.pose
        if cell.patch in patches.bases:
            shift, turn = patches.bases[cell.patch]
            position, rotation = turn @ position + shift, turn @ rotation
        x, _, z = rotation.T.tolist()
        draft.add(cell.line, str(cell.id), channel, position.tolist(), z, x)
        draft.neighbours.append(tuple(str(i) for i in dict.fromkeys(cell.ports) if i in known and i != cell.id))


def _missing_references(patches: Patches) -> Iterator[Finding]:
    """Yield warnings for unknown neighbours, patches without pose, and different base frames."""
    known = {cell.id for cell in patches.cells}
    incomplete = [cell for cell in patches.cells if set(cell.ports) - known - set(NO_NEIGHBOUR)]
    if incomplete:
        ids = sorted({i for cell in incomplete for i in cell.ports} - known - set(NO_NEIGHBOUR))
        message = (
            f"starts a cell with a neighbour outside this file; {len(ids)} are missing, the first is cell {ids[0]}"
        )
        yield warning("unknown-neighbour", line(incomplete[0].line), message, len(ids))
    without = [cell for cell in patches.cells if cell.patch not in patches.bases]
    if without:
        message = "starts a cell of a patch without patchExtrinsics: it stays in the frame of its root cell"
        yield warning("no-frame", line(without[0].line), message, len(without))
    frames = sorted(set(patches.frames.values()))
    if len(frames) > 1:
        yield warning("frames", "", f"has patches in {len(frames)} base frames; they are treated as one", frames)


def _pose(node: Node) -> Pose:
    """Return position and rotation of a node."""
    shift, turn = _matrix(node, "pos", 1)[:, 0], _matrix(node, "rot", 3)
    with np.errstate(all="ignore"):  # huge numbers overflow, and are not a rotation
        proper = np.abs(turn @ turn.T - np.eye(3)).max() <= ROTATION_TOLERANCE and np.linalg.det(turn) > 0
    if not proper:
        raise XmlError(
            "rotation", node.child("rot").line, "has a matrix rot that is not a rotation; export the file again"
        )
    return shift, turn


def _matrix(node: Node, name: str, columns: int) -> Array:
    """Return the numbers of a matrix with three rows."""
    found = np.full((3, columns), np.nan)
    holder = node.child(name).child("matrix")
    for element in holder.children:
        i, j = element.whole("row"), element.whole("col")
        if not (0 <= i < 3 and 0 <= j < columns):
            raise XmlError("size", element.line, f"contains element ({i}, {j}) of {name}, which is 3 x {columns}")
        found[i, j] = element.number()
    if np.isnan(found).any():
        i, j = (int(k) for k in np.argwhere(np.isnan(found))[0])
        raise XmlError("missing", holder.line, f"starts a matrix without element ({i}, {j})")
    if len(holder.children) > found.size:
        raise XmlError("syntax", holder.line, f"starts a matrix {name} that repeats an element; export the file again")
    return found


def write_tum(calibration: LinkCalibration) -> bytes:
    """Write all taxels as the cells of one patch, because the driver reads one patch from a file.

    The root cell is the first cell, and the base frame is the link frame. The id of a cell is its channel plus one,
    because 0 means no neighbour. A board has the six ports of its sides. Other neighbours follow.
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
    for cell, others, shift, rotation in zip(ids, _sides(taxels), shifts, turns):
        ports = "".join(f'<neighbor port="{port}" id="{other}"/>' for port, other in enumerate(others, 1))
        lines.append(f'<cell id="{cell}" patch="1" segment="1"><rootCellId>{ids[0]}</rootCellId>')
        lines.append(f'<neighbors id="{cell}" size="{len(others)}">{ports}</neighbors>')
        lines.append(f"{_pose_text(shift, rotation)}</cell>")
    return ("\n".join(lines) + "\n</SkinConfig>\n").encode()


def _sides(taxels: LinkTaxels) -> Iterator[list[int]]:
    """Yield the cells at the ports of each taxel: 0 without neighbour, or if its patch is not written."""
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
