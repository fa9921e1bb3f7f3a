"""Single taxels that are disabled, or have a channel of their own."""

import json

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from skin_calib_addon.calibration.file import load_calibration, save_calibration
from skin_calib_addon.calibration.modality import Modality
from skin_calib_addon.calibration.response import Response
from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.geometry import CoverSpec, TubeGrid
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.pipeline.report import report_document, summary
from skin_calib_addon.plan import Plan
from skin_calib_addon.plan.document import skins_from, write_skin
from skin_calib_addon.plan.plan import Surface
from skin_calib_addon.plan.skins import following_channel
from tests.shapes import Z_AXIS, cylinder

SHEET = {"name": "band", "kind": "sheet", "rows": 3, "columns": 6, "pitch": [0.01, 0.01], "origin": [0.05, 0, 0.03]}
SHEET |= {"direction": [0, 1, 0]}
NEXT = SHEET | {"name": "next", "origin": [0.05, 0, 0.06]}  # the row above the band
BOARDS = {"name": "boards", "kind": "hexagons", "side": 0.01, "cells": [[0, 0], [1, 0], [0, 1]]}
BOARDS |= {"origin": [-0.05, 0, 0.1]}
OFF, MOVED = {"taxel": "1.2", "enabled": False}, {"taxel": "0.3", "channel": 77}


MESH, FITS = cylinder(0.05, 0.2, 48, 16), {}


def made(tmp_path, *skins, **members):
    """Return the result of a plan with these skins on a tube, which is fitted once."""
    surface = Surface(CoverSpec(), TubeGrid(6, 24, Z_AXIS, 1e-3))
    plan = Plan("tube", tmp_path / "tube.stl", "m", (surface,), skins_from(list(skins)), **members)
    result = calibrate(plan, MESH, known=FITS)
    FITS.update(result.fits)
    return result


def test_disabled_taxel_leaves_the_others_as_they_are(tmp_path):
    """Ids, channels, positions and uncertainties stay; no taxel, of whichever skin, is its neighbour."""
    edge = {"taxel": "2.3", "enabled": False}  # next to the other sheet
    all_, some = (made(tmp_path, SHEET | more, NEXT, BOARDS) for more in ({}, {"taxels": [OFF, edge]}))
    before, after = all_.calibration.patches[0].taxels, some.calibration.patches[0].taxels
    rest = [k for k, id in enumerate(before.ids) if id not in ("band.1.2", "band.2.3")]
    assert after.ids == tuple(before.ids[k] for k in rest) and len(after.ids) == 16
    for name in ("channels", "positions_link", "normals_link", "areas", "sigma"):
        assert_array_equal(getattr(after, name), getattr(before, name)[rest])
    assert_array_equal(after.quality["strain"], before.quality["strain"][rest])
    was = {other for patch in all_.calibration.patches for row in patch.taxels.neighbours for other in row}
    now = {other for patch in some.calibration.patches for row in patch.taxels.neighbours for other in row}
    assert was - now == {"band.1.2", "band.2.3"} and now <= was
    assert any("band.2.3" in row for row in all_.calibration.patches[1].taxels.neighbours)
    assert some.placed[0].disabled.taxels.ids == ("band.1.2", "band.2.3")


def test_own_channel_is_in_the_file(tmp_path):
    """The calibration is valid, and loads with the channel."""
    result = made(tmp_path, SHEET | {"taxels": [OFF, MOVED]})
    save_calibration(result.calibration, tmp_path / "tube.json")
    (patch,) = load_calibration(tmp_path / "tube.json").patches
    assert patch.taxels.channels[patch.taxels.ids.index("band.0.3")] == 77
    assert sorted(patch.taxels.channels.tolist()) == sorted({*range(18), 77} - {3, 8})
    assert "disabled taxels: band.1.2" in summary(result, tmp_path)
    assert report_document(result)["patches"][0]["disabled"] == ["band.1.2"]


def test_disabled_board_is_no_port(tmp_path):
    """The ports of the adjacent boards are free."""
    result = made(tmp_path, BOARDS | {"taxels": [{"taxel": "1.0", "enabled": False}]})
    taxels = result.calibration.patches[0].taxels
    assert taxels.ids == ("boards.0.0", "boards.0.1")
    assert {port for row in taxels.ports for port in row} == {None, *taxels.ids}


