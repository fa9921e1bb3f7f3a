"""ROS 2's converter and an IDL compiler accept the messages; without them the tests are skipped."""

import shutil
import subprocess

import pytest

from skin_calib_addon.messages.definitions import FOLDER, NAMES, OF_ROS, PACKAGE

MISSING = [tool for tool in ("rosidl", "idlc") if shutil.which(tool) is None]
INSTALL = "apt install python3-rosidl rosidl-tools python3-catkin-pkg python3-empy cyclonedds-tools"


@pytest.mark.skipif(bool(MISSING), reason=f"{MISSING} are not installed: {INSTALL}")
def test_an_idl_compiler_accepts_all_messages(tmp_path):
    """From .msg to .idl with rosidl, from .idl to C with Cyclone DDS; also the messages of ROS that they use."""
    texts = {f"{PACKAGE}/{name}": (FOLDER / f"{name}.msg").read_text() for name in NAMES}
    for kind, text in {**OF_ROS, **texts}.items():
        package, name = kind.split("/")
        source = tmp_path / "msg" / package / "msg" / f"{name}.msg"
        source.parent.mkdir(parents=True, exist_ok=True)
        source.write_text(text)
        run("rosidl", "translate", "-o", tmp_path / "idl" / package, "--to", "idl", package,
            f"{source.parent.parent}:msg/{name}.msg")  # fmt: skip
    files = sorted((tmp_path / "idl").rglob("*.idl"))
    assert len(files) == len(OF_ROS) + len(NAMES)
    for file in files:  # rosidl leaves out include guards, which other compilers need
        guard = file.stem.upper() + "_IDL"
        file.write_text(f"#ifndef {guard}\n#define {guard}\n{file.read_text()}\n#endif\n")
    for name in NAMES:
        run(
            "idlc",
            "-l",
            "c",
            "-I",
            tmp_path / "idl",
            "-o",
            tmp_path,
            tmp_path / "idl" / PACKAGE / "msg" / f"{name}.idl",
        )
        assert f"skin_calib_msgs_msg_{name}_desc" in (tmp_path / f"{name}.c").read_text()


def run(*words):
    """Run a program; its messages are those of a failure."""
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True)
    assert done.returncode == 0 and "error" not in done.stderr.lower(), done.stdout + done.stderr
