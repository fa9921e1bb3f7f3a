"""Validation finds all errors of a calibration, with their locations."""

import copy
import dataclasses
import gzip
import json
import re
from contextlib import suppress

import numpy as np
import pytest

from skin_calib_addon import calibration
from skin_calib_addon.calibration import encode, patch_checks, to_document, validate
from skin_calib_addon.calibration.parts import Part
from skin_calib_addon.calibration.validate import SCHEMA
from skin_calib_addon.common import findings, strict_json
from skin_calib_addon.common.encoding import checksum
from skin_calib_addon.common.findings import Finding
from skin_calib_addon.common.schema_check import check, read_schema
from skin_calib_addon.common.strict_json import MAX_JSON_DEPTH, parse
from tests.samples import seven_boards, sheet, small_calibration

TABLE = {"kind": "table", "readings": [0.0, 10.0, 20.0], "forces": [5.0, 1.0, 0.0]}
DEGREES = {"name": "temperature", "unit": "K", "response": TABLE, "channels": {"s9": 0, "s0.0": 1}}
SAMPLE = to_document(small_calibration())
TEXT = encode(SAMPLE)
NORMAL = "/patches/0/taxels/normal"


def at(document, pointer):
    """Return parent and key of the member of a pointer."""
    *path, last = [key.replace("~1", "/").replace("~0", "~") for key in pointer.split("/")[1:]]
    for key in path:
        document = document[int(key) if isinstance(document, list) else key]
    return document, int(last) if isinstance(document, list) else last


def changed(**by_pointer):
    """Return the sample with replaced values (``...`` removes) and a correct checksum."""
    document = copy.deepcopy(SAMPLE)
    for pointer, value in by_pointer.items():
        parent, key = at(document, pointer)
        if value is ...:
            del parent[key]
        else:
            parent[key] = value(parent[key]) if callable(value) else value
    if "/checksum" not in by_pointer:
        with suppress(ValueError):  # NaN and lone surrogates have no checksum
            document["checksum"] = checksum(document)
    return document


def found(document):
    return [(finding.code, finding.pointer) for finding in validate(document)]


def times(factor):
    return lambda values: (factor * np.array(values)).tolist()


def spread(taxels):
    """Return taxels at 20 times the distance, with cells of the same size."""
    position = np.array(taxels["position"])
    corners = np.array(taxels["corners"]) + 19 * position[:, None]
    return {"position": (20 * position).tolist(), "corners": corners.tolist()}


