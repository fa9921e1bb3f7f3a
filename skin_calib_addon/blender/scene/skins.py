# SPDX-License-Identifier: GPL-3.0-or-later
"""The skins of a plan: from properties in scene units to the plan's document in metres, and back."""

import json
import os
import re
from itertools import chain, count
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...calibration.model import TaxelArray
from ...common.errors import InvalidPlan, SkinCalibError
from ...pipeline.sources import relative_path
from ...plan.skins import GAP, SIDE, BoardSkin, SheetSkin
from .decimals import exact, in_units, vector

PITCH = 0.01  # of a new sheet [m]
RADIUS = 0.005  # of a new zone [m]
CELL = re.compile(r"(-?\d{1,4}),(-?\d{1,4})")


def read_cells(text: str) -> list[list[int]]:
    """Axial coordinates written as "0,0 1,0 0,1".

    Raises
    ------
    InvalidPlan
        Names the word that is none.
    """
    cells = []
    for word in re.sub(r"\s*,\s*", ",", text).split():
        found = CELL.fullmatch(word)
        if not found:
            raise InvalidPlan(f"{word!r} is no cell; write each as q,r with spaces between, such as 0,0 1,0 0,1")
        cells.append([int(number) for number in found.groups()])
    return cells


def skin_document(skin: Any, metre: float) -> dict[str, Any]:
    """The document of a skin.

    Raises
    ------
    InvalidPlan
        If its list of cells is empty or cannot be read, or it is of no file.
    """
    document = {"sheet": _sheet, "hexagons": _boards, "imported": _imported}[skin.kind](skin, metre)
    document |= {"name": skin.name, "kind": skin.kind}
    if not skin.auto_channel:
        document["first_channel"] = skin.first_channel
    return document


def _sheet(skin: Any, metre: float) -> dict[str, Any]:
    if skin.landmarks:
        places = [{"cell": [*mark.cell], "point": vector(mark.point, metre)} for mark in skin.landmarks]
        held: dict[str, Any] = {"landmarks": places}
    else:
        held = {"origin": _origin(skin, metre)}
    return held | {
        "rows": skin.rows,
        "columns": skin.columns,
        "pitch": vector(skin.pitch, metre),
        "direction": vector(skin.direction),
        "hand": skin.hand,
        "trim": skin.trim,
        "offset": exact(skin.offset, metre),
    }


def _boards(skin: Any, metre: float) -> dict[str, Any]:
    document: dict[str, Any] = {
        "side": exact(skin.side, metre),
        "cells": _cells(skin) if skin.choice == "listed" else skin.choice,
        "origin": _origin(skin, metre),
        "offset": exact(skin.offset, metre),
    }
    if not skin.auto_gap:
        document["gap"] = exact(skin.gap, metre)
    if not skin.auto_direction:
        document["direction"] = vector(skin.direction)
    if skin.excluded:
        document["excluded"] = [
            {"point": vector(zone.point, metre), "radius": exact(zone.radius, metre)} for zone in skin.excluded
        ]
    return document


def _imported(skin: Any, metre: float) -> dict[str, Any]:
    if not skin.file:
        raise InvalidPlan(f"skin {skin.name!r} is of no file; choose the one that has its taxels")
    document: dict[str, Any] = {"file": file_of(skin), "snap": skin.snap}
    if skin.format != "auto":
        document["format"] = skin.format
    if skin.only:
        document["only"] = skin.only
    if skin.framed:
        rotation = np.reshape(vector(skin.rotation), (3, 3)).tolist()
        document["frame"] = {"rotation": rotation, "translation": vector(skin.translation, metre)}
    return document


def file_of(skin: Any) -> str:
    """Where the file of an imported skin is, whatever folder is the current one."""
    return os.path.abspath(bpy.path.abspath(skin.file, library=skin.id_data.library))


def find_files(documents: list[dict[str, Any]], folder: Path) -> None:
    """Make the files of imported skins absolute, which a plan in a folder names."""
    for document in documents:
        if document["kind"] == "imported":
            document["file"] = os.path.abspath(folder / document["file"])


