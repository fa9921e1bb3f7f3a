"""How to install a Python package that is missing, where the program runs: with pip, or in Blender."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from .errors import SkinCalibError

# The zip file of the extension, and the extra "author", have these packages, by the modules that are imported.
IN_ZIP = {"scipy": "scipy", "trimesh": "trimesh", "igl": "libigl", "collada": "pycollada"}


def how_to_install(module: str) -> str:
    """Return how to install the package that has a module, as the end of a message."""
    package = IN_ZIP[module]
    if "bpy" not in sys.modules:
        return "pip install 'skin-calib[author]'"
    return (
        "install the zip of Skin Calib for this platform, which has it: Edit > Preferences > Get Extensions > Install "
        f"from Disk. The Blender of a Linux distribution needs {package} in its own Python, {sys.executable}"
    )


@contextmanager
def optional_package(need: str, extra: str) -> Iterator[None]:
    """Turn the error of an import that fails into one that states how to install the extra with the package."""
    try:
        yield
    except ImportError as error:
        message = f"{need}, which is not installed here: pip install 'skin-calib[{extra}]'"
        raise SkinCalibError(message) from error
