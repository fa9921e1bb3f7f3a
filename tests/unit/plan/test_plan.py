"""Plan files: what an author wrote comes back, and what is wrong is named with its place."""

import copy
import json
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from skin_calib_addon.calibration.response import Response
from skin_calib_addon.common.errors import CalibrationFormatError, InvalidPlan, OutputError
from skin_calib_addon.common.findings import child
from skin_calib_addon.geometry import PlanesGrid
from skin_calib_addon.geometry.grid.grids import Across, Sector, Size, Tube
from skin_calib_addon.plan import check_plan, check_plan_wholly, load_plan, plan_document, plan_from, save_plan

ROOT = Path(__file__).parents[3]
SAMPLES = sorted((ROOT / "sample_scenes").glob("*.plan.json"))
EXAMPLES = sorted((ROOT / "examples").glob("*.plan.json"))

PLANE = {"point": [0.0, 0.0, 0.5], "normal": [0.0, 0.6, 0.8]}
LINE = {"point": [0.0, 0.0, 0.1], "direction": [0.0, 0.0, 2.0]}
TUBE = {"kind": "tube", "n": 10, "m": 10, "axis": "auto", "margin": 0.002}
SECTOR = {"kind": "patch", "n": 6, "lines": 9, "axis": LINE, "from": -1.0, "to": 1.5}
ACROSS = {"kind": "patch", "n": 6, "lines": 9, "normal": [0.0, 0.0, -1.0]}


def framed(*rotation):
    """Return an imported skin with a frame."""
    frame = {"rotation": [list(map(float, row)) for row in rotation], "translation": [0, 0, 0]}
    return {"name": "a", "kind": "imported", "file": "t.csv", "frame": frame}


MIRRORED = framed((-1, 0, 0), (0, 1, 0), (0, 0, 1))
SCALED = framed((0, -1000, 0), (1000, 0, 0), (0, 0, 1000))
SHEARED = framed((1, 0.1, 0), (0, 1, 0), (0, 0, 1))
SINGULAR = framed((1, 0, 0), (1, 0, 0), (1, 0, 0))
PLANES = {"kind": "planes", "u": [PLANE] * 4, "v": [PLANE] * 5, "closed": True}
SHEET = {
    "name": "wrist",
    "kind": "sheet",
    "rows": 6,
    "columns": 22,
    "pitch": [0.01, 0.01],
    "origin": "center",
    "direction": [0.0, 1.0, 0.0],
}
BOARDS = {"name": "sole", "kind": "hexagons"}
TABLE = {"kind": "table", "readings": [0.0, 100.0, 250.0], "forces": [0.0, 1.0, 16.0]}
CELSIUS = {"kind": "polynomial", "coefficients": [-40.0, 0.05], "range": [0.0, 4095.0]}
TURNING = {"kind": "polynomial", "coefficients": [0.0, 0.5, -0.002], "range": [0.0, 130.0]}
WHOLE = {
    "format": "skin-plan",
    "version": 1,
    "link": "forearm",
    "mesh": "meshes/forearm.stl",
    "unit": "mm",
    "cover": {"shell": "all", "cuts": [PLANE]},
    "grid": TUBE,
    "degree": [3, 4],
    "skins": [SHEET, SHEET | {"name": "palm", "origin": [0.1, 0.2, 0.3], "first_channel": 200}],
    "response": {"kind": "polynomial", "coefficients": [0.0, 0.5]},
    "modalities": [
        {"name": "proximity", "unit": "m", "response": TABLE},
        {"name": "temperature", "unit": "degC", "response": CELSIUS, "channels": {"a": 3}},
    ],
    "x_note": {"by": "前腕", "numbers": [1, 2.5, None]},
}


def changed(pointer, value):
    """The whole plan with one place replaced; ``...`` removes it."""
    document = json.loads(json.dumps(WHOLE))  # without shared parts
    *path, last = [int(key) if key.isdecimal() else key for key in pointer.split("/")[1:]]
    place = document
    for key in path:
        place = place[key]
    if value is ...:
        del place[last]
    else:
        place[last] = value
    return document


