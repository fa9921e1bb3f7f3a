"""Orientation of boards from accelerometers at rest."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skin_calib_addon.calibration import save_calibration
from skin_calib_addon.cli import main
from skin_calib_addon.common.errors import CalibrationFormatError
from skin_calib_addon.validation.gravity import read_orientations, rotated
from tests.samples import seven_boards, small_calibration

BOARDS = seven_boards()
CALIBRATION = small_calibration(patches=(BOARDS,))
TURNS = np.deg2rad((0, 60, 0, 0, -120, 0, 0))  # about the normals
TILT = np.deg2rad((0, 0, 5, 0, 0, 0, 0))  # about the tangents


def written(folder, postures=10, noise=0.03, unit="m/s^2", edit=lambda rows: rows, seed=0, scale=0.0):
    """Write what accelerometers with offsets measure on boards that are rotated by `TURNS` or `TILT`."""
    rng = np.random.default_rng(seed)
    taxels, rows = BOARDS.taxels, []
    down = rng.normal(size=(postures, 3))
    for k, name in enumerate(taxels.ids):
        x, z = taxels.tangents_link[k], taxels.normals_link[k]
        board = Rotation.from_rotvec(TURNS[k] * z) * Rotation.from_rotvec(TILT[k] * x)
        axes = board.apply(np.stack((x, np.cross(z, x), z)))  # of the accelerometer, in the link frame
        specific = -9.80665 * down / np.linalg.norm(down, axis=1)[:, None]
        scales = 1 + scale * rng.normal(size=3) if scale else 1.0
        measured = scales * (specific @ axes.T) + rng.normal(0, 0.3, 3) + rng.normal(0, noise, (postures, 3))
        measured /= 9.80665 if unit == "g" else 1.0
        rows += [[name, *a, *g] for a, g in zip(measured, down)]
    header = ["taxel", *(f"{name} [{unit}]" for name in ("ax", "ay", "az")), "gx", "gy", "gz"]
    path = folder / "rest.csv"
    path.write_text("\n".join(",".join(map(str, row)) for row in [header, *edit(rows)]) + "\n")
    return path


@pytest.mark.parametrize("unit", ["m/s^2", "g"])
def test_boards_that_are_turned_or_tilted_are_named(tmp_path, unit):
    """Ten postures; the offset of each sensor is unknown."""
    found = read_orientations(written(tmp_path, unit=unit), CALIBRATION)
    np.testing.assert_allclose([one.turn for one in found], TURNS, rtol=0, atol=np.deg2rad(0.6))
    np.testing.assert_allclose([one.tilt[0] for one in found], TILT, rtol=0, atol=np.deg2rad(0.6))
    assert max(one.errors.max() for one in found) < np.deg2rad(0.3)
    (warning,) = rotated(found)
    assert warning.code == "wrong-orientation" and warning.where.taxels == tuple(
        BOARDS.taxels.ids[k] for k in (1, 2, 4)
    )
    assert "turned -120." in warning.message


@pytest.mark.parametrize("scale", [0.0, 0.03])
def test_standard_errors_hold(tmp_path, scale):
    """Of 40 x 7 boards, 68 % are within one standard error per axis, 95 % within two, with unequal scales, too."""
    ratios = []
    for seed in range(40):
        found = read_orientations(written(tmp_path, seed=seed, scale=scale), CALIBRATION)
        assert max(one.errors.max() for one in found) < np.deg2rad(0.6)
        ratios += [abs((one.turn - turn) / one.errors[2]) for one, turn in zip(found, TURNS)]
        assert not list(rotated([one for k, one in enumerate(found) if k not in (1, 2, 4)]))
    assert 0.6 < np.mean(np.array(ratios) < 1) < 0.76 and 0.91 < np.mean(np.array(ratios) < 2) < 0.99


def test_boards_that_are_upside_down_or_upright_are_named(tmp_path):
    """A half turn about the tangent, and a quarter turn, in true angles; the other boards stay as they are."""

    def edited(rows):
        over = {"b0.0": lambda x, y, z: (x, -y, -z), "b1.0": lambda x, y, z: (y, z, x)}
        return [[row[0], *over.get(row[0], lambda *a: a)(*row[1:4]), *row[4:]] for row in rows]

    found = {one.taxel: one for one in read_orientations(written(tmp_path, edit=edited), CALIBRATION)}
    assert [name for name, one in found.items() if one.is_reversed] == ["b0.0"]
    assert found["b0.0"].is_rotated and "upside down, turned" in found["b0.0"].summary()
    assert abs(found["b0.0"].turn) < 0.01 and np.abs(found["b0.0"].tilt).max() < 0.01
    np.testing.assert_allclose(np.linalg.norm(found["b1.0"].tilt), np.pi / 2, rtol=0, atol=0.01)


def test_rows_of_one_posture_count_once(tmp_path):
    """Postures are known to 2 degrees only: many rows of each do not make the standard errors smaller."""

    def repeated(rows):
        rng, out = np.random.default_rng(4), []
        for row in rows:
            down = np.array(row[4:]) / np.linalg.norm(row[4:]) + rng.normal(0, 0.03, 3)
            out += [[row[0], *(np.array(row[1:4]) + rng.normal(0, 0.03, 3)), *down] for _ in range(50)]
        return out

    for one in read_orientations(written(tmp_path, edit=repeated), CALIBRATION):
        assert one.postures == 10 and one.errors.min() > np.deg2rad(0.3)


def about_one_axis(rows):
    return [[*row[:4], row[4], row[5], 0.0] for row in rows]


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (about_one_axis, "line 2: the 10 postures of the taxel \"b0.0\" leave its orientation open"),
        (lambda rows: rows[:3], "the 3 postures"),
        (lambda rows: [[row[0], *(-a for a in row[1:4]), *row[4:]] for row in rows], "the opposite sign; at rest"),
        (lambda rows: [[row[0], *(a / 9.8 for a in row[1:4]), *row[4:]] for row in rows], "change by 0.102 of what"),
        (lambda rows: [[row[0], *row[3:0:-1], *row[4:]] for row in rows], "do not fit gravity: one or all axes"),
        (lambda rows: [[*rows[0][:4], 0, 0, 0], *rows[1:]], "line 2: the direction of gravity is zero"),
        (lambda rows: [["b9.9", *rows[0][1:]], *rows[1:]], 'line 2, column 1: the calibration has no taxel "b9.9"'),
    ],
)  # fmt: skip
def test_error_is_one_line(tmp_path, edit, message):
    with pytest.raises(CalibrationFormatError) as caught:
        read_orientations(written(tmp_path, edit=edit), CALIBRATION)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_the_command_states_orientations(tmp_path, capsys):
    """A line for each board, a warning about those that are turned; nothing to refine."""
    save_calibration(CALIBRATION, tmp_path / "c.json")
    table = written(tmp_path)
    assert main(["touches", str(tmp_path / "c.json"), str(table)]) == 0
    out, err = capsys.readouterr()
    assert "7 of 7 taxels with an accelerometer" in out and out.count("about the normal") == 7
    assert "[wrong-orientation]" in err
    with pytest.raises(SystemExit):
        main(["touches", str(tmp_path / "c.json"), str(table), "--picture", str(tmp_path / "p.png")])
    assert "accelerations show the orientation" in capsys.readouterr().err
