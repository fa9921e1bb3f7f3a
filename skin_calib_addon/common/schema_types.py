"""Check types and limits of JSON values, one by one and whole arrays at once."""

import operator
import re
from collections.abc import Callable
from functools import cache
from itertools import chain
from typing import Any

import numpy as np

Schema = dict[str, Any]

LIMITS = {
    "minimum": (operator.ge, "at least"),
    "exclusiveMinimum": (operator.gt, "more than"),
    "maximum": (operator.le, "at most"),
    "exclusiveMaximum": (operator.lt, "less than"),
}
ANNOTATIONS = {"$schema", "$defs", "$comment", "title", "description", "default"}
_BULK_KEYWORDS = {"type", "items", "minItems", "maxItems", "pattern", "minLength", *LIMITS, *ANNOTATIONS}
_BULK_KEYWORDS |= {"required", "properties", "additionalProperties"}
_TYPES = {"object": dict, "array": list, "boolean": bool, "null": type(None)}
_SURROGATE = re.compile("[\ud800-\udfff]")
_LARGEST = float(np.finfo(float).max)


def has_type(value: Any, name: str) -> bool:
    """Return whether a value has a JSON type."""
    if name == "string":
        return isinstance(value, str) and not _SURROGATE.search(value)
    if name in _TYPES:
        return isinstance(value, _TYPES[name])
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool) and -_LARGEST <= value <= _LARGEST
    return is_number and (name == "number" or value == int(value))


def is_same(value: Any, const: Any) -> bool:
    """Return whether a value equals a scalar as a JSON value: 1 equals 1.0, but not true."""
    is_scalar = isinstance(value, (str, int, float, type(None)))
    return is_scalar and isinstance(value, bool) == isinstance(const, bool) and value == const


def fits_length(length: int, schema: Schema) -> bool:
    """Return whether an array may have this length."""
    return schema.get("minItems", 0) <= length <= schema.get("maxItems", length)


def definition(schema: Schema, root: Schema) -> Schema:
    """Return the schema itself, or the schema in ``$defs`` to which it refers."""
    return root["$defs"][schema["$ref"].removeprefix("#/$defs/")] if "$ref" in schema else schema


def branch_test(branch: Schema) -> Callable[[Any], bool]:
    """Return a function that decides whether a branch applies to a value, valid or not."""
    if "const" in branch:
        return lambda value: is_same(value, branch["const"])
    wanted, constants = branch["type"], tuple(constant_members(branch).items())
    return lambda value: has_type(value, wanted) and all(is_same(value.get(name), const) for name, const in constants)


def constant_members(branch: Schema) -> dict[str, Any]:
    """Return the constant members that distinguish a branch from the others."""
    return {name: part["const"] for name, part in branch.get("properties", {}).items() if "const" in part}


@cache
def matcher(pattern: str) -> Any:
    """Return the search function of a pattern; a final ``$`` matches only the end of the text."""
    return re.compile(re.sub(r"\$$", r"\\Z", pattern)).search


def all_fit(values: list[Any], schema: Schema, root: Schema) -> bool:
    """Return whether all values of a list match a schema, checked one nesting level at a time."""
    if schema.keys() - ANNOTATIONS == {"$ref"}:
        schema = definition(schema, root)
    if schema.keys() - ANNOTATIONS == {"const"}:
        return all(is_same(value, schema["const"]) for value in values)
    if schema.keys() - ANNOTATIONS == {"oneOf"}:
        return _choices_fit(values, [definition(branch, root) for branch in schema["oneOf"]], root)
    if not schema.keys() <= _BULK_KEYWORDS or "type" not in schema:
        return False
    types, wanted = set(map(type, values)), schema["type"]
    if wanted == "array":
        fits = types <= {list} and all(fits_length(length, schema) for length in set(map(len, values)))
        return fits and ("items" not in schema or all_fit(list(chain.from_iterable(values)), schema["items"], root))
    if wanted == "string":
        least, matches = schema.get("minLength", 0), matcher(schema.get("pattern", ""))
        return types <= {str} and all(len(v) >= least and matches(v) and not _SURROGATE.search(v) for v in set(values))
    if wanted == "object":
        return types <= {dict} and _objects_fit(values, schema, root)
    if wanted in _TYPES:
        return types <= {_TYPES[wanted]}
    return wanted in ("number", "integer") and types <= {int, float} and _all_numbers_fit(values, schema)


def _choices_fit(values: list[Any], branches: list[Schema], root: Schema) -> bool:
    for branch in branches:
        matching = list(map(branch_test(branch), values))
        if not all_fit([value for value, is_this in zip(values, matching) if is_this], branch, root):
            return False
        values = [value for value, is_this in zip(values, matching) if not is_this]
    return not values


def _objects_fit(values: list[Any], schema: Schema, root: Schema) -> bool:
    known, needed = schema.get("properties", {}), set(schema.get("required", ()))
    is_open = schema.get("additionalProperties") is not False
    if not all(needed <= names and (is_open or names <= known.keys()) for names in set(map(frozenset, values))):
        return False
    return all(all_fit([v[name] for v in values if name in v], part, root) for name, part in known.items())


def _all_numbers_fit(values: list[Any], schema: Schema) -> bool:
    try:
        numbers = np.array(values, float)
    except OverflowError:
        return False
    fits = np.isfinite(numbers) & (schema["type"] == "number" or numbers == np.floor(numbers))
    for name, (holds, _) in LIMITS.items():
        fits &= name not in schema or holds(numbers, schema[name])
    return bool(fits.all())
