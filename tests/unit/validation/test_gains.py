"""Responses from presses of many taxels at once, whose total force a sensor measures."""

from dataclasses import replace

import numpy as np
import pytest

from skin_calib_addon.calibration import load_calibration, save_calibration
from skin_calib_addon.cli import main
from skin_calib_addon.common.errors import UnderdeterminedFit
from skin_calib_addon.validation import read_touches
from skin_calib_addon.validation.flat import flat_places
from skin_calib_addon.validation.gains import fit_gains
from tests.samples import sheet, small_calibration

SHEET = sheet(3, 4, 0.01)
OTHER = sheet(1, 2, 0.01)
CALIBRATION = small_calibration(patches=(SHEET,))
IDS = SHEET.taxels.ids
GAINS = 1 + 0.2 * np.sin(np.arange(12))
SHAPE = np.concatenate((np.zeros(20), np.linspace(0, 1, 10), np.ones(15), np.linspace(1, 0, 10)))


def answer(loads):
    """Readings (..., 12) of loads [N]."""
    return 250 * (1 - np.exp(-GAINS * loads / 10))


def loads_of(forces, seed=0):
    """Loads (m, 12) of presses with these total forces, on up to four cells each [N]."""
    flat = flat_places(SHEET, SHEET.taxels.index) / 0.01
    places = np.random.default_rng(seed).uniform(flat.min(axis=0) - 0.4, flat.max(axis=0) + 0.4, (len(forces), 2))
    parts = np.maximum(1 - np.abs(places[:, None] - flat), 0).prod(axis=2)
    return parts / parts.sum(axis=1, keepdims=True) * forces[:, None]


FORCES = np.random.default_rng(1).uniform(1.0, 8.0, 80)


def written(folder, rest=30.0, sign=1, lag=0.0, top=np.inf, edit=lambda columns: columns):
    """Write a session of presses: readings, and wrenches that push along the mean normal of the cells."""
    loads = loads_of(FORCES)
    normals = loads @ SHEET.taxels.normals_link
    forces = -normals / np.linalg.norm(normals, axis=1, keepdims=True)
    along = (loads * -(forces @ SHEET.taxels.normals_link.T)).sum(axis=1)
    factor = np.concatenate((np.zeros(60), np.tile(SHAPE, len(FORCES))))
    press = np.concatenate((np.zeros(60, int), np.repeat(np.arange(len(FORCES)), len(SHAPE))))
    felt = answer(loads[press] * factor[:, None]) * (1 + lag * (np.gradient(factor) < 0))[:, None]
    noise = np.random.default_rng(2).normal(0, 0.5, (len(press), 15))
    forces += np.random.default_rng(3).normal(0, 0.05, forces.shape)  # presses lean a little
    wrench = (forces * along[:, None])[press] * factor[:, None] + 0.05 * noise[:, :3]
    columns = {"time": np.arange(len(press)) / 50}
    columns |= dict(zip(IDS, (rest + sign * np.rint(np.minimum(felt + noise[:, 3:], top))).T))
    columns |= dict(zip(("fx", "fy", "fz", "tx", "ty", "tz"), (*wrench.T, *np.zeros((3, len(press))))))
    columns = edit(columns)
    path = folder / "session.csv"
    np.savetxt(path, np.column_stack(list(columns.values())), "%.6g", ",", header=",".join(columns), comments="")
    return path


def fitted(folder, **changes):
    return fit_gains(CALIBRATION, read_touches(written(folder, **changes), CALIBRATION))


@pytest.mark.parametrize(("rest", "sign"), [(30.0, 1), (900.0, -1)])
def test_gains_and_curve_give_the_force_of_each_taxel(tmp_path, rest, sign):
    """Readings that rise or fall with force; the noise of the sensors remains."""
    fit = fitted(tmp_path, rest=rest, sign=sign)
    loads = np.array((1.0, 3.0))[:, None] * np.ones(12)
    readings = rest + sign * answer(loads)
    found = np.stack([fit.responses[name].newtons(readings[:, k]) for k, name in enumerate(IDS)], axis=1)
    np.testing.assert_allclose(found, loads, rtol=0.12)
    np.testing.assert_allclose(np.mean(found / loads), 1.0, rtol=0, atol=0.02)
    assert np.corrcoef(fit.gains, 1 / GAINS)[0, 1] > 0.95
    assert fit.rms < 0.06 and abs(fit.bias) < 0.01
    assert [warning.code for warning in fit.warnings()] == []