E0 = "/surfaces/0/errors/mesh_to_surface"
FAR = {"mean": 0.1, "rms": 0.2, "max": 1.0}
MILLIMETRES = {"mesh_to_surface": FAR, "surface_to_mesh": FAR, "hausdorff": 1.0}
T0, T1 = "/patches/0/taxels", "/patches/1/taxels"
STORED = {"code": "off-mesh", "severity": "warning", "message": "It is 6.2 mm off.", "where": {}, "value": 0.0062}
STORED |= {"advice": "Cut."}
TOUCHED = {
    "date": "2026-11-29",
    "used": 19,
    "left_out": 1,
    "shift": [0.001, 0],
    "turn": 0.01,
    "anchor": [0.035, 0, 0.005],
}
TOUCHED |= {"covariance": [[1e-8, 0, 0], [0, 1e-8, 0], [0, 0, 1e-6]], "along": 4e-3}
MOUNTED = {"origin": 0.001, "direction": 0.0175, "anchor": [0.035, 0.0, 0.005]}
FORM = [  # errors by the schema: pointer to change, new value, code, words of the message, where below it
    ("/format", "skin-plan", "value", 'must be "skin-calibration", not "skin-plan"'),
    ("/version", 4, "version", "newer than version 3 of this program; update"),
    ("/version", 0, "value", "must be 3, not 0"),
    ("/version", True, "value", "must be 3, not true"),
    ("/warnings", ..., "missing", 'lacks the member "warnings"'),
    ("/warnings", {}, "type", "must be an array"),
    ("/warnings", [None], "type", "must be an object, not null", "/0"),
    ("/warnings", [STORED | {"severity": "bad"}], "value", 'must be one of "error", "warning"', "/0/severity"),
    ("/warnings", [STORED | {"code": "Off Mesh"}], "pattern", "must match", "/0/code"),
    ("/warnings", [STORED | {"message": ""}], "length", "at least 1 characters", "/0/message"),
    ("/warnings", [STORED | {"value": "6 mm"}], "type", "must be a finite number or null", "/0/value"),
    ("/warnings", [STORED | {"where": {"at": 1}}], "unknown", "not a known member", "/0/where/at"),
    ("/warnings", [STORED | {"where": {"point": [0, 0]}}], "length", "3 elements", "/0/where/point"),
    ("/warnings", [{n: v for n, v in STORED.items() if n != "where"}], "missing", 'member "where"', "/0"),
    (f"{T0}/sigma", [None] * 5 + [[1e-3, 1e-3]], "length", "must have 3 elements, not 2", "/5"),
    (f"{T0}/sigma", [None] * 5 + [[1e-3, -1e-3, 0]], "range", "must be at least 0", "/5/1"),
    ("/patches/0/registration", {"origin": 0.001, "anchor": [0, 0, 0]}, "missing", 'lacks the member "direction"'),
    ("/patches/0/registration", MOUNTED | {"origin": -1}, "range", "at least 0", "/origin"),
    ("/patches/0/touches", TOUCHED | {"date": "29.11.26"}, "pattern", "must match", "/date"),
    ("/patches/0/touches", TOUCHED | {"along": None}, "type", "must be a finite number", "/along"),
    ("/units/length", "mm", "value", 'must be "m", not "mm"'),
    ("/link", "", "pattern", "must match"),
    ("/link", "fore\narm", "pattern", "must match"),
    ("/link", "\ud800", "type", "must be a string"),
    ("/link", ..., "missing", 'lacks the member "link"'),
    ("/linc", "forearm", "unknown", 'not a known member; did you mean "link"?'),
    ("/mesh/sha256", "F" * 64, "pattern", "must match"),
    ("/mesh/faces", -1, "range", "must be at least 0, not -1"),
    ("/mesh/faces", 2**31, "range", "must be at most 2147483647"),
    ("/mesh/faces", 1.5, "type", "must be an integer, not 1.5"),
    ("/surfaces", {}, "type", "must be an array, not an object of 0"),
    ("/surfaces/0", None, "type", "must be an object, not null"),
    ("/surfaces/0/degree", [3], "length", "must have 2 elements, not 1"),
    ("/surfaces/0/degree/0", 0, "range", "at least 1"),
    ("/surfaces/0/closed/0", 0, "type", "must be a boolean, not 0"),
    ("/surfaces/0/control_net/1/2/0", "1.5", "type", 'a finite number, not "1.5"'),
    ("/surfaces/0/control_net/1/2", [0, 0], "length", "must have 3 elements, not 2"),
    ("/surfaces/0/control_net", [], "length", "must have at least 1 elements, not 0"),
    ("/surfaces/1/trusted/boundary/0", [[0, 0], [1, 0]], "length", "must have at least 3 elements, not 2"),
    ("/surfaces/1/trusted/sites/0", "1 1", "pattern", "must match"),
    ("/surfaces/1/trusted/sites", ..., "missing", 'lacks the member "sites"'),
    ("/patches/0/kind", "sheets", "value", 'did you mean "sheet"?'),
    ("/patches/0/pitch/0", 0, "range", "must be more than 0, not 0"),
    (f"{T0}/normal", ..., "missing", 'lacks the member "normal"'),
    (f"{T0}/positon", [], "unknown", 'did you mean "position"?'),
    (f"{T0}/a~1~0b", [], "unknown", "not a known member"),
    (f"{T0}/position/3/1", True, "type", "must be a finite number, not true"),
    (f"{T0}/position/3/1", 10**400, "type", "must be a finite number, not a Python int"),
    (f"{T0}/channel/2", 2.5, "type", "must be an integer, not 2.5"),
    (f"{T0}/channel/2", -1, "range", "at least 0"),
    (f"{T0}/id/2", 7, "type", "must be a string, not 7"),
    (f"{T0}/neighbours/2/0", None, "type", "must be a string, not null"),
    (f"{T0}/corners/1", [[0, 0, 0]] * 2, "length", "must have at least 3 elements, not 2"),
    ("/response/coefficients", [], "length", "must have 1 to 16 elements, not 0"),
    ("/response/kind", "tabel", "value", 'must be one of "polynomial", "table".*did you mean "table"'),
    ("/response", TABLE | {"coefficients": [1]}, "unknown", "not a known member", "/coefficients"),
    ("/response", TABLE | {"readings": [0]}, "length", "must have 2 to 65536 elements, not 1", "/readings"),
    (f"{T0}/response", [0, 1, -1, 0, 0, 0], "range", "must be at least 0, not -1", "/2"),
    ("/checksum", "sha256:0", "pattern", "must match"),
]
MEANING = [  # errors that need the complete document
    (f"{T0}/sigma", [None] * 5, "length", "contains 5 taxels, but 'id' has 6"),
    (f"{T0}/sigma", [[1, 1, 0.1]] * 5 + [[1.5, 1, 0.1]], "units", "1.5 m; divide lengths by 1000", "/5/0"),
    (f"{T0}/sigma", [None] * 5 + [[0, 2, 0]], "units", "is 2 m; divide lengths by 1000", "/5/1"),
    (f"{T0}/sigma", [None] * 5 + [[0, 0, 4]], "units", "is 4 rad; an angle is at most 3.1416 rad", "/5/2"),
    (
        f"{T0}/corners/2",
        lambda c: [c[0], c[2], c[1], c[3]],
        "crossing-outline",
        "cross each other: two sides of the outline",
    ),
    (f"{T1}/corners/1", lambda c: [c[0], c[1], c[4], c[3], c[2], c[5]], "crossing-outline", "cross each other"),
    (
        T0,
        lambda t: t | {"position": [*t["position"][:5], (np.array(t["position"][1]) + [0, 0, 9e-4]).tolist()]},
        "duplicate-position",
        'is 0.9 mm from taxel "s0.1": two taxels are in one place',
        "/position/5",
    ),
    (
        "/patches",
        lambda p: [p[0], p[1] | {"taxels": p[1]["taxels"] | {"position": [p[0]["taxels"]["position"][4], [0.05] * 3]}}],
        "duplicate-position",
        'is 0 mm from taxel "s1.1"',
        "/1/taxels/position/0",
    ),
    (f"{T0}/neighbours/1", lambda n: [*n, n[0]], "duplicate-neighbour", 'names "s1.1" a second', "/3"),
    (f"{T0}/area/0", 1.11e-4, "area", "is 0.000111 m.2, but the area of the corners is 0.0001 m.2"),
    (f"{T1}/area/0", 7.05e-4, "area", "is 0.000705 m.2, but the area of the corners is 0.0006903 m.2"),
    (f"{T0}/tangent/4", lambda t: [-x for x in t], "mirrored-tangent", 'gives another direction to "s0.1"'),
    ("/patches/0/registration", MOUNTED | {"origin": 2}, "units", "at most 1 m", "/origin"),
    ("/patches/0/registration", MOUNTED | {"direction": 4}, "units", "3.142 rad", "/direction"),
    (
        "/patches/0/registration",
        MOUNTED | {"anchor": [0, 35, 0]},
        "units",
        "35 m from the link frame; divide",
        "/anchor",
    ),
    (
        "/patches/0/touches",
        TOUCHED | {"covariance": [[1e-8, 2e-8, 0], [2e-8, 1e-8, 0], [0, 0, 1e-6]]},
        "covariance",
        "has a negative variance",
        "/covariance",
    ),
    ("/checksum", "sha256:" + "0" * 64, "checksum", "changed after writing; .* use sha256:"),
    ("/surfaces/1/name", "tube", "duplicate-name", 'repeats "tube" of /surfaces/0/name'),
    ("/patches/1/name", "sheet", "duplicate-name", "of /patches/0/name"),
    (f"{T1}/channel/1", 3, "duplicate-channel", f"repeats 3 of {T0}/channel/3"),
    ("/patches/0/surface", "tub", "unknown-surface", 'did you mean "tube"?'),
    (f"{T0}/neighbours/0/1", "s9", "unknown-neighbour", 'names the unknown taxel "s9"'),
    (f"{T0}/neighbours/0/1", "s0.0", "self-neighbour", "names the taxel itself"),
    (f"{T0}/neighbours/0/1", "h0", "one-sided-neighbour", "does not list this taxel"),
    ("/surfaces/1/trusted/boundary/0/2", [1.0, 1.2], "value", r"is outside of \[0, 1\] x \[0, 1\]"),
    ("/surfaces/1/trusted/sites/1", "10", "length", "rows of different lengths", "/surfaces/1/trusted/sites"),
    (f"{T0}/uv", lambda uv: uv[:5], "length", "contains 5 taxels, but 'id' has 6"),
    (f"{T0}/strain", lambda rows: rows + rows, "length", "contains 12 taxels"),
    (f"{T0}/corners/2", lambda polygon: polygon[:3], "length", "has 3 corners, but the first cell has 4"),
    (f"{NORMAL}/4", times(1 + 3e-6), "not-unit", "has length 1.000003"),
    (f"{T0}/tangent/0", [0, 0, 0], "not-unit", "has length 0;"),
    (f"{T0}/tangent/0", [1, 0, 0], "not-square", "not perpendicular"),
    (f"{NORMAL}/1", times(-1), "flipped-normal", "points inwards"),
    (
        f"{T0}/corners/1",
        lambda polygon: polygon[::-1],
        "flipped-normal",
        "reverse the normal, or the corners",
        f"{NORMAL}/1",
    ),
    (f"{T0}/area/5", 1.3e-4, "area", "is 0.00013 m.2, but the area of the corners is 0.0001 m.2"),
    (f"{T0}/position/2", times(1000), "units", "divide lengths by 1000"),
    (f"{T0}/area", times(1e6), "units", "at least 1e.06 times the area of the corners for every taxel"),
    (f"{T0}/area", times(1e4), "units", "is at least 1e.04 times"),
    (T0, lambda t: t | spread(t), "units", "are 0.1993 m from their neighbours, but the pitch is 0.01 m", "/position"),
    ("/surfaces/0/errors/hausdorff", 0.1, "errors", "the larger maximum is 0.00011"),
    (f"{E0}/rms", 9e-6, "errors", "has mean 1e-05, rms 9e-06, max 0.0001; they must not decrease", E0),
    (f"{E0}/max", 1.9e-5, "errors", "rms 2e-05, max 1.9e-05", E0),
    ("/surfaces/0/errors", MILLIMETRES, "units", "is 1 m, but the size of the surface is 0.2", "/hausdorff"),
    ("/patches/0/pitch", [10, 10], "units", "is 10 m; divide lengths by 1000"),
    ("/surfaces/1/control_net", times(1000), "units", "has points 100 m"),
    ("/surfaces/0/control_net/1", lambda row: row[:-1], "length", "but the first row has 11"),
    ("/surfaces/0/knots/0", lambda row: row[1:], "length", "must have 6 knots .*, not 5"),
    ("/surfaces/0/degree/0", 3, "length", "degree 3 needs at least 4", "/surfaces/0/control_net"),
    ("/surfaces/0/knots/1/6", 0.1, "knots-decrease", "is 0.1, less than the previous knot"),
    ("/surfaces/0/knots/1", times(2), "knots-domain", r"not \[0.0, 2.0\]"),
    ("/response", TABLE | {"forces": [5, 1]}, "length", "contains 2 forces, but 'readings' has 3", "/forces"),
    ("/response", TABLE | {"readings": [0, 1, 1]}, "not-increasing", "is 1, not larger than the", "/readings/2"),
    (
        "/response",
        TABLE | {"readings": [-1e308, 0, 1e308]},
        "not-increasing",
        "spans a range that exceeds",
        "/readings",
    ),
    ("/response", TABLE | {"forces": [5, 0, 1]}, "not-monotone", "is 1, which reverses the direction", "/forces/2"),
    ("/response", TABLE | {"forces": [5, 0, 5]}, "not-monotone", "is 0, which reverses the direction", "/forces/1"),
    ("/response/range", [3, 3.0], "not-increasing", r"must be \[low, high\], not \[3, 3.0\]"),
    ("/response/range", [-1e308, 1.7e308], "not-increasing", "spans a range that exceeds the largest"),
    ("/response/range", [0, 126], "not-monotone", "the force is not monotone or overflows"),
    ("/responses", [TABLE, TABLE | {"forces": [0, 1, 0]}], "not-monotone", "is 1, which reverses", "/1/forces/1"),
    ("/modalities", [DEGREES], "unknown-taxel", 'names the unknown taxel "s9"', "/0/channels/s9"),
    (f"{T0}/response", [0] * 6, "unknown-response", "is 0, but the file has 0 responses", "/0"),
    (f"{T0}/response", [0] * 5, "length", "contains 5 taxels, but 'id' has 6"),
    (
        "/surfaces/0/control_net/1/9/0",
        0.03,
        "open-seam",
        "deviate from its first 3 by 0.00525 m",
        "/surfaces/0/control_net",
    ),
]


