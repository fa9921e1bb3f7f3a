"""Recorded readings in the runtime, from the command line."""

import dataclasses
import io
import json
import os
import zipfile

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from skin_calib_addon.calibration import Modality, Response, ResponseTable, load_calibration, save_calibration
from skin_calib_addon.cli import main
from skin_calib_addon.common.errors import CalibrationFormatError
from skin_calib_addon.inspection.recording import read_recording
from skin_calib_addon.runtime import Skin, load
from tests.samples import plane, small_calibration
from tests.soles import sole_patch

N = 42
NAMES = "c0,c1,c2,c3,c4,c5,c6,c7"  # columns of a skin of eight taxels


@pytest.fixture
def calibration(tmp_path):
    """Write the file of a sole whose readings are newtons."""
    path = tmp_path / "sole.json"
    sole = small_calibration(
        link="sole", patches=(sole_patch(),), surfaces=(plane(),), response=Response((0.0, 1.0)), extra={}
    )
    save_calibration(sole, path)
    return path


@pytest.fixture
def skin():
    """Return a skin of eight taxels."""
    return Skin(small_calibration())


def readings(frames=12):
    """Return a press that moves over the sole."""
    t = np.arange(frames) * 0.004
    return t, np.array([np.where(np.abs(np.arange(N) - 3 * k - 4) < 4, 5.0 + k, 0.0) for k in range(frames)])


