"""The words that `docs/glossary.md` rejects are in no code, string, comment or Markdown file."""

import io
import re
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GLOSSARY = ROOT / "docs" / "glossary.md"
FOLDERS = (
    "skin_calib_addon",
    "operators",
    "panels",
    "tests",
    "benchmarks",
    "control",
    "cpp",
    "examples",
    "sample_scenes",
    "scripts",
    "docs",
)
TEXT = {"COMMENT", "STRING", "FSTRING_MIDDLE"}
OWN = {GLOSSARY, Path(__file__)}  # these two name the words
# A key of earlier files, the folder of ROS packages, and a public function.
NAMES = (
    '"doubts"',
    '"share"',
    '"ros/share"',
    '"ros/share/bot"',
    '"ros/share/bot/meshes/pin.ply"',
    "lay boards",
    "column shares",
    "row shares",
    '"/usr/share"',
)


def words_out(glossary):
    """The words and phrases in the column "not" of the glossary's table."""
    table = glossary[glossary.index("| use | not |") :].split("\n\n")[0]
    rows = [line.strip()[1:-1].split("|") for line in table.splitlines()]
    assert all(len(row) == len(rows[0]) for row in rows), "a row of the table has another number of cells"
    return [word.strip() for row in rows[2:] for word in row[1].split(",") if word.strip()]


def pattern_of(words):
    """A pattern that finds each of the words as a whole word, in any case."""
    return re.compile(rf"\b({'|'.join(re.escape(word) for word in words)})\b", re.IGNORECASE)


def texts(path):
    """Line number and text of everything in a file that a person reads."""
    source = path.read_text("utf-8")
    if path.suffix != ".py":
        yield from enumerate(source.splitlines(), 1)
        return
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        name = tokenize.tok_name[token.type]
        if name in TEXT:
            yield from enumerate(token.string.splitlines(), token.start[0])
        elif name == "NAME":
            yield token.start[0], token.string.replace("_", " ")


def files():
    """All Python, Markdown and C++ files of the repository."""
    yield from (path for path in ROOT.glob("*.md"))
    yield from (path for path in ROOT.glob("*.py"))
    for folder in FOLDERS:
        yield from (path for ending in ("*.py", "*.md", "*.[ch]pp") for path in sorted((ROOT / folder).rglob(ending)))


def test_words_that_are_out_stand_nowhere():
    """The offenders are listed as file:line."""
    pattern = pattern_of(words_out(GLOSSARY.read_text("utf-8")))
    found = [
        f"{path.relative_to(ROOT)}:{line}: {match[0]!r} in {text.strip()[:80]!r}"
        for path in files()
        if path not in OWN
        if pattern.search(path.read_text("utf-8").replace("_", " "))  # reading words one by one takes long
        for line, text in texts(path)
        if text not in NAMES
        for match in pattern.finditer(text)
    ]
    assert found == []


@pytest.mark.parametrize(
    ("text", "hits"),
    [
        ("# it tells\nx = 1\n", ["tells"]),
        ('def f():\n    """Is told."""\n    return f"a {x} doubt"\n', ["told", "doubt"]),
        ("share_of = 2\n", ["share"]),
        ("shared = halfway + teller\n", []),
    ],
)
def test_each_kind_of_text_is_read(tmp_path, text, hits):
    """Comments, docstrings, formatted strings and names; whole words only."""
    path = tmp_path / "a.py"
    path.write_text(text)
    pattern = pattern_of(["tells", "told", "doubt", "share"])
    assert [match[0] for _, line in texts(path) for match in pattern.finditer(line)] == hits


def test_table_is_read():
    """The second column alone, up to the end of the table, whether other columns are empty or not."""
    table = "| a | b |\n|---|---|\n| x | y |\n\n| use | not | by eye |\n|---|---|---|\n"
    table += "| p | q, r s | t |\n| u |  | v |\n| w | z | |\n"
    assert words_out(table) == ["q", "r s", "z"]
    assert {"doubt", "told", "share", "way", "to and fro", "snug"} <= set(words_out(GLOSSARY.read_text("utf-8")))