WARNINGS = ("area", "duplicate-position", "errors", "mirrored-tangent", "one-sided-neighbour")


@pytest.mark.parametrize("row", FORM + MEANING)
def test_validate_finds_each_mistake(row):
    """One change gives one finding with code, location and message."""
    pointer, value, code, words, below = (*row, "")[:5]
    where = below if below.startswith(("/surfaces", "/patches")) else pointer + below
    if value is ...:  # the object lacks it
        where = pointer.rpartition("/")[0]
    document = changed(**{pointer: value})
    findings = [finding for finding in validate(document) if (finding.code, finding.pointer) == (code, where)]
    assert len(findings) == 1, found(document)
    assert re.search(words, findings[0].message), findings[0].message
    assert findings[0].severity == ("warning" if code in WARNINGS else "error")


def test_stored_warnings_are_findings_again():
    """With the code and severity that they had; a note is no problem."""
    stored = [STORED, STORED | {"severity": "note"}, STORED | {"code": "folded", "severity": "error", "value": None}]
    findings = validate(changed(**{"/warnings": stored}))
    assert [(f.code, f.severity, f.pointer, f.value) for f in findings] == [
        ("off-mesh", "warning", "/warnings/0", 0.0062),
        ("folded", "error", "/warnings/2", None),
    ]
    assert findings[0].message == "reports: It is 6.2 mm off. Cut."


