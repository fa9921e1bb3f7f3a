# SPDX-License-Identifier: GPL-3.0-or-later
"""Call functions when Blender reports a change, and after a delay."""

from collections.abc import Callable, Iterable
from typing import Any

import bpy

SCENE_REPLACED = ("undo_post", "redo_post", "load_post")  # events after which all objects can be different

Handlers = dict[str, Callable[..., Any]]  # by the name of the event in bpy.app.handlers
Timer = Callable[[], float | None]  # returns the seconds to its next call, None to end


def listen(handlers: Handlers) -> None:
    """Call each handler at its event from now on."""
    for name, handler in handlers.items():
        getattr(bpy.app.handlers, name).append(handler)


def ignore(handlers: Handlers, timers: Iterable[Timer]) -> None:
    """Remove the handlers, and the timers that wait."""
    for name, handler in handlers.items():
        getattr(bpy.app.handlers, name).remove(handler)
    for timer in timers:
        if bpy.app.timers.is_registered(timer):
            bpy.app.timers.unregister(timer)


def wake(timer: Timer, seconds: float = 0.0) -> None:
    """Call a timer after a delay, if it does not wait already."""
    if not bpy.app.timers.is_registered(timer):
        bpy.app.timers.register(timer, first_interval=seconds)