numbers = st.floats(-1e6, 1e6)
lengths = st.floats(1e-5, 1.0)
vectors = st.lists(numbers, min_size=3, max_size=3).filter(lambda v: max(map(abs, v)) > 1e-3)
planes = st.fixed_dictionaries({"point": vectors, "normal": vectors})
lines = st.fixed_dictionaries({"point": vectors, "direction": vectors})
names = st.text(st.characters(exclude_categories=["Cs", "Cc"]), min_size=1, max_size=8)
counts = st.integers(1, 1000)
rest = {
    "axis": st.just("auto") | lines,
    "margin": st.floats(0, 10),
    "spacing": st.sampled_from(["auto", "uniform", "arc"]),
}
angles = {"from": st.floats(-9, 9), "to": st.floats(-9, 9)}


def grid(kind, optional=rest, **members):
    """Draw grids of a kind with these members, and with any of the optional ones."""
    return st.fixed_dictionaries({"kind": st.just(kind), **members}, optional=optional)


rest_of_auto = {"measure": st.sampled_from(["mean", "max"]), "axis": rest["axis"], "margin": rest["margin"]}
few_planes = st.lists(planes, min_size=1, max_size=3)
grids = st.one_of(
    grid("tube", n=counts, m=counts),
    grid("tube", n=counts, lines=counts),
    grid("patch", n=counts, lines=counts, **angles),
    grid("patch", n=counts, m=counts, normal=vectors),
    grid("planes", {}, u=few_planes, v=few_planes, closed=st.booleans()),
    grid("auto", rest_of_auto | {"normal": vectors}, tolerance=lengths),
    grid("auto", rest_of_auto, tolerance=lengths, **angles),
)
sheets = st.fixed_dictionaries(
    {
        "name": names,
        "kind": st.just("sheet"),
        "rows": counts,
        "columns": counts,
        "pitch": st.lists(lengths, min_size=2, max_size=2),
        "origin": st.just("center") | vectors,
        "direction": vectors,
    }
)
documents = st.fixed_dictionaries(
    {
        "format": st.just("skin-plan"),
        "version": st.just(1),
        "link": names,
        "mesh": st.sampled_from(["a.stl", "../b/c.ply", "/d/e.obj", "前腕.off"]),
        "unit": st.sampled_from(["m", "mm"]),
        "grid": grids,
        "skins": st.lists(sheets, max_size=3, unique_by=lambda sheet: sheet["name"]),
    },
    optional={
        "cover": st.fixed_dictionaries(
            {}, optional={"shell": st.sampled_from(["outer", "all"]), "cuts": st.lists(planes, max_size=2)}
        ),
        "degree": st.lists(st.integers(2, 5), min_size=2, max_size=2),
        "mesh_uncertainty": st.fixed_dictionaries(
            {}, optional={"standard_deviation": st.floats(0, 0.1), "correlation_length": st.floats(1e-4, 10)}
        ),
        "response": st.just(TABLE)
        | st.fixed_dictionaries(
            {"kind": st.just("polynomial"), "coefficients": st.lists(numbers, min_size=1, max_size=4)}
        )
        | st.fixed_dictionaries(
            {"kind": st.just("polynomial"), "coefficients": st.lists(numbers, min_size=1, max_size=2)},
            optional={"range": st.lists(numbers, min_size=2, max_size=2, unique=True).map(sorted)},
        ),
        "chords": st.booleans(),
        "x_free": st.none() | names | st.lists(numbers),
    },
)


@given(document=documents)
def test_plan_round_trip_is_the_identity(document, tmp_path_factory):
    """Any plan, written and read, has the same document to the last bit, and that one keeps the schema."""
    assert check_plan(document) == ()
    first = plan_document(plan_from(document))
    assert check_plan(first) == ()
    assert plan_document(plan_from(first)) == first
    path = tmp_path_factory.mktemp("plan") / "p.plan.json"
    save_plan(plan_from(document), path)
    assert plan_document(replace(load_plan(path), mesh=plan_from(document).mesh)) == first


@given(document=documents)
def test_plan_keeps_what_the_author_wrote(document):
    """Nothing is lost: each member of the document is in the one that is written, next to defaults."""
    written = plan_document(plan_from(document))
    for name in ("link", "mesh", "unit", "degree", "x_free"):
        assert written.get(name) == document.get(name, written.get(name))
    assert written["cover"] == {"shell": "outer", "cuts": []} | document.get("cover", {})
    assert written.get("chords", False) == document.get("chords", False)
    for sheet, kept in zip(document["skins"], written["skins"], strict=True):
        assert kept == sheet | {"first_channel": kept["first_channel"]}
    grid, kept = document["grid"], written["grid"]
    if "m" in grid:
        grid = {k: v for k, v in grid.items() if k != "m"} | {"lines": grid["m"] * (2 if grid["kind"] == "tube" else 1)}
    if grid["kind"] == "planes":
        assert [p["point"] for p in kept["u"]] == [p["point"] for p in grid["u"]] and kept["closed"] == grid["closed"]
    else:
        # Planes across a face take the direction of an axis alone.
        across = {"axis"} if "normal" in grid and grid["kind"] == "patch" else set()
        assert {k: kept.get(k) for k in grid.keys() - across} == {k: v for k, v in grid.items() if k not in across}