def as_csv(path, time, rows):
    """Write a recording as a table."""
    lines = ["time," + ",".join(f"channel_{k}" for k in range(len(rows[0])))]
    lines += [",".join(map(repr, [float(t), *map(float, row)])) for t, row in zip(time, rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_replay_is_what_the_runtime_gives(calibration, tmp_path, capsys):
    """The output has a line for each frame with its values, the same from CSV and NPZ."""
    time, rows = readings()
    table, packed = as_csv(tmp_path / "r.csv", time, rows), tmp_path / "r.npz"
    np.savez(packed, time=time, readings=rows)
    out, again, picture = tmp_path / "out.jsonl", tmp_path / "again.jsonl", tmp_path / "out.png"
    assert main(["replay", str(calibration), str(table), "-o", str(out), "--picture", str(picture), "--on", "0.2"]) == 0
    assert main(["replay", str(calibration), str(packed), "-o", str(again), "--on", "0.2"]) == 0
    assert out.read_bytes() == again.read_bytes() and picture.read_bytes()[:4] == b"\x89PNG"
    said = capsys.readouterr()
    assert "frames           12, 0.044 s" in said.out and said.err == ""
    skin = load(calibration, 0.2)
    for line, t, row in zip(out.read_text().splitlines(), time, rows, strict=True):
        frames_out, frame = json.loads(line), skin.update(row, t)
        assert frames_out["time"] == t and frames_out["flags"] == [] and frames_out["touched"] is True
        assert frames_out["wrench"] == frame.wrench.tolist() and frames_out["cop"] == frame.cop.tolist()
        assert frames_out["zmp"] == frame.zmp.tolist() and frames_out["reason"] is None
        assert frames_out["polygon"]["outer"] == frame.polygon.outer.corners.tolist()
        assert [c["number"] for c in frames_out["contacts"]] == [c.number for c in frame.contacts]
        assert [c["ids"] for c in frames_out["contacts"]] == [list(c.ids) for c in frame.contacts]
        assert frames_out["forces"] == frame.forces.tolist() and frames_out["force_sigmas"] is None
        assert frames_out["calibration"] == json.loads(calibration.read_text())["checksum"]


def test_lines_have_the_deviations_of_the_runtime(calibration, tmp_path):
    """With learned noise; what is not known is null."""
    rng = np.random.default_rng(3)
    time, rows = 0.004 * np.arange(60), rng.normal(0, 0.05, (60, N))
    rows[50:] += 10.0
    rows[55, 3] = np.nan
    path, out = as_csv(tmp_path / "r.csv", time, rows), tmp_path / "out.jsonl"
    assert main(["replay", str(calibration), str(path), "--tare", "40", "-o", str(out)]) == 0
    skin = load(calibration)
    skin.tare(rows[:40])
    lines = [json.loads(line) for line in out.read_text().splitlines()]
    frames = [skin.update(row, t) for t, row in zip(time, rows)]
    for name in ("force_sigmas", "wrench_sigma", "cop_sigma", "zmp_sigma"):
        for line, frame in zip(lines, frames, strict=True):
            sigma = getattr(frame, name)
            known = None if sigma is None else [x if np.isfinite(x) else None for x in sigma.tolist()]
            assert line[name] == known
        assert lines[52][name] is not None
    assert lines[55]["forces"][3] is None and lines[55]["force_sigmas"][3] is None
    assert lines[55]["forces"][4] == frames[55].forces[4] and lines[0]["cop_sigma"] is None


def test_missing_numbers_are_flagged_not_refused(calibration, tmp_path, capsys):
    """An empty cell, NaN and a short row give null and flags in the frame, and the summary counts them."""
    time, rows = readings(4)
    path = as_csv(tmp_path / "r.csv", time, rows)
    lines = path.read_text().splitlines()
    cells = lines[2].split(",")
    cells[10], cells[11] = "", "nan"
    lines[2], lines[3] = ",".join(cells), ",".join(lines[3].split(",")[:20])
    path.write_text("\n".join(lines))
    out = tmp_path / "out.jsonl"
    assert main(["replay", str(calibration), str(path), "-o", str(out), "--on", "0.2"]) == 0
    frames_out = [json.loads(line) for line in out.read_text().splitlines()]
    assert [t["flags"] for t in frames_out] == [[], ["not_finite"], ["wrong_length"], []]
    assert (
        frames_out[2]["wrench"] is None and frames_out[2]["touched"] is None and "needs 42" in frames_out[2]["reason"]
    )
    assert "warning: wrong_length in 1 of 4 frames" in capsys.readouterr().err


def test_order_of_the_columns_does_not_count(calibration, tmp_path, capsys):
    """Columns with numbers give the frames of the table with the usual order; the summary states the columns."""
    time, rows = readings(2)
    path = as_csv(tmp_path / "r.csv", time, rows)
    forwards = [line.split(",") for line in path.read_text().splitlines()]
    path.write_text("\n".join(",".join([*cells[:0:-1], "1.5", f"{1e3 * float(cells[0])}"]) for cells in forwards[1:]))
    names = [*(f"s{k + 1}" for k in reversed(range(N))), "total", "t_ms"]
    path.write_text(",".join(names) + "\n" + path.read_text())
    recording = read_recording(path, load(calibration))
    found = list(recording.frames)
    assert [reading.tolist() for _, reading in found] == rows.tolist()
    np.testing.assert_allclose([t for t, _ in found], time, atol=1e-12)
    assert main(["replay", str(calibration), str(path)]) == 0
    columns = "t_ms is the time [0.001 s]; s1 to s42 are channels 0 to 41, counted from 1; not used: total"
    assert f"columns          {columns}\n" in capsys.readouterr().out


def test_more_numbers_than_channels_are_a_warning(calibration, tmp_path, capsys):
    """Numbers of an array have no names: the first one may be a counter."""
    time, rows = readings(2)
    np.savez(tmp_path / "r.npz", time=time, readings=np.column_stack((rows, rows[:, :1])))
    assert main(["replay", str(calibration), str(tmp_path / "r.npz")]) == 0
    said = capsys.readouterr()
    assert "more numbers than the skin needs (readings[:, 0] to readings[:, 41] are channels 0 to 41; not" in said.err
    assert "not used: readings[:, 42]\n" in said.out


def test_replay_takes_rest_and_thresholds(calibration, tmp_path, capsys):
    """The first frames are the baseline; a higher threshold detects fewer contacts."""
    time, rows = readings()
    rows[:3] = 0.0
    path = as_csv(tmp_path / "r.csv", time, rows + 2.0)
    assert main(["replay", str(calibration), str(path), "--tare", "3", "--accept"]) == 0
    assert "in 9 frames" in capsys.readouterr().out
    assert main(["replay", str(calibration), str(path), "--tare", "3", "--accept", "--on", "15"]) == 0
    assert "in 2 frames" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty. Check that it was written completely."),
        ("\n", "line 1: the header has no time; it has none. Name a column 'time'"),
        (f"u,{NAMES}\n1,2\n", "line 1: the header has no time; it has .*, "),
        (f"time,{NAMES},c0\n0,1,2,3\n", "line 1: the header names c0 twice"),
        (f"time,{NAMES}\n0,1\n1,x\n", 'line 3, column 2: has "x" instead of a number'),
        (f'time,{NAMES}\n0,"1\n', "is not a row of a table"),
        ('time,"a\n', "line 1: is not a row of a table"),
    ],
)
def test_bad_table_is_refused_with_its_position(text, message, skin, tmp_path):
    """The message names file, line and column."""
    path = tmp_path / "r.csv"
    path.write_text(text)
    with pytest.raises(CalibrationFormatError, match=message):
        list(read_recording(path, skin).frames)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"time": np.zeros(3)}, r"has no array 'readings'; it has \['time'\]"),
        ({"time": np.zeros(3), "readings": np.zeros(3)}, r"Give numbers of shapes \(t,\) and \(t, channels\)"),
        ({"time": np.zeros(2), "readings": np.zeros((3, 2))}, "Give numbers of shapes"),
        ({"time": np.array(["a"]), "readings": np.zeros((1, 2))}, "Give numbers of shapes"),
        ({"time": np.array([None]), "readings": np.zeros((1, 2))}, "cannot read .* allow_pickle"),
    ],
)
def test_bad_archive_is_refused(arrays, message, skin, tmp_path):
    """The message names the missing array or the wrong shape; no content is executed."""
    path = tmp_path / "r.npz"
    np.savez(path, **arrays)
    with pytest.raises(CalibrationFormatError, match=message):
        list(read_recording(path, skin).frames)


