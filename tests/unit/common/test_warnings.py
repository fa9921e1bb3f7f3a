"""The record of a warning: its text, and its conversion to JSON and back."""

import json
import re

from skin_calib_addon.common.warnings import (
    ORDER,
    Place,
    Warning,
    from_document,
    to_document,
    worst_first,
)
from tests.unit.test_docs import TROUBLES

FULL = Warning(
    "off-mesh",
    "warning",
    "The surface is 7.1 mm off the mesh.",
    Place((0.01, -0.02, 0.03), "u-plane 3", "sole", ("sole.1", "sole.2")),
    7.1e-3,
    "Cut it away.",
)
BARE = Warning("parts", "note", "One connected part")


def test_worst_warning_is_first():
    """First what is wrong with the surface, then with taxels, then what is left out; the severity before all of it."""
    codes = ("parts", "outlier-vertices", "overlap", "mesh-size", "off-mesh", "dropped-curves")
    found = [*(Warning(code, "warning", "") for code in codes), Warning("fit", "note", ""), Warning("x", "error", "")]
    sorted_codes = ["x", "off-mesh", "overlap", "dropped-curves", "outlier-vertices", "parts", "mesh-size", "fit"]
    assert [warning.code for warning in worst_first(found)] == sorted_codes


def test_order_has_each_code_of_a_fit_and_of_a_skin():
    """The tables of the documentation have the same order."""
    text, order = TROUBLES.read_text("utf-8"), []
    for name in ("Fit", "Skins"):
        section = text.split(f"### {name}\n")[1].split("\n### ")[0]
        codes = re.findall(r"^\| `([a-z-]+)`", section, re.MULTILINE)
        assert codes == [code for code in ORDER if code in codes]
        order += codes
    assert sorted(order) == sorted(ORDER)


def test_document_is_json_and_comes_back():
    """Nothing is lost; unknown fields of the place are left out."""
    documents = json.loads(json.dumps(to_document((FULL, BARE))))
    assert from_document(documents) == (FULL, BARE)
    assert documents[1]["where"] == {} and documents[0].keys() == documents[1].keys()
