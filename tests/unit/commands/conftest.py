"""What several tests of commands use."""

import pytest

from skin_calib_addon.geometry.mesh.triangle_mesh import save_mesh
from tests.shapes import cylinder
from tests.unit.commands.test_cli import write_plan


@pytest.fixture
def folder(tmp_path):
    """A folder with a mesh and a plan for it."""
    save_mesh(cylinder(around=24, along=8), tmp_path / "tube.ply")
    write_plan(tmp_path)
    return tmp_path