def test_file_that_is_not_an_archive_is_refused(skin, tmp_path):
    """The message does not advise to trust the file, as that of the library does."""
    path = tmp_path / "r.npz"
    path.write_bytes(bytes(range(256)) * 8)
    with pytest.raises(
        CalibrationFormatError, match="cannot read .*r.npz': it is not an NPZ file; save it with numpy.savez"
    ):
        list(read_recording(path, skin).frames)


@pytest.mark.parametrize("place", range(24))
def test_damaged_archive_is_one_error(place, skin, tmp_path):
    """Wrong bytes anywhere in the file: the reader of the library raises errors of many types."""
    path = tmp_path / "r.npz"
    time, rows = readings()
    np.savez_compressed(path, time=time, readings=rows)
    data = bytearray(path.read_bytes())
    at = place * len(data) // 24
    data[at : at + 9] = bytes(255 - byte for byte in data[at : at + 9])
    path.write_bytes(data)
    try:
        frames = list(read_recording(path, skin).frames)
    except CalibrationFormatError as error:
        assert "r.npz" in str(error)
    else:  # a part of the file that nothing reads
        assert_array_equal([row for _, row in frames], rows)


def test_archive_that_expands_too_much_is_refused(skin, tmp_path):
    """Its header states its size before memory is used: 2 MB of file would become 3 GB."""
    path = tmp_path / "r.npz"
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (400_000, 1000)})
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("readings.npy", header.getvalue() + bytes(1000))
        with archive.open("time.npy", "w") as file:
            np.save(file, np.arange(400_000.0))
    with pytest.raises(CalibrationFormatError, match="r.npz' has 400000000 numbers in the array 'readings', more than"):
        list(read_recording(path, skin).frames)


def test_row_with_more_cells_than_the_header_is_refused(skin, tmp_path):
    """A number more in one row moves all channels after it."""
    path = tmp_path / "r.csv"
    path.write_text(f"time,{NAMES}\n0{8 * ',1'}\n1{9 * ',1'}\n")
    with pytest.raises(CalibrationFormatError, match="r.csv', line 3: the row has 10 columns, but the header has 9"):
        list(read_recording(path, skin).frames)


def test_tare_beyond_the_recording_is_refused(calibration, tmp_path, capsys):
    """The rest would be made of fewer frames than the user asked for."""
    path = as_csv(tmp_path / "r.csv", *readings())
    assert main(["replay", str(calibration), str(path), "--tare", "12", "--accept"]) == 0
    capsys.readouterr()
    assert main(["replay", str(calibration), str(path), "--tare", "13"]) == 1
    assert "has 12 frames, fewer than the 13 of --tare" in capsys.readouterr().err


