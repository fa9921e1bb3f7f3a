"""Limits of files and inputs: the largest that is accepted, and the next one, which is refused.

The numbers are written out, so that a limit does not change unnoticed.
"""

import numpy as np
import pytest

from skin_calib_addon.calibration.exchange.xml_nodes import XmlError, children_of_root
from skin_calib_addon.calibration.measurements import MAX_MAGNITUDE, MIN_MAGNITUDE
from skin_calib_addon.common.errors import CalibrationFormatError, InvalidPlan, listed
from skin_calib_addon.common.findings import error, first
from skin_calib_addon.common.text import check_size, text_of
from skin_calib_addon.skin import HexLattice, lay_boards
from skin_calib_addon.skin.imported import near_pairs
from tests.shapes import plane_surface


def test_text_files_have_64_megabytes_and_lines_of_a_million_characters():
    """The largest file and the longest line pass; one character more is an error."""
    largest = bytes(64 * 2**20)
    check_size(largest, "a.csv")
    with pytest.raises(CalibrationFormatError, match=f"exceed the limit of {64 * 2**20}"):
        check_size(largest + b"x", "a.csv")
    line = b"x" * 2**20
    assert len(text_of(line + b"\n1\n", "a.csv")) == 2**20 + 3
    with pytest.raises(CalibrationFormatError, match=f"the limit is {2**20}"):
        text_of(line + b"x\n", "a.csv")


def test_a_check_lists_1000_findings():
    """A thousand problems are listed completely; of more, the thousand first and a note."""
    problems = [error("units", "", f"is {k}") for k in range(1001)]
    assert len(list(first(problems[:1000]))) == 1000
    *listed_ones, last = first(problems)
    assert listed_ones == problems[:1000] and "1000" in last.message


def test_messages_list_five_names():
    """Five names are complete; of more, the number of the others follows, and a full stop can be next to it."""
    assert listed("abcde") == "a, b, c, d, e" and listed("abcdefg") == "a, b, c, d, e and 2 more"


def nested(depth, inside=""):
    """An XML document with so many levels, and a text in the deepest one."""
    tags = ["root", *(f"a{k}" for k in range(depth - 1))]
    return "".join(f"<{t}>" for t in tags) + inside + "".join(f"</{t}>" for t in reversed(tags))


def test_xml_files_have_16_levels_1000_elements_and_64_characters():
    """The deepest file, the largest element and the longest text pass; of a longer text the end is cut off."""
    assert list(children_of_root(nested(16), "root"))
    with pytest.raises(XmlError, match="more than 16 nesting levels"):
        list(children_of_root(nested(17), "root"))
    (cell,) = children_of_root(f"<root><cell>{'<a/>' * 1000}</cell></root>", "root")
    assert len(cell.children) == 1000
    with pytest.raises(XmlError, match="the limit is 1000"):
        list(children_of_root(f"<root><cell>{'<a/>' * 1001}</cell></root>", "root"))
    for length in (64, 65):
        (cell,) = children_of_root(nested(2, "1" * length), "root")
        assert len(cell.text) == 64


def test_forces_span_a_hundred_orders():
    """Squares of the smallest and products of the largest number stay far from the limits of double precision."""
    assert (MIN_MAGNITUDE, MAX_MAGNITUDE) == (1e-100, 1e12)
    with np.errstate(all="raise"):
        assert MIN_MAGNITUDE**2 * 1e-90 > 0 and np.isfinite(MAX_MAGNITUDE**14)


def test_surface_of_boards_has_up_to_50000_cells():
    """The circle around a surface with boards with a pitch of 20 mm may have the area of 50 000 cells."""
    lattice = HexLattice(0.02 / np.sqrt(3), 0.0)
    diagonal = 2 * np.sqrt(50_000 * np.sqrt(0.75) * 0.02**2 / np.pi)
    for factor, fits in ((0.999, True), (1.001, False)):
        surface = plane_surface(np.sqrt((factor * diagonal) ** 2 - 0.04**2), 0.04)
        if fits:
            assert len(lay_boards(surface, lattice, "all", None, (1, 0, 0))[0].cells) > 50
        else:
            with pytest.raises(
                InvalidPlan,
                match=r"extends too far for boards with a pitch of 20 mm. Use larger boards, or check",
            ):
                lay_boards(surface, lattice, "all", None, (1, 0, 0))


def test_taxels_have_up_to_200_neighbours_on_average():
    """Two hundred equal points are pairs of each other; of one more the pitch is too large."""
    points, normals = np.zeros((201, 3)), np.tile((0.0, 0, 1), (201, 1))
    assert len(near_pairs(points[:200], normals[:200], 1e-3, "cloud")) == 200 * 199 // 2
    with pytest.raises(InvalidPlan, match="too close together"):
        near_pairs(points, normals, 1e-3, "cloud")
