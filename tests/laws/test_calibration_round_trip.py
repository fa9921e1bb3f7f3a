"""Laws of calibration files: save then load is the identity, and any bytes give findings or a calibration."""

import copy
import dataclasses
import json

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from skin_calib_addon.calibration import (
    Modality,
    Response,
    ResponseTable,
    check_bytes,
    encode,
    from_document,
    load_calibration,
    save_calibration,
    to_document,
    validate,
)
from skin_calib_addon.calibration.modality import UNITS
from skin_calib_addon.common.encoding import checksum
from skin_calib_addon.common.errors import CalibrationFormatError
from skin_calib_addon.common.findings import child
from skin_calib_addon.common.schema_check import check
from skin_calib_addon.common.strict_json import parse
from tests.examples import examples, slow
from tests.samples import boards, sheet, small_calibration

OWN = (Response((0.0, 0.5), (0.0, 250.0)), ResponseTable((0.0, 100.0, 250.0), (16.0, 1.0, 0.0)))


def own_responses(patch, index):
    """Return the patch with a response for each taxel."""
    return dataclasses.replace(patch, taxels=dataclasses.replace(patch.taxels, responses=np.array(index)))


NEAR_AND_WARM = (Modality("proximity", "m", OWN[0]), Modality("temperature", "K", OWN[1], {"h0": 1, "s0.0": 0}))
SMALL = to_document(
    small_calibration(
        1, 2, patches=(own_responses(sheet(1, 2, 0.01), (1, 0)), boards(2)), responses=OWN, modalities=NEAR_AND_WARM
    )
)
TEXT = encode(SMALL)

floats = st.floats(allow_nan=False, allow_infinity=False)
names = st.text(st.characters(exclude_categories=["Cs", "Cc"]), min_size=1)
values = st.one_of(
    st.sampled_from([None, True, False, 0, -1, 1.0, 1.5, 2, 1e308, -1e-308, 10**18, "", "1.5", "x", "s0.0", "tube"]),
    st.sampled_from(
        [[], {}, [[]], [0.0, 0.0, 0.0], [1, 2], [True, 1.0, 0.5], {"x_": 1}, [["s0.0"]], [[[0, 0, 0]] * 3]]
    ),
)


def nodes(document, pointer=""):
    """Return all pointers of a document, starting with the document itself."""
    yield pointer
    for key in document if isinstance(document, dict) else range(len(document)) if isinstance(document, list) else ():
        yield from nodes(document[key], child(pointer, key))


NODES = list(nodes(SMALL))


increasing = st.lists(st.floats(-1e300, 1e300), min_size=2, max_size=5, unique=True).map(sorted)


@st.composite
def responses(draw):
    """Draw polynomials without range, linear ones with range, and rising or falling tables."""
    if draw(st.booleans()):
        return Response(tuple(draw(st.lists(floats, min_size=1, max_size=8))))
    readings = draw(increasing)
    if draw(st.booleans()):
        return Response((draw(st.floats(-1e9, 1e9)), draw(st.floats(-1, 1))), (readings[0], readings[-1]))
    n = len(readings)
    forces = draw(st.lists(floats, min_size=n, max_size=n).map(sorted))
    return ResponseTable(tuple(readings), tuple(forces if draw(st.booleans()) else forces[::-1]))


@st.composite
def modalities(draw, ids):
    """Draw modalities of any names and responses, of all taxels or of some."""
    drawn = []
    for name in draw(st.lists(names.filter(lambda name: name != "force"), max_size=3, unique=True)):
        which = draw(st.none() | st.lists(st.sampled_from(sorted(ids)), unique=True).map(sorted))
        positions = [] if which is None else draw(st.permutations(range(len(which))))
        channels = None if which is None else dict(zip(which, positions))
        drawn.append(Modality(name, draw(st.sampled_from(sorted(UNITS))), draw(responses()), channels))
    return tuple(drawn)


