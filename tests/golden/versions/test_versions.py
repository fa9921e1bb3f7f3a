"""A calibration file of every version that was released; each is read for ever, to the same numbers.

A file and its numbers are written once, with the release, and never again: whatever stands in a robot looks like them.
"""

import hashlib
import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from skin_calib_addon.calibration import check_calibration, load_calibration, save_calibration
from skin_calib_addon.calibration.validate import CALIBRATION_VERSION

HERE = Path(__file__).parent
FILES = {  # by version, the SHA-256 of its file
    1: "5c574a156d36e537c1868582c25eeb4acf6e85e17f86999e16db6127f348249b",
    2: "cf50b134e9c8f9b5422c23a8c55b06921a4f3328afa0b5688b76164f940d9de7",
    3: "18f57643e3e7ce81df3b6010f3706d64bcfb3928adad04607e0cbb7c63dee9fc",
}
FITTED = {  # files of older versions that the program of then fitted to samples
    "1.sheet": "aaf3827a8102660a3bb3d7fcbe86b4ffa0fab1624bc1551f519251a698e34c88",
    "1.boards": "bc9d5bc7be6788b2e34a613ba19f9d9f6d2d52e625d7d35c488d5f93cdddb5ab",
    "1.imported": "190660484b8f4f8baf8fbc77f6093224c5583e0a5b4555c9bfb0b34ba5fe2956",
}


def numbers(calibration):
    """Return all data of a calibration as arrays by name; other values as JSON."""
    mesh = {name: value for name, value in calibration.mesh.__dict__.items() if value is not None}
    found = {"words": _json(calibration.link, calibration.generator, mesh, calibration.extra)}
    found |= {f"response {i}": a for i, r in enumerate(_responses(calibration)) for a in [_response(r)]}
    for surface in calibration.surfaces:
        errors = surface.errors
        found |= {
            f"{surface.name} {name}": np.asarray(value)
            for name, value in {
                "net": surface.control_net,
                "knots u": surface.knots_u,
                "knots v": surface.knots_v,
                "degree": surface.degree,
                "closed": surface.closed,
                "to surface": (errors.mesh_to_surface.mean, errors.mesh_to_surface.rms, errors.mesh_to_surface.max),
                "to mesh": (errors.surface_to_mesh.mean, errors.surface_to_mesh.rms, errors.surface_to_mesh.max),
                "hausdorff": errors.hausdorff,
                "words": _json(surface.extra),
            }.items()
        }
        if surface.trusted is not None:
            found |= {f"{surface.name} boundary {i}": loop for i, loop in enumerate(surface.trusted.boundary)}
            found[f"{surface.name} sites"] = np.array(surface.trusted.sites)
    for patch in calibration.patches:
        t = patch.taxels
        found |= {
            f"{patch.name} {name}": np.asarray(value)
            for name, value in {
                "channels": t.channels,
                "index": t.index,
                "uv": t.uv,
                "positions": t.positions_link,
                "normals": t.normals_link,
                "tangents": t.tangents_link,
                "corners": t.corners_link,
                "areas": t.areas,
                "responses": t.responses,
                "shape": patch.shape,
                "pitch": patch.pitch,
                "offset": patch.offset,
                "words": _json(patch.kind, patch.surface, patch.extra, t.ids, t.neighbours, t.ports),
                **t.quality,
                **({"sigma": t.sigma} if len(t.sigma) else {}),
                **({"registration": _json(asdict(patch.registration))} if patch.registration else {}),
                **({"touches": _json(asdict(patch.touches))} if patch.touches else {}),
            }.items()
        }
    if calibration.warnings:
        found["warnings"] = _json([_warning(warning) for warning in calibration.warnings])
    if calibration.modalities:
        found["modalities"] = _json([asdict(modality) for modality in calibration.modalities])
    return found


def _warning(warning):
    """Return what a file has of a warning; the name of the surface is in its message, and no warning has a normal."""
    document = asdict(warning)
    assert document["where"].pop("surface") == "" and document["where"].pop("normal") is None
    return document


def _responses(calibration):
    return (calibration.response, *calibration.responses)


