"""The angles of the legs in closed form."""

import numpy as np


def test_angles_of_the_legs_agree_with_the_simulator():
    import mujoco
    from biped import FEET, nominal
    from legs import joint_angles, rotation

    model, rng = nominal(), np.random.default_rng(0)
    data = mujoco.MjData(model)
    for _ in range(20):
        pelvis, turn = rng.normal(0, 0.02, 3), rotation(2, rng.normal(0, 0.2)) @ rotation(0, rng.normal(0, 0.1))
        feet = {}
        for foot, y in zip(FEET, (0.1, -0.1)):
            pitch = rotation(1, rng.normal(0, 0.1)) @ rotation(0, rng.normal(0, 0.1))
            feet[foot] = (np.array((0, y, -0.6)) + rng.normal(0, 0.03, 3), pitch)
        data.qpos[:3] = pelvis
        mujoco.mju_mat2Quat(data.qpos[3:7], turn.ravel())
        data.qpos[7:19] = joint_angles(pelvis, turn, feet)
        mujoco.mj_kinematics(model, data)
        for foot, (position, orientation) in feet.items():
            body = data.body(f"{foot}_foot")
            assert np.abs(body.xpos - position).max() < 1e-9
            assert np.abs(body.xmat.reshape(3, 3) - orientation).max() < 1e-9
