"""The example with proximity sensors and events, step by step."""

from dataclasses import replace

import numpy as np

from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.plan import load_plan
from skin_calib_addon.runtime import Skin


def test_virtual_force_rises_until_the_foot_stands():
    """In the air it is the sum over the taxels; on the ground the real force counts."""
    import landing_foot as example

    plan = replace(load_plan(example.PLAN), modalities=(example.PROXIMITY,))
    skin = Skin(calibrate(plan).calibration, switch_on=0.2)
    ahead = example.SLOPE * (skin.positions[:, 0].max() - skin.positions[:, 0])
    before = 0.0
    for height, frame, wrench in example.landing(skin):
        distances = height + ahead
        if height > 0:
            assert frame.touched is False
            expected = example.STIFFNESS * skin.areas * np.clip(example.RANGE - distances, 0, None)
            assert abs(wrench[2] - expected @ -skin.normals[:, 2]) < 1e-3 and wrench[2] >= before
            before = wrench[2]
        pushed = example.PAD * skin.areas * np.maximum(-distances, 0)
        np.testing.assert_allclose(frame.forces, pushed, atol=1e-9)
    assert (
        frame.touched and before > 50 and abs(wrench[2] - pushed[pushed >= 0.2] @ -skin.normals[pushed >= 0.2, 2]) < 0.5
    )