@pytest.mark.parametrize("path", SAMPLES + EXAMPLES, ids=lambda path: path.name)
def test_plans_that_we_ship_are_valid(path):
    """Samples and examples have not one finding, and name their mesh relative to themselves."""
    document = json.loads(path.read_text())
    assert check_plan_wholly(document) == ()
    assert load_plan(path).mesh == path.parent / document["mesh"]


def test_whole_plan_is_read():
    """Every member arrives where it belongs."""
    assert check_plan_wholly(WHOLE) == ()
    plan = plan_from(WHOLE)
    assert (plan.link, plan.mesh, plan.unit, plan.surface.degree) == (
        "forearm",
        Path("meshes/forearm.stl"),
        "mm",
        (3, 4),
    )
    assert (plan.surface.cover.shell, plan.surface.cover.cuts[0].normal) == ("all", (0.0, 0.6, 0.8))
    assert (plan.surface.grid.size, plan.surface.grid.region) == (Size(10, 20), Tube(None, 0.002))
    assert plan.response == Response((0.0, 0.5)) and plan.extra == {"x_note": WHOLE["x_note"]}
    wrist, palm = plan.skins
    assert (wrist.origin, wrist.first_channel, wrist.lattice.rows, wrist.lattice.pitch) == (None, None, 6, (0.01, 0.01))
    assert (palm.origin, palm.first_channel) == ((0.1, 0.2, 0.3), 200)


@pytest.mark.parametrize(
    ("grid", "kind", "lines"),
    [
        (TUBE, Tube, 20),
        (TUBE | {"m": 1000}, Tube, 2000),
        ({"kind": "tube", "n": 10, "lines": 7}, Tube, 7),
        (SECTOR, Sector, 9),
        ({"kind": "patch", "n": 6, "m": 9, "from": 0, "to": 1}, Sector, 9),
        (ACROSS, Across, 9),
    ],
)
def test_lines_are_counted_as_documented(grid, kind, lines):
    """m full planes through a tube's axis make 2 m lines; of a patch each plane makes one."""
    made = plan_from(changed("/grid", grid)).surface.grid
    assert isinstance(made.region, kind) and made.size.lines == lines


def test_planes_are_kept_in_their_order():
    """Points as they stand, normals scaled to one."""
    u = [{"point": [0, 0, z], "normal": [0, 0, 2 + z]} for z in range(4)]
    grid = plan_from(changed("/grid", PLANES | {"u": u})).surface.grid
    assert isinstance(grid, PlanesGrid) and grid.closed
    assert grid.u.points.tolist() == [[0, 0, z] for z in range(4)] and (grid.u.normals == (0, 0, 1)).all()


