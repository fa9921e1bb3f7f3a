"""Build the extension: one zip file for each platform, with SciPy, trimesh and libigl for Python 3.11 and 3.13.

    python scripts/make_extension.py [--platform linux-x64 ...]
    python scripts/make_extension.py --platform linux-x64 --without-wheels

The second zip is for the Blender of a Linux distribution, whose Python has SciPy and trimesh from the distribution. It
has the wheel of libigl for all Pythons from 3.12 on, because distributions lack it.
Run it with the Python of the virtual environment: the builder is part of Blender's module.
"""

import argparse
import email
import hashlib
import importlib.util
import json
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PIP_PLATFORMS = {
    "linux-x64": ("manylinux2014_x86_64", "manylinux_2_28_x86_64"),
    "linux-arm64": ("manylinux2014_aarch64", "manylinux_2_28_aarch64"),
    "windows-x64": ("win_amd64",),
    "macos-arm64": ("macosx_12_0_arm64", "macosx_11_0_arm64"),
    "macos-x64": ("macosx_10_13_x86_64", "macosx_10_15_x86_64"),
}
EARLIEST = (1980, 1, 1, 0, 0, 0)  # the first time that a zip file knows: the same files give the same bytes
SBOM = "sbom.spdx.json"


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


def licences_of(wheel):
    """Return the names of the texts of licences in a wheel file, and its metadata."""
    with zipfile.ZipFile(wheel) as archive:
        texts = re.compile(r"dist-info/(.*/)?(LICEN[CS]E|COPYING|NOTICE).*[^/]$", re.I)
        names = [n for n in archive.namelist() if texts.search(n)]
        metadata = next(n for n in archive.namelist() if n.endswith(".dist-info/METADATA"))
        return names, email.message_from_bytes(archive.read(metadata))


def copy_licences(wheel, folder):
    """Copy the texts of the licences of a wheel into a folder of its name."""
    target = folder / wheel.name.split("-")[0]
    target.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(wheel) as archive:
        for name in licences_of(wheel)[0]:
            (target / Path(name).name).write_bytes(archive.read(name))


def bill_of(wheels, version):
    """Return the software bill of materials (SPDX 2.3) of a zip file with these wheels."""
    packages = [package("skin-calib", version, "GPL-3.0-or-later", None)]
    for wheel in wheels:
        name, release = wheel.split("-")[:2]
        metadata = licences_of(ROOT / "wheels" / wheel)[1]
        named = [c.split(" :: ")[-1] for c in metadata.get_all("Classifier", ()) if c.startswith("License ::")]
        licence = metadata["License-Expression"] or ", ".join(named) or metadata["License"] or "see its texts"
        packages.append(package(name, release, " ".join(licence.split("\n")[0].split()), wheel))
    root = {"SPDXID": "SPDXRef-DOCUMENT", "name": f"skin-calib-{version}", "spdxVersion": "SPDX-2.3"}
    root |= {"dataLicense": "CC0-1.0", "documentNamespace": f"urn:skin-calib:{version}:{sha256_of(*wheels)}"}
    created = {"created": "1980-01-01T00:00:00Z", "creators": ["Organization: Skin Calib contributors"]}
    relations = [relation("SPDXRef-DOCUMENT", "DESCRIBES", packages[0])]
    relations += [relation(packages[0]["SPDXID"], "CONTAINS", part) for part in packages[1:]]
    return root | {"creationInfo": created, "packages": packages, "relationships": relations}


def package(name, version, licence, wheel):
    """Return one package of the bill."""
    found = {"SPDXID": "SPDXRef-" + re.sub(r"[^A-Za-z0-9.]+", "-", wheel or name), "name": name, "versionInfo": version}
    found |= {"licenseDeclared": "NOASSERTION", "licenseComments": licence, "downloadLocation": "NOASSERTION"}
    if wheel is not None:
        found["checksums"] = [{"algorithm": "SHA256", "checksumValue": sha256_of(wheel)}]
        url = {"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl"}
        found["externalRefs"] = [url | {"referenceLocator": f"pkg:pypi/{name}@{version}"}]
    return found


def relation(of, kind, part):
    """Return a relationship of the bill."""
    return {"spdxElementId": of, "relationshipType": kind, "relatedSpdxElement": part["SPDXID"]}


def sha256_of(*wheels):
    """Return the hash of the bytes of wheels."""
    return hashlib.sha256(b"".join((ROOT / "wheels" / wheel).read_bytes() for wheel in wheels)).hexdigest()


def rewrite_with_fixed_times(archive):
    """Write a zip file again, its members sorted and without the times of their files."""
    with zipfile.ZipFile(archive) as old:
        members = {name: old.read(name) for name in sorted(old.namelist())}
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as new:
        for name, content in members.items():
            info = zipfile.ZipInfo(name, EARLIEST)
            info.external_attr, info.create_system = 0o644 << 16, 3
            info.compress_type = zipfile.ZIP_STORED if name.endswith(".whl") else zipfile.ZIP_DEFLATED
            new.writestr(info, content)


def build(platform, with_wheels=True):
    """Build the zip file of one platform and return its path.

    The builder packs every wheel that it finds. Its source is therefore a copy of the tracked files with the wheels of
    this platform only, their licences, and a list of what they are (SPDX).
    """
    import shutil
    import tempfile

    wheels = [wheel for wheel in wheels_for(platform) if with_wheels or "-abi3-" in wheel]
    download(wheels, platform)
    with tempfile.TemporaryDirectory() as folder:
        tracked = subprocess.run(
            ["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True
        ).stdout.splitlines()
        for name in filter(lambda n: (ROOT / n).is_file(), tracked):
            target = Path(folder) / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target)
        (Path(folder) / "wheels").mkdir()
        for wheel in wheels:
            shutil.copy2(ROOT / "wheels" / wheel, Path(folder) / "wheels")
            copy_licences(ROOT / "wheels" / wheel, Path(folder) / "LICENSES" / "wheels")
        manifest = Path(folder) / "blender_manifest.toml"
        listed = "".join(f'  "./wheels/{wheel}",\n' for wheel in wheels)
        text = re.sub(r"^wheels = \[.*?^\]", f"wheels = [\n{listed}]", manifest.read_text(), flags=re.M | re.S)
        manifest.write_text(re.sub(r"^platforms = .*$", f'platforms = ["{platform}"]', text, flags=re.M))
        version = tomllib.loads(text)["version"]
        (Path(folder) / SBOM).write_text(json.dumps(bill_of(wheels, version), indent=1) + "\n")
        (ROOT / "dist").mkdir(exist_ok=True)
        end = "" if with_wheels else "_without_wheels"
        target = ROOT / "dist" / f"skin_calib-{version}-{platform.replace('-', '_')}{end}.zip"
        part = target.with_suffix(f".{os.getpid()}.part.zip")  # a reader of the target never gets half of it
        subprocess.run(
            [sys.executable, builder(), "build", "--source-dir", folder, "--output-filepath", part], check=True
        )
        rewrite_with_fixed_times(part)
        subprocess.run([sys.executable, builder(), "validate", part], check=True)
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
