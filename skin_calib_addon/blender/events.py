# SPDX-License-Identifier: GPL-3.0-or-later
"""Events of Blender, and calls after a delay."""

from collections.abc import Callable

import bpy

SCENE_REPLACED = ("undo_post", "redo_post", "load_post")  # events after which all objects can be different


def wake(timer: Callable[[], float | None], seconds: float = 0.0) -> None:
    """Call a timer after a delay, if it does not wait already; it returns the seconds to its next call, None to end."""
    if not bpy.app.timers.is_registered(timer):
        bpy.app.timers.register(timer, first_interval=seconds)
