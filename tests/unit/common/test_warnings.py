"""The record of a warning: its text, and its conversion to JSON and back."""

import json
import re

from skin_calib_addon.common.warnings import (
    NOWHERE,
    ORDER,
    Place,
    Warning,
    from_document,
    point_of,
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


def test_text_has_message_advice_and_code():
    """On one line, for any names."""
    assert str(FULL) == "The surface is 7.1 mm off the mesh. Cut it away. [off-mesh]"
    assert str(BARE) == "One connected part [parts]"
    assert str(Warning("a", "note", "x\ny")) == r"x\ny [a]"


def test_place_in_words():
    """Point and names, if they are known."""
    assert FULL.where.words == "at (10.0, -20.0, 30.0) mm, near u-plane 3"
    assert (Place(names="row 2").words, NOWHERE.words) == ("near row 2", "")


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


def test_point_of_an_array():
    """Python floats, so that records can be compared and stored."""
    import numpy as np

    assert point_of(np.array((1.0, 2.0, 3.0))) == (1.0, 2.0, 3.0)
