# SPDX-License-Identifier: GPL-3.0-or-later
"""What the properties of a plan have in common: none is animated, and a change outdates the result."""

from typing import Any


def outdate(group: Any, _context: Any) -> None:
    """The plan that a property belongs to is no longer the one that was fitted."""
    group.id_data.skin_calib.result.outdated = True


FIXED = {"options": set()}  # not animatable
PLAN = FIXED | {"update": outdate}
PLACE = PLAN | {"subtype": "TRANSLATION", "unit": "LENGTH", "precision": 5}
WAY = PLAN | {"subtype": "XYZ", "precision": 5}
SIZE = PLAN | {"subtype": "DISTANCE", "unit": "LENGTH", "precision": 5}
# Blender keeps the path in the way that the author prefers, relative to the .blend or not.
FILE = PLAN | {"subtype": "FILE_PATH", "options": {"PATH_SUPPORTS_BLEND_RELATIVE"}}
LENGTH = FIXED | {"subtype": "DISTANCE", "unit": "LENGTH", "precision": 6}
