"""Modalities from a plan to the calibration, through the commands."""

import json

import pytest

from skin_calib_addon.calibration import Modality, Response, ResponseTable, load_calibration
from skin_calib_addon.cli import main
from tests.unit.commands.test_cli import assert_refused, write_plan
from tests.unit.commands.test_cli import folder as folder  # a fixture

PROXIMITY = {
    "name": "proximity",
    "unit": "m",
    "response": {"kind": "table", "readings": [0, 4000], "forces": [0.2, 0]},
}
TEMPERATURE = {
    "name": "temperature",
    "unit": "degC",
    "response": {"kind": "polynomial", "coefficients": [-40, 0.05]},
    "channels": {"tube.0.1": 1, "tube.1.3": 0},
}


def test_plan_gives_its_modalities_to_the_calibration(folder, capsys):
    """``fit`` writes them, ``check`` accepts the file, ``show`` prints them."""
    plan = write_plan(folder, modalities=[PROXIMITY, TEMPERATURE])
    path = folder / "tube.calibration.json"
    assert main(["fit", str(plan), "-o", str(path)]) == 0
    assert load_calibration(path).modalities == (
        Modality("proximity", "m", ResponseTable((0.0, 4000.0), (0.2, 0.0))),
        Modality("temperature", "degC", Response((-40.0, 0.05)), {"tube.0.1": 1, "tube.1.3": 0}),
    )
    assert main(["check", str(plan)]) == 0 and main(["check", str(path)]) == 0
    capsys.readouterr()
    assert main(["show", str(path)]) == 0
    shown = capsys.readouterr().out
    assert "modality  proximity: table of 2 rows, readings 0 to 4000, 0 to 0.2 m; all 8 taxels\n" in shown
    assert "modality  temperature: -40 + 0.05 I degC for a reading I; 2 of 8 taxels\n" in shown


def test_taxel_that_the_skins_do_not_have_is_refused(folder, capsys):
    """The plan cannot know the ids; ``fit`` names the modality, the id and the nearest one, and writes nothing."""
    plan = write_plan(folder, modalities=[TEMPERATURE | {"channels": {"tube.0.9": 0}}])
    message = '/modalities/0/channels/tube.0.9 names the unknown taxel "tube.0.9"; did you mean "tube.0.'
    assert_refused(capsys, 1, message, "fit", plan, "-o", folder / "c.json")
    assert not (folder / "c.json").exists()


@pytest.mark.parametrize("name", ["unit", "response"])
def test_plan_without_a_member_of_a_modality_is_refused(folder, capsys, name):
    """A modality without unit or response: one line that names the member."""
    plan = write_plan(folder, modalities=[{key: value for key, value in PROXIMITY.items() if key != name}])
    assert_refused(capsys, 1, f'/modalities/0 lacks the member "{name}"', "fit", plan, "-o", folder / "c.json")
    assert json.loads(plan.read_text())["modalities"]
