"""Names that were in the runtime are the same objects here, and their old modules warn."""

import importlib
import inspect
import subprocess
import sys

import pytest

from skin_calib_addon.runtime import moved
from skin_control import virtual

PUBLIC = [
    (f"skin_calib_addon.runtime.{old}", new, name)
    for old, new in moved.MODULES.items()
    if new and new.startswith("skin_control.")
    for name, value in vars(importlib.import_module(new)).items()
    if name[0] != "_" and inspect.getmodule(value) is importlib.import_module(new)
]
PUBLIC += [("skin_calib_addon.runtime.wrench", "skin_control.virtual", name) for name in sorted(moved.OF_WRENCH)]


@pytest.mark.parametrize(("old", "new", "name"), PUBLIC)
def test_old_name_is_the_new_one(old, new, name):
    """The warning names the new module, and its position is that of the import."""
    with pytest.warns(DeprecationWarning, match=f"{old}.{name} moved: import it from {new}") as warned:
        value = getattr(importlib.import_module(old), name)
    assert value is getattr(importlib.import_module(new), name)
    assert [w.filename for w in warned] == [__file__]


def test_each_virtual_wrench_is_forwarded():
    functions = {n for n, f in vars(virtual).items() if inspect.isfunction(f) and f.__module__ == virtual.__name__}
    assert functions <= moved.OF_WRENCH


def test_import_statement_warns_in_a_fresh_process():
    """Python shows the warning of a script without any option."""
    code = "from skin_calib_addon.runtime.balance.cone import wrench_cone"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "DeprecationWarning: skin_calib_addon.runtime.balance.cone.wrench_cone moved" in done.stderr
    assert subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True).returncode == 1
