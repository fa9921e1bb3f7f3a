"""The skins of a plan: what lies where on the link."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..calibration.model import MAX_CHANNEL
from ..common.errors import InvalidPlan
from ..skin.boards.layout import Choice
from ..skin.boards.outline import Zone
from ..skin.lattice import HexLattice, SheetLattice
from ..skin.sheet.landmarks import Landmark

# A shorter vector points nowhere.
SHORTEST = 1e-6
# The hexagonal boards of the TUM skin: their sides are 16.3 mm long, and trimmed so that they stand 27.75 mm apart.
SIDE = 0.0163
GAP = 0.02775 - float(np.sqrt(3)) * SIDE

Point = tuple[float, float, float]
Rows = tuple[Point, Point, Point]


@dataclass(frozen=True)
class SheetSkin:
    """A sheet of ``rows`` x ``columns`` cells and where it lies on the link."""

    name: str
    lattice: SheetLattice
    origin: Point | None  # centre of cell (0, 0) [m]; None: centred on the surface, or held by landmarks
    direction: Point  # where the rows run to
    first_channel: int | None = None  # None: after the skin before
    offset: float = 0.0  # height of its neutral layer above the surface [m]
    landmarks: tuple[Landmark, ...] = ()
    trim: bool = False  # whether cells that lie off the surface are left out

    @property
    def count(self) -> int:
        """How many channels it takes."""
        return self.lattice.rows * self.lattice.columns


@dataclass(frozen=True)
class BoardSkin:
    """Hexagonal boards and where they lie on the link."""

    name: str
    lattice: HexLattice
    choice: Choice
    origin: Point | None = None  # centre of the root cell [m]; None: the middle of the surface
    direction: Point | None = None  # where its row runs to; None: along the surface's v
    first_channel: int | None = None  # None: after the skin before
    offset: float = 0.0  # height of their middle planes above the surface [m]
    excluded: tuple[Zone, ...] = ()

    @property
    def count(self) -> int | None:
        """How many channels it takes; None before it is laid."""
        return None if isinstance(self.choice, str) else len(self.choice)


@dataclass(frozen=True)
class ImportedSkin:
    """Taxels of a file that another program wrote."""

    name: str
    file: Path
    format: str | None = None  # None: the content tells
    rotation: Rows | None = None  # of the file's frame into the link's; None: the file is in the link frame
    translation: Point = (0.0, 0.0, 0.0)  # [m]
    snap: bool = False  # whether taxels are moved to the surface
    only: str | None = None  # pattern of the labels that are taken; None: all
    first_channel: int | None = None  # None: after the skin before; channels of the file count from there
    count = None  # how many channels it takes is told by the file

    @property
    def frame(self) -> tuple[Rows, Point] | None:
        """Rotation and translation into the link frame; None: the file is in it."""
        return None if self.rotation is None else (self.rotation, self.translation)


Skin = SheetSkin | BoardSkin | ImportedSkin


def skins_from(documents: list[dict[str, Any]]) -> tuple[Skin, ...]:
    """The skins in documents that keep the schema.

    Raises
    ------
    InvalidPlan
        If their members do not go together.
    """
    read: dict[str, Callable[[dict[str, Any]], Skin]] = {"sheet": _sheet, "hexagons": _boards, "imported": _imported}
    skins = tuple(read[document["kind"]](document) for document in documents)
    for i, skin in enumerate(skins):
        if skin.name in {other.name for other in skins[:i]}:
            raise InvalidPlan(f"two skins are called {skin.name!r}; names must differ")
    firsts = first_channels(skins, [skin.count for skin in skins])
    return tuple(replace(skin, first_channel=first) for skin, first in zip(skins, firsts))


def first_channels(skins: tuple[Skin, ...], counts: list[int | None]) -> list[int | None]:
    """The first channel of each skin; None for one that follows a skin whose number of taxels is not known yet.

    Raises
    ------
    InvalidPlan
        If two share a channel, or one ends beyond the highest.
    """
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
            raise InvalidPlan(f"skin {skin.name!r} would end on channel {following - 1}; the highest is {MAX_CHANNEL}")
        for other, channels in taken:
            if first < channels.stop and channels.start < following:
                both = max(first, channels.start)
                raise InvalidPlan(f"skins {other.name!r} and {skin.name!r} share channel {both}; move a first_channel")
        taken.append((skin, range(first, following)))
    return firsts


def _sheet(document: dict[str, Any]) -> SheetSkin:
    name = document["name"]
    if ("origin" in document) == ("landmarks" in document):
        raise InvalidPlan(f'skin {name!r} needs either "origin" or "landmarks", not both and not none')
    landmarks = tuple(Landmark(tuple(k["cell"]), tuple(k["point"])) for k in document.get("landmarks", ()))
    rows, columns = document["rows"], document["columns"]
    for landmark in landmarks:
        if landmark.cell[0] >= rows or landmark.cell[1] >= columns:
            raise InvalidPlan(
                f"a landmark of skin {name!r} is of cell {list(landmark.cell)}; the sheet has {rows} x {columns} cells"
                ", counted from 0"
            )
    return SheetSkin(
        name=name,
        lattice=SheetLattice(rows, columns, tuple(document["pitch"]), document.get("hand", "right")),
        origin=_origin(document),
        direction=direction_from(
            document["direction"], f"the direction of skin {name!r} is zero; say where its rows run to"
        ),
        first_channel=document.get("first_channel"),
        offset=document.get("offset", 0.0),
        landmarks=landmarks,
        trim=document.get("trim", False),
    )


def _boards(document: dict[str, Any]) -> BoardSkin:
    name, cells = document["name"], document.get("cells", "fill")
    if not isinstance(cells, str):
        cells = tuple((q, r) for q, r in cells)
        if len(set(cells)) < len(cells):
            raise InvalidPlan(f"skin {name!r} names a cell twice; each board has its own")
    direction = None
    if "direction" in document:
        message = f"the direction of skin {name!r} is zero; say where its rows run to, or leave it out"
        direction = direction_from(document["direction"], message)
    return BoardSkin(
        name=name,
        lattice=HexLattice(document.get("side", SIDE), document.get("gap", GAP)),
        choice=cells,
        origin=_origin(document),
        direction=direction,
        first_channel=document.get("first_channel"),
        offset=document.get("offset", 0.0),
        excluded=tuple(Zone(tuple(z["point"]), z["radius"]) for z in document.get("excluded", ())),
    )


def _imported(document: dict[str, Any]) -> ImportedSkin:
    frame = document.get("frame", {})
    return ImportedSkin(
        name=document["name"],
        file=Path(document["file"]),
        format=document.get("format"),
        rotation=_rows(frame["rotation"]) if frame else None,
        translation=tuple(frame.get("translation", (0.0, 0.0, 0.0))),
        snap=document.get("snap", False),
        only=document.get("only"),
        first_channel=document.get("first_channel"),
    )


def _rows(matrix: list[list[float]]) -> Rows:
    x, y, z = ((a, b, c) for a, b, c in matrix)
    return x, y, z


def _origin(document: dict[str, Any]) -> Point | None:
    origin = document.get("origin", "center")
    return None if origin == "center" else tuple(origin)


def direction_from(vector: list[float], message: str) -> Point:
    """A direction that is none too short to point anywhere."""
    if np.linalg.norm(vector) < SHORTEST:
        raise InvalidPlan(message)
    x, y, z = vector
    return x, y, z


def skin_document(skin: Skin) -> dict[str, Any]:
    """The skin as the document that reads back to it."""
    if isinstance(skin, ImportedSkin):
        document = _imported_document(skin)
    else:
        document = _sheet_document(skin) if isinstance(skin, SheetSkin) else _boards_document(skin)
        document |= {"offset": skin.offset} if skin.offset else {}
    return document | ({} if skin.first_channel is None else {"first_channel": skin.first_channel})


def _sheet_document(skin: SheetSkin) -> dict[str, Any]:
    document: dict[str, Any] = {
        "name": skin.name,
        "kind": "sheet",
        "rows": skin.lattice.rows,
        "columns": skin.lattice.columns,
        "pitch": [*skin.lattice.pitch],
    }
    if skin.landmarks:
        document["landmarks"] = [{"cell": [*k.cell], "point": [*k.point]} for k in skin.landmarks]
    else:
        document["origin"] = "center" if skin.origin is None else [*skin.origin]
    document["direction"] = [*skin.direction]
    if skin.lattice.hand != "right":
        document["hand"] = skin.lattice.hand
    return document | ({"trim": True} if skin.trim else {})


def _boards_document(skin: BoardSkin) -> dict[str, Any]:
    document: dict[str, Any] = {
        "name": skin.name,
        "kind": "hexagons",
        "side": skin.lattice.side,
        "gap": skin.lattice.gap,
        "cells": skin.choice if isinstance(skin.choice, str) else [[*cell] for cell in skin.choice],
        "origin": "center" if skin.origin is None else [*skin.origin],
    }
    if skin.direction is not None:
        document["direction"] = [*skin.direction]
    if skin.excluded:
        document["excluded"] = [{"point": [*z.point], "radius": z.radius} for z in skin.excluded]
    return document


def _imported_document(skin: ImportedSkin) -> dict[str, Any]:
    document: dict[str, Any] = {"name": skin.name, "kind": "imported", "file": skin.file.as_posix()}
    if skin.format is not None:
        document["format"] = skin.format
    if skin.only is not None:
        document["only"] = skin.only
    if skin.rotation is not None:
        document["frame"] = {"rotation": [[*row] for row in skin.rotation], "translation": [*skin.translation]}
    return document | ({"snap": True} if skin.snap else {})
