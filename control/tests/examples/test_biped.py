"""The simulated biped: what its sensors deliver, and when."""

import numpy as np
import pytest


def test_noise_and_latency_are_wrong_from_a_time_on():
    """The noise at rest is learned before; a reading is that of one cycle before, and then of three before."""
    from biped import NOISE, PERIOD, Biped, Faults

    robot = Biped(faults=Faults(since=0.4, noise=2 * NOISE, latency=3), proximity=False)
    plain = Biped(proximity=False)
    for name, skin in robot.body.skins.items():
        assert skin.noise.sigma == pytest.approx(plain.body.skins[name].noise.sigma)
    made, kept = [], {True: [], False: []}
    original = robot._reading

    def reading(name, forces):
        counts = original(name, forces)
        if name == "left_foot":
            made.append(counts)
        return counts

    robot._reading = reading
    robot.data.qpos[2] += 1  # in the air
    while robot.data.time < 0.8:
        senses, late = robot.senses(), robot.data.time >= 0.4
        kept[late].append(senses.readings["left_foot"]["force"])
        assert senses.readings["left_foot"] is made[max(len(made) - 1 - (3 if late else 1), 0)]
        robot.data.time += PERIOD
    before, after = (np.std(kept[late][5:], axis=0).mean() for late in (False, True))
    assert abs(before / NOISE - 1) < 0.1 and abs(after / NOISE - 2) < 0.2
