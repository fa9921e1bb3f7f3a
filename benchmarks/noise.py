"""Which statements of the runtime hold for noisy readings: polygons, CoP, ZMP, feet in the air.

    python benchmarks/noise.py [--frames N] [--seed N] [--rest tare|frames] [--kind normal|heavy|correlated|common]
        [--period S] [--light N] [--drift SIGMAS] [--lost TAXELS] [--noisy TAXELS]

The scenes are those of ``winkler.py``, and the recorded soles of an independent simulator where they are present. Their
forces become readings with 12 or 8 bits on 800 N, with normal noise that the converter clips at zero. The skin has its
default settings and one second of rest, and before each scene carries a light even load for a second. In the second
half of each scene all taxels drift by some standard deviations, some taxels at the tip have no reading, and the noise
of some is four times as large. A foot in the air drifts from the start. The period is that of the scene: the recorded
ones have 25 frames per second. For each scene the table has the fraction of frames in which

- the guaranteed polygon is inside the true contact, and is not empty;
- the first half, and the second half, has the flag ``drift`` or ``noisy``;
- there is a CoP;
- the outer polygon contains every taxel with more than the detection limit that the skin states;

the mean distance of the CoP from the true one, and the fractions of errors of load, CoP and moments within one and two
stated standard deviations, component by component. For a foot in the air it has the fraction of frames in which the
foot stands, those with a contact, and those with a guaranteed polygon. For two feet it has the distance of the ZMP, its
errors within one and two standard deviations, and the frames in which a foot that carries more than the limit of its
sum does not stand.
"""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import winkler
from winkler import Array, Scene

from skin_calib_addon.calibration import Response
from skin_calib_addon.runtime import Body, Skin, convex_hull

SHARED = Path(__file__).resolve().parents[1] / ".." / "shared" / "data" / "truth"
FULL_SCALE = 800.0  # [N] force of a taxel at the highest count
AIR_FRAMES = 5000
GROWTH = 4.0  # of the noise of noisy taxels


@dataclass(frozen=True)
class Sensor:
    """A converter with noise; ``kind`` names the distribution of the noise."""

    bits: int
    noise: float  # standard deviation [counts]
    kind: str = "normal"

    @property
    def count(self) -> float:
        """Return the force of one count [N]."""
        return FULL_SCALE / (2**self.bits - 1)

    @property
    def sigma(self) -> float:
        """Return the standard deviation of a force with the rounding to counts [N]."""
        return self.count * float(np.sqrt(self.noise**2 + 1 / 12))

    def read(self, forces: Array, rng: np.random.Generator) -> Array:
        """Return the readings (t, n) of forces (t, n)."""
        counts = forces / self.count + self.noise * NOISES[self.kind](rng, *forces.shape)
        return np.clip(np.rint(counts), 0, 2**self.bits - 1).astype(np.uint16)


def normal(rng: np.random.Generator, frames: int, n: int) -> Array:
    """Return independent noise of unit standard deviation."""
    return rng.normal(size=(frames, n))


def heavy(rng: np.random.Generator, frames: int, n: int) -> Array:
    """Return noise with heavy tails: Student's distribution with four degrees of freedom."""
    return rng.standard_t(4, (frames, n)) / np.sqrt(2)


def correlated(rng: np.random.Generator, frames: int, n: int) -> Array:
    """Return noise with a correlation of 0.6 from frame to frame."""
    noise = rng.normal(size=(frames, n))
    for k in range(1, frames):
        noise[k] = 0.6 * noise[k - 1] + 0.8 * noise[k]
    return noise


def common(rng: np.random.Generator, frames: int, n: int) -> Array:
    """Return noise of which half of the variance is common to all taxels of a frame."""
    return (rng.normal(size=(frames, n)) + rng.normal(size=(frames, 1))) / np.sqrt(2)


NOISES: dict[str, Callable] = {"normal": normal, "heavy": heavy, "correlated": correlated, "common": common}


def rested(sensor: Sensor, how: str, rng: np.random.Generator) -> Skin:
    """Return a skin after one second without contact."""
    skin = Skin(replace(winkler.sole(), response=Response((0.0, sensor.count))))
    n = len(skin.ids)
    rest = sensor.read(np.zeros((round(1 / winkler.PERIOD), n)), rng)
    if how == "tare":
        skin.tare(rest)
    else:
        for k, reading in enumerate(rest):
            skin.update(reading, winkler.PERIOD * k)
    return skin