def test_channels_are_swapped_and_freed(tmp_path):
    """Two taxels may change their channels; that of a disabled taxel is free."""
    swap = [{"taxel": "0.0", "channel": 1}, {"taxel": "0.1", "channel": 0}]
    taxels = made(tmp_path, SHEET | {"taxels": swap}).calibration.patches[0].taxels
    assert taxels.channels[:3].tolist() == [1, 0, 2]
    freed = [OFF, {"taxel": "0.0", "channel": 8}]
    assert made(tmp_path, SHEET | {"taxels": freed}).calibration.patches[0].taxels.channels[0] == 8


def test_modality_has_no_disabled_taxel(tmp_path):
    """Otherwise the calibration would name a taxel that it does not have."""
    heat = Modality("temperature", "K", Response(), {"band.1.2": 0, "band.0.0": 1})
    result = made(tmp_path, SHEET | {"taxels": [OFF]}, modalities=(heat,))
    save_calibration(result.calibration, tmp_path / "tube.json")
    assert load_calibration(tmp_path / "tube.json").modalities[0].channels == {"band.0.0": 1}


@pytest.mark.parametrize(
    ("skin", "message"),
    [
        (SHEET | {"taxels": [{"taxel": "0.0", "channel": 5}]}, r"Taxels band\.0\.0 and band\.0\.5 both have channel 5"),
        (SHEET | {"taxels": [OFF, OFF]}, "has the single taxel '1.2' twice"),
        (SHEET | {"taxels": [{"taxel": "3.0"}]}, r"has no taxel '3\.0'; did you mean"),
        (BOARDS | {"taxels": [{"taxel": "5.5"}]}, r"has no taxel '5\.5'"),
        (BOARDS | {"cells": "fill", "taxels": [{"taxel": "0.0"}]}, "List its boards one by one"),
        (BOARDS | {"taxels": [{"taxel": c, "enabled": False} for c in ("0.0", "1.0", "0.1")]}, "Enable one, or remove"),
    ],
)
def test_error_names_skin_and_taxel(skin, message, tmp_path):
    """What is wrong, where, and what to do."""
    with pytest.raises(InvalidPlan, match=message):
        made(tmp_path, skin)


def test_channel_of_another_skin_is_refused(tmp_path):
    """Also where the ranges of the skins are apart."""
    with pytest.raises(InvalidPlan, match=r"Taxels band\.0\.0 and next\.0\.2 both have channel 20"):
        made(tmp_path, SHEET | {"taxels": [{"taxel": "0.0", "channel": 20}]}, NEXT)


def test_imported_taxel_is_named_by_the_file(tmp_path):
    """An id that the file does not have is refused when it is read."""
    (tmp_path / "t.csv").write_text("id,x,y,z\na,-0.0505,0,0.02\nb,-0.05,0.0065,0.02\nc,-0.05,0,0.0265\n")
    few = {"name": "few", "kind": "imported", "file": str(tmp_path / "t.csv")}
    ids = made(tmp_path, few | {"taxels": [{"taxel": "b", "enabled": False}]}).calibration.patches[0].taxels.ids
    assert ids == ("few.a", "few.c")
    with pytest.raises(InvalidPlan, match="has no taxel 'd'. Remove it from the single taxels"):
        made(tmp_path, few | {"taxels": [{"taxel": "d", "enabled": False}]})


def test_cell_that_is_trimmed_away_may_be_disabled(tmp_path):
    """Another fit may leave it out; the plan stays valid."""
    high = SHEET | {"origin": [0.05, 0, 0.185], "trim": True}
    trimmed = made(tmp_path, high).calibration.patches[0].taxels.ids
    assert "band.2.0" not in trimmed
    result = made(tmp_path, high | {"taxels": [{"taxel": "2.0", "enabled": False}]})
    assert result.calibration.patches[0].taxels.ids == trimmed


def test_following_channel_is_after_own_channels():
    """Skins of other links begin there."""
    assert following_channel(skins_from([SHEET | {"taxels": [MOVED]}])) == 78


def test_plan_without_single_taxels_is_unchanged(tmp_path):
    """The key is not written; taxels are the same arrays."""
    (skin,) = skins_from([SHEET])
    assert "taxels" not in write_skin(skin)
    (skin,) = skins_from([SHEET | {"taxels": [OFF, MOVED]}])
    assert json.loads(json.dumps(write_skin(skin)))["taxels"] == [OFF, MOVED]
    assert not np.any([placed.disabled for placed in made(tmp_path, SHEET).placed])
