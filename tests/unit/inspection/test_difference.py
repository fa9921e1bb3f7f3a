"""Difference of two calibrations: taxels, channels, distances, angles, motion, other members, exit codes."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from skin_calib_addon.calibration import Response, save_calibration
from skin_calib_addon.cli import main
from skin_calib_addon.common.warnings import Warning
from skin_calib_addon.inspection.difference import differ
from tests.samples import boards, sheet, small_calibration

SHEET = sheet(4, 5, 0.01)


def with_sheet(**changes):
    """Return a calibration of one sheet with changed taxels."""
    return small_calibration(patches=(replace(SHEET, taxels=replace(SHEET.taxels, **changes)),))


def test_equal_calibrations_have_no_difference():
    """Nothing is moved, added or named, and any tolerance is met."""
    found = differ(small_calibration(), small_calibration())
    assert found.lines() == [
        "link             forearm",
        "taxels           8 and 8, 8 in both by their ids",
        "moved            mean 0 mm, maximum 0 mm",
        "normals          mean 0°, maximum 0°",
    ]
    assert found.beyond(1e-12) == []


def test_moved_taxels_have_the_exact_motion():
    """All are moved by one motion, one of them further: distances and the remaining one are known."""
    turn, shift = Rotation.from_rotvec([0.0, 0.0, 0.1]), np.array((0.001, 0.0, -0.002))
    t = SHEET.taxels
    moved = turn.apply(t.positions_link) + shift
    found = differ(with_sheet(), with_sheet(positions_link=moved, normals_link=turn.apply(t.normals_link)))
    assert_allclose(found.distances, np.linalg.norm(moved - t.positions_link, axis=1), rtol=1e-12)
    assert_allclose(found.motion[0], turn.as_matrix(), atol=1e-12)
    assert_allclose(found.motion[1], shift, atol=1e-12)
    assert_allclose(found.angles, 0.1, rtol=1e-9)
    assert found.remaining.max() < 1e-12
    motion = "best motion      a turn by 5.730° and a shift by (1.000, 0.000, -2.000) mm"
    assert f"{motion}; it leaves mean 0 mm, maximum 0 mm" in found.lines()
    further = moved.copy()
    further[7] += (0.0, 0.0, 3e-4)
    found = differ(with_sheet(), with_sheet(positions_link=further))
    assert int(found.remaining.argmax()) == 7 and 2e-4 < found.remaining[7] < 3e-4


def test_taxels_are_paired_by_their_ids():
    """Another order of the rows is no difference; added, removed and renumbered ones are named."""
    a = small_calibration(patches=(SHEET, boards(first_channel=20)))
    assert differ(a, replace(a, patches=a.patches[::-1])).beyond(1e-12) == []
    channels = np.arange(20)
    channels[[2, 3]] = 3, 2
    ids = ("new", *SHEET.taxels.ids[1:])
    near = tuple(tuple("new" if name == "s0.0" else name for name in names) for names in SHEET.taxels.neighbours)
    found = differ(with_sheet(), with_sheet(ids=ids, channels=channels, neighbours=near))
    assert (found.added, found.removed) == (("new",), ("s0.0",))
    assert found.renumbered == (("s0.2", 2, 3), ("s0.3", 3, 2))
    assert "renumbered       2: s0.2 from channel 2 to 3, s0.3 from channel 3 to 2" in found.lines()
    assert found.beyond(1.0) == ["1 taxel added", "1 taxel removed", "2 taxels renumbered"]
    assert "neighbours of taxels" in found.others
    none = differ(small_calibration(patches=(SHEET,)), small_calibration(patches=(boards(),)))
    assert none.common == () and none.motion is None and len(none.lines()) == 5  # patches differ, too


def test_normals_count_by_the_edges_of_their_cells():
    """A cell of 10 mm whose normal turns by 0.2 rad moves its edge by 1 mm."""
    normals = SHEET.taxels.normals_link.copy()
    normals[3] = Rotation.from_rotvec(0.2 * SHEET.taxels.tangents_link[3]).apply(normals[3])
    found = differ(with_sheet(), with_sheet(normals_link=normals))
    assert_allclose(found.edges[3], 0.01 * np.sin(0.1), rtol=1e-9)
    assert found.beyond(0.99e-3) == ["1 taxel turned"] and found.beyond(1e-3) == []


def test_everything_else_that_differs_is_named():
    """Responses of taxels, members of the file, columns of taxels; the link counts, too."""
    a = with_sheet()
    b = replace(a, link="thigh", response=Response((0.0, 0.5)), surfaces=a.surfaces[:1], extra={})
    found = differ(a, b)
    assert found.responses == SHEET.taxels.ids and found.beyond(1.0) == [
        "another link",
        "20 taxels with another response",
    ]
    assert found.lines()[0] == "link             forearm and thigh, which are different links"
    assert found.others == ("link", "surfaces", "x_note")
    one = replace(a, responses=(Response((0.0, 0.5)),), patches=(replace(
        SHEET, taxels=replace(SHEET.taxels, responses=np.array([-1] * 19 + [0]))),))  # fmt: skip
    assert differ(a, one).responses == ("s3.4",)
    areas = SHEET.taxels.areas.copy()
    areas[0] *= 2
    assert differ(a, with_sheet(areas=areas)).others == ("area of taxels",)
    assert differ(a, replace(a, patches=(replace(a.patches[0], offset=1e-3),))).others == ("patches",)


def test_exit_codes_and_warnings(tmp_path, capsys):
    """1 beyond the tolerance and for a wrong file, 2 for a wrong call; a warning of one file is stated."""
    moved = SHEET.taxels.positions_link + np.array((0.0, 0.0, 5e-4))
    a, b, c = (str(tmp_path / f"{name}.calibration.json") for name in "abc")
    warning = Warning("strain", "warning", "A cell is strained.", advice="Move it.")
    save_calibration(with_sheet(), a)
    save_calibration(replace(with_sheet(positions_link=moved), warnings=(warning,)), b)
    assert main(["diff", a, b]) == 0
    said = capsys.readouterr()
    assert "moved            mean 0.5 mm, maximum 0.5 mm (s" in said.out
    assert said.err.count("\n") == 1 and "b.calibration.json: warning" in said.err and "A cell is strained" in said.err
    assert main(["diff", b, b, "--tolerance", "0.001"]) == 0 and capsys.readouterr().err == ""
    assert main(["diff", a, b, "--tolerance", "0.51"]) == 0
    assert main(["diff", a, b, "--tolerance", "0.49"]) == 1
    assert "the calibrations differ by more than 0.49 mm: 20 taxels moved\n" in capsys.readouterr().err
    assert main(["diff", a, c]) == 1 and "Check the path" in capsys.readouterr().err
    for words in ([a], [a, b, "--tolerance", "-1"], [a, b, c]):
        with pytest.raises(SystemExit) as caught:
            main(["diff", *words])
        assert caught.value.code == 2 and capsys.readouterr().err.count("\n") == 1
