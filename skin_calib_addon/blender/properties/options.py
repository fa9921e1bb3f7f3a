# SPDX-License-Identifier: GPL-3.0-or-later
"""Options that the properties of a plan have in common: no animation, and a change outdates the result."""

from typing import Any


def outdate(group: Any, _context: Any) -> None:
    """Mark the result of a link as outdated, because its plan has changed."""
    group.id_data.skin_calib.result.outdated = True


FIXED = {"options": set()}  # not animatable
PLAN = FIXED | {"update": outdate}
# Blender keeps the path as the author prefers, relative to the .blend or not.
FILE = PLAN | {"subtype": "FILE_PATH", "options": {"PATH_SUPPORTS_BLEND_RELATIVE"}}
LENGTH = FIXED | {"subtype": "DISTANCE", "unit": "LENGTH", "precision": 6}
