# SPDX-License-Identifier: GPL-3.0-or-later
"""Register all parts of the extension, in the order in which they depend on each other."""

from importlib import import_module
from types import ModuleType

from . import command, session
from .handles import plane_handles, skin_handles
from .inspection import replay, taxel_mesh
from .live import diagnoses, updates
from .overlay import drawing
from .properties import link as properties
from .scene import results

_modules: list[ModuleType] = []


def register(package: str) -> None:
    """Add properties, operators, panels, overlay, handles and command."""
    outside = [import_module(f"{package}.{name}") for name in ("operators", "panels")]
    for module in (
        properties,
        *outside,
        drawing,
        session,
        updates,
        diagnoses,
        plane_handles,
        skin_handles,
        replay,
        taxel_mesh,
        command,
    ):
        module.register()
        _modules.append(module)


def unregister() -> None:
    """Remove everything in the opposite order."""
    while _modules:
        _modules.pop().unregister()
    results.clear()
