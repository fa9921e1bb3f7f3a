"""The skins of a plan: what is placed where on the link."""

from dataclasses import astuple, dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..calibration.model import MAX_CHANNEL, Touched
from ..common.arrays import unit
from ..common.errors import InvalidPlan
from ..skin.boards.ground import Zone
from ..skin.boards.layout import Choice
from ..skin.lattice import HexLattice, SheetLattice
from ..skin.sheet.landmarks import Landmark
from ..skin.single_taxels import SingleTaxel
from ..skin.uncertainty import DIRECTION_UNCERTAINTY, ORIGIN_UNCERTAINTY

Point = tuple[float, float, float]
Rows = tuple[Point, Point, Point]


class Mounting(NamedTuple):
    """How exactly a skin is mounted where the plan says: standard uncertainties, independent of each other."""

    origin: float = ORIGIN_UNCERTAINTY  # of the anchor along the surface, per axis [m]
    direction: float = DIRECTION_UNCERTAINTY  # of the rotation about the normal at the anchor [rad]
    anchor: Point | None = None  # near the skin [m]; None: what places the skin


# [m], [1] differences of points and of unit directions from which on a skin was placed anew. Smaller: rounding in the
# window counts. Larger: a skin that was moved keeps the uncertainty of its touches.
MAX_SAME_POINT, MAX_SAME_DIRECTION = 1e-5, 1e-4


class Spot(NamedTuple):
    """Where a plan places a skin, to find out whether it does so still."""

    points: tuple[Point, ...]  # the landmarks, or the origin; empty: centred
    direction: Point | None  # of the row; None: along the lines of the surface
    surface: str | None  # its name; None: the first of the plan
    cells: str  # hash of the lattice, and of the cells that are listed or pinned


@dataclass(frozen=True)
class Registered:
    """How a skin was registered by touches, and where the plan placed it then."""

    touched: Touched
    spot: Spot


@dataclass(frozen=True, kw_only=True)
class OnSurface:
    """What a plan can say of a skin of any kind."""

    surface: str | None = None  # name of the surface it is on; None: the first of the plan
    first_channel: int | None = None  # None: after the skin before; channels of a file count from there
    max_overhang: float | None = None  # of a cell or a board over an edge; more is an error [m]; None: any
    max_load: float | None = None  # largest plausible load [N]; None: by the area
    registration: Mounting | None = None  # None: with the usual uncertainty, or that of two landmarks
    taxels: tuple[SingleTaxel, ...] = ()  # those that differ from the others
    touches: Registered | None = None  # which replaces the registration while the skin is where it was registered


@dataclass(frozen=True)
class SheetSkin(OnSurface):
    """A sheet of ``rows`` x ``columns`` cells and where it lies on the link."""

    name: str
    lattice: SheetLattice
    origin: Point | None  # centre of cell (0, 0) [m]; None: centred on the surface, or placed by landmarks
    direction: Point  # of the row of the origin
    offset: float = 0.0  # height of its neutral layer above the surface [m]
    landmarks: tuple[Landmark, ...] = ()
    trim: bool = False  # whether cells that lie off the surface are left out
    overlap: bool = False  # whether it may overlap itself where it closes around the link

    @property
    def count(self) -> int:
        """Return how many channels it has."""
        return self.lattice.rows * self.lattice.columns


@dataclass(frozen=True)
class BoardSkin(OnSurface):
    """Hexagonal boards and where they lie on the link."""

    name: str
    lattice: HexLattice
    choice: Choice
    origin: Point | None = None  # centre of the root cell [m]; None: the middle of the surface
    direction: Point | None = None  # of its row; None: along the surface's v
    offset: float = 0.0  # height of their middle planes above the surface [m]
    excluded: tuple[Zone, ...] = ()

    @property
    def count(self) -> int | None:
        """Return how many channels it has; None before it is placed."""
        return None if isinstance(self.choice, str) else len(self.choice)


class Frame(NamedTuple):
    """The frame of a file in the link frame; the rotation comes first."""

    rotation: Rows
    translation: Point  # [m]


