# SPDX-License-Identifier: GPL-3.0-or-later
"""Between properties, in scene units, and the frozen records of a plan, in metres, by the table of keys."""

import json
import os
import re
from operator import attrgetter
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...common.errors import InvalidPlan
from ...common.text import NumberError, real
from ...geometry.mesh.cover import Cut
from ...geometry.sampling.planes import Planes
from ...plan.document import as_tuples, planes_from, read_value, write_value
from ...plan.key import Key, Record, problem
from ...skin.boards.layout import Cell
from .units import exact, in_units, vector

CELL = re.compile(r"-?\d{1,4},-?\d{1,4}(,[^,]+,[^,]+,[^,]+)?")
# Kinds of values whose properties a module of its own reads and writes.
OWN = ("mesh", "group", "grid", "skins", "response")


def read(record: Record, group: Any, metre: float, where: tuple[str, ...] = ()) -> Any:
    """Return the frozen record in a group of properties."""
    return record.made({key.path: read_key(key, group, metre, where) for key in record.keys if key.path})


def write(record: Record, value: Any, group: Any, metre: float) -> None:
    """Set a group of properties from a frozen record."""
    for key in record.keys:
        if key.path:
            write_key(key, group, attrgetter(key.path)(value), metre)


def read_key(key: Key, group: Any, metre: float, where: tuple[str, ...] = ()) -> Any:
    """Return the Python value of a key from its properties."""
    if has_default(key, group):
        return key.default
    value = _value(key, group, metre, where)
    wrong = "" if value == key.default else problem(key, value)
    if wrong:
        raise refusal(key, wrong, where)
    return planes_from(value) if key.type.kind == "planes" else value


def has_default(key: Key, group: Any) -> bool:
    """Return whether the properties of a key stand for its default, whatever the value next to them is."""
    if key.empty is not None and getattr(group, key.property_name) == key.empty:
        return True
    if key.switch is None or key.is_required:
        return False
    return bool(getattr(group, key.switch.name) == key.switch.means_default)


def refusal(key: Key, wrong: str, where: tuple[str, ...]) -> InvalidPlan:
    """Return the error about the value of a key, in words of the window."""
    label = key.labels[0] if key.type.kind == "cells" else key.label
    return InvalidPlan(f"{', '.join((*where, label))}: {wrong}.")


def _value(key: Key, group: Any, metre: float, where: tuple[str, ...]) -> Any:
    kind, record = key.type.kind, key.type.record
    if kind == "json":
        return read_value(key.type, json.loads(getattr(group, key.property_name) or "[]"))
    if kind in ("records", "planes"):
        assert record is not None
        entries = enumerate(getattr(group, key.property_name))
        return tuple(read(record, item, metre, (*where, f"{key.labels[0]} {i}")) for i, item in entries)
    if record is not None:
        return read(record, group, metre, where)
    value = getattr(group, key.property_name)
    if kind == "cells":
        return _cells(key, group.cells, where) if value == "listed" else value
    if kind == "file":
        if not value:
            raise refusal(key, "is empty; choose the file that has the taxels", where)
        return Path(os.path.abspath(bpy.path.abspath(value, library=group.id_data.library)))
    factor = metre if key.type.is_length else 1.0
    if key.type.shape:
        numbers = [*value] if kind == "count" else vector(value, factor)
        return as_tuples(np.reshape(np.array(numbers, object), key.type.shape).tolist())
    return exact(value, factor) if isinstance(value, float) else value


def _cells(key: Key, text: str, where: tuple[str, ...]) -> tuple[Cell, ...]:
    try:
        cells = read_cells(text)
    except InvalidPlan as error:
        raise refusal(key, str(error), where) from error
    if not cells:
        raise refusal(key, "must not be empty; write q,r for each board, as in 0,0 1,0 0,1, or choose Fill", where)
    return cells


def write_key(key: Key, group: Any, value: Any, metre: float) -> None:
    """Set the properties of a key from its Python value; Blender keeps seven digits."""
    is_default = not key.is_required and _same(value, key.default)
    if key.switch is not None:
        setattr(group, key.switch.name, is_default == key.switch.means_default)
    if is_default and (key.switch is not None or value is None):
        if key.empty is not None:
            setattr(group, key.property_name, key.empty)
        return
    kind, record = key.type.kind, key.type.record
    if kind in ("records", "planes"):
        assert record is not None
        entries = getattr(group, key.property_name)
        entries.clear()
        for entry in _cuts(value) if isinstance(value, Planes) else value:
            write(record, entry, entries.add(), metre)
    elif kind == "json":
        setattr(group, key.property_name, json.dumps(write_value(key.type, value)) if value else "")
    elif record is not None:
        write(record, value, group, metre)
    elif kind == "cells":
        group.choice = value if isinstance(value, str) else "listed"
        if group.choice == "listed":
            group.cells = written_cells(value)
    elif kind == "file":
        setattr(group, key.property_name, kept_path(os.path.abspath(value)))
    else:
        numbers = np.ravel(value).tolist() if key.type.shape else value
        setattr(group, key.property_name, _scaled(numbers, metre) if key.type.is_length else numbers)


def write_first(record: Record, group: Any, metre: float) -> None:
    """Set the lengths of a new group to those of a new entry, which depend on the unit of the scene."""
    for key in record.keys:
        if key.type.is_length and key.type.record is None and key.shown_first is not None:
            setattr(group, key.property_name, _scaled(key.shown_first, metre))


def _same(value: Any, default: Any) -> bool:
    return type(value) is type(default) and value == default or value is default


def _scaled(lengths: Any, metre: float) -> Any:
    return lengths / metre if isinstance(lengths, int | float) else in_units(lengths, metre)


def _cuts(planes: Planes) -> tuple[Cut, ...]:
    """Return planes one by one, with their normals as they were given."""
    return tuple(Cut(*pair) for pair in zip(planes.points.tolist(), planes.directions.tolist()))


def read_cells(text: str) -> tuple[Cell, ...]:
    """Return boards written as "0,0 1,0 0,1", or "0,0,x,y,turn" shifted from their place [m, m, rad]."""
    cells: list[Cell] = []
    for word in re.sub(r"\s*,\s*", ",", text).split():
        found = CELL.fullmatch(word)
        if not found:
            raise InvalidPlan(f"{word!r} is not a cell; write q,r for each board, as in 0,0 1,0 0,1")
        q, r, *shifted = word.split(",")
        try:
            cells.append((int(q), int(r), *map(real, shifted)))
        except NumberError as error:
            raise InvalidPlan(f"{word!r} is not a board: {error}") from error
    return tuple(cells)


def written_cells(cells: Any) -> str:
    """Return axial coordinates as :func:`read_cells` reads them."""
    return " ".join(",".join(f"{number:g}" if k < 2 else f"{number:.6f}" for k, number in enumerate(c)) for c in cells)


def kept_path(path: str) -> str:
    """Return a path as Blender keeps it: relative to the .blend where there is one and the author prefers that."""
    if bpy.data.filepath and bpy.context.preferences.filepaths.use_relative_paths:
        try:
            return bpy.path.relpath(path)
        except ValueError:  # on another drive
            pass
    return path
