# SPDX-License-Identifier: GPL-3.0-or-later
"""Lengths in millimetres, whatever the unit of the scene: for each length a second property, which panels show."""

import inspect
from collections.abc import Callable, Sequence
from typing import Any

import bpy
import numpy as np

from ..scene.units import exact, metres_per_unit
from .options import FIXED

SUFFIX = "_mm"
# Unit of a lens in Blender: the number is in millimetres, and is shown with that unit in every scene with units.
UNIT = {"unit": "CAMERA"}
STEP = 10  # [0.01 mm] change of a length by a click on the arrow of its field


def millimetres_of(properties: dict[str, Any]) -> dict[str, Any]:
    """Return for each length among some properties one that has it in millimetres, and no value of its own."""
    lengths = {name: found for name, found in properties.items() if found.keywords.get("unit") == "LENGTH"}
    return {name + SUFFIX: _in_millimetres(name, length) for name, length in lengths.items()}


def with_millimetres(group: type) -> type:
    """Add to the lengths of a group of properties those in millimetres."""
    group.__annotations__ |= millimetres_of(inspect.get_annotations(group))
    return group


def shown(group: Any, name: str) -> str:
    """Return the name of the property that a panel shows: of a length, the one in millimetres."""
    return name + SUFFIX if name + SUFFIX in group.bl_rna.properties else name


def _in_millimetres(name: str, length: Any) -> Any:
    options = {key: length.keywords[key] for key in ("name", "description", "min", "size") if key in length.keywords}
    options |= FIXED | UNIT | {"precision": 4, "step": STEP}
    if length.keywords.get("subtype") == "TRANSLATION":
        options["subtype"] = "XYZ"  # X, Y and Z before the numbers
    if length.function == bpy.props.FloatVectorProperty:
        return length.function(
            get=lambda group: [exact(number, _factor()) for number in getattr(group, name)],
            set=_set_vector(name),
            **options,
        )
    return length.function(
        get=lambda group: exact(getattr(group, name), _factor()),
        set=lambda group, number: setattr(group, name, exact(number, 1 / _factor())),
        **options,
    )


def _factor() -> float:
    """Return how many millimetres a scene unit is."""
    return 1e3 * metres_per_unit(bpy.context.scene)


def _set_vector(name: str) -> Callable[[Any, Sequence[float]], None]:
    """Return what sets a vector; components that did not change keep their digits."""

    def store(group: Any, lengths: Sequence[float]) -> None:
        kept, factor = getattr(group, name), _factor()
        pairs = [(old, np.float32(exact(old, factor)) == np.float32(new), new) for old, new in zip(kept, lengths)]
        setattr(group, name, [old if is_same else exact(new, 1 / factor) for old, is_same, new in pairs])

    return store
