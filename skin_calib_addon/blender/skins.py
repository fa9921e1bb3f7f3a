# SPDX-License-Identifier: GPL-3.0-or-later
"""The skins of a plan: from properties in scene units to the plan's document in metres, and back."""

import re
from typing import Any

import numpy as np

from ..calibration.model import TaxelArray
from ..errors import InvalidPlan, SkinCalibError
from ..plan_skins import GAP, SIDE
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
        If its list of cells is empty or cannot be read.
    """
    document = _sheet(skin, metre) if skin.kind == "sheet" else _boards(skin, metre)
    document |= {"name": skin.name, "kind": skin.kind, "offset": exact(skin.offset, metre)}
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
    }


def _boards(skin: Any, metre: float) -> dict[str, Any]:
    document: dict[str, Any] = {
        "side": exact(skin.side, metre),
        "cells": _cells(skin) if skin.choice == "listed" else skin.choice,
        "origin": _origin(skin, metre),
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


def check_kinds(documents: list[dict[str, Any]]) -> None:
    """Refuse skins of a plan that have no place in a scene.

    Raises
    ------
    InvalidPlan
        Names the first.
    """
    for document in documents:
        if document["kind"] == "imported":
            raise InvalidPlan(
                f"skin {document['name']!r} is imported from a file, which a scene has no place for; calibrate this "
                "plan by the command line"
            )


def add_skin(skins: Any, kind: str, metre: float) -> Any:
    """A new skin at the end of a collection, in usual sizes, called as no other one there."""
    names = {skin.name for skin in skins}
    skin = skins.add()
    skin.name = next(n for n in ("skin", *(f"skin_{k}" for k in range(2, len(names) + 3))) if n not in names)
    skin.kind, skin.auto_channel = kind, True
    _set_usual_sizes(skin, metre)
    return skin


def _set_usual_sizes(skin: Any, metre: float) -> None:
    """Also those of the other kind, for the author may change it; the defaults of properties know no unit."""
    skin.pitch, skin.side, skin.gap = in_units((PITCH, PITCH), metre), SIDE / metre, GAP / metre


def set_skin(skin: Any, document: dict[str, Any], metre: float) -> None:
    """Set a new skin of a collection from its document."""
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
    if skin.kind == "sheet":
        _set_sheet(skin, document, metre)
    else:
        _set_boards(skin, document, metre)


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
    return owner, "origin"


def put_point(plan: Any, what: str, skin: int, index: int, point: Any) -> None:
    """Set an origin, a landmark or a zone to a point in the link frame in scene units; raises as point_of does."""
    owner, name = point_of(plan, what, skin, index)
    setattr(owner, name, point)
    if what == "origin":
        owner.centred = False


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