@pytest.mark.parametrize("patch", [sheet(4, 5, 0.01), seven_boards()], ids=["sheet", "boards"])
@pytest.mark.parametrize("mirror", [np.diag((-1.0, 1, 1)), np.diag((1.0, 1, -1))])
def test_mirrored_frames_of_all_taxels_are_found(patch, mirror):
    """All tangents reversed; or positions, normals and tangents of another hand than the corners, or than the index."""
    taxels = patch.taxels
    reversed_ = dataclasses.replace(taxels, tangents_link=-taxels.tangents_link)
    assert {f.code for f in findings_of(patch, reversed_)} == {"mirrored-tangent"}
    assert len(findings_of(patch, reversed_)) == len(taxels.ids)
    image = {name: getattr(taxels, name) @ mirror for name in ("positions_link", "normals_link", "tangents_link")}
    flipped = dataclasses.replace(taxels, **image, corners_link=taxels.corners_link @ mirror)
    assert {f.code for f in findings_of(patch, flipped)} >= {"flipped-normal"}
    if patch.kind == "hexagons":  # a mirrored sheet is a sheet of the other hand
        ordered = dataclasses.replace(flipped, corners_link=flipped.corners_link[:, ::-1])
        assert {f.code for f in findings_of(patch, ordered)} == {"mirrored-tangent"}


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.0])
def test_left_handed_and_turned_patches_are_valid(turn):
    """The rows of a left-handed sheet follow each other on the other side, in all taxels."""
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array(((c, -s, 0), (s, c, 0), (0, 0, 1))) @ np.array(((1, 0, 0), (0, c, -s), (0, s, c)))
    names = ("positions_link", "normals_link", "tangents_link", "corners_link")
    for patch in (sheet(4, 5, 0.01), seven_boards()):
        turned = {name: getattr(patch.taxels, name) @ rotation.T for name in names}
        assert findings_of(patch, dataclasses.replace(patch.taxels, **turned)) == ()
    taxels = sheet(4, 5, 0.01).taxels
    left = dataclasses.replace(taxels, index=taxels.index * (-1, 1) + (3, 0))
    assert findings_of(sheet(4, 5, 0.01), left) == ()


