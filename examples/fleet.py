"""Compute what the skins of many recordings felt, on all processors of this machine or of a cluster of Dask.

    python examples/fleet.py CALIBRATION RECORDINGS -o RESULTS [--noise NOISE.json] [--scheduler tcp://HOST:PORT]

RECORDINGS is a folder with MCAP, Parquet, CSV or NPZ files of one skin. A Parquet file has the column ``time`` [s],
and a column ``channel_0``, ``channel_1`` ... for each channel. RESULTS gets a Parquet file for each recording with a
row for each reading. Recordings that have results, and did not change, are not computed again. A worker that ends loses
only the file it worked at, which another one begins anew.

All machines see the folders under the same path. Needs ``pip install 'skin-calib[live,fleet]'``.
"""

import argparse
import os
import sys
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
from dask.distributed import Client, KilledWorker, LocalCluster, as_completed

from skin_calib_addon.common.errors import SkinCalibError
from skin_calib_addon.common.file_hash import file_hash
from skin_calib_addon.inspection.recording import read_recording
from skin_calib_addon.runtime import load

LONG_STEP = 1.0  # [s] between readings, above which the time may be in other units. Larger: more of them are unseen
ENDINGS = (".mcap", ".parquet", ".csv", ".npz")


def readings_of(path, skin):
    """Return times (t,) [s] and readings (t, channels) of a recording, and what is special about it."""
    if path.suffix.lower() != ".parquet":
        recording = read_recording(path, skin)
        frames = list(recording.frames)
        return np.array([at for at, _ in frames]), np.array([row for _, row in frames]), recording.notes
    names = [f"channel_{k}" for k in range(skin.reading_length)]
    schema = pyarrow.parquet.read_schema(path)
    if missing := [name for name in ("time", *names) if name not in schema.names]:
        raise SkinCalibError(f"'{path.name}' has no column {missing[0]}: it is of another skin, or another table")
    kind = schema.field("time").type
    if not (pyarrow.types.is_floating(kind) or pyarrow.types.is_integer(kind)):
        raise SkinCalibError(f"the column time of '{path.name}' is {kind}. Write it as numbers of seconds")
    table = pyarrow.parquet.read_table(path, columns=["time", *names])
    others = [name for name in schema.names if name.startswith("channel_") and name not in names]
    notes = [f"warning: {len(others)} columns are not of this skin; the first is {others[0]}"] if others else []
    return table["time"].to_numpy(), np.stack([table[name].to_numpy() for name in names], axis=1), notes


def computed(source, target, calibration, noise):
    """Write the results of one recording; return the number of readings, and lines about it."""
    try:
        made = made_with(source, calibration, noise)
        skin = load(calibration)
        if noise:
            skin.load_noise(noise)
        times, readings, notes = readings_of(source, skin)
        if not len(times):
            raise SkinCalibError(f"'{source.name}' has no reading")
        if count := np.count_nonzero(~(np.diff(times) > 0)):
            notes = (*notes, f"warning: the time does not increase in {count} rows")
        if len(times) > 1 and (step := np.median(np.diff(times))) > LONG_STEP:
            notes = (*notes, f"warning: readings are {step:g} s apart (median): time must be in seconds")
        found = skin.batch(readings, times)
    except (SkinCalibError, pyarrow.ArrowException, OSError) as problem:
        return 0, (f"error: {str(problem).splitlines()[0]}",)
    unknown = (~found.known).sum(axis=1)
    if unknown.any():
        notes = (*notes, f"warning: taxels have no valid force in {np.count_nonzero(unknown)} rows")
    columns = {"time": times, "contacts": found.contact_counts, "stands": found.stands, "load": found.load}
    columns["unknown_taxels"] = unknown
    columns |= dict(zip(("fx", "fy", "fz", "tx", "ty", "tz"), found.wrench.T))
    columns |= dict(zip(("cop_x", "cop_y", "zmp_x", "zmp_y"), (*found.cop.T, *found.zmp.T)))
    table = pyarrow.table(columns).replace_schema_metadata(made)
    part = target.with_name(f"{target.name}.part")
    pyarrow.parquet.write_table(table, part)
    os.replace(part, target)
    return len(times), notes


def made_with(source, calibration, noise):
    """Return what results depend on: name, size and time of the recording, checksums of the other files."""
    state = source.stat()
    recording = f"{source.name}, {state.st_size} bytes, {state.st_mtime_ns} ns"
    return {"recording": recording, "calibration": file_hash(calibration), "noise": file_hash(noise) if noise else ""}


def is_done(source, target, calibration, noise):
    """Return whether a complete result is there, made with the same files."""
    try:
        made = made_with(source, calibration, noise)
        metadata = pyarrow.parquet.read_schema(target).metadata or {}
    except (OSError, pyarrow.ArrowException):
        return False
    return all(metadata.get(name.encode(), b"").decode() == checksum for name, checksum in made.items())


def main():
    """Compute all recordings; exit 1 if one cannot be read."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("calibration", type=Path)
    parser.add_argument("recordings", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--noise", type=Path)
    parser.add_argument("--scheduler", help="address of a cluster of Dask; without it, all processors of this machine")
    options = parser.parse_args()
    load(options.calibration)  # or say what is wrong with it
    calibration, noise = options.calibration.resolve(), options.noise and options.noise.resolve()
    if not options.recordings.is_dir():
        parser.error(f"{options.recordings} is not a folder")
    sources = sorted(path for path in options.recordings.resolve().iterdir() if path.suffix.lower() in ENDINGS)
    if not sources:
        parser.error(f"{options.recordings} has no file {', '.join(ENDINGS)}")
    if options.output.resolve() == options.recordings.resolve():
        parser.error("the results would be in the folder of the recordings. Name another folder")
    options.output.mkdir(parents=True, exist_ok=True)
    targets = {source: options.output.resolve() / f"{source.name}.parquet" for source in sources}
    left = [source for source in sources if not is_done(source, targets[source], calibration, noise)]
    cluster = options.scheduler or LocalCluster(
        n_workers=min(os.cpu_count() or 1, max(len(left), 1)), threads_per_worker=1, dashboard_address=None
    )
    if not noise:
        print("no noise file: contacts are those above the thresholds for unknown noise", file=sys.stderr)
    failed = 0
    with Client(cluster) as client:
        tasks = {
            client.submit(computed, source, targets[source], calibration, noise, pure=False): source for source in left
        }
        for task in as_completed(tasks):
            try:
                count, notes = task.result()
            except KilledWorker as problem:  # several workers ended with this recording, such as for want of memory
                count, notes = 0, (f"error: {problem}",)
            failed += count == 0
            print("\n".join((f"{tasks[task].name}: {count} readings", *notes)), flush=True)
    print(f"{len(left) - failed} computed, {len(sources) - len(left)} up to date, {failed} failed, in {options.output}")
    return 1 if failed else 0


if __name__ == "__main__" and (code := main()):
    sys.exit(code)
