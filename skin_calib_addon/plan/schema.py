"""The JSON Schema of plan files, from the keys."""

from collections.abc import Sequence
from functools import cache
from typing import Any

from .document import write_value
from .key import Key, Record
from .keys import PLANS, RECORDS, RESPONSES

DIALECT = "https://json-schema.org/draft/2020-12/schema"


@cache
def plan_schema() -> dict[str, Any]:
    """Return the schema of a plan file: one of the versions, ``version_1`` and so on in its definitions."""
    kinds: dict[str, list[Record]] = {}
    for record in RECORDS:
        kinds.setdefault(schema_name(record), []).append(record)
    plan: dict[str, Any] = {"$schema": DIALECT, "title": "Skin plan: what to cut, where the planes are, which skins"}
    versions = {f"version_{k}": schema_of([record]) | {"patternProperties": {"^x_": {}}} for k, record in PLANS.items()}
    plan |= {"oneOf": [{"$ref": f"#/$defs/{name}"} for name in versions]}
    return plan | {"$defs": versions | RESPONSES | {name: schema_of(records) for name, records in kinds.items()}}


def schema_name(record: Record) -> str:
    """Return the name of the object of the schema that a record belongs to: its kind, where it has one."""
    kinds = [key.type.schema["const"] for key in record.keys if key.name == "kind"]
    return kinds[0] if kinds else record.name


def schema_of(records: Sequence[Record]) -> dict[str, Any]:
    """Return the schema of an object that has the keys of one of some records."""
    keys: dict[str, Key] = {}
    for record in records:
        keys = {key.name: key for key in record.keys} | keys
    in_all = [name for name in keys if all(name in {key.name for key in record.keys} for record in records)]
    required = [name for name in in_all if keys[name].is_required]
    return {
        "type": "object",
        **({"required": required} if required else {}),
        "properties": {name: schema_of_value(key) for name, key in keys.items()},
        "additionalProperties": False,
    }


def schema_of_value(key: Key) -> dict[str, Any]:
    """Return the schema of the value of a key."""
    own = dict(key.type.schema)
    if key.type.kind == "constant":
        return own
    schema = {"oneOf": [{"const": key.word}, own]} if key.word else own
    schema |= {"description": key.meaning}
    if key.is_required or key.default is None and not key.word:
        return schema
    return schema | {"default": key.word if key.default is None else write_value(key.type, key.default)}
