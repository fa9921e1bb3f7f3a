"""``skin-calib response``: measurements in, a calibration with responses out, and what is wrong in one line."""

import dataclasses

import numpy as np
import pytest

from skin_calib_addon.calibration import Response, ResponseTable, TaxelResponses, load_calibration, save_calibration
from skin_calib_addon.calibration.response_fit import fit_response
from skin_calib_addon.cli import main
from tests.samples import boards, sheet, small_calibration
from tests.unit.calibration.test_response_fit import forearm, forearm_truth, presses
from tests.unit.commands.test_cli import assert_refused
from tests.unit.pictures.test_picture import read_png

FORCES = presses(10.0, 60)
READINGS = forearm(FORCES, 0.5)


@pytest.fixture
def folder(tmp_path):
    """A folder with a calibration of six taxels in a sheet and two boards, and measurements for all."""
    save_calibration(small_calibration(), tmp_path / "c.json")
    write(tmp_path / "m.csv", "reading,force", zip(READINGS, FORCES))
    return tmp_path


def write(path, header, rows):
    """A table of numbers and names."""
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return path


def respond(folder, *words, table="m.csv"):
    return main([str(w) for w in ("response", folder / "c.json", folder / table, "-o", folder / "out.json", *words)])


def test_one_response_for_all_taxels(folder, capsys):
    """A line about the fit, nothing on stderr; nothing else of the calibration changes."""
    assert respond(folder) == 0
    out, err = capsys.readouterr()
    fit = fit_response(READINGS, FORCES)
    size = np.abs(fit.residuals)
    assert err == "" and out.splitlines()[1] == f"calibration      {folder / 'out.json'}"
    assert out.startswith(f"all taxels       polynomial of degree {len(fit.response.coefficients) - 1} on readings ")
    assert f"60 measurements; residuals mean {size.mean():.4f}, rms {np.sqrt(np.mean(size**2)):.4f}, max" in out
    before, after = load_calibration(folder / "c.json"), load_calibration(folder / "out.json")
    assert after.response == fit.response and after.responses == ()
    assert_same_but_responses(before, after)
    forces = TaxelResponses.of(after).forces(np.full(8, 100.0))
    np.testing.assert_allclose(forces, forearm_truth(100.0), rtol=0, atol=0.03)


def assert_same_but_responses(before, after):
    from tests.laws.test_calibration_round_trip import same

    def bare(calibration):
        rows = {"responses": np.empty(0, np.int64)}
        patches = tuple(
            dataclasses.replace(p, taxels=dataclasses.replace(p.taxels, **rows)) for p in calibration.patches
        )
        return dataclasses.replace(calibration, response=Response(), responses=(), patches=patches)

    assert same(bare(before), bare(after))


def test_each_taxel_gets_its_own(folder, capsys):
    """Gains that differ are found; a patch without measurements keeps the response of the link, with a warning."""
    names = small_calibration().patches[0].taxels.ids
    rows = [(name, round(r * (1 + k / 50)), f) for r, f in zip(READINGS, FORCES) for k, name in enumerate(names)]
    write(folder / "t.csv", "Taxel, Reading ,FORCE", rows)
    assert respond(folder, table="t.csv") == 0
    out, err = capsys.readouterr()
    assert [line.split()[0] for line in out.splitlines()] == [*names, "calibration"]
    text = "2 taxels have no measurement and keep their response; the first is h0. [not-measured]\n"
    assert err == f"skin-calib: warning: {text}"
    after = load_calibration(folder / "out.json")
    assert [p.taxels.responses.tolist() for p in after.patches] == [[0, 1, 2, 3, 4, 5], []]
    readings = np.array([*(100 * (1 + k / 50) for k in range(6)), 100, 100])
    forces = TaxelResponses.of(after).forces(readings)
    np.testing.assert_allclose(forces[:6], forearm_truth(100.0), rtol=0, atol=0.04)
    np.testing.assert_allclose(forces[6:], Response((0.0, 0.25, -0.001)).newtons(100.0), rtol=1e-12)


