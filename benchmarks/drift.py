"""How far the baseline is off, and which statements hold, on a simulated sensor with drift and creep.

    python benchmarks/drift.py [--seconds N] [--seed N]

A taxel with creep reads ``F + k x``; x follows the force F with a time constant. The paper gives a recovery time of
5.1 s after a load of 10 kPa for 2 s (Table 1), and a sensitivity of 10 counts per kPa. Recovery means one count here.
Each time constant then gives one k. The paper found no hysteresis, so that there is none here. The skin does not know
the creep, or knows it exactly, or its constants are wrong.

The drift is linear in time, other for each taxel. The sole is in the air, or walks: it is free for 0.37 s in 2 s.
"drift" is the fraction of frames with the flag.

The last table has a light even load for some seconds, and then 855 N for 20 s. Nothing drifts.
"""

import argparse
from dataclasses import dataclass, replace

import numpy as np
import winkler
from noise import Array, Sensor

from skin_calib_addon.calibration import Response
from skin_calib_addon.runtime import Skin, convex_hull

CYCLE = 500  # frames of a step
OFFSET = 100.0  # [counts] readings at rest
SPREAD = 0.5  # standard deviation of the drift over the taxels, relative to its mean
RECOVERY = 5.1  # [s] until one count is left
LOAD_TIME = 2.0  # [s] of the load before
LOAD_COUNTS = 100.0  # 10 kPa
SENSOR = Sensor(12, 2.0)


@dataclass(frozen=True)
class Creep:
    """Part of a reading that follows the force late."""

    fraction: float
    time: float  # time constant [s]

    @classmethod
    def recovering(cls, time: float) -> "Creep":
        """Return the creep of a time constant with the recovery time of the paper."""
        left = (1 - np.exp(-LOAD_TIME / time)) * np.exp(-RECOVERY / time)
        return cls(1 / (LOAD_COUNTS * left), time)

    def felt(self, forces: Array) -> Array:
        """Return what a sensor makes of forces (t, n)."""
        late, felt = np.zeros(forces.shape[1]), np.empty_like(forces)
        gain = -np.expm1(-winkler.PERIOD / self.time)
        for k, force in enumerate(forces):
            felt[k] = force + self.fraction * late
            late += gain * (force - late)
        return felt


def judge(forces: Array, hulls: list[Array], rate: float, true: Creep, seed: int, **options) -> str:
    """Return a line of the table.

    Parameters
    ----------
    forces : array, shape (t, n)
        Of the taxels [N].
    hulls : list of array
        True contacts of one cycle.
    rate : float
        Mean drift [N/min].
    true : Creep
        Of the sensor.
    seed : int
        Of the noise.
    **options
        Of the skin.
    """
    rng = np.random.default_rng(seed)
    n = forces.shape[1]
    skin = Skin(replace(winkler.sole(), response=Response((0.0, SENSOR.count))), **options)
    rest = OFFSET * SENSOR.count
    skin.tare(SENSOR.read(np.full((250, n), rest), rng), accept=True)
    times = winkler.PERIOD * np.arange(len(forces))
    drift = rate / 60 * (1 + SPREAD * rng.normal(size=n)) * times[:, None]
    readings = SENSOR.read(true.felt(forces) + drift + rest, rng)
    air, inside, off, errors, flags = [], [], [], [], []
    for k, reading in enumerate(readings):
        frame, load = skin.update(reading, 10 + times[k]), forces[k].sum()
        if k < len(readings) // 3:
            continue
        off.append(drift[k] - skin.drift * SENSOR.count)
        flags.append("drift" in frame.flags)
        if load == 0:
            air.append(frame.stands)
        else:
            errors.append(frame.load - load)
            contact = convex_hull(hulls[k % CYCLE])
            inside.append(all(contact.margin(c) > -1e-9 for c in frame.polygon.guaranteed.corners))
    means = [f"{np.sqrt(np.mean(np.square(off))):8.3f} {np.sum(off, axis=1).mean():8.2f} {np.mean(air):8.2%}"]
    means.append(f"{np.mean(flags):7.1%}")
    means += [f"{np.mean(inside):8.2%} {np.sqrt(np.mean(np.square(errors))):7.1f}"] if inside else []
    return " ".join(means)


def after_rest(loads: Array, period: float, seed: int) -> float:
    """Return the fraction of frames with the flag ``drift`` in 20 s with 855 N after light loads (t,) [N]."""
    rng, skin = np.random.default_rng(seed), Skin(replace(winkler.sole(), response=Response((0.0, SENSOR.count))))
    skin.tare(SENSOR.read(np.full((250, len(skin.ids)), OFFSET * SENSOR.count), rng), accept=True)
    loads = np.append(loads, np.full(round(20 / period), 855.0))
    readings = SENSOR.read(loads[:, None] / len(skin.ids) + OFFSET * SENSOR.count + np.zeros(len(skin.ids)), rng)
    flags = ["drift" in skin.update(reading, period * k).flags for k, reading in enumerate(readings)]
    return float(np.mean(flags[-round(20 / period) :]))


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description="residual error of the baseline under drift and creep")
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    foot = winkler.steps(CYCLE, winkler.PERIOD, options.seed)[0]
    walk = np.tile(foot.forces, (options.seconds // 2, 1))
    still, none = np.zeros_like(walk), Creep(0.0, 1.0)
    print("                                    taxel N   sole N   stands   drift   inside  load N")
    for name, forces in (("in the air", still), ("walking", walk)):
        for rate in (0.0, 0.1, 0.4, 1.6):
            for follows in (False, True):
                row = judge(forces, foot.hulls, rate, none, options.seed, follow_drift=follows)
                print(f"{name:10} {rate:3.1f} N/min {'followed' if follows else 'not followed':12} {row}", flush=True)
    for time in (1.5, 2.0, 5.0):
        creep = Creep.recovering(time)
        print(f"walking, creep {creep.fraction:.2f} in {time:.1f} s")
        for fraction, duration in ((0.0, 1.0), (1.0, 1.0), (0.7, 1.0), (1.3, 1.0), (1.0, 0.7), (1.0, 1.3)):
            known = (fraction * creep.fraction, duration * time)
            row = judge(walk, foot.hulls, 0.0, creep, options.seed, creep=known if fraction else None)
            name = f"known: {fraction:.1f} k, {duration:.1f} time" if fraction else "not known"
            print(f"  {name:30} {row}", flush=True)
    for period in (0.001, 0.004, 0.04):
        count = round(1 / period)
        rests = {"15 N, 1 s": np.full(count, 15.0), "10 N, 3 s": np.full(3 * count, 10.0)}
        rests["5 N/s, 3 s"] = np.linspace(0.0, 15.0, 3 * count)
        found = ", ".join(f"{name} {after_rest(loads, period, options.seed):.1%}" for name, loads in rests.items())
        print(f"drift in 20 s with 855 N, every {1e3 * period:g} ms, after {found}", flush=True)


if __name__ == "__main__":
    main()
