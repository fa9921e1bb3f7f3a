"""Collect all taxels of a calibration in one record, ordered by channel, for the writers."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...common.arrays import Array, BoolArray, IntArray, freeze
from ...common.errors import CalibrationFormatError
from ...common.findings import did_you_mean, show
from ...common.text import MAX_TAXELS
from ..model import LinkCalibration
from .taxel_set import MAX_LABEL_LENGTH


@dataclass(frozen=True, eq=False)
class LinkTaxels:
    """Taxels of a link; row i of each field belongs to the same taxel."""

    link: str
    ids: tuple[str, ...]
    channels: IntArray  # (n,) ascending
    patches: tuple[str, ...]  # name of the patch of each taxel
    pixels: IntArray  # (n, 2) row and column in an image of all patches, one below the other
    positions: Array  # (n, 3) [m]
    axes: Array  # (n, 3, 3) columns: tangent, normal x tangent, normal
    areas: Array  # (n,) [m^2]
    sizes: Array  # (n, 2) extents of the cell along and across the tangent [m]
    square: BoolArray  # (n,) True for cells with four corners
    sigma: Array  # (n, 3) along the surface [m], along the normal [m], of the normal [rad]; NaN where unknown
    neighbours: tuple[tuple[str, ...], ...]
    ports: tuple[tuple[str | None, ...], ...]  # adjacent boards at the sides of a board; empty for other taxels

    def __post_init__(self):
        n = len(self.ids)
        freeze(self, channels=(n,), pixels=(n, 2), positions=(n, 3), axes=(n, 3, 3), areas=(n,), sizes=(n, 2))
        freeze(self, square=(n,))

    @property
    def normals(self) -> Array:
        """Return unit normals, shape (n, 3)."""
        return self.axes[:, :, 2]

    @property
    def tangents(self) -> Array:
        """Return unit tangents, shape (n, 3)."""
        return self.axes[:, :, 0]

    def of(self, patch: str) -> IntArray:
        """Return the rows of the taxels of a patch."""
        return np.flatnonzero(np.array(self.patches) == patch)


def taxels_of(calibration: LinkCalibration) -> LinkTaxels:
    """Return the taxels of all patches."""
    parts = [patch.taxels for patch in calibration.patches]
    count = sum(len(part.ids) for part in parts)
    if not 0 < count <= MAX_TAXELS:
        raise CalibrationFormatError(
            f"link {show(calibration.link)} has {count} taxels; files may have 1 to {MAX_TAXELS}"
        )
    channels = np.concatenate([part.channels for part in parts])
    order = np.argsort(channels, kind="stable")

    def joined(rows: Iterable[NDArray[Any]]) -> NDArray[Any]:
        return np.concatenate(list(rows))[order]

    def listed(rows: Iterable[Sequence[Any]]) -> tuple[Any, ...]:
        every = [row for part in rows for row in part]
        return tuple(every[i] for i in order)

    normals, tangents = (joined(getattr(part, name) for part in parts) for name in ("normals_link", "tangents_link"))
    return LinkTaxels(
        link=calibration.link,
        ids=listed(part.ids for part in parts),
        channels=channels[order],
        patches=listed([patch.name] * len(patch.taxels.ids) for patch in calibration.patches),
        pixels=_pixels([part.index for part in parts])[order],
        positions=joined(part.positions_link for part in parts),
        axes=np.stack((tangents, np.cross(normals, tangents), normals), axis=2),
        areas=joined(part.areas for part in parts),
        sizes=joined(np.ptp(part.flat_corners, axis=1) for part in parts),
        square=joined(np.full(len(part.ids), part.corners_link.shape[1] == 4) for part in parts),
        sigma=joined(part.known_sigma for part in parts),
        neighbours=listed(part.neighbours for part in parts),
        ports=listed(part.ports or ((),) * len(part.ids) for part in parts),
    )


def _pixels(indices: Sequence[IntArray]) -> IntArray:
    """Return rows and columns, counted from zero, with each patch below the previous one."""
    below, pixels = 0, []
    for index in indices:
        pixels.append(index - index.min(axis=0) + (below, 0))
        below = int(pixels[-1][:, 0].max()) + 1
    return np.concatenate(pixels)


def only_patches(calibration: LinkCalibration, names: Sequence[str]) -> LinkCalibration:
    """Return a calibration with only the named patches."""
    known = [patch.name for patch in calibration.patches]
    for name in names:
        if name not in known:
            listed = ", ".join(map(show, known))
            raise CalibrationFormatError(
                f"the calibration has no patch {show(name)}; it has {listed}{did_you_mean(name, known)}"
            )
    return replace(calibration, patches=tuple(patch for patch in calibration.patches if patch.name in names))


def refuse_labels(labels: Iterable[str], what: str) -> None:
    """Reject names that the readers of this package would reject or change."""
    for label in labels:
        if not label or len(label) > MAX_LABEL_LENGTH or not label.isprintable() or label != label.strip():
            allowed = f"1 to {MAX_LABEL_LENGTH} printable characters without spaces at the ends"
            raise CalibrationFormatError(f"{what} {show(label)} cannot be written: names have {allowed}. Rename it.")


def refuse_repeats(names: Iterable[str], format: str) -> None:
    """Reject equal names in a format in which all names must differ."""
    again = [name for name, times in Counter(names).items() if times > 1]
    if again:
        raise CalibrationFormatError(
            f"the name {show(again[0])} would occur twice in {format}. Rename the patch or the link."
        )
