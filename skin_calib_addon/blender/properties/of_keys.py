# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties of Blender from the table of plan keys."""

import inspect
import math
from collections.abc import Callable, Iterable
from typing import Any

from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    IntVectorProperty,
    StringProperty,
)

from ...plan.key import Choice, Key, Record
from .millimetres import millimetres_of
from .options import FILE, FIXED, PLAN

# By the names of their records: the groups of properties that lists have as entries.
GROUPS: dict[str, type] = {}


def of_keys(*records: Record) -> Callable[[type], type]:
    """Return a decorator that gives a group the properties of the keys of some records.

    Keys with the same property have one together; the first key describes it.
    """

    def give(group: type) -> type:
        given = properties_of([key for record in records for key in record.keys])
        group.__annotations__ = given | inspect.get_annotations(group)
        for record in records:
            GROUPS[record.name] = group
        return group

    return give


def properties_of(keys: Iterable[Key]) -> dict[str, Any]:
    """Return the properties of keys by their names; keys without a label have none."""
    found: dict[str, Any] = {}
    for key in keys:
        if key.label:
            found = switch_of(key) | property_of(key) | found
    return found | millimetres_of(found)


def switch_of(key: Key) -> dict[str, Any]:
    """Return the tick box that stands for the default of a key; nothing if it has none."""
    switch = key.switch
    if switch is None:
        return {}
    words = tooltip(switch.description or key.otherwise)
    return {switch.name: BoolProperty(name=switch.label, description=words, default=switch.ticked, **PLAN)}


def property_of(key: Key) -> dict[str, Any]:
    """Return the properties of one key; nothing where its group has them by hand."""
    kind, record = key.type.kind, key.type.record
    if kind in ("records", "planes") and record is not None:
        lists = CollectionProperty(type=GROUPS[record.name], **words_of(key), **FIXED)
        return {key.property_name: lists}
    if kind == "record" and record is not None:
        return properties_of(record.keys)
    if kind not in PROPERTIES:
        return {}
    return {key.property_name: PROPERTIES[kind](key)}


def words_of(key: Key) -> dict[str, str]:
    """Return the label and the tooltip of a key."""
    return {"name": key.label, "description": tooltip(key.description)}


def tooltip(text: str) -> str:
    """Return a description as Blender shows it: with a capital, and without marks and the full stop that it adds."""
    return (text[0].upper() + text[1:]).replace("`", "").removesuffix(".")


def items_of(choices: Iterable[Choice]) -> list[tuple[str, str, str]]:
    """Return the items of a menu."""
    return [(choice.value, choice.label, choice.description) for choice in choices]


def _switch(key: Key) -> Any:
    return BoolProperty(default=bool(key.shown_first), **words_of(key), **PLAN)


def menu_of(key: Key) -> dict[str, Any]:
    """Return label, tooltip and items of a menu, with an item for the default where no choice stands for it."""
    automatic = [] if key.empty is None else [(key.empty, "Automatic", tooltip(key.otherwise))]
    return words_of(key) | {"items": automatic + items_of(key.type.choices)}


def _choice(key: Key) -> Any:
    return EnumProperty(**menu_of(key), **PLAN)


def _text(key: Key) -> Any:
    return StringProperty(default=key.shown_first or "", **words_of(key), **PLAN)


def _json(key: Key) -> Any:
    return StringProperty(name=key.label, description=f"{tooltip(key.description)}, as JSON", **PLAN)


def _file(key: Key) -> Any:
    return StringProperty(**words_of(key), **FILE)


def _count(key: Key) -> Any:
    schema = key.type.schema.get("items", key.type.schema)
    limits = {short: schema[name] for short, name in (("min", "minimum"), ("max", "maximum")) if name in schema}
    if not key.type.shape:
        return IntProperty(default=key.shown_first or 0, **limits, **words_of(key), **PLAN)
    size = key.type.shape[0]
    return IntVectorProperty(size=size, default=key.shown_first or (0,) * size, **limits, **words_of(key), **PLAN)


def _numbers(key: Key) -> Any:
    options = UNITS[key.type.kind, key.type.shape] | words_of(key) | PLAN
    schema = key.type.schema.get("items", key.type.schema)
    if key.type.is_length and schema.get("minimum", schema.get("exclusiveMinimum", -1)) >= 0:
        options |= {"min": 0}  # the other limits are in metres, which a property does not know
    if key.type.kind == "force":
        options |= {"min": 0, "max": schema["maximum"]}
    if not key.type.shape:
        digits = {} if key.type.kind == "angle" else {"precision": key.type.digits}
        return FloatProperty(default=key.shown_first or 0.0, **digits, **options)
    options |= {"size": math.prod(key.type.shape), "precision": key.type.digits}
    return FloatVectorProperty(default=key.shown_first or (0.0,) * options["size"], **options)


# How Blender shows numbers, by kind and shape.
UNITS: dict[tuple[str, tuple[int, ...]], dict[str, Any]] = {
    ("length", ()): {"subtype": "DISTANCE", "unit": "LENGTH"},
    ("length", (2,)): {"unit": "LENGTH"},
    ("length", (3,)): {"subtype": "TRANSLATION", "unit": "LENGTH"},
    ("angle", ()): {"subtype": "ANGLE"},
    ("force", ()): {},
    ("direction", (3,)): {"subtype": "XYZ"},
    ("rotation", (3, 3)): {},
}
# What makes the property of a key, by the kind of its type.
PROPERTIES: dict[str, Callable[[Key], Any]] = {
    "switch": _switch,
    "choice": _choice,
    "cells": _choice,
    "text": _text,
    "file": _file,
    "json": _json,
    "count": _count,
    "length": _numbers,
    "angle": _numbers,
    "force": _numbers,
    "direction": _numbers,
    "rotation": _numbers,
}
