"""Build the extension: one zip file for each platform, with SciPy, trimesh and libigl for Python 3.11 and 3.13.

    python scripts/make_extension.py [--platform linux-x64 ...]
    python scripts/make_extension.py --platform linux-x64 --without-wheels

The second zip is for the Blender of a Linux distribution, whose Python has SciPy and trimesh from the distribution. It
has the wheel of libigl for all Pythons from 3.12 on, because distributions lack it.
Run it with the Python of the virtual environment: the builder is part of Blender's module.
"""

import argparse
import importlib.util
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PIP_PLATFORMS = {
    "linux-x64": ("manylinux2014_x86_64", "manylinux_2_28_x86_64"),
    "windows-x64": ("win_amd64",),
    "macos-arm64": ("macosx_12_0_arm64", "macosx_11_0_arm64"),
}


def wheels_for(platform):
    """Return the wheels of the manifest that one platform needs."""
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text())
    ends = (*(f"{name}.whl" for name in PIP_PLATFORMS[platform]), "none-any.whl")
    return [Path(w).name for w in manifest["wheels"] if w.endswith(ends)]


def download(wheels, platform):
    """Download the missing ones of some wheels by name and version, unmodified."""
    folder = ROOT / "wheels"
    for wheel in wheels:
        if (folder / wheel).is_file():
            continue
        name, version, tag = wheel.split("-")[:3]
        words = [
            sys.executable,
            "-m",
            "pip",
            "download",
            "--quiet",
            "--no-deps",
            "--only-binary=:all:",
            "--dest",
            folder,
        ]
        if tag.startswith("cp"):
            words += ["--python-version", tag[2:]]
            words += [word for name in PIP_PLATFORMS[platform] for word in ("--platform", name)]
        subprocess.run([*words, f"{name}=={version}"], check=True)


def builder():
    """Return the path of Blender's extension command in its module."""
    folder = Path(importlib.util.find_spec("bpy").origin).parent
    return next(folder.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"))


def build(platform, with_wheels=True):
    """Build the zip file of one platform and return its path.

    The builder packs every wheel that it finds. Its source is therefore a copy of the tracked files with the wheels of
    this platform only.
    """
    import shutil
    import tempfile

    wheels = [wheel for wheel in wheels_for(platform) if with_wheels or "-abi3-" in wheel]
    download(wheels, platform)
    with tempfile.TemporaryDirectory() as folder:
        tracked = subprocess.run(
            ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
            cwd=ROOT,
            check=True,
            capture_output=True,
            text=True,
        ).stdout.splitlines()
        for name in filter(lambda n: (ROOT / n).is_file(), tracked):
            target = Path(folder) / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target)
        (Path(folder) / "wheels").mkdir()
        for wheel in wheels:
            shutil.copy2(ROOT / "wheels" / wheel, Path(folder) / "wheels")
        manifest = Path(folder) / "blender_manifest.toml"
        listed = "".join(f'  "./wheels/{wheel}",\n' for wheel in wheels)
        text = re.sub(r"^wheels = \[.*?^\]", f"wheels = [\n{listed}]", manifest.read_text(), flags=re.M | re.S)
        manifest.write_text(re.sub(r"^platforms = .*$", f'platforms = ["{platform}"]', text, flags=re.M))
        version = tomllib.loads(text)["version"]
        (ROOT / "dist").mkdir(exist_ok=True)
        end = "" if with_wheels else "_without_wheels"
        target = ROOT / "dist" / f"skin_calib-{version}-{platform.replace('-', '_')}{end}.zip"
        part = target.with_suffix(f".{os.getpid()}.part.zip")  # a reader of the target never gets half of it
        subprocess.run(
            [sys.executable, builder(), "build", "--source-dir", folder, "--output-filepath", part], check=True
        )
        part.replace(target)
    return target


def main():
    """Build the given platforms."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--platform", action="append", choices=PIP_PLATFORMS, help="default: all")
    parser.add_argument("--without-wheels", action="store_true", help="the Python of Blender has SciPy and trimesh")
    given = parser.parse_args()
    for platform in given.platform or PIP_PLATFORMS:
        print(build(platform, not given.without_wheels).relative_to(ROOT))


if __name__ == "__main__":
    main()