def recorded(name: str) -> Scene:
    """Return a sole of the independent simulator."""
    with np.load(SHARED / f"{name}.npz") as file:
        data = dict(file)
    bounds = data["true_hull_off"]
    hulls = [data["true_hull"][i:j] for i, j in zip(bounds, bounds[1:])]
    return Scene(name, 0.04 * np.arange(len(hulls)), data["taxel_fn"], hulls, data["cop_sole"])


def judge(skin: Skin, sensor: Sensor, scene: Scene, rng: np.random.Generator, options: argparse.Namespace) -> dict:
    """Return the fractions and the errors of a scene with what the options say."""
    light, drift, lost = options.light, options.drift, np.argsort(-skin.positions[:, 0])[: options.lost]
    period, limit = scene.times[1] - scene.times[0], skin.noise.detection_limits
    before = round(1 / period) if light else 0
    for k, reading in enumerate(sensor.read(np.full((before, len(limit)), light / len(limit)), rng)):
        skin.update(reading, 10 + period * (k - before))
    late = np.arange(len(scene.times)) >= len(scene.times) // 2
    flags, inside, filled, holds, overshoot, errors = [], [], [], [], [], []
    ratios: dict[str, list[float]] = {"load": [], "CoP": [], "moment": []}
    readings = sensor.read(scene.forces + drift * sensor.sigma * late[:, None], rng).astype(float)
    if options.noisy:
        rows = np.ix_(late, rng.permutation(len(limit))[: options.noisy])
        loud = replace(sensor, noise=GROWTH * sensor.noise)
        readings[rows] = loud.read(scene.forces + drift * sensor.sigma * late[:, None], rng)[rows]
    readings[np.ix_(late, lost)] = np.nan
    for k, reading in enumerate(readings):
        frame = skin.update(reading, 10 + scene.times[k])
        flags.append(not frame.flags.isdisjoint({"drift", "noisy"}))
        true, polygon = convex_hull(scene.hulls[k]), frame.polygon
        inside.append(all(true.margin(c) > -1e-9 for c in polygon.guaranteed.corners))
        filled.append(len(polygon.guaranteed.corners) > 2)
        corners = skin.ground.corners[scene.forces[k] > limit].reshape(-1, 2)
        holds.append(all(polygon.outer.margin(c) > -1e-9 for c in corners))
        overshoot.append(max((-true.margin(c) for c in polygon.outer.corners), default=0.0))
        if frame.cop is not None:
            load, (x, y) = scene.forces[k].sum(), scene.cops[k]
            errors.append(np.linalg.norm(frame.cop - scene.cops[k]))
            ratios["load"].append((frame.load - load) / frame.load_sigma)
            ratios["CoP"].extend((frame.cop - scene.cops[k]) / frame.cop_sigma)
            ratios["moment"].extend((frame.wrench[3:5] - (y * load, -x * load)) / frame.wrench_sigma[3:5])
    return {
        "inside": np.mean(inside),
        "filled": np.mean(filled),
        "stands": len(errors) / len(flags),
        "drift": "/".join(f"{np.mean(np.array(flags)[part]):.0%}"[:-1] for part in (~late, late)),
        "holds": np.mean(holds),
        "too far": 1e3 * np.mean(overshoot),
        "mm": 1e3 * np.mean(errors),
    } | {name: coverage(values) for name, values in ratios.items()}


def coverage(ratios: list[float]) -> str:
    """Return the percentages of errors, relative to their standard deviations, within one and two of them."""
    return "/".join(f"{np.mean(np.abs(ratios) < k):.0%}"[:-1] for k in (1, 2))


def in_the_air(skin: Skin, sensor: Sensor, drift: float, rng: np.random.Generator) -> tuple[float, float, float]:
    """Return the fractions of frames of a free sole in which it stands, has a contact, and a guaranteed polygon."""
    readings = sensor.read(np.full((AIR_FRAMES, len(skin.ids)), drift * sensor.sigma), rng)
    frames = [skin.update(reading, 10 + winkler.PERIOD * k) for k, reading in enumerate(readings)]
    found = [(f.cop is not None, bool(f.touched), len(f.polygon.guaranteed.corners) > 2) for f in frames]
    stands, contact, guaranteed = np.mean(found, axis=0).tolist()
    return stands, contact, guaranteed


