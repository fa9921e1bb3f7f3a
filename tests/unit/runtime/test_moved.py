"""What moved to ``skin_control`` has an error at its old name without this package; with it, see ``control/tests``."""

import importlib
import sys

import pytest

from skin_calib_addon.runtime import moved, polygon, wrench

OLD = [f"skin_calib_addon.runtime.{name}" for name, new in moved.MODULES.items() if new and "skin_control" in new]


@pytest.fixture
def without_control(monkeypatch):
    """The package is not installed."""
    for name in [n for n in sys.modules if n.split(".")[0] == "skin_control"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "skin_control", None)


@pytest.mark.parametrize("old", OLD)
def test_missing_package_is_named(old, without_control):
    """The import of the old module works, so that tools can look at it; reading a name states what to install."""
    module = importlib.import_module(old)
    assert not hasattr(module, "__path__")
    with pytest.raises(ModuleNotFoundError, match=f"{old} moved to .*: pip install skin-calib-control"):
        module.anything  # noqa: B018


@pytest.mark.parametrize("name", sorted(moved.OF_WRENCH))
def test_missing_package_is_named_for_virtual_wrenches(name, without_control):
    """Other names that the module does not have are an ordinary error."""
    with pytest.raises(ModuleNotFoundError, match="runtime.wrench moved to .*: pip install skin-calib-control"):
        getattr(wrench, name)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        wrench.nothing  # noqa: B018


def test_polygons_are_found_in_their_old_module(without_control):
    """They stay in the runtime, and need no other package."""
    with pytest.warns(DeprecationWarning, match="Polygon moved: import it from skin_calib_addon.runtime.polygon"):
        from skin_calib_addon.runtime.balance.polygon import Polygon
    assert Polygon is polygon.Polygon
