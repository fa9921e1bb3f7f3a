# SPDX-License-Identifier: GPL-3.0-or-later
"""Register everything that Blender sees, in the order in which parts need each other."""

from importlib import import_module
from types import ModuleType

from . import command
from .handles import handles, skin_handles
from .inspection import replay
from .live import diagnoses, live
from .overlay import overlay
from .properties import link as properties
from .scene import results

_modules: list[ModuleType] = []


def register(package: str) -> None:
    """Add properties, operators, panels, overlay and command.

    Parameters
    ----------
    package : str
        Name of the extension's package, under which ``operators`` and ``panels`` lie beside this one.
    """
    outside = [import_module(f"{package}.{name}") for name in ("operators", "panels")]
    for module in (properties, *outside, overlay, live, diagnoses, handles, skin_handles, replay, command):
        module.register()
        _modules.append(module)


def unregister() -> None:
    """Take everything away in the opposite order."""
    while _modules:
        _modules.pop().unregister()
    results.clear()