def test_patch_of_one_taxel_is_valid():
    """It has no second cell to compare with."""
    assert findings_of(sheet(1, 1, 0.01), sheet(1, 1, 0.01).taxels) == ()


def findings_of(patch, taxels):
    """Return the findings of a calibration with one patch of these taxels."""
    only = (dataclasses.replace(patch, taxels=taxels),)
    return validate(to_document(small_calibration(patches=only)))


def test_crossing_outlines_agree_with_triangulation():
    """Random polygons: Shapely decides whether they are simple. Corners that nearly touch a side are left out."""
    shapely = pytest.importorskip("shapely")
    rng = np.random.default_rng(7)
    for count in (4, 5, 6, 9):
        flat = rng.uniform(-1, 1, (200, count, 2))
        flat = flat[[shapely.Polygon(p).exterior.minimum_clearance > 1e-6 for p in flat]]
        wanted = [not shapely.Polygon(p).is_valid for p in flat]
        corners = (
            np.concatenate((flat, np.zeros((*flat.shape[:2], 1))), axis=2) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
        )
        normal = np.cross(*np.linalg.svd(corners[0] - corners[0].mean(0))[2][:2])
        part = Part("", {"normal": np.tile(normal, (len(flat), 1)), "corners": corners}, frozenset({"corners"}))
        found_rows = {int(f.pointer.split("/")[-1]) for f in patch_checks._outlines_do_not_cross(part)}
        assert found_rows == set(np.flatnonzero(wanted)) and 0 < len(found_rows) < len(flat)


