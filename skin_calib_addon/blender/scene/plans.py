# SPDX-License-Identifier: GPL-3.0-or-later
"""The plan of a link: from the properties of its object in scene units to a frozen plan in metres, and back."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...calibration.modality import modality_document, modality_from
from ...calibration.response import AnyResponse, Response, response_document, response_from
from ...common.errors import InvalidPlan
from ...geometry import Grid, PlanesGrid
from ...plan import Plan
from ...plan.checks import check_together
from ...plan.document import grid_kind, without_axis_point
from ...plan.document import read as read_document
from ...plan.document import write as write_document
from ...plan.key import Key, Record
from ...plan.keys import COVER, GRIDS, LINK, MESH_UNCERTAINTY, SURFACE
from ...plan.plan import Surface
from .face_groups import empty_groups
from .fields import OWN, read, read_key, write, write_key
from .link_meshes import placement_warnings
from .skins import read_skin, seen_from, write_skin
from .units import metres_per_unit, vector

# Largest numbers of Blender's properties, which have single precision and 32 bits.
LARGEST_NUMBER, LARGEST_COUNT = 3e38, 2**31 - 1


def read_plan(link: bpy.types.Object, scene: bpy.types.Scene) -> Plan:
    """Return the plan in an object's properties; its mesh has a name there, and is not read."""
    settings, metre = link.skin_calib, metres_per_unit(scene)
    extra = json.loads(settings.extra or "{}")
    try:
        plan = Plan(
            link=read_key(LINK, settings, metre),
            mesh=Path(settings.mesh_file or f"{link.name}.ply"),
            unit="m",
            surfaces=read_surfaces(settings, metre),
            skins=tuple(read_skin(skin, metre) for skin in settings.skins),
            response=_read_response(settings, extra.pop("response", None)),
            modalities=tuple(modality_from(modality) for modality in extra.pop("modalities", ())),
            mesh_uncertainty=read_key(MESH_UNCERTAINTY, settings, metre),
            extra=extra,
        )
        check_together(plan)
    except InvalidPlan as error:
        raise InvalidPlan(f"{link.name}: {error}", **error.numbers) from error
    return plan


def plan_to_write(link: bpy.types.Object, scene: bpy.types.Scene) -> Plan:
    """Return the plan in an object's properties, with the warnings about the object, which go into its calibration."""
    plan = read_plan(link, scene)
    return replace(plan, warnings=(*placement_warnings(link, metres_per_unit(scene)), *empty_groups(link)))


def write_plan(link: bpy.types.Object, scene: bpy.types.Scene, plan: Plan) -> None:
    """Set an object's properties from a plan that :func:`check_numbers` accepts; the mesh stays as it is.

    Blender keeps seven digits; a number with more is rounded.
    """
    settings, metre = link.skin_calib, metres_per_unit(scene)
    write_key(LINK, settings, plan.link, metre)
    write_key(MESH_UNCERTAINTY, settings, plan.mesh_uncertainty, metre)
    settings.mesh_file = plan.mesh.name
    write_surfaces(settings, plan.surfaces, 0, metre)
    settings.skins.clear()
    for skin in plan.skins:
        write_skin(skin, settings.skins.add(), metre)
    extra = dict(plan.extra)
    settings.response.clear()
    if isinstance(plan.response, Response) and plan.response.range is None:
        for coefficient in plan.response.coefficients if plan.response != Response() else ():
            settings.response.add().value = coefficient
    else:  # no property has a table or a range
        extra["response"] = response_document(plan.response)
    if plan.modalities:  # no property has them
        extra["modalities"] = [modality_document(modality) for modality in plan.modalities]
    settings.extra = json.dumps(extra) if extra else ""


def is_kept(plan: Plan, kept: Plan) -> bool:
    """Return whether properties have all numbers of a plan whose digits they can round."""
    skins = seen_from(Path(), plan.skins), seen_from(Path(), kept.skins)
    surfaces = ([(s.cover, s.grid) for s in each.surfaces] for each in (plan, kept))
    return skins[0] == skins[1] and plan.response == kept.response and next(surfaces) == next(surfaces)


def is_simple(key: Key) -> bool:
    """Return whether a key of the plan is one property of the link."""
    return bool(key.path and key.label) and key.type.kind not in OWN


