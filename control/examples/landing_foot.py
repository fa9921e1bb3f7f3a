"""A foot with proximity sensors lands: a virtual wrench before the contact, the real one from then on.

    python control/examples/landing_foot.py

The sole is that of ``sample_scenes/sole.plan.json`` with one modality more. Its electronics sends a force only when it
changes, as an event. The ground is flat and tilted by two degrees, so that the toes are near it first.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from skin_calib_addon.calibration import Modality, ResponseTable
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.plan import load_plan
from skin_calib_addon.runtime import Frame, Skin
from skin_control.virtual import lands_early, proximity_wrench, sole_wrench

PLAN = Path(__file__).resolve().parents[2] / "sample_scenes" / "sole.plan.json"
RANGE = 0.1  # [m] of the proximity sensors
PROXIMITY = Modality("proximity", "m", ResponseTable((0.0, 4000.0), (RANGE, 0.0)))  # 0: nothing in range
STIFFNESS = 5e4  # [N/m^3] of the virtual springs, per area of skin
SLOPE = np.tan(np.radians(2))
PERIOD, SPEED = 0.01, 0.2  # [s], [m/s]
PAD = 5e6  # [N/m^3] stiffness of the real sole, per area
Array = np.ndarray


def landing(skin: Skin) -> Iterator[tuple[float, Frame, Array]]:
    """Yield the height of the foot [m], the frame, and the virtual or real wrench while the foot moves down."""
    x, last = skin.positions[:, 0], np.zeros(skin.reading_length)
    skin.update(last, 0.0)
    for k, height in enumerate(np.arange(0.12, -0.012, -SPEED * PERIOD), 1):
        distances = height + SLOPE * (x.max() - x)
        raw = np.zeros(skin.reading_length)
        raw[skin.channels] = np.clip(4000 * (1 - distances / RANGE), 0, 4000)
        force = np.zeros(skin.reading_length)
        force[skin.channels] = PAD * skin.areas * np.maximum(-distances, 0)  # the readings of this plan are newtons
        (changed,) = (force != last).nonzero()
        frame, last = skin.update_events(changed, force[changed], k * PERIOD, {"proximity": raw}), force
        virtual = proximity_wrench(skin.geometry, frame.modalities["proximity"], RANGE, STIFFNESS)
        yield height, frame, sole_wrench(frame.touched, frame.wrench, virtual)


def main() -> None:
    """Print height, force and moment of every fifth frame."""
    plan = replace(load_plan(PLAN), modalities=(PROXIMITY,))
    skin = Skin(calibrate(plan).calibration, switch_on=0.2)
    for k, (height, frame, wrench) in enumerate(landing(skin)):
        if k % 5 == 0:
            state = "stands" if frame.touched else "slows down" if lands_early(wrench, 5.0) else "swings"
            print(f"{round(height * 1e3) + 0:4d} mm  {state:10}  {wrench[2]:6.1f} N up, {wrench[4]:6.2f} N m about y")


if __name__ == "__main__":
    main()