@pytest.mark.parametrize(
    ("pointer", "value", "where", "message"),
    [
        ("/format", "skin-calibration", "/format", 'must be "skin-plan"'),
        ("/version", 3, "/version", "newer than version 2 of this program"),
        ("/link", "", "/link", "must match"),
        ("/mesh", ..., "", 'lacks the member "mesh"'),
        ("/unit", "km", "/unit", 'must be one of "m", "mm", "cm", "in", not "km"'),
        ("/cover/cuts/0/point/2", 1e300, "/cover/cuts/0/point/2", "must be at most 1000000"),
        ("/grid", {"kind": "tub", "n": 4}, "/grid/kind", 'did you mean "tube"'),
        ("/grid/n", 0, "/grid/n", "must be at least 1, not 0"),
        ("/grid/margin", -0.001, "/grid/margin", "must be at least 0"),
        ("/grid/axis", "z", "/grid/axis", "must be"),
        ("/grid/axis", {"point": [0, 0, 0]}, "/grid/axis", 'lacks the member "direction"'),
        ("/grid", PLANES | {"u": []}, "/grid/u", "must have at least 1 elements, not 0"),
        ("/degree/1", 6, "/degree/1", "must be at most 5"),
        ("/skins/0/pitch/0", 0, "/skins/0/pitch/0", "must be at least"),
        ("/skins/0/pitch/1", 10, "/skins/0/pitch/1", "must be at most 1"),
        ("/skins/0/origin", "centre", "/skins/0/origin", 'must be "center" or an array'),
        ("/skins/1/first_channel", -1, "/skins/1/first_channel", "must be at least 0"),
        ("/skins/0", MIRRORED, "/skins/0/frame/rotation", "is not a rotation: it mirrors. Reverse one of its axes"),
        ("/skins/0", SCALED, "/skins/0/frame/rotation", "is not a rotation: it scales by 1000. Give rows of length"),
        ("/skins/0", SHEARED, "/skins/0/frame/rotation", "it stretches directions by 0.9512 to 1.051. Give orthogonal"),
        ("/skins/0", SINGULAR, "/skins/0/frame/rotation", "it stretches directions by 0 to 1.732"),
        ("/response/range", [3, 3], "/response/range", "must be [low, high], not [3, 3]"),
        ("/response", TURNING, "/response/range", "force is not monotone"),
        ("/modalities/0/unit", "mm", "/modalities/0/unit", 'must be one of "m", '),
        ("/modalities/0/response", TURNING, "/modalities/0/response/range", "force is not monotone"),
        ("/modalities/1/name", "proximity", "/modalities/1/name", 'repeats "proximity" of /modalities/0/name'),
        ("/gird", TUBE, "/gird", 'is not a known member; did you mean "grid"'),
        ("/x", 1, "/x", "is not a known member"),
    ],
)
def test_each_place_that_breaks_the_schema_is_found(pointer, value, where, message):
    """One finding, with the pointer to the place and what should stand there; a misspelt key names the nearest."""
    (finding,) = check_plan(changed(pointer, value))
    assert finding.severity == "error" and finding.pointer == where
    assert message in finding.message


@given(
    document=documents,
    junk=st.sampled_from([None, True, "x", -1, 1.5, 3.0, 1e308, [], {}, [[]], {"kind": "tube"}]),
    data=st.data(),
)
def test_plan_with_junk_in_any_place_is_refused_or_read(document, junk, data):
    """Whatever stands wherever: findings with pointers, an error of ours, or a plan; never another exception."""

    def nodes(value, pointer=""):
        yield pointer
        items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
        for key, member in items:
            yield from nodes(member, child(pointer, key))

    pointer = data.draw(st.sampled_from(sorted(nodes(document))[1:]))
    document = copy.deepcopy(document)
    *path, last = [key.replace("~1", "/").replace("~0", "~") for key in pointer.split("/")[1:]]
    place = document
    for key in path:
        place = place[int(key)] if isinstance(place, list) else place[key]
    place[int(last) if isinstance(place, list) else last] = junk
    findings = check_plan_wholly(document)
    if not findings:
        plan_from(document)
    assert all(f.pointer == "" or f.pointer.startswith("/") for f in findings)


@pytest.mark.parametrize(
    ("pointer", "value", "message"),
    [
        ("/grid", TUBE | {"lines": 20}, 'Give exactly one of "m" and "lines" in the grid'),
        ("/grid", {"kind": "tube", "n": 10}, 'Give exactly one of "m" and "lines" in the grid'),
        ("/grid", {"kind": "patch", "n": 6, "m": 9}, 'A patch needs either "from" and "to" .* or "normal"'),
        ("/grid", SECTOR | {"normal": [0, 0, 1]}, 'A patch needs either "from" and "to"'),
        ("/grid", {"kind": "patch", "n": 6, "m": 9, "from": 0}, 'A patch needs either "from" and "to"'),
        ("/grid", TUBE | {"axis": LINE | {"direction": [0, 0, 0]}}, "The direction of the axis is zero"),
        ("/grid", TUBE | {"axis": LINE | {"direction": [0, 0, 1e-300]}}, "The direction of the axis is zero"),
        ("/grid", ACROSS | {"normal": [0, 0, 0]}, "The outward normal of the grid is zero"),
        ("/grid", PLANES | {"v": [PLANE, PLANE | {"normal": [0, 0, 0]}]}, "The normal of v-plane 1 is zero"),
        ("/cover/cuts/0/normal", [0, 0, 0], "The normal of cut 0 is zero"),
        ("/skins/1/direction", [0, 0, 0], "The direction of skin 'palm' is zero"),
        ("/skins/1/name", "wrist", "Two skins have the name 'wrist'"),
        ("/skins/1/first_channel", 131, "Skins 'wrist' and 'palm' both have channel 131"),
        ("/skins/0/first_channel", 331, "Skins 'wrist' and 'palm' both have channel 331"),
        ("/skins/1/first_channel", 2**31 - 1, "Skin 'palm' would end on channel 2147483778"),
    ],
)
def test_members_that_do_not_go_together_are_refused(pointer, value, message):
    """What a schema cannot say: an error with the same words when the plan is used and when it is checked."""
    document = changed(pointer, value)
    assert check_plan(document) == ()
    with pytest.raises(InvalidPlan, match=message) as caught:
        plan_from(document)
    (finding,) = check_plan_wholly(document)
    assert finding.severity == "error" and str(caught.value) in finding.message


