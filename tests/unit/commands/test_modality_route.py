"""Modalities from a plan to the calibration, through the commands."""

import dataclasses
import re

import numpy as np
import pytest

from skin_calib_addon.calibration import (
    Modality,
    Response,
    ResponseTable,
    load_calibration,
    save_calibration,
    to_document,
)
from skin_calib_addon.cli import main
from tests.samples import small_calibration
from tests.unit.commands.test_cli import assert_refused, write_plan

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


@pytest.fixture
def measured(tmp_path):
    """A calibration with two modalities, and a table of temperatures from -20 to 80 degrees."""
    modalities = (
        Modality("proximity", "m", ResponseTable((0.0, 4000.0), (0.2, 0.0))),
        Modality("temperature", "degC", Response((0.0, 1.0)), {"h0": 3}),
    )
    save_calibration(small_calibration(modalities=modalities), tmp_path / "c.json")
    celsius = np.linspace(-20.0, 80.0, 60)
    noise = np.random.default_rng(1).normal(0, 2, 60)
    rows = zip(np.rint((celsius + 40.0) / 0.05 + noise), celsius)
    (tmp_path / "m.csv").write_text("\n".join(["reading,value", *(f"{a},{b}" for a, b in rows)]))
    return tmp_path


def respond(folder, *words, table="m.csv"):
    return main([str(w) for w in ("response", folder / "c.json", folder / table, "-o", folder / "out.json", *words)])


def test_response_of_a_modality_is_fitted(measured, capsys):
    """The line through the measurements, below zero too; nothing else of the calibration changes."""
    assert respond(measured, "--modality", "temperature", "--picture", measured / "p.png") == 0
    out, err = capsys.readouterr()
    assert err == "" and out.startswith("temperature      polynomial of degree 1 on readings ")
    rms = re.search(r"rms (\S+), max \S+ degC\n", out)
    assert rms and 0.07 < float(rms[1]) < 0.13 and (measured / "p.png").stat().st_size > 1000
    before, after = load_calibration(measured / "c.json"), load_calibration(measured / "out.json")
    (near, warm) = after.modalities
    assert near == before.modalities[0] and (warm.name, warm.unit, warm.channels) == ("temperature", "degC", {"h0": 3})
    np.testing.assert_allclose(warm.response.values([400.0, 800.0, 2400.0]), [-20.0, 0.0, 80.0], atol=0.08)
    assert after.response == before.response
    plain = [dataclasses.replace(c, modalities=()) for c in (before, after)]
    assert to_document(plain[0]) == to_document(plain[1])


def test_warnings_about_a_modality_have_its_unit(measured, capsys):
    """No force and no newton in the messages."""
    (measured / "few.csv").write_text("reading,value\n0,-5\n100,0\n100,3\n100,4\n100,9\n100,8\n")
    assert respond(measured, "--modality", "temperature", table="few.csv") == 0
    out, err = capsys.readouterr()
    assert "degC" in err and " N" not in err + out and "force" not in err + out


@pytest.mark.parametrize(
    ("words", "text", "message"),
    [
        (("temprature",), None, "has no modality \"temprature\"; did you mean \"temperature\"? It has proximity, temp"),
        (("temperature",), "reading,force\n0,1\n1,2\n", "names no column \"value\""),
        (("temperature",), "taxel,reading,value\nh0,0,1\nh0,1,2\n", "has one response for all taxels. Remove"),
        (("temperature",), "reading,value\n0,1\n0,2\n", "Measure at two or more values with different readings"),
    ],
)  # fmt: skip
def test_wrong_measurements_of_a_modality_are_refused(measured, capsys, words, text, message):
    """One line, and no file."""
    if text:
        (measured / "m.csv").write_text(text)
    assert_refused(
        capsys, 1, message, "response", measured / "c.json", measured / "m.csv", "-o", measured / "out.json",
        "--modality", *words,
    )  # fmt: skip
    assert not (measured / "out.json").exists()