def relate_files(documents: list[dict[str, Any]], folder: Path) -> None:
    """Name the files of imported skins as a plan in a folder does."""
    for document in documents:
        if document["kind"] == "imported":
            document["file"] = relative_path(folder, Path(document["file"]))


def kept_path(path: str) -> str:
    """A path as Blender would keep it: relative to the .blend where there is one and the author likes that."""
    if bpy.data.filepath and bpy.context.preferences.filepaths.use_relative_paths:
        try:
            return bpy.path.relpath(path)
        except ValueError:  # on another drive
            pass
    return path


def _origin(skin: Any, metre: float) -> Any:
    return "center" if skin.centred else vector(skin.origin, metre)


def _cells(skin: Any) -> list[list[int]]:
    try:
        cells = read_cells(skin.cells)
    except InvalidPlan as error:
        raise InvalidPlan(f"skin {skin.name!r}: {error}") from error
    if not cells:
        raise InvalidPlan(f"skin {skin.name!r} lists no cells; write some, such as 0,0 1,0 0,1, or let it fill")
    return cells


def add_skin(skins: Any, kind: str, metre: float, name: str = "skin") -> Any:
    """A new skin at the end of a collection, in usual sizes, called as no other one there."""
    names = {skin.name for skin in skins}
    skin = skins.add()
    skin.name = next(n for n in chain([name], (f"{name}_{k}" for k in count(2))) if n not in names)
    skin.kind, skin.auto_channel = kind, True
    _set_usual_sizes(skin, metre)
    return skin


def _set_usual_sizes(skin: Any, metre: float) -> None:
    """Also those of the other kind, for the author may change it; the defaults of properties know no unit."""
    skin.pitch, skin.side, skin.gap = in_units((PITCH, PITCH), metre), SIDE / metre, GAP / metre


def set_skin(skin: Any, document: dict[str, Any], metre: float) -> None:
    """Set a new skin of a collection from its document, whose file is absolute."""
    _set_usual_sizes(skin, metre)
    skin.name, skin.kind = document["name"], document["kind"]
    skin.offset = document.get("offset", 0.0) / metre
    origin = document.get("origin", "center")
    skin.centred = origin == "center"
    if not skin.centred:
        skin.origin = in_units(origin, metre)
    if "direction" in document:
        skin.direction, skin.auto_direction = document["direction"], False
    skin.auto_channel = "first_channel" not in document
    if not skin.auto_channel:
        skin.first_channel = document["first_channel"]
    {"sheet": _set_sheet, "hexagons": _set_boards, "imported": _set_imported}[skin.kind](skin, document, metre)


def _set_sheet(skin: Any, document: dict[str, Any], metre: float) -> None:
    skin.rows, skin.columns, skin.pitch = document["rows"], document["columns"], in_units(document["pitch"], metre)
    skin.hand, skin.trim = document.get("hand", "right"), document.get("trim", False)
    for landmark in document.get("landmarks", ()):
        item = skin.landmarks.add()
        item.cell, item.point = landmark["cell"], in_units(landmark["point"], metre)


def _set_boards(skin: Any, document: dict[str, Any], metre: float) -> None:
    skin.side = document.get("side", SIDE) / metre
    # The standard gap has more digits than a property keeps.
    skin.auto_gap = document.get("gap", GAP) == GAP
    if not skin.auto_gap:
        skin.gap = document["gap"] / metre
    cells = document.get("cells", "fill")
    skin.choice = cells if isinstance(cells, str) else "listed"
    if skin.choice == "listed":
        skin.cells = " ".join(f"{q},{r}" for q, r in cells)
    for zone in document.get("excluded", ()):
        item = skin.excluded.add()
        item.point, item.radius = in_units(zone["point"], metre), zone["radius"] / metre


