"""Zones of a robot: what they contain, what a file may not have, and that proposals leave them free."""

import json
from dataclasses import replace

import numpy as np
import pytest

from skin_calib_addon.cli import main
from skin_calib_addon.common.errors import SkinCalibError
from skin_calib_addon.geometry.mesh.triangle_mesh import save_mesh
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.plan import load_plan
from skin_calib_addon.robot.zones import load_zones, save_zones
from tests.shapes import box

VENT = {"link": "plate", "name": "vent", "kind": "box", "low": [-0.02, -1, -1], "high": [0.02, 1, 1]}
SCREW = {"link": "plate", "name": "screw", "kind": "sphere", "center": [0.06, 0, 0.01], "radius": 0.012}
END = {"link": "plate", "name": "end", "kind": "half-space", "point": [-0.08, 0, 0], "normal": [-1, 0, 0]}


@pytest.fixture
def plate(tmp_path):
    """A plate of 200 x 80 mm."""
    save_mesh(box((-0.1, -0.04, 0), (0.1, 0.04, 0.01)), tmp_path / "plate.ply")
    return tmp_path / "plate.ply"


def write(plate, *zones, **more):
    document = {"format": "skin-zones", "version": 1, "zones": list(zones)} | more
    plate.with_name("plate.zones.json").write_text(json.dumps(document))


def test_zones_contain_what_they_describe(plate):
    write(plate, VENT, SCREW, END)
    vent, screw, end = load_zones(plate)
    points = np.array(
        [(0.0, 0, 0), (0.021, 0, 0), (0.06, 0.0119, 0.01), (0.06, 0, 0.03), (-0.081, 5, 5), (-0.079, 0, 0)]
    )
    assert vent.contains(points).tolist() == [True, *[False] * 5]
    assert screw.contains(points).tolist() == [False, False, True, False, False, False]
    assert end.contains(points).tolist() == [False] * 4 + [True, False]


def test_saved_zones_are_those_that_are_read(plate):
    """A wrong one leaves the file as it is."""
    write(plate, VENT, SCREW, END)
    zones, path = load_zones(plate), plate.with_name("plate.zones.json")
    path.unlink()
    save_zones(plate, zones)
    assert load_zones(plate) == zones
    before = path.read_bytes()
    with pytest.raises(SkinCalibError, match="/zones/1.*low corner"):
        save_zones(plate, [zones[1], replace(zones[0], numbers={"low": [0, 0, 0], "high": [0, 0, 0]})])
    assert path.read_bytes() == before


def test_no_board_is_in_a_zone_and_a_change_is_named(plate, capsys):
    """Three zones; the plan is proposed again when they are other ones."""
    write(plate, VENT, SCREW, END)
    out = str(plate.parent / "plans")
    assert main(["propose", str(plate), "-o", out]) == 0
    plan = load_plan(plate.parent / "plans" / "plate.plan.json")
    taxels = [p.taxels for p in calibrate(plan).calibration.patches]
    points, corners = (
        np.concatenate([t.positions_link for t in taxels]),
        np.concatenate([c for t in taxels for c in t.corners_link]),
    )
    assert len(points) > 20 and not any(zone.contains(points).any() for zone in load_zones(plate))
    inner = [VENT | {"low": [-0.0175, -1, -1], "high": [0.0175, 1, 1]}, SCREW | {"radius": 0.0095}]
    write(plate, *inner, END | {"point": [-0.0825, 0, 0]})  # the boundary is exact to 2.5 mm
    assert not any(zone.contains(corners).any() for zone in load_zones(plate))
    write(plate, VENT, SCREW, END)
    assert main(["check", out]) == 0 and "zones" not in capsys.readouterr().out
    write(plate, VENT)
    capsys.readouterr()
    assert main(["check", out]) == 0 and "The zones of the link have changed" in capsys.readouterr().out
    assert main(["propose", str(plate), "-o", out, "--again"]) == 0 and "kept" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("zone", "words"),
    [
        (VENT | {"link": "plat"}, 'names the link "plat"; did you mean "plate"'),
        (VENT | {"kind": "cone"}, 'has the kind "cone". Use one of sphere, box, half-space.'),
        (VENT | {"high": [-1, 1, 1]}, "has a low corner that is not below the high one"),
        (END | {"normal": [0, 0, 0]}, "has a normal of length 0"),
        (SCREW | {"radius": -1}, "/radius"),
        (SCREW | {"colour": 1}, "colour"),
        ({}, "has the kind"),
    ],
)
def test_wrong_zones_are_named(plate, zone, words):
    """Before anything is computed; nothing is written."""
    write(plate, zone)
    with pytest.raises(SkinCalibError, match="zones.json: /zones/0") as caught:
        load_zones(plate)
    assert words in str(caught.value)
    assert main(["propose", str(plate), "-o", str(plate.parent / "plans")]) == 1
    assert not (plate.parent / "plans").exists()


def test_other_files_are_no_zones(plate, capsys):
    write(plate, version=2)
    assert main(["propose", str(plate), "-o", str(plate.parent / "plans")]) == 1
    assert "plate.zones.json" in capsys.readouterr().err