def read_surfaces(settings: Any, metre: float) -> tuple[Surface, ...]:
    """Return the surfaces of a link: the one in its properties, and the others, which are kept as JSON."""
    kept = _kept(settings.other_surfaces)
    return tuple(_shown(settings, metre) if other is None else read_document(SURFACE, other) for other in kept)


def other_surface(settings: Any, index: int) -> Surface:
    """Return a surface that the properties of a link do not have."""
    return read_document(SURFACE, _kept(settings.other_surfaces)[index])


def shown_surface(link: bpy.types.Object, scene: bpy.types.Scene) -> Surface:
    """Return the surface that the properties of an object have."""
    return read_plan(link, scene).surfaces[shown_index(link.skin_calib)]


def shown_index(settings: Any) -> int:
    """Return which of the surfaces of a link its properties have, from 0."""
    return _kept(settings.other_surfaces).index(None)


def surface_names(settings: Any) -> list[str]:
    """Return the names of the surfaces of a link, in the order of the plan."""
    kept = _kept(settings.other_surfaces)
    return [settings.surface_name if other is None else other["name"] for other in kept]


@lru_cache(maxsize=4)  # panels ask for it several times in each redraw
def _kept(text: str) -> list[Any]:
    """Return the surfaces that a link keeps as JSON, with None for the one that its properties have."""
    kept: list[Any] = json.loads(text or "[null]")
    return kept


def _shown(settings: Any, metre: float) -> Surface:
    simple = {key.path: read_key(key, settings, metre) for key in SURFACE.keys if is_simple(key)}
    return Surface(cover=read(COVER, settings.cover, metre), grid=read_grid(settings.grid, metre), **simple)


def write_surfaces(settings: Any, surfaces: Sequence[Surface], shown: int, metre: float) -> None:
    """Set the properties of a link to one surface, and keep the others as JSON."""
    surface = surfaces[shown]
    for key in SURFACE.keys:
        if is_simple(key):
            write_key(key, settings, getattr(surface, key.path), metre)
    write(COVER, surface.cover, settings.cover, metre)
    write_grid(settings.grid, surface.grid, metre)
    kept = [None if k == shown else write_document(SURFACE, other) for k, other in enumerate(surfaces)]
    settings.other_surfaces = json.dumps(kept) if len(kept) > 1 else ""


def read_grid(group: Any, metre: float) -> Grid | PlanesGrid:
    """Return the grid in a group of properties."""
    grid: Grid | PlanesGrid = read(record_of(group), group, metre)
    return without_axis_point(grid) if group.kind == "across" else grid


def record_of(group: Any) -> Record:
    """Return the record of the kind and the region that the properties of a grid name."""
    return GRIDS[group.kind, {"auto": group.region, "planes": ""}.get(group.kind, group.kind)]


def write_grid(group: Any, grid: Grid | PlanesGrid, metre: float) -> None:
    """Set a group of properties from a grid."""
    group.kind, region = grid_kind(grid)
    if region:
        group.region = region
    write(GRIDS[group.kind, region], grid, group, metre)


def _read_response(settings: Any, kept: Any) -> AnyResponse:
    """Return the response: kept as JSON, as a polynomial in the properties, or readings in newtons."""
    if kept is not None:
        return response_from(kept)
    coefficients = tuple(vector(c.value for c in settings.response))
    if not all(map(np.isfinite, coefficients)):
        raise InvalidPlan("Response: must have finite numbers.")
    return Response(coefficients) if coefficients else Response()


def check_numbers(plan: Plan, metre: float = 1.0) -> None:
    """Refuse a plan with a number that is too large for Blender's properties, or not finite."""
    for number in numbers_of(plan):
        largest = LARGEST_COUNT if isinstance(number, int) else LARGEST_NUMBER * min(metre, 1.0)
        if not abs(number) <= largest:
            raise InvalidPlan(f"The plan has the number {number}. Blender keeps numbers up to {largest:g}; change it.")


def numbers_of(part: Any) -> Iterator[float]:
    """Return all numbers in a frozen record and the records in it."""
    if is_dataclass(part):
        part = tuple(getattr(part, f.name) for f in fields(part))
    if isinstance(part, np.ndarray):
        part = tuple(part.ravel().tolist())
    if isinstance(part, tuple):
        for item in part:
            yield from numbers_of(item)
    elif isinstance(part, int | float):
        yield part