def test_saturated_readings_and_hysteresis_are_named(tmp_path):
    """Presses with saturated readings have no part in the fit, and the table ends where they begin."""
    fit = fitted(tmp_path, top=90.0, lag=0.3)
    assert {warning.code for warning in fit.warnings()} == {"saturated", "hysteresis"}
    assert 0.1 < fit.hysteresis < 0.2 and fit.saturated == (~fit.used).sum() > 5
    assert abs(fit.bias) < 0.03


def test_taxels_that_nothing_pressed_have_the_usual_response(tmp_path):
    """It begins at their own rest: stuck at the end of the range, or a dead one with noise. They are named."""

    def silent(columns):
        noise = np.random.default_rng(5).normal(0, 3, len(columns["time"]))
        return columns | {IDS[0]: np.full(len(columns["time"]), 900.0), IDS[1]: 300 + np.rint(noise)}

    fit = fitted(tmp_path, edit=silent)
    assert len(fit.gains) == 10 and fit.saturated == 0
    assert fit.responses[IDS[0]].rest == 900 and abs(fit.responses[IDS[1]].rest - 300) < 2
    np.testing.assert_array_equal(fit.responses[IDS[0]].forces, fit.common.forces)
    (warning,) = (one for one in fit.warnings() if one.code == "not-measured")
    assert warning.where.taxels == IDS[:2]


def test_presses_that_no_taxel_felt_are_errors(tmp_path):
    """A dead zone hides them from the readings, not from the stated error."""

    def insensitive(columns):
        return columns | {name: 30 + np.maximum(columns[name] - 80, 0) for name in IDS}

    fit = fitted(tmp_path, edit=insensitive)
    assert fit.unfelt.sum() > 5 and not (fit.unfelt & fit.used).any()
    assert (fit.errors == -1).sum() == fit.unfelt.sum() and fit.rms > np.sqrt(fit.unfelt.mean())
    assert "unfelt" in {one.code for one in fit.warnings()}
    with pytest.raises(UnderdeterminedFit, match="0 of 80 presses can be used, which are too few; 0 are saturated, no"):
        fitted(tmp_path, edit=lambda columns: columns | dict.fromkeys(IDS, np.full(len(columns["time"]), 30.0)))


def without_time(columns):
    """Rows of presses alone: nothing says what readings at rest are."""
    number = np.repeat(np.arange(len(FORCES)), len(SHAPE))
    out = {name: column[60:] for name, column in columns.items() if name != "time"} | {"press": number}
    plateau = np.tile(SHAPE, len(FORCES)) == 1
    return {name: column[plateau] for name, column in out.items()}


def test_readings_whose_rest_is_not_known_are_refused(tmp_path):
    """They would be forces. Those that are tared are not refused."""
    with pytest.raises(UnderdeterminedFit, match="never reads less than 30. Record a second without contact"):
        fitted(tmp_path, edit=without_time)
    assert fitted(tmp_path, edit=without_time, rest=0.0).rms < 0.06


def test_a_session_without_readings_is_refused(tmp_path):
    def strongest(columns):
        kept = {name: column for name, column in columns.items() if name not in IDS}
        return kept | {"channel": np.zeros(len(kept["time"]))}

    with pytest.raises(UnderdeterminedFit, match="needs the readings of all taxels"):
        fitted(tmp_path, edit=strongest)


def test_the_command_takes_a_session(tmp_path, capsys):
    """The result has a response for each taxel; the picture is drawn; bad sessions are one line."""
    session = written(tmp_path)
    taxels = replace(OTHER.taxels, ids=("t0", "t1"), channels=np.array((12, 13)), neighbours=(("t1",), ("t0",)))
    other = replace(OTHER, name="other", taxels=taxels)
    save_calibration(small_calibration(patches=(SHEET, other)), tmp_path / "c.json")
    words = ["response", tmp_path / "c.json", session, "-o", tmp_path / "out.json", "--picture", tmp_path / "p.png"]
    assert main([str(word) for word in words]) == 0
    out, err = capsys.readouterr()
    assert "gains            0.8" in out and "80 of 80 presses; by the other presses within " in out
    assert "2 taxels have no measurement and keep their response; the first is t0" in err and err.count("\n") == 1
    after = load_calibration(tmp_path / "out.json")
    assert len(set(after.patches[0].taxels.responses.tolist())) == 12 and (tmp_path / "p.png").stat().st_size > 10_000
    session.write_text(session.read_text().replace("fz", "force"))
    assert main([str(word) for word in words]) == 1
    assert 'names no column "fz"' in capsys.readouterr().err