def _set_imported(skin: Any, document: dict[str, Any], metre: float) -> None:
    skin.file, skin.format = kept_path(document["file"]), document.get("format", "auto")
    skin.only, skin.snap = document.get("only", ""), document.get("snap", False)
    if "frame" in document:
        set_frame(skin, document["frame"]["rotation"], document["frame"]["translation"], metre)


def set_frame(skin: Any, rotation: Any, translation: Any, metre: float) -> None:
    """Set the frame of an imported skin: rotation (3, 3), translation (3,) [m]."""
    skin.framed, skin.rotation, skin.translation = True, np.ravel(rotation), in_units(translation, metre)


def move_skin(skin: Any, moved: SheetSkin | BoardSkin, metre: float) -> None:
    """Set what places a skin, and nothing else of it: origin and direction or landmarks, and which boards there are."""
    for item, mark in zip(skin.landmarks, getattr(moved, "landmarks", ())):
        item.point = in_units(mark.point, metre)
    if moved.origin is not None:
        skin.origin, skin.centred = in_units(moved.origin, metre), False
    skin.direction, skin.auto_direction = moved.direction, False
    if isinstance(moved, BoardSkin):
        skin.choice, skin.cells = "listed", " ".join(f"{q},{r}" for q, r in moved.choice)


def point_of(plan: Any, what: str, skin: int, index: int) -> tuple[Any, str]:
    """The group of properties that holds an origin, a landmark or a zone, and the name of its point there.

    Raises
    ------
    SkinCalibError
        If it is not there.
    """
    owner = entry(plan.skins, skin, "skin")
    if what == "landmark":
        return entry(of_kind(owner, "sheet", "landmarks").landmarks, index, "landmark"), "point"
    if what == "zone":
        return entry(of_kind(owner, "hexagons", "excluded zones").excluded, index, "excluded zone"), "point"
    if owner.kind == "imported":
        raise SkinCalibError(f"skin {owner.name!r} has no origin: it lies where its file says; give it a frame")
    return owner, "origin"


def put_point(plan: Any, what: str, skin: int, index: int, point: Any) -> None:
    """Set an origin, a landmark or a zone to a point in the link frame in scene units; raises as point_of does."""
    owner, name = point_of(plan, what, skin, index)
    setattr(owner, name, point)
    if what == "origin":
        owner.centred = False


def in_window(error: SkinCalibError) -> str:
    """What the window says of an error: a frame is found by a button there, where a plan has to have it written."""
    finding = error.numbers.get("finding")
    proposal = json.dumps(finding.value) if finding else ""
    return str(error).replace(f'give it "frame": {proposal}', "press Find Frame")


def hold(skin: Any, taxels: TaxelArray, metre: float) -> None:
    """Keep a skin where it lies, by an origin and a direction of its own; of boards, all that fit from there."""
    i = root_row(taxels)
    is_free = skin.kind == "hexagons" and skin.choice == "fill"
    if is_free or skin.centred and not skin.landmarks:
        skin.origin, skin.centred = in_units(taxels.positions_link[i], metre), False
    skin.direction, skin.auto_direction = taxels.tangents_link[i], False
    if is_free:
        skin.choice = "all"


def root_row(taxels: TaxelArray) -> int:
    """The row of the cell that an origin names, or of the first cell where that one was left out."""
    return int(np.argmin(np.abs(taxels.index).sum(axis=1)))


def of_kind(skin: Any, kind: str, what: str) -> Any:
    """A skin, if it is of the kind that has such things.

    Raises
    ------
    SkinCalibError
        If it is not.
    """
    if skin.kind != kind:
        raise SkinCalibError(f"skin {skin.name!r} has no {what}, which belong to {kind}; change its kind first")
    return skin


def entry(entries: Any, index: int, what: str) -> Any:
    """One entry of a list of the plan.

    Raises
    ------
    SkinCalibError
        If it is not there.
    """
    if not 0 <= index < len(entries):
        raise SkinCalibError(f"no {what} {index} here; there are {len(entries)}, counted from 0")
    return entries[index]