@st.composite
def calibrations(draw):
    """Draw valid calibrations whose free numbers are any floats: negative zero, subnormal, close to one."""
    patch = sheet(draw(st.integers(1, 3)), draw(st.integers(1, 3)), 0.01)
    n = len(patch.taxels.ids)
    many = st.lists(floats, min_size=n, max_size=n)
    own = draw(st.lists(responses(), max_size=3))
    which = draw(st.lists(st.integers(0, len(own) - 1), min_size=n, max_size=n)) if own and draw(st.booleans()) else ()
    taxels = dataclasses.replace(
        patch.taxels,
        uv=np.array(draw(st.lists(st.tuples(floats, floats), min_size=n, max_size=n))),
        positions_link=patch.taxels.positions_link * draw(st.floats(0.9, 1.1)),
        areas=np.array(draw(st.lists(st.floats(5e-324, 9e-3), min_size=n, max_size=n))),
        channels=np.array(draw(st.lists(st.integers(2, 2**31 - 1), min_size=n, max_size=n, unique=True))),
        quality={"strain": np.array(draw(many))[:, None] * np.ones(3), "tilt": np.array(draw(many))},
        responses=np.array(which, np.int64),
    )
    patch = dataclasses.replace(patch, name=draw(names.filter(lambda name: name != "boards")), taxels=taxels)
    extra = st.dictionaries(names.map("x_".__add__), st.recursive(floats | names | st.none(), st.lists, max_leaves=5))
    return small_calibration(
        patches=(patch, boards()),
        response=draw(responses()),
        responses=tuple(own),
        link=draw(names),
        extra=draw(extra),
        modalities=draw(modalities(patch.taxels.ids)),
    )


def same(a, b):
    """Return whether values are equal in all bits and types, with the sign of zero."""
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if dataclasses.is_dataclass(a):
        return type(a) is type(b) and all(same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    if isinstance(a, (tuple, list)):
        return type(a) is type(b) and len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict):
        return list(a) == list(b) and all(same(a[key], b[key]) for key in a)
    return type(a) is type(b) and repr(a) == repr(b)


@given(calibration=calibrations())
def test_save_then_load_is_identity(calibration, tmp_path_factory):
    """All fields are read back exactly, and saving again writes the same bytes."""
    path = tmp_path_factory.mktemp("law") / "c.json"
    save_calibration(calibration, path)
    loaded = load_calibration(path)
    assert same(loaded, calibration)
    assert encode(to_document(loaded)) == path.read_bytes()


def mutated(document, pointer, value):
    """Return a copy with one node replaced; ``...`` removes it."""
    if not pointer:
        return None if value is ... else value
    document = copy.deepcopy(document)
    *path, last = [key.replace("~1", "/").replace("~0", "~") for key in pointer.split("/")[1:]]
    place = document
    for key in path:
        place = place[int(key) if isinstance(place, list) else key]
    last = int(last) if isinstance(place, list) else last
    if value is ...:
        del place[last]
    else:
        place[last] = value
    return document


def resolves(document, pointer):
    for key in pointer.split("/")[1:]:
        key = key.replace("~1", "/").replace("~0", "~")
        document = document[int(key) if isinstance(document, list) else key]
    return True


def assert_handled(document):
    """Check that the findings have an error, or the document is a calibration; all pointers are valid."""
    findings = validate(document)
    assert all(resolves(document, finding.pointer) for finding in findings)
    if not any(finding.severity == "error" for finding in findings):
        assert validate(to_document(from_document(document))) == findings


CHANGED = [..., None, True, -1, 1.5, 1e308, "1.5", "s0.0", [], {}, [[0.0, 0.0, 0.0]]]


@pytest.mark.parametrize("part", [0, *map(slow, range(1, 5))])
def test_any_changed_node_is_handled(part):
    """Each node is removed or replaced once; each change applies to another part of the nodes."""
    for k, pointer in list(enumerate(NODES))[part::5]:
        document = mutated(SMALL, pointer, CHANGED[k % len(CHANGED)])
        if isinstance(document, dict) and "checksum" in document and pointer != "/checksum":
            document["checksum"] = checksum(document)
        assert_handled(document)


mutations = st.lists(st.tuples(st.sampled_from(NODES), st.one_of(st.just(...), values)), min_size=1, max_size=4)


def mutated_often(changes):
    document = SMALL
    for pointer, value in changes:
        if pointer in set(nodes(document)):
            document = mutated(document, pointer, value)
    return document


@example(changes=[("/surfaces/0/errors/surface_to_mesh/rms", 0)])
@given(changes=mutations)
@examples(200)
def test_any_changed_structure_is_handled(changes):
    """Several changes at once give findings or a calibration, not an exception."""
    document = mutated_often(changes)
    if isinstance(document, dict) and "checksum" in document:
        document["checksum"] = checksum(document)
    assert_handled(document)


