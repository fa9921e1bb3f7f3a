"""The golden vectors, which both runtimes must give: `cpp/tests/vectors.cpp` compares those of C++."""

import json
from itertools import chain

import numpy as np
import pytest

from skin_calib_addon.calibration.file import load_calibration
from skin_calib_addon.runtime import Body, Polygon
from tests.vectors.make import FOLDER, compact, expanded, record, record_body, skin_of, tared

CASES = sorted(path.name.removesuffix(".case.json") for path in FOLDER.glob("*.case.json"))


def started(link):
    """Return the skin of a case or of a link of a case."""
    skin = skin_of(load_calibration(FOLDER / link["calibration"]), link.get("options", {}))
    if link["noise"]:
        skin.load_noise(FOLDER / link["noise"])
    return skin


@pytest.mark.parametrize("case", CASES)
def test_vectors_are_the_frames_of_this_runtime(case):
    """Sets, numbers, flags and forces are equal; sums and polygons within the rounding of linear algebra."""
    document = json.loads((FOLDER / f"{case}.case.json").read_text())
    is_body = "links" in document
    skin = Body({link["name"]: started(link) for link in document["links"]}) if is_body else started(document)
    for k, line in enumerate(document["frames"]):
        time = np.nan if line["time"] is None else line["time"]
        if is_body:
            readings, poses = ({n: each(x) for n, x in line[what].items()} for what, each in INPUTS.items())
            found = record_body(skin.update(readings, time, poses))
        else:
            if "mask" in line:
                skin.mask(line["mask"])
            found = record(skin.update(expanded(line["readings"]), time))
        compare(line["frame"], found, f"frame {k}")


def test_vectors_of_a_tare_are_what_this_runtime_learns():
    """Refusals have the same words, and levels the same numbers."""
    document = json.loads((FOLDER / "mixed.tare.json").read_text())
    calibration = load_calibration(FOLDER / document["calibration"])
    for line in document["tares"]:
        found = compact(tared(skin_of(calibration, {}), np.array(line["readings"]), line["type"], line["accept"]))
        for name, value in found.items():
            if name == "noise" and value:
                for level, numbers in value.items():
                    if level != "dead":
                        a, b = (np.array(x, float) for x in (line["noise"][level], numbers))
                        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9, err_msg=f"{line['name']}, {level}")
            elif name in ("forces", "baseline"):
                np.testing.assert_allclose(line[name], value, rtol=1e-9, atol=1e-9)
            else:
                assert line[name] == value, line["name"]


INPUTS = {"readings": expanded, "poses": lambda pose: np.stack([expanded(row) for row in pose])}
POLYGONS = {"outer", "nominal", "guaranteed"}
SUMS = {"wrench", "force", "position", "normal", "area", "load", "cop", "zmp", "size", "peak_pressure"}
SUMS |= {f"{name}_sigma" for name in SUMS} | {"outer_probability", "guaranteed_probability"}


def compare(expected, found, where):
    """Compare the record of a frame, or of a contact, with one of this runtime."""
    assert expected.keys() == found.keys()
    for name, value in expected.items():
        what = f"{where}, {name}"
        if name == "contacts":
            assert len(value) == len(found[name]), what
            for k, contact in enumerate(value):
                compare(contact, found[name][k], f"{what} {k}")
        elif value is None or found[name] is None or name not in POLYGONS | SUMS:
            assert value == compact(found[name]), what
        elif name in POLYGONS:
            corners = np.reshape(value, (-1, 2)).astype(float)
            assert bool(len(corners)) == bool(len(found[name])), what
            for a, b in ((corners, found[name]), (found[name], corners)):
                assert all(Polygon(np.array(a)).margin(point) > -1e-8 for point in b), what
        else:
            np.testing.assert_allclose(found[name], value, rtol=1e-11, atol=1e-11, err_msg=what)


def test_vectors_are_small_and_cover_what_a_runtime_can_state():
    """At most 2 MB; contacts, all three polygons, deviations, and each flag, occur."""
    assert sum(path.stat().st_size for path in FOLDER.iterdir() if path.is_file()) < 2e6
    documents = [json.loads((FOLDER / f"{case}.case.json").read_text()) for case in CASES]
    frames = [line["frame"] for document in documents for line in document["frames"]]
    flags = set(chain.from_iterable(frame["flags"] for frame in frames))
    assert {"not_finite", "too_large", "blind", "saturated", "time_back", "time_jump", "wrong_length"} <= flags
    assert {"drift", "noisy", "stuck", "frozen", "below_rest", "byte_order", "rest_assumed"} <= flags
    assert {"lost", "overload", "left:no_reading", "right:no_pose", "left:wrong_pose", "not_coplanar"} <= flags
    for name in ("cop_sigma", "zmp_sigma", "outer", "nominal", "guaranteed"):
        assert sum(bool(frame[name]) for frame in frames) > 20, name
