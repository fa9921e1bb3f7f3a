"""ROS 2's converter and an IDL compiler accept the messages; without them the tests are skipped."""

import shutil

import pytest

from skin_calib_addon.messages.definitions import NAMES, OF_ROS, PACKAGE
from tests.live.programs import run, write_idl

MISSING = [tool for tool in ("rosidl", "idlc") if shutil.which(tool) is None]
INSTALL = "apt install python3-rosidl rosidl-tools python3-catkin-pkg python3-empy cyclonedds-tools"


@pytest.mark.skipif(bool(MISSING), reason=f"{MISSING} are not installed: {INSTALL}")
def test_an_idl_compiler_accepts_all_messages(tmp_path):
    """From .msg to .idl with rosidl, from .idl to C with Cyclone DDS; also the messages of ROS that they use."""
    assert len(write_idl(tmp_path)) == len(OF_ROS) + len(NAMES)
    for name in NAMES:
        file = tmp_path / "idl" / PACKAGE / "msg" / f"{name}.idl"
        run("idlc", "-l", "c", "-I", tmp_path / "idl", "-o", tmp_path, file)
        assert f"skin_calib_msgs_msg_{name}_desc" in (tmp_path / f"{name}.c").read_text()