def _response(response):
    rows = vars(response).values()
    return np.array([x for row in rows if row is not None for x in (len(row), *row)], float)


def _json(*values):
    return np.array(json.dumps(values))


@pytest.mark.parametrize("version", range(1, CALIBRATION_VERSION + 1))
def test_every_version_is_read(version):
    """Each released version, also the current one, has an unchanged file that gives its original numbers."""
    path = HERE / f"{version}.calibration.json"
    assert hashlib.sha256(path.read_bytes()).hexdigest() == FILES[version], "a file of a release never changes"
    calibration = load_calibration(path)
    found, listed = numbers(calibration), check_calibration(path)
    stored = [w.code for w in calibration.warnings if w.severity == "warning"]
    assert [f.code for f in listed] == ["duplicate-position", *stored]  # the taxel "alone" is where "s0.0" is
    with np.load(HERE / f"{version}.npz") as golden:
        assert set(golden.files) == set(found)
        for name, values in found.items():
            assert values.dtype == golden[name].dtype and values.shape == golden[name].shape, name
            assert values.tobytes() == golden[name].tobytes(), name


@pytest.mark.parametrize("name", FITTED)
def test_fitted_file_of_an_older_version_is_read(tmp_path, name):
    """A file that was fitted with the older program keeps its numbers; only version, warnings and checksum change."""
    path = HERE / f"{name}.calibration.json"
    assert hashlib.sha256(path.read_bytes()).hexdigest() == FITTED[name], "a file of a release never changes"
    assert check_calibration(path) == ()
    calibration = load_calibration(path)
    assert calibration.warnings == ()
    save_calibration(calibration, tmp_path / "c.json")
    old, new = (json.loads(file.read_bytes()) for file in (path, tmp_path / "c.json"))
    assert new.pop("warnings") == [] and old.pop("checksum") != new.pop("checksum")
    assert [surface.pop("trusted") for surface in new["surfaces"]] == [None] * len(old["surfaces"])
    assert (old.pop("version"), new.pop("version")) == (1, CALIBRATION_VERSION) and old == new


def test_our_version_is_written_as_it_was(tmp_path):
    """Byte for byte: the layout of rows and numbers belongs to the version."""
    path = HERE / f"{CALIBRATION_VERSION}.calibration.json"
    save_calibration(load_calibration(path), tmp_path / "c.json")
    assert (tmp_path / "c.json").read_bytes() == path.read_bytes()


def test_file_of_our_version_has_everything():
    """All kinds of patches, columns and responses of the schema of the current version."""
    document = json.loads((HERE / f"{CALIBRATION_VERSION}.calibration.json").read_bytes())
    schema = json.loads((Path(load_calibration.__code__.co_filename).with_name("schema.json")).read_bytes())
    parts = schema["$defs"]
    patches = document["patches"]
    assert {p["kind"] for p in patches} == set(parts["patch"]["properties"]["kind"]["enum"])
    assert {name for p in patches for name in p if name[:2] != "x_"} == set(parts["patch"]["properties"])
    assert {name for p in patches for name in p["taxels"]} == set(parts["taxels"]["properties"])
    assert [bool(s["trusted"] and s["trusted"]["sites"]) for s in document["surfaces"]].count(True) == 1
    responses = [document["response"], *document["responses"]]
    assert {(r["kind"], "range" in r) for r in responses} == {
        ("polynomial", True),
        ("polynomial", False),
        ("table", False),
    }
    assert {name for r in responses for name in r} == {
        name for kind in ("polynomial", "table") for name in parts[kind]["properties"]
    }
    assert {name for p in patches for row in p["taxels"].get("sigma", ()) for name in [row is None]} == {True, False}
    warnings = document["warnings"]
    assert {name for w in warnings for name in w["where"]} == set(parts["place"]["properties"])
    assert {w["severity"] for w in warnings} == {"warning", "note"}  # an error makes a file invalid
    assert {w["value"] is None for w in warnings} == {True, False}
    assert {name for m in document["modalities"] for name in m} == set(parts["modality"]["properties"])
    assert set(schema["properties"]) == {name for name in document if name[:2] != "x_"}
