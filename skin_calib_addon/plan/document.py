"""Between the JSON document of a plan and its frozen records, by the table of keys."""

from collections.abc import Callable
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from ..calibration.response import response_document, response_from
from ..common.errors import InvalidPlan
from ..geometry.grid.grids import Across, Grid, PlanesGrid, Sector, Tolerance, axis_along
from ..geometry.mesh.cover import Cut
from ..geometry.sampling.planes import Planes
from ..skin.boards.layout import Choice
from .checks import check_skins, check_together
from .key import Record, Type
from .keys import GRIDS, PLAN, PLANE, PLANS, SKINS_OF
from .plan import SURFACE, Plan
from .skins import BoardSkin, SheetSkin, Skin, with_channels

NO_REGION = 'A patch needs either "from" and "to" (a sector of a tube), or "normal" (planes across a face).'


def plan_from(document: dict[str, Any]) -> Plan:
    """Return the plan in a document that keeps the schema.

    Raises
    ------
    InvalidPlan
        If its members contradict each other.
    """
    plan: Plan = read(PLANS[document["version"]], document)
    plan = replace(plan, extra={name: value for name, value in document.items() if name.startswith("x_")})
    check_together(plan)
    return plan


def plan_document(plan: Plan) -> dict[str, Any]:
    """Return the plan as the JSON document that reads back to it, with the channels that are known.

    A plan with one surface of the usual name is of version 1, which older programs read.
    """
    is_old = [surface.name for surface in plan.surfaces] == [SURFACE]
    return write(PLAN if is_old else PLANS[2], replace(plan, skins=with_channels(plan.skins))) | plan.extra


def skins_from(documents: list[dict[str, Any]]) -> tuple[Skin, ...]:
    """Return the skins in documents that keep the schema; raises as :func:`plan_from`."""
    skins = tuple(read_skin(document) for document in documents)
    check_skins(skins)
    return skins


def read(record: Record, document: dict[str, Any]) -> Any:
    """Return the frozen record in an object of a document that keeps the schema."""
    values = {}
    for key in record.keys:
        is_given = key.name in document and not (key.word and document[key.name] == key.word)
        if key.path:
            values[key.path] = read_value(key.type, document[key.name]) if is_given else key.default
    return record.made(values)


def write(record: Record, value: Any) -> dict[str, Any]:
    """Return the object of a document that reads back to a frozen record."""
    document = {}
    for key in record.keys:
        if key.type.kind == "constant":
            document[key.name] = key.type.schema["const"]
        elif key.path:
            member = attrgetter(key.path)(value)
            if key.always or key.is_required or member != key.default:
                document[key.name] = key.word if member is None else write_value(key.type, member)
    return document


def read_value(of: Type, value: Any) -> Any:
    """Return the Python value of a JSON value."""
    if of.kind in READ:
        return READ[of.kind](value)
    if of.record is not None:
        return tuple(read(of.record, v) for v in value) if of.kind == "records" else read(of.record, value)
    return as_tuples(value)


def write_value(of: Type, value: Any) -> Any:
    """Return the JSON value of a Python value."""
    if of.kind in WRITE:
        return WRITE[of.kind](value)
    if of.record is not None:
        return [write(of.record, v) for v in value] if of.kind == "records" else write(of.record, value)
    return as_lists(value)


def as_tuples(value: Any) -> Any:
    """Return a value with tuples instead of lists."""
    return tuple(as_tuples(item) for item in value) if isinstance(value, list) else value


def whole(value: Any) -> Any:
    """Return whole numbers, with tuples instead of lists: JSON takes 6.0 for one. Words stay as they are."""
    if isinstance(value, list):
        return tuple(whole(item) for item in value)
    return value if isinstance(value, str) else int(value)


def read_cells(value: Any) -> Choice:
    """Return the boards of a skin: a word, or a list."""
    if isinstance(value, str):
        return value  # type: ignore[return-value]
    return tuple((int(q), int(r), *map(float, shifted)) for q, r, *shifted in value)  # type: ignore[misc]


def as_lists(value: Any) -> Any:
    """Return a value with lists instead of tuples."""
    return [as_lists(item) for item in value] if isinstance(value, tuple) else value