def test_taxels_in_one_place_agree_with_brute_force():
    """All pairs nearer than a tenth of a pitch, also on planes and lines, where many have the same height.

    Taxels that look away from each other, on both sides of a thin wall, are not in one place.
    """
    rng = np.random.default_rng(3)
    for flatten in ((1, 1, 1), (1, 1, 0), (0, 0, 1)):
        position = 0.02 * rng.random((120, 3)) * flatten
        normal = rng.choice((1.0, -1.0), (120, 1)) * (0, 0, 1)
        members = {"position": position, "normal": normal, "pitch": np.array((0.01, 0.012))}
        part = Part("", members | {"id": [f"t{i}" for i in range(120)]}, frozenset({"position"}))
        near = (np.linalg.norm(position[:, None] - position, axis=2) < 1e-3) & (normal @ normal.T > 0)
        wanted = sorted(int(b) for a, b in zip(*np.nonzero(np.triu(near, 1))))
        assert sorted(int(f.pointer.split("/")[-1]) for f in patch_checks.taxels_are_apart([part])) == wanted != []


def test_validate_finds_repeated_ids_across_patches():
    """An id belongs to one taxel of the link, in any patch."""
    document = changed(**{f"{T1}/id/1": "s0.2", f"{T1}/neighbours/0": [], f"{T1}/neighbours/1": []})
    assert ("duplicate-id", f"{T1}/id/1") in found(document)


def test_validate_knows_the_responses_of_taxels():
    """The last index of the list is valid, the next is not; an invalid list gives no further finding."""
    own = {"/responses": [TABLE, TABLE], f"{T0}/response": [0, 1, 0, 1, 1, 0]}
    assert found(changed(**own)) == []
    assert found(changed(**own | {f"{T0}/response": [0, 1, 0, 2, 1, 0]})) == [("unknown-response", f"{T0}/response/3")]
    assert found(changed(**own | {"/responses": {}})) == [("type", "/responses")]


def test_validate_finds_millimetres_near_the_frame():
    """Taxels within 20 units of the frame: the corners contradict a pitch in metres, and no pitch is over a metre."""
    small = {f"{T1}/{name}": times(100) for name in ("position", "corners")}
    assert [pointer for code, pointer in found(changed(**small)) if code == "units"] == [
        f"{T1}/corners",
        f"{T1}/position",
    ]
    small["/patches/1/pitch"] = times(100)
    assert [pointer for code, pointer in found(changed(**small)) if code == "units"] == ["/patches/1/pitch"]


def test_pitches_may_differ_by_a_factor_of_nine():
    """Corners are compared with the smaller pitch from below and with the larger one from above."""
    assert (
        found(changed(**{"/patches/0/pitch": [0.09, 0.01]}))
        == found(changed(**{"/patches/0/pitch": [0.01, 0.09]}))
        == []
    )
    assert found(changed(**{"/patches/0/pitch": [0.09, 0.09]})) != []


def test_validate_finds_everything_at_once():
    """Errors in different members do not hide each other, in form or meaning."""
    document = changed(
        **{
            "/link": 5,
            "/surfaces/0/name": None,
            "/surfaces/0/knots/1/6": 0.1,
            f"{T0}/uv/0/0": "0.1",
            f"{T0}/tangent": lambda rows: rows[1:],
            f"{NORMAL}/4": times(1.1),
            f"{T1}/channel/1": 3,
            f"{T1}/area/0": 1.0,
        }
    )
    assert set(found(document)) == {
        ("type", "/link"),
        ("type", "/surfaces/0/name"),
        ("knots-decrease", "/surfaces/0/knots/1/6"),
        ("type", f"{T0}/uv/0/0"),
        ("length", f"{T0}/tangent"),
        ("not-unit", f"{NORMAL}/4"),
        ("duplicate-channel", f"{T1}/channel/1"),
        ("area", f"{T1}/area/0"),
    }


def test_check_bytes_reports_a_problem_once():
    """A problem of both strict JSON and the schema is one finding; the rest of the document is checked, too."""
    text = TEXT.replace(b'"forearm.stl"', b"NaN").replace(b'"length": "m"', b'"length": 1e999, "length": "mm"')
    assert [(f.code, f.pointer) for f in calibration.check_bytes(text)[1]] == [
        ("duplicate-key", "/units/length"),
        ("not-finite", "/mesh/file"),
        ("checksum", "/checksum"),
    ]
    assert [(f.code, f.pointer) for f in calibration.check_bytes(b"null")[1]] == [("type", "")]


def test_validate_ignores_invalid_lists():
    """If ids, names or lists are invalid, nothing is reported as missing from them."""
    assert found(changed(**{"/surfaces": {}})) == [("type", "/surfaces")]
    assert found(changed(**{"/checksum": "sha256:0"})) == [("pattern", "/checksum")]
    assert found(changed(**{"/patches/1": None})) == [("type", "/patches/1")]
    assert found(changed(**{f"{T1}/id/0": 3})) == [("type", f"{T1}/id/0")]


