"""What one key of the plan file is: the records from which schema, reading, writing, properties and panels follow."""

from collections.abc import Callable, Iterator, Mapping, Sized
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from ..common.schema_types import LIMITS, fits_length, matcher

REQUIRED: Any = type("Required", (), {"__repr__": lambda self: "REQUIRED"})()
# Of the numbers that people read: how many of the unit of the plan file one unit in a message is, and its name.
READABLE_UNITS = {"m": (1e3, "mm"), "rad": (float(np.rad2deg(1)), "degrees")}


@dataclass(frozen=True)
class Choice:
    """One value of a key with a fixed set of values."""

    value: str
    label: str  # in the window
    description: str


@dataclass(frozen=True)
class Type:
    """What the values of a key are.

    ``kind`` selects the conversions: ``plan/document.py`` converts to and from JSON values, ``blender/scene/fields.py``
    to and from properties, ``blender/properties/of_keys.py`` makes the property.
    """

    kind: str
    words: str  # in the documentation
    schema: Mapping[str, Any]  # JSON Schema of one value
    unit: str = ""  # of the plan file
    shape: tuple[int, ...] = ()  # of an array of numbers
    digits: int = 5  # behind the decimal point in the window
    choices: tuple[Choice, ...] = ()
    record: "Record | None" = None

    @property
    def is_length(self) -> bool:
        """Whether its numbers are in scene units in the window."""
        return self.unit == "m"


@dataclass(frozen=True)
class Switch:
    """A tick box in the window that replaces the value of a key by its default."""

    name: str  # of the property
    label: str
    description: str = ""  # where it is not what the key is otherwise
    means_default: bool = True  # whether the key has its default where the box is ticked, or where it is not
    ticked: bool = True  # in a new plan


@dataclass(frozen=True)
class Key:
    """One key of the plan file."""

    name: str
    type: Type
    description: str
    default: Any = REQUIRED  # as Python value; None where the program finds the value
    otherwise: str = ""  # what the default means, where its value does not say it
    label: str | None = None  # in the window, where it is not the name; empty: the window does not have it
    always: bool = False  # whether it is written where it is the default
    word: str = ""  # which stands for None in the plan file
    field: str | None = None  # of the frozen record, or of one of its parts; None: of the same name; "": none
    blender: str = ""  # name of its property, where it differs
    first: Any = None  # value in a new plan in the window, where it is not the default
    switch: Switch | None = None  # which stands for the default
    empty: str | None = None  # value of the property that stands for the default
    labels: tuple[str, ...] = ()  # in the window, of each number of a pair; of an entry of a list
    joined: bool = False  # whether the window shows it directly below the key before
    panel: str = ""  # in which the window has it, where that is not the panel of the other keys of its record

    def __post_init__(self):
        if self.label is None:
            words = self.name.replace("_", " ").title()
            object.__setattr__(self, "label", "" if self.type.kind == "constant" else words)

    @property
    def path(self) -> str:
        """Return the name of the field in the frozen record, with the part before a dot; empty if it has none."""
        if self.field is None:
            return "" if self.type.kind == "constant" else self.name
        return self.field

    @property
    def property_name(self) -> str:
        """Return the name of its property in Blender."""
        return self.blender or self.name

    @property
    def meaning(self) -> str:
        """Return the description, with what the default means."""
        start = f"`{self.word}`" if self.word else "Default"
        return f"{self.description} {start}: {self.otherwise}." if self.otherwise else self.description

    @property
    def is_required(self) -> bool:
        """Return whether a plan must have it."""
        return self.default is REQUIRED

    @property
    def shown_first(self) -> Any:
        """Return its value in a new plan in the window; None leaves it to Blender."""
        return self.default if self.first is None and not self.is_required else self.first


@dataclass(frozen=True)
class Record:
    """The keys of one object of the plan file, and the frozen record that it is read to.

    Records with the same constant ``kind`` have one object of the schema together.
    """

    name: str  # in the schema
    title: str  # in the documentation
    make: Callable[..., Any]
    keys: tuple[Key, ...]
    parts: Mapping[str, Any] = field(default_factory=dict)  # dataclasses of the fields that are records

    def __post_init__(self):
        part_of = {own.name: part for part, make in self.parts.items() for own in fields(make)}
        keys = (replace(k, field=f"{part_of[k.path]}.{k.path}") if k.path in part_of else k for k in self.keys)
        object.__setattr__(self, "keys", tuple(keys))

    def made(self, values: Mapping[str, Any]) -> Any:
        """Return the frozen record."""
        own = {path: value for path, value in values.items() if "." not in path}
        for part, make in self.parts.items():
            inner = {path.removeprefix(f"{part}."): v for path, v in values.items() if path.startswith(f"{part}.")}
            own[part] = make(**inner)
        return self.make(**own)

    def key(self, name: str) -> Key:
        """Return the key with this name."""
        return next(key for key in self.keys if key.name == name)


def problem(key: Key, value: Any) -> str:
    """Return what is wrong with a value as the end of a sentence for people; empty if nothing is."""
    schema = dict(key.type.schema["oneOf"][-1] if "oneOf" in key.type.schema else key.type.schema)
    if isinstance(value, str):
        is_fine = len(value) >= schema.get("minLength", 0) and matcher(schema.get("pattern", ""))(value)
        return "" if is_fine else "must have at least one character, and no control characters"
    if isinstance(value, Sized) and not key.type.shape and not fits_length(len(value), schema):
        return f"must have at most {schema['maxItems']} entries" if value else "must not be empty"
    for number in _numbers(value):
        if not np.isfinite(number):
            return "must be a finite number"
        for name, limit in _limits(schema).items():
            holds, words = LIMITS[name]
            if not holds(number, limit):
                return f"must be {words} {_readable(limit, key.type.unit)}, not {_readable(number, key.type.unit)}"
    return ""


def _numbers(value: Any) -> Iterator[float]:
    if isinstance(value, tuple):
        for item in value:
            yield from _numbers(item)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield value


def _limits(schema: Mapping[str, Any]) -> dict[str, Any]:
    """Return the limits of the numbers in a value, which all have those of the first."""
    while "items" in schema or "prefixItems" in schema:
        schema = schema["prefixItems"][0] if "prefixItems" in schema else schema["items"]
    return {name: schema[name] for name in LIMITS if name in schema}


def _readable(number: float, unit: str) -> str:
    factor, name = READABLE_UNITS.get(unit, (1, ""))
    return f"{number * factor:.6g} {name}".rstrip()