def two_feet(sensor: Sensor, how: str, scenes: tuple[Scene, Scene], rng: np.random.Generator) -> str:
    """Return mean and maximum distance of the ZMP, and the number of feet that vanish, of all that carry enough.

    The feet are 0.2 m apart.
    """
    skins = {scene.name: rested(sensor, how, rng) for scene in scenes}
    body, poses = Body(skins), {scene.name: np.eye(4) for scene in scenes}
    poses["left"][1, 3], poses["right"][1, 3] = 0.1, -0.1
    readings = {scene.name: sensor.read(scene.forces, rng) for scene in scenes}
    errors, ratios, vanished, enough = [], [], 0, 0
    for k, time in enumerate(scenes[0].times):
        frame = body.update({name: rows[k] for name, rows in readings.items()}, 10 + time, poses)
        weights = np.array([scene.forces[k].sum() for scene in scenes])
        points = np.array([np.nan_to_num(scene.cops[k]) + poses[scene.name][:2, 3] for scene in scenes])
        if frame.zmp is not None:
            error = frame.zmp - weights @ points / weights.sum()
            errors.append(1e3 * np.linalg.norm(error))
            ratios.extend(error / frame.zmp_sigma)
        for scene, weight in zip(scenes, weights):
            if weight > skins[scene.name].noise.load_limit:
                enough += 1
                vanished += scene.name not in frame.standing
    distances = f"{np.mean(errors):.2f} / {np.percentile(errors, 95):.2f} / {np.max(errors):.2f} mm"
    return f"ZMP mean/95%/max {distances}, covered {coverage(ratios)}, vanished {vanished} of {enough}"


def table(sensor: Sensor, scenes: list[Scene], feet: tuple[Scene, Scene], options: argparse.Namespace) -> Iterator[str]:
    """Yield the lines of the table of a sensor."""
    rng, how = np.random.default_rng(options.seed), options.rest
    skin = rested(sensor, how, rng)
    limit, whole = skin.noise.detection_limits, skin.noise.load_limit
    yield (
        f"{sensor.bits} bits, {sensor.noise:g} counts, {sensor.kind}, rest by {how}: detection limit"
        f" {np.median(limit):.2f} N of a taxel ({np.median(limit) / sensor.sigma:.1f} sigma), {whole:.1f} N of the sole"
    )
    names = "inside", "filled", "drift", "stands", "outer", "too far", "CoP mm", "load", "CoP", "moment"
    yield f"  {'scene':12}" + "".join(f" {name:>{width}}" for name, width in zip(names, (7, 7, 7, 7, 7, 8, 7, 7, 7, 7)))
    for scene in scenes:
        row = judge(rested(sensor, how, rng), sensor, scene, rng, options)
        yield (
            f"  {scene.name:12} {row['inside']:7.2%} {row['filled']:7.1%} {row['drift']:>7}"
            f" {row['stands']:7.1%} {row['holds']:7.2%}"
            f" {row['too far']:8.1f} {row['mm']:7.2f} {row['load']:>7} {row['CoP']:>7} {row['moment']:>7}"
        )
    stands, ghosts, guaranteed = in_the_air(skin, sensor, options.drift, rng)
    yield f"  in the air: stands {stands:.2%}, contact {ghosts:.2%}, guaranteed {guaranteed:.2%}"
    yield f"  two feet: {two_feet(sensor, how, feet, rng)}"


def main() -> None:
    """Print a table for each sensor."""
    parser = argparse.ArgumentParser(description="which statements of the runtime hold for noisy readings")
    parser.add_argument("--frames", type=int, default=200, help="of each scene")
    parser.add_argument("--period", type=float, default=winkler.PERIOD, help="between frames [s]")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--light", type=float, default=0.0, help="load before each scene [N]")
    parser.add_argument("--lost", type=int, default=0, help="taxels without a reading in the second half")
    parser.add_argument("--noisy", type=int, default=0, help="taxels with more noise in the second half")
    parser.add_argument("--drift", type=float, default=0.0, help="in the second half [standard deviations]")
    parser.add_argument("--rest", choices=("tare", "frames"), default="tare")
    parser.add_argument("--kind", choices=tuple(NOISES), default="normal")
    parser.add_argument("--sensors", nargs="*", default=["12:2", "12:.5", "8:.5", "8:2"], help="BITS:COUNTS")
    options = parser.parse_args()
    scenes = list(winkler.scenes(options.frames, options.period, options.seed))
    if SHARED.is_dir():
        scenes += [recorded(name) for name in ("foot_flat", "foot_beam12")]
    feet = winkler.steps(2 * options.frames, options.period, options.seed)
    for text in options.sensors:
        bits, noise = text.split(":")
        sensor = Sensor(int(bits), float(noise), options.kind)
        print("\n".join(table(sensor, scenes, feet, options)), flush=True)


if __name__ == "__main__":
    main()