def test_validate_lists_a_thousand_of_a_kind():
    """A file with errors everywhere gives a limited report; warnings do not hide errors."""
    document = to_document(small_calibration(40, 50, 0.001))
    document["patches"][0]["taxels"]["neighbours"] = [["h0"]] * 2000
    document["patches"][1]["taxels"]["neighbours"] = [["h9"], []]
    document["checksum"] = checksum(document)
    codes = [(finding.code, finding.severity) for finding in validate(document)]
    assert codes == [
        ("unknown-neighbour", "error"),
        *[("one-sided-neighbour", "warning")] * 1000,
        ("more", "warning"),
    ]
    document["patches"][0]["taxels"]["uv"] = [["0", "0"]] * 2000
    document["checksum"] = checksum(document)
    codes = [(finding.code, finding.severity) for finding in validate(document)]
    assert codes == [("type", "error")] * 1000 + [("more", "error")]


@pytest.mark.parametrize("document", [None, True, 1, 1.5, "", [], {}, [[]], {"version": 10**5000}, {1: 2}, np.eye(3)])
def test_validate_accepts_any_value(document):
    """Any value gives findings, not an exception."""
    assert any(finding.severity == "error" for finding in validate(document))
    assert all("\n" not in str(finding) for finding in validate(document))


def test_validate_accepts_objects_that_are_not_json():
    """A free member that JSON cannot represent gives a finding, not an exception."""
    loop = []
    loop.append(loop)
    for junk in (loop, {1, 2}, float("nan"), "\ud800", {(1, 2): 3}):
        findings = validate({**SAMPLE, "x_junk": junk})
        assert [(f.code, f.pointer) for f in findings] == [("checksum", "/checksum")]
        assert "not JSON" in findings[0].message


def test_finding_is_one_printable_line():
    """For any names of members, a finding is one printable line."""
    finding = Finding("unknown", "error", "/a\nb\ud800\x1b[31m" + "c" * 1000, "is not a known member")
    assert "\n" not in str(finding) and "\x1b" not in str(finding) and len(str(finding)) < 300
    str(finding).encode()


BYTES = [  # bytes, code, pointer, words of the message
    (b"\xef\xbb\xbf{}", "byte-order-mark", "", "byte order mark"),
    (b'{"a": "\xff"}', "encoding", "", "not UTF-8 at byte 7"),
    ("{}".encode("utf-16"), "encoding", "", "is UTF-16. Save it as UTF-8"),
    ("{}".encode("utf-16-le"), "encoding", "", "is binary at byte 1. Check that it is the correct file"),
    (b"\x89PNG\r\n\x1a\n", "encoding", "", "is binary at byte 6. Check"),
    (b"PK\3\4\xff", "encoding", "", "is a ZIP archive (NPZ files are"),
    (gzip.compress(b"{}", mtime=0), "encoding", "", "is compressed with gzip. Decompress it"),
    (b"{" + b" " * 2**17 + b"\xff\0}", "encoding", "", "is binary at byte 131074"),
    (b"", "syntax", "", "is empty"),
    (b" ", "syntax", "", "byte 1, line 1, column 2"),
    ('{"é": 1,\n  "b" 2}'.encode(), "syntax", "", "byte 16, line 2, column 7: Expecting ':'"),
    (b"{} {}", "syntax", "", "byte 3, line 1, column 4: Extra data"),
    (b"[1,]", "syntax", "", "byte"),
    (b'["\n"]', "syntax", "", "byte 2, line 1, column 3: Invalid control character"),
    (b"[01]", "syntax", "", "byte 2"),
    (b"// a\n1", "syntax", "", "byte 0"),
    (b'{"a": {"b": 1, "b/~": 2, "b/~": 3}}', "duplicate-key", "/a/b~1~0", "more than once"),
    (b'[{"a": 1, "\\u0061": 2}]', "duplicate-key", "/0/a", "more than once"),
    (b'{"a": [1, NaN]}', "not-finite", "/a/1", "is NaN"),
    (b"[-Infinity]", "not-finite", "/0", "is -Infinity"),
    (b"[1e999]", "number-range", "/0", "is 1e999"),
    (b"[" + b"9" * 5000 + b"]", "number-range", "/0", "is 99999"),
    (b"[9223372036854775808]", "number-range", "/0", "is 9223372036854775808"),
    (b'["a", "\\ud800"]', "surrogate", "/1", "a lone surrogate"),
    (b'{"\\uDFff": 1}', "surrogate", "", "a lone surrogate"),
    (b"[" * (MAX_JSON_DEPTH + 1) + b"]" * (MAX_JSON_DEPTH + 1), "depth", "", "has 33 nesting levels; the limit is 32"),
    (b"[" * 1_000_000, "depth", "", "has 1000000 nesting levels"),
    (b'{"a":' * 1_000_000, "depth", "", "has 1000000 nesting levels"),
]