GENERAL = {  # all keywords of the checker in a small schema
    "type": "object",
    "properties": {
        "a": {"type": "array", "prefixItems": [{"type": "string", "minLength": 2}], "items": {"type": "integer"}},
        "b": {
            "oneOf": [{"const": "auto"}, {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 3}]
        },
        "c": {"oneOf": [{"$ref": "#/$defs/tube"}, {"$ref": "#/$defs/auto"}]},
        "d": {"enum": ["x", 1, None, True]},
        "e": {"type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 3, "minimum": 1, "maximum": 2},
        "f": {"type": "array", "items": {"$ref": "#/$defs/positive", "maximum": 2}},
        "g": {"type": "array", "items": {"type": "string", "pattern": "^[a-c]+$", "minLength": 2}},
        "h": {"type": "null"},
        "n": {"type": "number", "minimum": 1},
    },
    "patternProperties": {"^x_": {}, "^n": {"type": "integer"}},
    "required": ["a"],
    "additionalProperties": False,
    "$defs": {
        "positive": {"type": "number", "exclusiveMinimum": 0},
        "tube": {
            "type": "object",
            "properties": {"kind": {"const": "tube"}, "n": {"type": "integer"}},
            "required": ["kind", "n"],
        },
        "auto": {"type": "object", "properties": {"kind": {"const": "auto"}}, "required": ["kind"]},
    },
}
scalars = st.sampled_from([None, True, False, 0, 1, 1.0, 1.5, 2, 3, -1, "auto", "tube", "x", "ab", "abc", "a", ""])
lists = (
    st.lists(scalars, max_size=4)
    | st.lists(st.sampled_from(["a", "ab", "abc"]), max_size=2)
    | st.lists(st.sampled_from([0, 1, 2, 1.5, 2.0, 3]), max_size=3)
)
objects = st.dictionaries(st.sampled_from(["kind", "n", "z"]), scalars, max_size=3)
members = st.sampled_from([*"abcdefgh", "x_1", "n", "n2", "z"])


@given(document=st.dictionaries(members, scalars | lists | objects, max_size=8))
@examples(1000)
def test_every_keyword_agrees_with_the_reference(document):
    """Each keyword has the meaning of JSON Schema: errors are in the same members."""
    jsonschema = pytest.importorskip("jsonschema")
    errors = list(jsonschema.Draft202012Validator(GENERAL).iter_errors(document))
    ours = check(document, GENERAL)
    assert bool(ours) == bool(errors)
    assert {finding.pointer.split("/")[1] for finding in ours if finding.pointer and finding.code != "unknown"} == {
        str(error.absolute_path[0]) for error in errors if error.absolute_path
    }


@given(numbers=st.lists(st.sampled_from([0, 1, 1.0, 2, True, "1", None, 1.5]), max_size=6), repeats=st.integers(1, 500))
def test_bulk_check_agrees_with_the_reference(numbers, repeats):
    """Long arrays, which are checked in blocks, give the same findings as short ones, with exact pointers."""
    schema = {"type": "array", "items": {"type": "array", "items": {"type": "integer", "maximum": 1}}}
    good = [[0, 1]] * repeats * 5
    found = {finding.pointer for finding in check([*good, numbers, *good], schema)}
    wrong = [i for i, v in enumerate(numbers) if v is True or v is None or isinstance(v, str) or v not in (0, 1)]
    assert found == {f"/{len(good)}/{i}" for i in wrong}


edits = st.lists(
    st.tuples(
        st.integers(0, len(TEXT) - 1),
        st.integers(0, 30),
        st.one_of(
            st.binary(max_size=4),
            st.sampled_from(
                [b"NaN", b"1e999", b"[[[[[", b"}", b'"', b"\\", b"\\ud800", b'"link": 1,', b"-", b"9" * 30]
            ),
        ),
    ),
    min_size=1,
    max_size=5,
)


@given(changes=edits)
@examples(200)
def test_any_changed_bytes_are_handled(changes, tmp_path_factory):
    """Replaced, removed and inserted bytes: the file loads, or gives an error with findings in one line."""
    data = TEXT
    for start, length, new in changes:
        data = data[:start] + new + data[start + length :]
    path = tmp_path_factory.getbasetemp() / "bytes.json"
    path.write_bytes(data)
    document, findings = check_bytes(data)
    if any(finding.severity == "error" for finding in findings):
        with pytest.raises(CalibrationFormatError) as caught:
            load_calibration(path)
        assert caught.value.findings == findings and "\n" not in str(caught.value)
    else:
        assert same(load_calibration(path), from_document(document))


@given(document=st.recursive(scalars | floats, lambda inner: st.lists(inner) | st.dictionaries(names, inner)))
def test_parse_agrees_with_the_standard_library(document):
    """Valid JSON gives the result of the standard library."""
    text = json.dumps(document, ensure_ascii=False)
    assert parse(text.encode()) == (json.loads(text), ())


@pytest.mark.parametrize("cut", range(0, len(TEXT), 97))
def test_truncated_files_are_rejected(cut):
    """A truncated file does not load."""
    assert check_bytes(TEXT[:cut])[1][0].code == "syntax"
