"""Write what is generated from the table of plan keys: the schema in the package, and the tables of the documentation.

``python scripts/plan_keys.py`` writes both files; ``--check`` says whether they are up to date.
"""

import argparse
import json
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from skin_calib_addon.plan.document import write_value  # noqa: E402
from skin_calib_addon.plan.key import Key, Record  # noqa: E402
from skin_calib_addon.plan.keys import PLANS, RECORDS  # noqa: E402
from skin_calib_addon.plan.schema import plan_schema  # noqa: E402

SCHEMA = ROOT / "skin_calib_addon" / "plan" / "schema.json"
TABLES = ROOT / "docs" / "reference" / "plan_keys.md"
HEAD = """# Plan keys

Generated from `skin_calib_addon/plan/keys.py` by `scripts/plan_keys.py`. Lengths are metres, angles radians, points and
directions are in the link frame. Keys at the top level that begin with `x_` are yours;
they are kept.
"""
COLUMNS = ("key", "value", "default", "meaning", "in the window")


def schema() -> str:
    """Return the text of the schema file."""
    return json.dumps(plan_schema(), indent=2) + "\n"


def tables() -> str:
    """Return the text of the page of tables: one for each object of a plan file."""
    first: dict[tuple[str, ...], Record] = {}
    return HEAD + "".join(table(record, first) for record in (*PLANS.values(), *RECORDS))


def table(record: Record, first: dict[tuple[str, ...], Record]) -> str:
    """Return the heading and the table of one object; rows of earlier ones, in ``first``, are not repeated."""
    rows, others = [COLUMNS, ("---",) * len(COLUMNS)], dict[str, list[str]]()
    for key in record.keys:
        cells = row(key)
        if (owner := first.setdefault(cells, record)) is record or key.type.kind == "constant":
            rows.append(cells)
        else:
            others.setdefault(f"[{owner.title}](#{owner.name})", []).append(cells[0])
    lines = ["| " + " | ".join(cells) + " |" for cells in rows]
    lines += ["", *(f"As in {link}: {', '.join(keys)}." for link, keys in others.items())] if others else []
    return "\n".join(["", f"## {record.title} {{#{record.name}}}", "", *lines, ""])


def row(key: Key) -> tuple[str, ...]:
    """Return the cells of one key."""
    in_window = key.switch.label + " / " * bool(key.label) + key.label if key.switch else key.label
    unit = f" [{key.type.unit}]" if key.type.unit else ""
    return f"`{key.name}`", key.type.words + unit, default(key), meaning(key), in_window


def default(key: Key) -> str:
    """Return the default of a key as the plan file has it; empty where the program finds the value."""
    if key.is_required:
        return "" if key.type.kind == "constant" else "required"
    if key.default is None:
        return f"`{key.word}`" if key.word else ""
    return f"`{json.dumps(write_value(key.type, key.default))}`"


def meaning(key: Key) -> str:
    """Return the description of a key and of its choices."""
    listed = "".join(f" `{c.value}`: {c.description[0].lower()}{c.description[1:]}." for c in key.type.choices)
    return key.meaning + listed


def main() -> int:
    """Write the files, or compare them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare the files instead of writing them")
    check, differs = parser.parse_args().check, False
    for path, text in ((SCHEMA, schema()), (TABLES, tables())):
        if check:
            is_same = path.exists() and path.read_text("utf-8") == text
            differs |= not is_same
            print(f"{path.relative_to(ROOT)}: {'up to date' if is_same else 'differs; run scripts/plan_keys.py'}")
        else:
            path.write_text(text, "utf-8")
    return int(differs)


if __name__ == "__main__":
    sys.exit(main())