@pytest.mark.parametrize(("data", "code", "pointer", "words"), BYTES)
def test_parse_finds_what_strict_json_forbids(data, code, pointer, words):
    """Code, location and message for each violation of JSON, and for each ambiguity."""
    _, found = parse(data)
    assert [(finding.code, finding.pointer) for finding in found] == [(code, pointer)]
    assert words in found[0].message


def test_parse_refuses_sizes_before_building(monkeypatch):
    """Too many bytes or values are an error before parsing; strings are not counted."""
    monkeypatch.setattr(strict_json, "MAX_VALUES", 100)
    assert parse(b"[" + b"1," * 99 + b"1]")[1] == ()
    assert parse(b'["' + b"," * 1000 + b'"]')[1] == ()
    assert parse(b"[" + b"1," * 100 + b"1]")[1][0].code == "size"
    assert parse(b"[" + b"{}," * 50 + b"{}]")[1][0].code == "size"
    monkeypatch.setattr(strict_json, "MAX_JSON_BYTES", 10)
    assert "has 11 bytes; the limit is 10" in parse(b'"123456789"')[1][0].message


def test_measure_is_independent_of_chunks(monkeypatch):
    """The positions of chunk borders do not change depth and count."""
    monkeypatch.setattr(strict_json, "MAX_JSON_DEPTH", 2)
    for size in range(1, 12):
        monkeypatch.setattr(strict_json, "BLOCK_LENGTH", size)
        assert parse(rb'[["[[\"[[", "\\"], [{}]]')[1][0].message.startswith("has 3 nesting levels")
        assert parse(rb'[["[[\"[[", "\\"], [0]]')[1] == ()


CHOICES = {
    "$defs": {"tube": {"type": "object", "properties": {"kind": {"const": "tube"}, "n": {"type": "integer"}}}},
    "type": "object",
    "properties": {
        "grid": {
            "oneOf": [
                {"$ref": "#/$defs/tube"},
                {"type": "object", "properties": {"kind": {"const": "auto"}}, "required": ["kind"]},
            ]
        },
        "axis": {"oneOf": [{"const": "auto"}, {"type": "array", "minItems": 3}]},
        "pair": {"type": "array", "prefixItems": [{"type": "string"}, {"type": "integer"}], "items": {"type": "null"}},
        "name": {"type": "string", "minLength": 2},
    },
}


@pytest.mark.parametrize(
    ("document", "pointer", "words"),
    [
        ({"grid": {"kind": "tub"}}, "/grid/kind", 'must be one of "tube", "auto", not "tub"; did you mean "tube"?'),
        ({"grid": {"kind": "tube", "n": "4"}}, "/grid/n", "must be an integer"),
        ({"grid": {}}, "/grid", 'lacks the member "kind"'),
        ({"grid": 4}, "/grid", "must be an object or an object, not 4"),
        ({"axis": "autu"}, "/axis", 'must be "auto" or an array, not "autu"'),
        ({"axis": [1]}, "/axis", "must have at least 3 elements, not 1"),
        ({"pair": [1, 1]}, "/pair/0", "must be a string"),
        ({"pair": ["a", 1, None, 1]}, "/pair/3", "must be null, not 1"),
        ({"name": "a"}, "/name", "must have at least 2 characters"),
    ],
)
def test_check_explains_choices(document, pointer, words):
    """The message of a choice is that of the matching branch."""
    (finding,) = check(document, CHOICES)
    assert finding.pointer == pointer and finding.message.startswith(words)


def test_read_schema_refuses_unknown_keywords(tmp_path):
    """A keyword that `check` does not support raises an AssertionError."""
    path = tmp_path / "schema.json"
    path.write_text(json.dumps({"properties": {"a": {"items": {"uniqueItems": True}}}}), "utf-8")
    with pytest.raises(AssertionError, match="uniqueItems"):
        read_schema(path)


def test_schema_is_a_schema():
    """The schema is valid JSON Schema of its draft, by the reference implementation."""
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert jsonschema.Draft202012Validator(SCHEMA).is_valid(SAMPLE)


def test_show_is_short():
    """Values are short in messages."""
    for value in ("x" * 10**6, list(range(10**5)), {str(i): i for i in range(1000)}, 10**3000, 1e308, {1, 2}, None):
        assert len(findings.show(value)) < 60
