"""Build independent readers of the messages, in C with Cyclone DDS and in C++ with Fast DDS, from the IDL of rosidl."""

import re
import shutil
import subprocess
from pathlib import Path

from skin_calib_addon.messages.definitions import FOLDER, NAMES, OF_ROS, PACKAGE

HERE = Path(__file__).parent
INSTALL = "apt install python3-rosidl rosidl-tools python3-catkin-pkg python3-empy cyclonedds-tools cyclonedds-dev"
INSTALL_FAST = "apt install libfastrtps-dev libfastcdr-dev fastddsgen"
HEADERS = {"cyclone": "/usr/include/dds/dds.h", "fast": "/usr/include/fastdds/dds/subscriber/DataReader.hpp"}


def missing(kind):
    """Return what a reader needs and is not installed here."""
    tools = ["rosidl", "idlc", "cc"] if kind == "cyclone" else ["rosidl", "fastddsgen", "java", "c++"]
    found = [tool for tool in tools if shutil.which(tool) is None]
    return found + [path for path in [HEADERS[kind]] if not Path(path).exists()]


def run(*words, **options):
    """Run a program; its messages are those of a failure."""
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, **options)
    assert done.returncode == 0 and "error" not in done.stderr.lower(), done.stdout + done.stderr
    return done.stdout


def write_idl(folder):
    """Write the IDL of all messages, with include guards, which rosidl leaves out; return the files."""
    texts = OF_ROS | {f"{PACKAGE}/{name}": (FOLDER / f"{name}.msg").read_text() for name in NAMES}
    for kind, text in texts.items():
        package, name = kind.split("/")
        source = folder / "msg" / package / "msg" / f"{name}.msg"
        source.parent.mkdir(parents=True, exist_ok=True)
        source.write_text(text)
        run("rosidl", "translate", "-o", folder / "idl" / package, "--to", "idl", package,
            f"{source.parent.parent}:msg/{name}.msg")  # fmt: skip
    files = sorted((folder / "idl").rglob("*.idl"))
    for file in files:
        guard = file.stem.upper() + "_IDL"
        file.write_text(f"#ifndef {guard}\n#define {guard}\n{file.read_text()}\n#endif\n")
    return files


def as_on_the_wire(text):
    """Return an IDL with the names that ROS 2 gives to its types on the wire, and without annotations."""
    text = re.sub(r"@\w+ \((?:[^()\"]|\"[^\"]*\")*\)", "", text)
    text = re.sub(r"\bmsg::(\w+)", r"msg::dds_::\1_", text)
    text = re.sub(r"struct (\w+)", r"struct \1_", text).replace("module msg {", "module msg { module dds_ {")
    return re.sub(r"\};(\s*\};\s*#endif)", r"}; };\1", text)


def build(kind, folder):
    """Build a reader; return its path."""
    for file in write_idl(folder):
        file.write_text(as_on_the_wire(file.read_text()))
    files, out, program = sorted((folder / "idl").rglob("*.idl")), folder / "generated", folder / f"{kind}_reader"
    out.mkdir()
    if kind == "cyclone":
        for file in files:
            made = out / file.relative_to(folder / "idl").parent
            made.mkdir(parents=True, exist_ok=True)
            run("idlc", "-l", "c", "-I", folder / "idl", "-o", made, file)
        run("cc", "-O1", "-Wall", "-I", out, HERE / "reader.c", *out.rglob("*.c"), "-o", program, "-lddsc", "-lm")
    else:
        order = (
            "Time",
            "Header",
            "Point",
            "Vector3",
            "Wrench",
            "SkinContact",
            "SkinPolygon",
            "SkinQuantity",
            "SkinFrame",
        )
        texts = {file.stem: re.sub("#include .*", "", file.read_text()) for file in files}
        (out / "Skin.idl").write_text("".join(texts[name] for name in order))  # one file compiles faster than nine
        run("fastddsgen", "-replace", "-d", out, out / "Skin.idl")
        run("c++", "-I", out, HERE / "reader.cpp", *out.glob("*.cxx"), "-o", program, "-lfastrtps", "-lfastcdr")
    return program