@pytest.mark.skipif(os.name == "nt", reason="Windows has no pipes of this kind")
@pytest.mark.parametrize("name", ["r.npz", "r.csv"])
def test_pipe_is_refused_without_waiting(name, skin, tmp_path):
    """A reader could wait for a writer without end."""
    os.mkfifo(tmp_path / name)
    with pytest.raises(CalibrationFormatError, match=f"{name}': it is not a regular file. Name a file"):
        list(read_recording(tmp_path / name, skin).frames)


NEAR = Modality("proximity", "m", ResponseTable((0.0, 4000.0), (0.2, 0.0)))


def with_proximity(calibration, tmp_path):
    """Write the calibration with a modality, and return its path."""
    path = tmp_path / "near.calibration.json"
    save_calibration(dataclasses.replace(load_calibration(calibration), modalities=(NEAR,)), path)
    return path


def test_tare_under_load_is_refused_or_named(calibration, tmp_path, capsys):
    """A foot that steps during it is refused. One that stands still gives an offset that the summary states."""
    rng, steps = np.random.default_rng(1), np.maximum(np.sin(np.arange(90) / 4), 0)[:, None]
    time, rows = 0.03 * np.arange(90), 10 * steps + rng.normal(0, 0.05, (90, N))
    out = tmp_path / "out.jsonl"
    path = as_csv(tmp_path / "r.csv", time, rows)
    assert main(["replay", str(calibration), str(path), "--tare", "40", "-o", str(out)]) == 1
    assert "r.csv', readings at rest: the 40 readings for a tare are not at rest: the" in capsys.readouterr().err
    assert not out.exists()
    rows[:30] = 10 + rng.normal(0, 0.05, (30, N))
    words = ["replay", str(calibration), str(as_csv(path, time, rows)), "--tare", "30"]
    assert main(words) == 1
    assert "they are those of 42" in capsys.readouterr().err
    assert main([*words, "--accept"]) == 0
    said = capsys.readouterr()
    assert "rest             30 frames; 4" in said.out and "in total count as offset, at most 10." in said.out
    assert "of 90 frames: something may have pressed during those of --tare" in said.err


def test_replay_takes_modalities_of_an_npz_file(calibration, tmp_path, capsys):
    """Arrays with the names of modalities; the frames have their values, null where unknown. Others do not count."""
    time, rows = readings(3)
    raw = np.linspace(0.0, 4000.0, 3 * 42).reshape(3, 42)
    raw[1, 7] = np.nan
    np.savez(tmp_path / "r.npz", time=time, readings=rows, proximity=raw, truth=np.zeros(7))
    out = tmp_path / "out.jsonl"
    path = with_proximity(calibration, tmp_path)
    assert main(["replay", str(path), str(tmp_path / "r.npz"), "-o", str(out), "--on", "0.2"]) == 0
    lines = [json.loads(line) for line in out.read_text().splitlines()]
    for k, line in enumerate(lines):
        near = line["modalities"]["proximity"]
        expected = [None if np.isnan(r) else 0.2 * (1 - r / 4000) for r in raw[k]]
        assert near["unit"] == "m" and (near["values"][7] is None) == (k == 1)
        pairs = [(a, b) for a, b in zip(near["values"], expected) if b is not None]
        np.testing.assert_allclose(*np.array(pairs).T, rtol=0, atol=1e-15)
        assert line["touched"] is True and line["flags"] == []
    assert capsys.readouterr().err == ""
    assert main(["replay", str(path), str(as_csv(tmp_path / "r.csv", time, rows)), "-o", str(out), "--on", "0.2"]) == 0
    assert "modalities" not in json.loads(out.read_text().splitlines()[0])
    assert "warning: the recording has no readings of proximity" in capsys.readouterr().err


def test_times_in_nanoseconds_are_a_warning(calibration, tmp_path, capsys):
    """Frames that are more than a second apart: the time of a recording is in seconds."""
    time, rows = readings(5)
    for factor, is_long in ((1, False), (1e9, True)):
        np.savez(tmp_path / "r.npz", time=time * factor, readings=rows)
        assert main(["replay", str(calibration), str(tmp_path / "r.npz")]) == 0
        assert ("frames are 4e+06 s apart (median): time must be in seconds" in capsys.readouterr().err) == is_long


