"""The package ``skin_calib_addon`` by the name of its distribution: ``from skin_calib.runtime import load``.

Each ``skin_calib.NAME`` is the module ``skin_calib_addon.NAME`` itself, not a copy of it.
"""

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

import skin_calib_addon
from skin_calib_addon import __version__

__all__ = ["__version__"]


class _SameModules(MetaPathFinder, Loader):
    """Give the modules of ``skin_calib_addon`` to those who import them from here."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        return ModuleSpec(name, self, is_package=True) if name.startswith(f"{__name__}.") else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        module = import_module(skin_calib_addon.__name__ + spec.name.removeprefix(__name__))
        self._specs[spec.name] = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        name = __name__ + module.__name__.removeprefix(skin_calib_addon.__name__)
        module.__spec__ = self._specs.pop(name)  # the import system has replaced it

    def __init__(self) -> None:
        self._specs: dict[str, ModuleSpec | None] = {}


sys.meta_path.insert(0, _SameModules())