@dataclass(frozen=True)
class ImportedSkin(OnSurface):
    """Taxels of a file that another program wrote."""

    name: str
    file: Path
    format: str | None = None  # None: found from the content
    frame: Frame | None = None  # None: the file is in the link frame
    snap: bool = False  # whether taxels are moved to the surface
    only: str | None = None  # pattern of the labels that are used; None: all
    count = None  # how many channels it has is known once the file is read


Skin = SheetSkin | BoardSkin | ImportedSkin


def spot_of(skin: SheetSkin | BoardSkin) -> Spot:
    """Return where a plan places a skin."""
    points: tuple[Point, ...] = () if skin.origin is None else (skin.origin,)
    cells: list[object] = [f"{number:.5g}" if isinstance(number, float) else number for number in astuple(skin.lattice)]
    if isinstance(skin, BoardSkin):
        listed = [] if isinstance(skin.choice, str) else skin.choice
        cells += [skin.choice] if isinstance(skin.choice, str) else []
        cells += [[f"{number:.6f}" if k > 1 else number for k, number in enumerate(cell)] for cell in listed]
    elif skin.landmarks:
        points = tuple(mark.point for mark in skin.landmarks)
        cells += [list(mark.cell) for mark in skin.landmarks]
    return Spot(points, skin.direction, skin.surface, sha256(repr(cells).encode()).hexdigest())


def placed_anew(skin: Skin) -> list[str]:
    """Return what of a skin is no longer as it was registered by touches; empty if all is, or if it was not."""
    if skin.touches is None or isinstance(skin, ImportedSkin):
        return []
    then, now = skin.touches.spot, spot_of(skin)
    is_elsewhere = len(then.points) != len(now.points) or any(
        np.abs(np.subtract(a, b)).max() > MAX_SAME_POINT for a, b in zip(then.points, now.points)
    )
    is_turned = (then.direction is None) != (now.direction is None) or (
        then.direction is not None
        and np.abs(unit(np.array(then.direction)) - unit(np.array(now.direction))).max() > MAX_SAME_DIRECTION
    )
    differs = (is_elsewhere, is_turned, then.surface != now.surface, then.cells != now.cells)
    return [what for what, is_other in zip(("position", "direction", "surface", "cells"), differs) if is_other]


def first_channels(skins: tuple[Skin, ...], counts: list[int | None]) -> list[int | None]:
    """Return the first channel of each skin; None after a skin whose number of taxels is not known yet."""
    firsts: list[int | None] = []
    following: int | None = 0
    taken: list[tuple[Skin, range]] = []
    for skin, count in zip(skins, counts):
        first = following if skin.first_channel is None else skin.first_channel
        firsts.append(first)
        following = None if first is None or count is None else first + count
        if first is None or following is None:
            continue
        if following - 1 > MAX_CHANNEL:
            raise InvalidPlan(f"Skin {skin.name!r} would end on channel {following - 1}; the highest is {MAX_CHANNEL}.")
        for other, channels in taken:
            if first < channels.stop and channels.start < following:
                both = max(first, channels.start)
                raise InvalidPlan(
                    f"Skins {other.name!r} and {skin.name!r} both have channel {both}. Change the first channel of one."
                )
        taken.append((skin, range(first, following)))
    return firsts


def with_channels(skins: tuple[Skin, ...]) -> tuple[Skin, ...]:
    """Return the skins with the first channel of each as far as it is known; raises as :func:`first_channels`."""
    firsts = first_channels(skins, [skin.count for skin in skins])
    return tuple(replace(skin, first_channel=first) for skin, first in zip(skins, firsts))


def following_channel(skins: tuple[Skin, ...]) -> int | None:
    """Return the channel after those of all skins; None if the number of channels of a skin is not known yet."""
    ends = [
        None if first is None or skin.count is None else first + skin.count
        for first, skin in zip(first_channels(skins, [skin.count for skin in skins]), skins)
    ]
    known = [end for end in ends if end is not None]
    own = [single.channel + 1 for skin in skins for single in skin.taxels if single.channel is not None]
    return max([*known, *own], default=0) if len(known) == len(ends) else None
