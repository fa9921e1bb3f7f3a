"""What decides how hard a foot lands."""

import numpy as np
import pytest


def test_effective_mass_of_a_sole_is_the_force_that_lifts_it_without_turning_it_and_falls_with_the_bend_of_the_knee():
    """The force is that of a robot whose sole is accelerated upward: all equations of motion are solved at once."""
    import mujoco
    from biped import Biped
    from estimator import SOLE_CENTRE
    from impacts import effective_masses

    robot, found = Biped(proximity=False), []
    model, data, n = robot.model, robot.data, robot.model.nv
    for bend in (0.35, 0.7):
        for name, angle in (("hip_pitch", -bend / 2), ("knee", bend), ("ankle_pitch", -bend / 2)):
            data.joint(f"right_{name}").qpos[:] = angle
        mujoco.mj_forward(model, data)
        inertia, jacobian, foot = np.zeros((n, n)), np.zeros((6, n)), data.body("right_foot")
        mujoco.mj_fullM(model, data, inertia)
        mujoco.mj_jac(model, data, jacobian[:3], jacobian[3:], foot.xpos + SOLE_CENTRE, foot.id)
        links = inertia - np.diag(model.dof_armature)
        system = np.block([[links, -jacobian.T], [jacobian, np.zeros((6, 6))]])
        force = np.linalg.solve(system, np.concatenate((np.zeros(n), (0, 0, 1, 0, 0, 0))))[n + 2]
        found.append(effective_masses(robot, "right"))
        assert found[-1][1] == pytest.approx(force) and found[-1][0] > found[-1][1]
    assert found[1][0] < 0.8 * found[0][0] and found[1][1] < 0.8 * found[0][1]
