"""Forward what moved to the package ``skin_control``, with a warning. To be removed after one release."""

import sys
import warnings
from importlib import import_module
from types import ModuleType
from typing import Any

MODULES = {  # of this package, and where their names are now; the package "balance" had no name of its own
    "balance": None,
    "balance.cone": "skin_control.cone",
    "balance.foothold": "skin_control.foothold",
    "balance.inscribed": "skin_control.inscribed",
    "balance.polygon": f"{__package__}.polygon",
    "balance.walking": "skin_control.walking",
    "tasks": "skin_control.tasks",
    "reflexes": "skin_control.reflexes",
    "proximity": "skin_control.proximity",
}
OF_WRENCH = {  # names of the module "wrench" that are now in "skin_control.virtual"
    "MIN_CONTACT_AREA",
    "distances_of",
    "lands_early",
    "pressure_driven",
    "proximity_wrench",
    "sole_wrench",
    "temperature_wrench",
}


class Moved(ModuleType):
    """Stand for a module that moved, which is imported when one of its names is read."""

    def __getattr__(self, name: str) -> Any:
        return moved(self.__name__, MODULES[self.__name__.removeprefix(f"{__package__}.")], name)


def moved(old: str, new: str | None, name: str) -> Any:
    """Return a name of its new module to a caller that reads it from the old one."""
    if new is None or name.startswith("__"):
        raise AttributeError(f"module {old!r} has no attribute {name!r}")
    try:
        value = getattr(import_module(new), name)
    except ModuleNotFoundError as error:
        what = f"{old} moved to the package skin_control; install it: pip install skin-calib-control"
        raise ModuleNotFoundError(what, name=error.name) from error
    warnings.warn(f"{old}.{name} moved: import it from {new}", DeprecationWarning, stacklevel=3)
    return value


def forward() -> None:
    """Put the modules that moved where imports find them."""
    for name in MODULES:
        full = f"{__package__}.{name}"
        parent, _, child = full.rpartition(".")
        sys.modules[full] = Moved(full)
        setattr(sys.modules[parent], child, sys.modules[full])
