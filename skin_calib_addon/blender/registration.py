# SPDX-License-Identifier: GPL-3.0-or-later
"""Register all parts of the extension, in the order in which they depend on each other.

Of each module, this registers the classes of Blender whose names begin with ``SKIN_``, and the functions in
``HANDLERS``, by the names of events in `bpy.app.handlers`; and it calls ``register``. Functions in ``TIMERS`` can wait
for a call until the extension is removed.
"""

from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType

import bpy

from . import command, session
from .handles import plane_handles, skin_handles
from .inspection import replay, taxel_mesh
from .live import diagnoses, updates
from .overlay import drawing
from .properties import inspect, link, robot, warning
from .scene import preferences, results

# Groups of properties first, each after those that it contains; what draws the links listens to undo after the session.
OURS = (warning, inspect, link, robot, preferences)
AFTER_PANELS = (drawing, session, updates, diagnoses, plane_handles, skin_handles, replay, taxel_mesh, command)
_modules: list[ModuleType] = []


def register(package: str) -> None:
    """Add properties, operators, panels, overlay, handles and command."""
    for module in (*OURS, *_all_in(f"{package}.operators"), *_all_in(f"{package}.panels"), *AFTER_PANELS):
        for cls in _classes_of(module):
            bpy.utils.register_class(cls)
        for event, handler in getattr(module, "HANDLERS", {}).items():
            getattr(bpy.app.handlers, event).append(handler)
        getattr(module, "register", lambda: None)()
        _modules.append(module)
    if not bpy.app.background:  # without a window timers do not run, but the exit waits for them
        bpy.app.timers.register(resume)  # an extension that registers has no access to the file


def resume() -> None:
    """Treat the open file as one that was just opened: Live goes on, and meshes may have changed in the meantime."""
    for module in _modules:
        getattr(module, "HANDLERS", {}).get("load_post", lambda *_: None)(bpy.data.filepath, None)


def unregister() -> None:
    """Remove everything in the opposite order."""
    if bpy.app.timers.is_registered(resume):
        bpy.app.timers.unregister(resume)
    while _modules:
        module = _modules.pop()
        getattr(module, "unregister", lambda: None)()
        for timer in getattr(module, "TIMERS", ()):
            if bpy.app.timers.is_registered(timer):
                bpy.app.timers.unregister(timer)
        for event, handler in getattr(module, "HANDLERS", {}).items():
            getattr(bpy.app.handlers, event).remove(handler)
        for cls in reversed(_classes_of(module)):
            bpy.utils.unregister_class(cls)
    results.clear()


def _all_in(package: str) -> list[ModuleType]:
    """Return the modules of a package."""
    return [import_module(f"{package}.{found.name}") for found in iter_modules(import_module(package).__path__)]


def _classes_of(module: ModuleType) -> list[type]:
    """Return the classes of Blender that a module defines, in its order."""
    own = (found for found in vars(module).values() if getattr(found, "__module__", "") == module.__name__)
    classes = (found for found in own if isinstance(found, type) and issubclass(found, bpy.types.bpy_struct))
    return [cls for cls in classes if cls.__name__.startswith("SKIN_")]
