# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of properties, none of which can be animated; a change of one of the plan outdates the result."""

from functools import partial
from typing import Any

from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    StringProperty,
)


def outdate(group: Any, _context: Any) -> None:
    """Mark the result of a link as outdated, because its plan has changed."""
    group.id_data.skin_calib.result.outdated = True


FIXED = {"options": set()}
PLAN = FIXED | {"update": outdate}
# Blender keeps the path as the author prefers, relative to the .blend or not.
FILE = PLAN | {"subtype": "FILE_PATH", "options": {"PATH_SUPPORTS_BLEND_RELATIVE"}}

text = partial(StringProperty, **FIXED)
flag = partial(BoolProperty, **FIXED)
choice = partial(EnumProperty, **FIXED)
many = partial(CollectionProperty, **FIXED)
whole = partial(IntProperty, **FIXED)
number = partial(FloatProperty, **FIXED)
vector = partial(FloatVectorProperty, **FIXED)
length = partial(FloatProperty, subtype="DISTANCE", unit="LENGTH", precision=6, **FIXED)
angle = partial(FloatProperty, subtype="ANGLE", precision=4, **FIXED)