def test_taxels_without_measurements_keep_what_they_had(folder, capsys):
    """In a patch of which one taxel was measured, the others have theirs of before: their own, or the link's."""
    table = ResponseTable((0.0, 255.0), (0.0, 5.0))
    own = dataclasses.replace(boards(6), taxels=dataclasses.replace(boards(6).taxels, responses=np.array((0, 0))))
    save_calibration(small_calibration(patches=(sheet(2, 3, 0.01), own), responses=(table,)), folder / "c.json")
    write(
        folder / "t.csv", "taxel,reading,force", [(n, r, f) for n in ("h1", "s0.1") for r, f in zip(READINGS, FORCES)]
    )
    assert respond(folder, table="t.csv") == 0
    assert "6 taxels have no measurement and keep their response; the first is s0.0." in capsys.readouterr().err
    after = load_calibration(folder / "out.json")
    kinds = [after.responses[i] for p in after.patches for i in p.taxels.responses]
    fitted = fit_response(READINGS, FORCES).response
    assert kinds == [after.response, fitted, *[after.response] * 4, table, fitted]
    assert len(after.responses) == 3

    (folder / "out.json").rename(folder / "c.json")
    assert respond(folder) == 0
    assert "8 taxels had responses of their own. The response of all taxels replaces them." in capsys.readouterr().err
    after = load_calibration(folder / "out.json")
    assert after.responses == () and all(len(p.taxels.responses) == 0 for p in after.patches)


def test_taxels_are_named_by_channels_too(folder, capsys):
    """The column was ignored, and the measurements of all taxels gave one response. Other columns are named."""
    rows = [(c, r, f * (1 + c), 21.5) for c in (0, 1) for r, f in zip(READINGS, FORCES)]
    write(folder / "t.csv", "channel,reading,force,temperature", rows)
    assert respond(folder, table="t.csv") == 0
    assert "columns          not used: temperature\n" in capsys.readouterr().out
    after = load_calibration(folder / "out.json")
    first, second = TaxelResponses.of(after).forces(np.full(8, 100.0))[:2]
    np.testing.assert_allclose((first, second), forearm_truth(100.0) * np.array((1, 2)), rtol=0, atol=0.06)


def test_warnings_name_their_taxel(folder, capsys):
    """Warnings are lines on stderr; the calibration is written all the same."""
    write(folder / "t.csv", "taxel,reading,force", [(n, r, r / 10) for n in ("s0.0", "h1") for r in (-0.0, 10, 20)])
    assert respond(folder, table="t.csv") == 0
    out, err = capsys.readouterr()
    assert out.count(" on readings 0 to 20, 3 measurements") == 2  # not from minus zero
    lines = err.splitlines()
    assert [line.split(": There are only 3")[0] for line in lines[:2]] == [
        "skin-calib: warning: Taxel s0.0",
        "skin-calib: warning: Taxel h1",
    ]
    assert len(lines) == 3 and (folder / "out.json").exists()


def test_picture_shows_curve_and_residuals(folder):
    """Measurements and curve on the left, residuals on the right."""
    assert respond(folder, "--picture", folder / "a.png") == 0
    pixels = read_png(folder / "a.png")
    colourful = np.ptp(pixels, axis=2) > 0.2
    left, right = np.array_split(colourful, 2, axis=1)
    assert left.mean() > 0.003 and right.mean() > 0.001


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("\n", 'line 1, column 2: the header names no column "reading"'),
        ("reading;forse\n1;2\n", 'line 1, column 3: the header names no column "force"; did you mean "forse"?'),
        ("reading,force,Reading\n1,2,3\n", 'line 1, column 3: the header names the column "reading" twice'),
        ("reading,force\n", "line 1, column 1: the table has no row below its header"),
        ("reading,force\n1,2\n\n# so\n1,2,3\n", "line 5, column 3: the row has 3 columns, but the header has 2"),
        ("reading\tforce\n1\t2\nx\t3\n", 'line 3, column 1: has "x" instead of a number'),
        ("reading,force\n1,2\n-2e12,3\n", "line 3, column 1: the number -2e+12 is not plausible; absolute values"),
        ("force,taxel,reading\n1,s0.0,2\n1,s0,2\n", 'line 3, column 2: the calibration has no taxel "s0"; did'),
        ('reading,force\n1,"2\n', "line 2: is not a row of a table: "),
        ("reading,force\n5,1\n5,2\n", "m.csv': all 2 measurements read 5. Measure at two or more forces"),
        ("taxel,reading,force\ns0.0,5,1\n", "m.csv', taxel s0.0: there is one measurement. Measure at two"),
    ],
)
def test_bad_table_is_one_line(folder, capsys, text, words):
    """The error names file, line and column of the first problem; nothing is written."""
    (folder / "m.csv").write_text(text)
    names = sorted(path.name for path in folder.iterdir())
    call = ("response", folder / "c.json", folder / "m.csv", "-o", folder / "out.json", "--picture", folder / "p.png")
    assert_refused(capsys, 1, words, *call)
    assert sorted(path.name for path in folder.iterdir()) == names