@pytest.mark.parametrize(
    ("times", "length"), [((np.nan, 1, 2), "3, 1.000 s"), ((3, 2, 1), "3, 2.000 s"), ((np.nan,) * 3, "3\n")]
)
def test_length_of_a_recording_is_that_of_its_finite_times(calibration, tmp_path, capsys, times, length):
    """One of "nan s", or a negative one, would say nothing."""
    table = as_csv(tmp_path / "r.csv", times, readings(3)[1])
    assert main(["replay", str(calibration), str(table)]) == 0
    assert f"frames           {length}" in capsys.readouterr().out


def test_picture_is_not_written_without_the_output(calibration, tmp_path, capsys):
    """A message cannot have the time: nothing is left."""
    table = as_csv(tmp_path / "r.csv", (1, np.nan, 2), readings(3)[1])
    out, picture = tmp_path / "out.mcap", tmp_path / "out.png"
    words = ["replay", str(calibration), str(table), "--to", "mcap", "-o", str(out), "--picture", str(picture)]
    assert main(words) == 1 and "cannot have the time nan s" in capsys.readouterr().err
    assert not out.exists() and not picture.exists()


def test_wrong_modalities_of_a_recording_are_refused_or_flagged(calibration, tmp_path, capsys):
    """A row for each frame is needed; channels that are missing are flagged in each frame."""
    time, rows = readings(3)
    path, out = with_proximity(calibration, tmp_path), tmp_path / "out.jsonl"
    np.savez(tmp_path / "r.npz", time=time, readings=rows, proximity=np.zeros((2, 42)))
    assert main(["replay", str(path), str(tmp_path / "r.npz"), "-o", str(out)]) == 1
    assert "has proximity float64 (2, 42) for 3 frames. Give numbers of shape (t, channels)" in capsys.readouterr().err
    np.savez(tmp_path / "r.npz", time=time, readings=rows, proximity=np.zeros((3, 5)))
    assert main(["replay", str(path), str(tmp_path / "r.npz"), "-o", str(out), "--on", "0.2"]) == 0
    assert "warning: modality in 3 of 3 frames" in capsys.readouterr().err


def test_bad_calls_give_a_reason_and_no_file(calibration, tmp_path, capsys):
    """The exit code is 1 for wrong data and 2 for a wrong call, with one line and no file."""
    time, rows = readings()
    path, out = as_csv(tmp_path / "r.csv", time, rows[:, :5]), tmp_path / "out.jsonl"
    assert main(["replay", str(calibration), str(path), "-o", str(out)]) == 1
    assert "line 1: the header has 5 columns for the 42 channels of the skin" in capsys.readouterr().err
    np.savez(tmp_path / "r.npz", time=time, readings=rows[:, :5])
    assert main(["replay", str(calibration), str(tmp_path / "r.npz"), "-o", str(out)]) == 1
    assert "does not fit the skin: the reading has 5 channels" in capsys.readouterr().err
    broken = tmp_path / "broken.npz"
    broken.write_bytes(b"PK\x03\x04 nothing")
    assert main(["replay", str(calibration), str(broken), "-o", str(out)]) == 1
    assert "cannot read" in capsys.readouterr().err
    assert main(["replay", str(calibration), str(tmp_path / "none.csv"), "-o", str(out)]) == 1
    assert "Check the path" in capsys.readouterr().err
    empty = tmp_path / "empty.csv"
    empty.write_text(as_csv(path, time, rows).read_text().splitlines()[0])
    assert main(["replay", str(calibration), str(empty), "-o", str(out)]) == 1
    assert "contains no frame" in capsys.readouterr().err
    assert main(["replay", str(calibration), str(path), "-o", str(tmp_path / "no" / "out")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    for words in (["--on", "0"], ["--on", "x"], ["--off", "3"], ["--tare", "-1"]):
        with pytest.raises(SystemExit) as caught:
            main(["replay", str(calibration), str(path), "-o", str(out), *words])
        assert caught.value.code == 2 and capsys.readouterr().err.count("\n") == 1
    assert not out.exists()
