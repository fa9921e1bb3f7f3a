"""Comparison of the taxels of a link with those of a file: distances, angles, and a possible error of the frame."""

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ..calibration.exchange import TaxelSet, read_taxels
from ..calibration.file import load_with_warnings
from ..common.arrays import Array, IntArray
from ..common.errors import CalibrationFormatError, counted, listed
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..geometry.registration import MAX_REMAINING_RATIO, ON_MESH_DISTANCE, find_frame
from .all_taxels import AllTaxels

# Mean distance from which on a motion between the two sets is tested [m]. Larger: fewer notes.
MIN_MOTION_DISTANCE = 5e-4


@dataclass(frozen=True, eq=False)
class Comparison:
    """Pairs of a taxel of the link ("ours") and a taxel of a file ("theirs"); row i of every array is the same pair."""

    by: Literal["id", "nearest"]
    ours: IntArray  # (m,) rows
    ends: Array  # (m, 2, 3) from ours to theirs [m]
    angles: Array | None  # (m,) between the normals [rad]; None where the file has none
    worst: str  # id of our taxel with the largest distance
    notes: tuple[str, ...]  # further notes for a person, the frame first

    @property
    def distances(self) -> Array:
        """Distance of each pair, shape (m,) [m]."""
        return np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1)


def read_others(path: str | os.PathLike[str]) -> TaxelSet:
    """Read the taxels of a calibration, or of a file of another program in any readable format."""
    if Path(path).suffix.lower() != ".json":
        return read_taxels(path)
    calibration, findings = load_with_warnings(path)
    taxels = AllTaxels.of(calibration.patches)
    if not len(taxels.ids):
        raise CalibrationFormatError(f"'{path}' is a calibration without taxels. Choose one with taxels")
    findings = tuple(replace(f, pointer="") if f.pointer.startswith("/warnings/") else f for f in findings)
    positions, normals = taxels.positions, taxels.normals
    return TaxelSet(positions, normals, taxels.ids, taxels.channels, calibration.link, findings=findings)


def compare(taxels: AllTaxels, others: TaxelSet, mesh: TriangleMesh, link: str = "") -> Comparison:
    """Pair taxels with those of a file: by id if most ids agree, otherwise each with the nearest of ours."""
    known = [(taxels.rows[label], row) for row, label in enumerate(others.labels) if label in taxels.rows]
    is_named = 2 * len(known) >= min(len(taxels.ids), len(others.labels))
    by: Literal["id", "nearest"] = "id" if is_named else "nearest"
    if is_named:
        ours, theirs = np.array(known, np.int64).T
    else:
        ours = np.asarray(cKDTree(taxels.positions).query(others.positions)[1])
        theirs = np.arange(len(others.labels))
    ends = np.stack((taxels.positions[ours], others.positions[theirs]), axis=1)
    angles = None if others.normals is None else angles_between(taxels.normals[ours], others.normals[theirs])
    worst = taxels.ids[ours[np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).argmax()]]
    notes = (
        *([f"The file is in the frame {others.frame}"] if link and others.frame not in (None, link) else ()),
        *(_of_pairs(ends) if is_named else _of_mesh(mesh, others.positions)),
        *_unpaired(by, taxels.ids, others.labels, ours, theirs),
        *_inward(angles),
        *(str(finding) for finding in others.findings),
    )
    return Comparison(by, ours, ends, angles, worst, notes)


def angles_between(a: Array, b: Array) -> Array:
    """Return angles between unit vectors (m, 3), exact also near 0 and 180 degrees."""
    return 2 * np.arctan2(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))


def _of_pairs(ends: Array) -> Iterator[str]:
    """Yield a note if one motion brings the taxels of the file to ours."""
    ours, theirs = ends.transpose(1, 0, 2)
    before = float(np.linalg.norm(theirs - ours, axis=1).mean())
    if before < MIN_MOTION_DISTANCE or len(ends) < 3:
        return
    turn, shift = best_motion(theirs, ours)
    after = float(np.linalg.norm(theirs @ turn.T + shift - ours, axis=1).mean())
    if after <= MAX_REMAINING_RATIO * before:
        motion = in_words(turn, shift)
        yield f"Another frame? {motion} would bring it from {in_mm(before)} to {in_mm(after)}"


def best_motion(points: Array, targets: Array) -> tuple[Array, Array]:
    """Return rotation (3, 3) and shift (3,) [m] that bring points (n, 3) nearest to targets (n, 3) (Kabsch, 1976)."""
    middle, target = points.mean(axis=0), targets.mean(axis=0)
    u, _, v = np.linalg.svd((targets - target).T @ (points - middle))
    turn = u @ np.diag((1.0, 1.0, np.sign(np.linalg.det(u @ v)))) @ v
    return turn, target - turn @ middle


def _of_mesh(mesh: TriangleMesh, positions: Array) -> Iterator[str]:
    """Yield a note if the taxels of the file are not on the mesh, and the motion that brings them there."""
    fit = find_frame(mesh, positions)
    if fit.before.mean <= ON_MESH_DISTANCE:
        return
    off = f"{in_mm(fit.before.mean)} off the mesh on average"
    if fit.verdict == "right":
        yield f"It is {off}, and no motion brings it much nearer"
    elif fit.verdict == "lost":
        left = in_mm(fit.after.mean)
        yield f"It is {off}, and no motion brings it nearer than {left}: another link, or another unit?"
    else:
        also = ", but other positions fit, too" if fit.verdict == "ambiguous" else ""
        motion = in_words(fit.rotation, fit.translation)
        yield f"Another frame: it is {off}; {motion} would bring it to {in_mm(fit.after.mean)}{also}"


def in_words(turn: Array, shift: Array, digits: int = 1) -> str:
    """Describe a motion in words, with some digits after the point."""
    angle = np.rad2deg(np.linalg.norm(Rotation.from_matrix(turn).as_rotvec()))
    by = ", ".join(f"{round(1e3 * x, digits) + 0.0:.{digits}f}" for x in shift.tolist())  # no minus zero
    turned = f"a turn by {angle:.{digits}f}° and " if round(angle, digits) else ""
    return f"{turned}a shift by ({by}) mm"


def in_mm(length: float) -> str:
    """Return a length [m] in words."""
    return f"{round(length * 1e3, 4):.3g} mm"


def _unpaired(
    by: str, ids: tuple[str, ...], labels: tuple[str, ...], ours: IntArray, theirs: IntArray
) -> Iterator[str]:
    """Yield notes on taxels without a partner, and on taxels with more than one."""
    alone = [ids[row] for row in np.setdiff1d(np.arange(len(ids)), ours)]
    others = [labels[row] for row in np.setdiff1d(np.arange(len(labels)), theirs)]
    repeated = len(ours) - len(np.unique(ours))
    if alone:
        yield f"{counted(len(alone), 'taxel')} of the link without a partner in the file: {listed(alone)}"
    if others:
        yield f"{counted(len(others), 'taxel')} of the file without a partner on the link: {listed(others)}"
    if by == "nearest" and repeated:
        yield f"{repeated} of the file have the same nearest taxel of the link as another one"


def _inward(angles: Array | None) -> Iterator[str]:
    count = 0 if angles is None else int((angles > np.pi / 2).sum())
    if count:
        yield f"{count} normals of the file point in the opposite direction"
