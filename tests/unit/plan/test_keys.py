"""One entry of the table of keys is all that a key needs: schema, reading, writing and documentation follow."""

import json
from dataclasses import MISSING, dataclass, fields, replace

import pytest

from scripts import plan_keys
from skin_calib_addon.common.schema_check import check, read_schema
from skin_calib_addon.plan.document import read, write
from skin_calib_addon.plan.key import Key, problem
from skin_calib_addon.plan.keys import BOARDS, COVER, IMPORTED, MODALITY, PLAN, PLANES, POINT, RECORDS, SHEET, length
from skin_calib_addon.plan.schema import plan_schema, schema_of
from skin_calib_addon.plan.skins import SheetSkin

THICKNESS = Key("thickness", length(minimum=0, maximum=0.1), "Thickness.", default=0.001)
BAND = {"name": "band", "kind": "sheet", "rows": 6, "columns": 22, "pitch": [0.01, 0.01], "direction": [0.0, 1.0, 0.0]}
BAND |= {"origin": "center"}


@dataclass(frozen=True)
class ThickSheet(SheetSkin):
    """A sheet with a field for the new key."""

    thickness: float = 0.001


THICK = replace(SHEET, make=ThickSheet, keys=(*SHEET.keys, THICKNESS))


def findings(document):
    """What the schema of the sheet with the new key finds in a document, by pointer."""
    return [(f.pointer, f.code) for f in check(document, schema_of([THICK]) | {"$defs": plan_schema()["$defs"]})]


def test_added_key_is_in_the_schema():
    """With its limits; without it, plans stay valid."""
    assert findings(BAND) == findings(BAND | {"thickness": 0.02}) == []
    assert findings(BAND | {"thickness": -1}) == [("/thickness", "range")]
    assert findings(BAND | {"thickness": "thin"}) == [("/thickness", "type")]


@pytest.mark.parametrize("members", [{}, {"thickness": 0.02}])
def test_added_key_is_read_and_written(members):
    """It comes back as it was written, and is left out where it has its default."""
    skin = read(THICK, BAND | members)
    assert skin.thickness == members.get("thickness", 0.001) and skin.lattice.rows == 6
    assert write(THICK, skin) == BAND | members
    assert list(write(THICK, skin))[:2] == ["name", "kind"]


def test_added_key_is_documented():
    """Its row says everything; a record with the same keys refers to it."""
    row, rows = "| `thickness` | length [m] | `0.001` | Thickness. | Thickness |", {}
    assert row in plan_keys.table(THICK, rows).splitlines()
    again = plan_keys.table(replace(THICK, name="again"), rows)
    assert row not in again and f"As in [{THICK.title}](#{THICK.name}): " in again and "`thickness`" in again


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        (THICKNESS, 0.02, ""),
        (THICKNESS, -0.02, "must be at least 0 mm, not -20 mm"),
        (THICKNESS, float("nan"), "must be a finite number"),
        (SHEET.key("pitch"), (0.01, 0.0), "must be at least 0.01 mm, not 0 mm"),
        (SHEET.key("rows"), 0, "must be at least 1, not 0"),
        (SHEET.key("direction"), (0.0, float("inf"), 0.0), "must be a finite number"),
        (SHEET.key("trim"), True, ""),
        (SHEET.key("name"), "前腕", ""),
        (SHEET.key("name"), "", "must have at least one character, and no control characters"),
        (SHEET.key("name"), "a\nb", "must have at least one character, and no control characters"),
        (SHEET.key("landmarks"), (), "must not be empty"),
        (BOARDS.key("cells"), "fill", ""),
        (BOARDS.key("cells"), ((0, 0), (1, 2000)), "must be at most 1000, not 2000"),
        (BOARDS.key("cells"), (), "must not be empty"),
        (IMPORTED.key("format"), "icub", ""),
        (PLANES.key("closed"), False, ""),
        (IMPORTED.key("file"), "a\0b", "must have at least one character, and no control characters"),
    ],
)
def test_problem_of_a_value_is_said_in_the_units_of_people(key, value, message):
    """What is wrong with a value, without pointers or patterns; nothing where nothing is wrong."""
    assert problem(key, value) == message


def test_schema_file_is_the_one_of_the_keys():
    """The file in the package, for editors and other programs; its keywords are those that ``check`` knows."""
    assert json.loads(plan_keys.SCHEMA.read_text("utf-8")) == plan_schema() == read_schema(plan_keys.SCHEMA)
    assert plan_keys.SCHEMA.read_text("utf-8") == plan_keys.schema()


def test_documentation_is_that_of_the_keys():
    """``scripts/plan_keys.py`` writes it."""
    assert plan_keys.TABLES.read_text("utf-8") == plan_keys.tables()


@pytest.mark.parametrize("record", [PLAN, *RECORDS], ids=lambda record: record.name)
def test_entry_of_a_key_is_complete(record):
    """A description that is a sentence, and a label; names and properties are each there once."""
    has_label = record is not MODALITY  # which the window does not have
    for key in record.keys:
        assert key.description.endswith(".") and key.description[0].isupper(), key.name
        assert key.label or key.type.kind == "constant" or key.name in ("m", "unit", "modalities") or not has_label, (
            key.name
        )
        assert all(choice.label and choice.description for choice in key.type.choices)
    for names in ([key.name for key in record.keys], [key.path for key in record.keys if key.path]):
        assert len(set(names)) == len(names)


def test_record_that_is_written_with_its_defaults_has_them_in_the_document():
    """Keys that are always written: a reader of the file sees them."""
    assert write(COVER, read(COVER, {})) == {"shell": "outer", "cuts": []}
    assert POINT.unit == "m" and POINT.is_length and not SHEET.key("direction").type.is_length


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: record.name)
def test_defaults_of_a_key_and_of_its_field_agree(record):
    """A record that code makes has the defaults of one that is read."""
    for make, part in ((record.make, ""), *((make, f"{part}.") for part, make in record.parts.items())):
        defaults = make._field_defaults if hasattr(make, "_fields") else {f.name: f.default for f in fields(make)}
        for key in record.keys:
            own = defaults.get(key.path.removeprefix(part), MISSING)
            if key.path.startswith(part) and not key.is_required and own is not MISSING:
                assert own == key.default, key.name
