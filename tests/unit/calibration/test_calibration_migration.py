"""Files of older versions are validated by their own schema and migrated step by step."""

import copy
import json

import pytest

from skin_calib_addon.calibration import check_bytes, encode, from_document, to_document
from skin_calib_addon.calibration.migration import STEPS, Step
from skin_calib_addon.calibration.validate import CALIBRATION_VERSION
from skin_calib_addon.common.encoding import checksum
from tests.samples import small_calibration

OURS = to_document(small_calibration())


def renamed(version, old, new):
    """Return a migration step that renames the member of the link to ``new``."""
    schema = json.loads(json.dumps(STEPS[1].schema).replace('"link"', f'"{old}"'))
    schema["properties"]["version"]["const"] = version

    def migrate(document):
        others = {name: value for name, value in document.items() if name != old}
        return others | {"version": version + 1, new: document[old]}

    return Step(schema, migrate)


@pytest.fixture
def older(monkeypatch):
    """Define two fictitious older versions with links ``part`` and ``body``, and return a file of the oldest."""
    monkeypatch.setitem(STEPS, -1, renamed(-1, "part", "body"))
    monkeypatch.setitem(STEPS, 0, renamed(0, "body", "link"))
    document = of_version_1() | {"version": -1, "part": OURS["link"]}
    del document["link"]
    return document


def of_version_1():
    """The document as the program wrote it first."""
    document = copy.deepcopy(OURS) | {"version": 1}
    del document["checksum"], document["warnings"]
    for surface in document["surfaces"]:
        del surface["trusted"]
    return document


def of_unknown_trust():
    """The document as an older one becomes it: it is not known where its surfaces follow their mesh."""
    document = copy.deepcopy(OURS)
    for surface in document["surfaces"]:
        surface["trusted"] = None
    return document | {"checksum": checksum(document)}


def summed(document):
    return encode({**document, "checksum": checksum(document)})


def test_older_file_is_migrated(older):
    """Through all versions in between, to a document of the current version with checksum."""
    document, findings = check_bytes(summed(older))
    assert findings == () and document == of_unknown_trust()
    assert encode(to_document(from_document(document))) == encode(of_unknown_trust())


def test_older_file_is_validated_by_its_own_version(older):
    """By the schema of its version and by its checksum, before any change."""
    wrong = {(f.code, f.pointer) for f in check_bytes(summed(older | {"part": 3, "link": "a"}))[1]}
    assert wrong == {("type", "/part"), ("unknown", "/link")}
    broken = {**older, "checksum": checksum(older)} | {"part": "other"}
    assert [f.code for f in check_bytes(encode(broken))[1]] == ["checksum"]


def test_migrated_file_is_validated_by_the_current_version(older):
    """The checks of the current version find contradictions between members."""
    older["patches"][1]["name"] = older["patches"][0]["name"]
    assert [f.code for f in check_bytes(summed(older))[1]] == ["duplicate-name"]


@pytest.mark.parametrize("version", [[], {}, None, "1", 1.5, True, -2, -1e300, 0.5])
def test_unknown_version_is_a_finding(older, version):
    """A version of any type gives findings."""
    findings = check_bytes(json.dumps(older | {"version": version}).encode())[1]
    assert "/version" in {finding.pointer for finding in findings}


def test_versions_1_and_2_get_what_they_did_not_store():
    """Version 1 an empty list of warnings, both that it is not known where surfaces follow their mesh."""
    first = of_version_1()
    for document in (first, first | {"version": 2, "warnings": []}):
        found, findings = check_bytes(summed(document))
        assert findings == () and found == of_unknown_trust()


@pytest.mark.parametrize(
    ("pointer", "member"),
    [("", "warnings"), ("/patches/0", "registration"), ("/patches/0/taxels", "sigma"), ("/surfaces/0", "trusted")],
)
def test_version_1_has_no_member_of_later_ones(pointer, member):
    """A file that states version 1 is validated by the schema of version 1."""
    parent = document = of_version_1()
    for key in pointer.split("/")[1:]:
        parent = parent[int(key) if isinstance(parent, list) else key]
    parent[member] = []
    assert [(f.code, f.pointer) for f in check_bytes(summed(document))[1]] == [("unknown", f"{pointer}/{member}")]


def test_plan_of_version_1_is_no_old_calibration():
    """The version of another format is not compared with the versions of calibrations."""
    (finding,) = check_bytes(b'{"format": "skin-plan", "version": 1}')[1]
    assert (finding.code, finding.pointer) == ("value", "/format") and "the file is a plan" in finding.message


@pytest.mark.parametrize("version", [CALIBRATION_VERSION + 1, CALIBRATION_VERSION + 1.0, 10**18])
def test_newer_version_is_the_only_finding(version):
    """The rest of a newer file cannot be validated."""
    findings = check_bytes(json.dumps(OURS | {"version": version, "new": 1}).encode())[1]
    assert [finding.code for finding in findings] == ["version"] and "update the program" in findings[0].message
