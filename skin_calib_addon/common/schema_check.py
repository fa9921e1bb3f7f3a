"""Check a document against the subset of JSON Schema (draft 2020-12) that the schemas of this package use.

Two rules are stricter than JSON Schema: a number is finite, and a string has no lone surrogates.

A compiled validator takes an eighth of the time, which is a ninth of that of loading a calibration. It would be another
package of each controller, with 15 MB, and its sentences would have to be replaced by those below.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .findings import Finding, child, did_you_mean, error, first, show
from .schema_types import (
    ANNOTATIONS,
    LIMITS,
    Schema,
    all_fit,
    branch_test,
    constant_members,
    definition,
    fits_length,
    has_type,
    is_same,
    matcher,
)

_KEYWORDS = {"$ref", "type", "const", "enum", "oneOf", "required", "properties", "patternProperties", *LIMITS}
_KEYWORDS |= {"additionalProperties", "items", "prefixItems", "minItems", "maxItems", "pattern", "minLength"}
# Array elements that are checked at once. A block with a problem is checked element by element.
# Larger: a problem costs more time; smaller: a valid array costs more time.
BULK_ITEMS = 1024


def read_schema(path: Path) -> Schema:
    """Read a schema of this package; an unsupported keyword raises an `AssertionError`."""
    schema = json.loads(path.read_text("utf-8"))
    parts = [schema]
    while parts:
        part = parts.pop()
        assert part.keys() <= _KEYWORDS | ANNOTATIONS, f"{path}: {part.keys() - _KEYWORDS - ANNOTATIONS}"
        parts += [p for name in ("$defs", "properties", "patternProperties") for p in part.get(name, {}).values()]
        parts += [*part.get("oneOf", ()), *part.get("prefixItems", ()), *([part["items"]] if "items" in part else ())]
    return schema


def check(document: Any, schema: Schema) -> tuple[Finding, ...]:
    """Return all deviations of a document from its schema; all are errors."""
    return tuple(first(_check(document, schema, "", schema)))


def _check(value: Any, schema: Schema, pointer: str, root: Schema) -> Iterator[Finding]:
    if "$ref" in schema:
        yield from _check(value, definition(schema, root), pointer, root)
    if "type" in schema and not has_type(value, schema["type"]):
        yield error("type", pointer, f"must be {_a(schema['type'])}, not {show(value)}", value)
        return
    if "const" in schema and not is_same(value, schema["const"]):
        yield error("value", pointer, f"must be {show(schema['const'])}, not {show(value)}", value)
    if "enum" in schema and not any(is_same(value, choice) for choice in schema["enum"]):
        yield _none_of(value, schema["enum"], pointer)
    if "oneOf" in schema:
        yield from _check_choice(value, schema["oneOf"], pointer, root)
    if isinstance(value, dict):
        yield from _check_object(value, schema, pointer, root)
    elif isinstance(value, list):
        yield from _check_array(value, schema, pointer, root)
    elif isinstance(value, str):
        yield from _check_string(value, schema, pointer)
    elif has_type(value, "number"):
        for name, (holds, words) in LIMITS.items():
            if name in schema and not holds(value, schema[name]):
                yield error("range", pointer, f"must be {words} {schema[name]}, not {show(value)}", value)


def _check_object(value: dict[str, Any], schema: Schema, pointer: str, root: Schema) -> Iterator[Finding]:
    known, patterns = schema.get("properties", {}), schema.get("patternProperties", {})
    for name in schema.get("required", ()):
        if name not in value:
            yield error("missing", pointer, f"lacks the member {show(name)}")
    for name, member in value.items():
        where = child(pointer, name)
        parts = [known[name]] if name in known else []
        parts += [part for pattern, part in patterns.items() if matcher(pattern)(str(name))]
        for part in parts:
            yield from _check(member, part, where, root)
        if not parts and schema.get("additionalProperties") is False:
            yield error("unknown", where, f"is not a known member{did_you_mean(str(name), known)}", member)


def _check_array(value: list[Any], schema: Schema, pointer: str, root: Schema) -> Iterator[Finding]:
    if not fits_length(len(value), schema):
        low, high = schema.get("minItems", 0), schema.get("maxItems")
        wanted = f"at least {low}" if high is None else f"{low}" if low == high else f"{low} to {high}"
        yield error("length", pointer, f"must have {wanted} elements, not {len(value)}", value)
    heads = schema.get("prefixItems", [])
    for index, (item, part) in enumerate(zip(value, heads)):
        yield from _check(item, part, child(pointer, index), root)
    for start in range(len(heads), len(value), BULK_ITEMS) if "items" in schema else ():
        block = value[start : start + BULK_ITEMS]
        if not all_fit(block, schema["items"], root):
            for index, item in enumerate(block, start):
                yield from _check(item, schema["items"], child(pointer, index), root)


def _check_string(value: str, schema: Schema, pointer: str) -> Iterator[Finding]:
    if len(value) < schema.get("minLength", 0):
        yield error("length", pointer, f"must have at least {schema['minLength']} characters", value)
    if "pattern" in schema and not matcher(schema["pattern"])(value):
        yield error("pattern", pointer, f"must match {schema['pattern']}, not {show(value)}", value)


def _check_choice(value: Any, branches: list[Schema], pointer: str, root: Schema) -> Iterator[Finding]:
    definitions = [definition(branch, root) for branch in branches]
    matching = [branch for branch, defined in zip(branches, definitions) if branch_test(defined)(value)]
    constants = [tag for defined in definitions for tag in constant_members(defined).items()]
    if matching:
        yield from _check(value, matching[0], pointer, root)
    elif isinstance(value, dict) and constants:
        name = constants[0][0]
        if name in value:
            yield _none_of(value[name], [const for _, const in constants], child(pointer, name))
        else:
            yield error("missing", pointer, f"lacks the member {show(name)}")
    else:
        wanted = " or ".join(show(d["const"]) if "const" in d else _a(d["type"]) for d in definitions)
        yield error("type", pointer, f"must be {wanted}, not {show(value)}", value)


def _none_of(value: Any, choices: list[Any], pointer: str) -> Finding:
    near = did_you_mean(value, choices) if isinstance(value, str) else ""
    return error("value", pointer, f"must be one of {', '.join(map(show, choices))}, not {show(value)}{near}", value)


def _a(name: str) -> str:
    return {"null": "null", "number": "a finite number"}.get(name, f"{'an' if name[0] in 'aio' else 'a'} {name}")
