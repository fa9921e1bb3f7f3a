"""The quadratic program of both feet."""

import numpy as np


def test_distribution_meets_the_wrench_with_both_feet_in_their_areas():
    """Compared with the corners of the areas: their forces make the same wrench (linear program)."""
    from distribution import distribute
    from scipy.optimize import linprog

    from skin_calib_addon.runtime import convex_hull, zero_moment_point
    from skin_control.cone import wrench_rays

    full = convex_hull(np.array(((0.1, 0.05), (-0.1, 0.05), (-0.1, -0.05), (0.1, -0.05))))
    rear = convex_hull(np.array(((0.0, 0.05), (-0.1, 0.05), (-0.1, -0.05), (0.0, -0.05))))
    soles = {"left": np.array((0.0, 0.09, 0.0)), "right": np.array((0.0, -0.09, 0.0))}
    areas, weight, wanted = {"left": full, "right": rear}, 340.0, np.array((0.03, 0.0))
    found = distribute(wanted, weight, soles, areas, 0.5)
    total = sum(np.concatenate((w[:3], w[3:] + np.cross(soles[foot], w[:3]))) for foot, w in found.items())
    assert np.abs(zero_moment_point(total) - wanted).max() < 1e-3 and abs(total[2] / weight - 1) < 1e-3
    for foot, wrench in found.items():
        rays = wrench_rays(areas[foot], 0.5)
        assert linprog(np.zeros(len(rays)), A_eq=rays.T, b_eq=wrench, bounds=(-1e-6, None)).success
    assert zero_moment_point(found["right"])[0] < 1e-6 < 0.03 < zero_moment_point(found["left"])[0]