def test_whole_numbers_may_have_a_decimal_point():
    """Some programs write 6.0 for 6, which is an integer of JSON Schema. The version is compared as such, too."""
    document = changed("/skins/0/rows", 6.0) | {"version": 1.0, "degree": [3.0, 4]}
    document["skins"].append(BOARDS | {"cells": [[0.0, 0], [1, 0.0]], "first_channel": 400.0})
    assert check_plan_wholly(document) == ()
    plan = plan_from(document)
    assert [repr(n) for n in (plan.skins[0].lattice.rows, plan.surface.degree, plan.skins[2].first_channel)] == [
        *("6", "(3, 4)", "400")
    ]
    assert repr(plan.skins[2].choice) == "((0, 0), (1, 0))"
    assert [f.pointer for f in check_plan(document | {"version": True})] == ["/version"]
    assert "/version" not in [f.pointer for f in check_plan(document | {"version": 2.0})]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "p.plan.json is not a valid plan: error: the document is empty"),
        (b"{", "not JSON at byte 1"),
        (b"[]", "must be an object, not an array of 0"),
        (b"\xff", "is not UTF-8"),
        (json.dumps(WHOLE | {"gird": 1}).encode(), '/gird is not a known member; did you mean "grid"'),
        (json.dumps(WHOLE | {"gird": 1, "unit": 2, "link": 3}).encode(), r"and 2 more: run check"),
        (json.dumps(WHOLE)[:-1].encode() + b', "unit": "m"}', "/unit occurs more than once"),
        (json.dumps(WHOLE).replace("0.002", "NaN").encode(), "/grid/margin is NaN"),
    ],
)
def test_load_plan_says_what_is_wrong_in_one_line(tmp_path, data, message):
    """Bytes that are no JSON, JSON that is no plan, members twice, NaN: the first finding, and how many more."""
    path = tmp_path / "p.plan.json"
    path.write_bytes(data)
    with pytest.raises(CalibrationFormatError, match=message) as caught:
        load_plan(path)
    assert caught.value.findings and "\n" not in str(caught.value)


def test_missing_plan_is_named(tmp_path):
    """The path, and what to check."""
    with pytest.raises(CalibrationFormatError, match=r"cannot read '.*none\.json': No such file .*. Check the path"):
        load_plan(tmp_path / "none.json")


def test_mesh_is_relative_to_the_plan(tmp_path):
    """Whatever the working directory; an absolute path stays."""
    (tmp_path / "a").mkdir()
    path = tmp_path / "a" / "p.json"
    for mesh, expected in (("../m.stl", tmp_path / "a" / ".." / "m.stl"), ("/m.stl", Path("/m.stl"))):
        path.write_text(json.dumps(WHOLE | {"mesh": mesh}))
        assert load_plan(path).mesh == expected


def test_saved_plan_is_for_people(tmp_path):
    """Indented, in the order of the documentation, names as they are written; into a missing folder nothing goes."""
    path = tmp_path / "p.json"
    save_plan(plan_from(WHOLE), path)
    text = path.read_text("utf-8")
    assert text.endswith("}\n") and "前腕" in text and '\n  "link": "forearm",' in text
    assert list(json.loads(text)) == list(WHOLE)
    with pytest.raises(OutputError, match="the folder .* does not exist"):
        save_plan(plan_from(WHOLE), tmp_path / "none" / "p.json")