def planes_from(cuts: tuple[Cut, ...]) -> Planes:
    """Return a family of planes."""
    return Planes(np.array([cut.point for cut in cuts]), np.array([cut.normal for cut in cuts]))


def read_planes(documents: list[dict[str, Any]]) -> Planes:
    """Return a family of planes from their documents."""
    return planes_from(tuple(read(PLANE, document) for document in documents))


def write_planes(planes: Planes) -> list[dict[str, Any]]:
    """Return the documents of a family of planes."""
    return [write(PLANE, Cut(*pair)) for pair in zip(planes.points.tolist(), planes.normals.tolist())]


def read_grid(document: dict[str, Any]) -> Grid | PlanesGrid:
    """Return the grid in a document that keeps the schema."""
    kind, both = document["kind"], {"from", "to"} & document.keys()
    region = "across" if "normal" in document else "sector" if both else "tube"
    if "normal" in document and both or len(both) == 1 or kind == "patch" and region == "tube":
        raise InvalidPlan(NO_REGION)
    if kind in ("tube", "patch"):
        document = with_lines(document)
    if kind != "planes":
        kind = region if kind == "patch" else kind
        grid: Grid = read(GRIDS[kind, region], document)
        return grid if kind == "auto" else without_axis_point(grid)
    planes: PlanesGrid = read(GRIDS["planes", ""], document)
    return planes


def without_axis_point(grid: Grid) -> Grid:
    """Return a grid whose axis is through the origin where only its direction counts: across a face."""
    if not isinstance(grid.region, Across) or grid.region.axis is None:
        return grid
    return replace(grid, region=replace(grid.region, axis=axis_along(grid.region.axis.direction)))


def with_lines(document: dict[str, Any]) -> dict[str, Any]:
    """Return the document of a grid with a number of lines, also where it has one of full planes."""
    if ("m" in document) == ("lines" in document):
        raise InvalidPlan('Give exactly one of "m" and "lines" in the grid.')
    if "lines" in document:
        return document
    return document | {"lines": document["m"] * (2 if document["kind"] == "tube" else 1)}


def write_grid(grid: Grid | PlanesGrid) -> dict[str, Any]:
    """Return the grid as the document that reads back to it."""
    return write(GRIDS[grid_kind(grid)], grid)


def grid_kind(grid: Grid | PlanesGrid) -> tuple[str, str]:
    """Return the kind and the region of a grid, as in the window."""
    if isinstance(grid, PlanesGrid):
        return "planes", ""
    region = grid.region
    name = "across" if isinstance(region, Across) else "sector" if isinstance(region, Sector) else "tube"
    return "auto" if isinstance(grid.size, Tolerance) else name, name


def read_skin(document: dict[str, Any]) -> Skin:
    """Return the skin in a document that keeps the schema."""
    if document["kind"] == "sheet" and ("origin" in document) == ("landmarks" in document):
        name = document["name"]
        raise InvalidPlan(f'Give exactly one of "origin" and "landmarks" in skin {name!r}.')
    skin: Skin = read(SKINS_OF[document["kind"]], document)
    return skin


def write_skin(skin: Skin) -> dict[str, Any]:
    """Return the skin as the document that reads back to it."""
    document = write(SKINS_OF[skin_kind(skin)], skin)
    if "landmarks" in document:
        del document["origin"]
    return document


def skin_kind(skin: Skin) -> str:
    """Return the kind of a skin, as in a document."""
    return "sheet" if isinstance(skin, SheetSkin) else "hexagons" if isinstance(skin, BoardSkin) else "imported"


# By kind of type, where records and tuples are not enough.
READ: dict[str, Callable[[Any], Any]] = {
    "count": whole,
    "cells": read_cells,
    "file": Path,
    "mesh": Path,
    "planes": read_planes,
    "grid": read_grid,
    "skins": lambda documents: tuple(read_skin(document) for document in documents),
    "response": response_from,
}
WRITE: dict[str, Callable[[Any], Any]] = {
    "file": Path.as_posix,
    "mesh": Path.as_posix,
    "planes": write_planes,
    "grid": write_grid,
    "skins": lambda skins: [write_skin(skin) for skin in skins],
    "response": response_document,
}
