"""The reference of ZMP and DCM."""

import numpy as np


def test_reference_of_the_dcm_obeys_the_pendulum():
    """Its derivative is omega (dcm - zmp) (thesis eq. 4.12), it is continuous, and it ends at the last point."""
    from zmp_plan import ZmpPlan

    rng, omega, step = np.random.default_rng(1), 3.8, 1e-5
    plan = ZmpPlan([0, 1, 1.9, 2.2, 3.1], rng.normal(0, 0.1, (5, 2)), omega)
    for time in rng.uniform(0, 3.09, 50):
        now, after = plan.at(time), plan.at(time + step)
        middle = plan.at(time + step / 2)
        np.testing.assert_allclose((after.dcm - now.dcm) / step, omega * (middle.dcm - middle.zmp), atol=1e-6)
    np.testing.assert_allclose(plan.at(9.0).dcm, plan.points[-1])
