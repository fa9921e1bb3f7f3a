"""What an author should look at in how a skin sits, each in a line that names the place and what to do."""

from collections.abc import Iterator

import numpy as np

from ..calibration.model import Patch
from ..common.arrays import Array
from .sheet.strain import Closure

# What real skins bear: the stretch of a sheet, the overlap of its ends, and on a board the gap, what it sticks out and
# how much deeper than in the flat it runs into another.
STRETCH = 0.05
OVERLAP = 5e-4  # [m]
GAP = 3e-3  # [m]
OVERHANG = 1e-3  # [m]
COLLISION = 5e-4  # [m]


def sitting_doubts(patch: Patch, closure: Closure | None = None) -> tuple[str, ...]:
    """Where a skin is stretched too much, overlaps itself, or has boards that do not sit."""
    return tuple(_doubts(patch, closure))


def _doubts(patch: Patch, closure: Closure | None) -> Iterator[str]:
    quality = patch.taxels.quality
    if "strain" in quality:
        strain = np.abs(quality["strain"][:, :2]).max(axis=1)
        yield from _worst(
            patch, strain, STRETCH, 100, "are strained by more than", "%", "where it will wrinkle or lift"
        )
    if closure is not None and closure.gaps.min() < -OVERLAP:
        line = int(closure.gaps.argmin())
        yield (
            f"{patch.name} overlaps itself by up to {-closure.gaps.min() * 1e3:.1f} mm where its {closure.of} close "
            f"({closure.of[:-1]} {line}); take fewer cells, or a smaller pitch"
        )
    boards = (
        ("gap", GAP, "stand off the surface at a corner, or sink in, by more than", "where it bends too much for them"),
        ("overhang", OVERHANG, "stick out over an edge by more than", "leave them out, or move the origin"),
        ("collision", COLLISION, "run into another by more than", "leave one of the two out"),
    )
    for name, limit, what, then in boards:
        if name in quality and "pitch_error" in quality:
            yield from _worst(patch, np.abs(quality[name]), limit, 1e3, what, " mm", then)


def _worst(patch: Patch, values: Array, limit: float, scale: float, what: str, unit: str, then: str) -> Iterator[str]:
    beyond = np.flatnonzero(values > limit)
    if len(beyond):
        worst = int(values.argmax())
        yield (
            f"{len(beyond)} cells of {patch.name} {what} {limit * scale:g}{unit}, the worst {patch.taxels.ids[worst]} "
            f"by {values[worst] * scale:.1f}{unit}; {then}"
        )
