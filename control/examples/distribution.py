"""Distribute the wrench of the ground over both feet by a quadratic program with wrench cones (thesis 4.4.4)."""

import numpy as np
from qpsolvers import solve_qp

from skin_calib_addon.runtime import Polygon
from skin_control.cone import wrench_cone

Array = np.ndarray
NET, RATIO, ANKLE = 1.0, 1e-2, 1e-3  # weights of the net wrench, of the fraction of the load, of the torques of ankles
MIN_LOAD = 1.0  # on each foot [N]


def distribute(
    wanted: Array, weight: float, soles: dict[str, Array], areas: dict[str, Polygon], friction: float
) -> dict[str, Array] | None:
    r"""Return the wrench (6,) of the ground on each foot about the centre of its sole; None if there is no solution.

    It minimizes, over the wrenches :math:`w_i` in the cones of the areas (thesis eq. 4.32 to 4.41, corrected),

    .. math::
        \Big\lVert \sum_i X_i w_i - w_d \Big\rVert^2 + a \sum_i (f_{z,i} - r_i f_{z,d})^2
        + b \sum_i \lVert \tau_i \rVert^2

    with the wrench :math:`w_d` of the weight at the desired ZMP, and the fractions :math:`r_i` by the distances of the
    ZMP from the feet.

    Parameters
    ----------
    wanted : array, shape (2,)
        The desired ZMP [m].
    weight : float
        [N].
    soles : dict of (3,) arrays
        Centres of the soles that stand [m].
    areas : dict of Polygon
        Where each sole can carry load, from its centre [m].
    friction : float
        Coefficient.
    """
    feet = list(soles)
    nets, rows = [], []
    for k, foot in enumerate(feet):
        arm = soles[foot] - np.array((*wanted, soles[foot][2]))
        net = np.eye(6)  # about the desired ZMP: the moment of a force f adds arm x f
        net[3:, :3] = np.array(((0, -arm[2], arm[1]), (arm[2], 0, -arm[0]), (-arm[1], arm[0], 0)))
        nets.append(net)
        cone = wrench_cone(areas[foot], friction)
        if cone is None:
            return None
        rows.append(np.zeros((len(cone), 6 * len(feet))))
        rows[-1][:, 6 * k : 6 * k + 6] = cone
    parts = np.ones(1)
    if len(feet) == 2:
        line = soles[feet[1]][:2] - soles[feet[0]][:2]
        part = float(np.clip((wanted - soles[feet[0]][:2]) @ line / (line @ line), 0, 1))
        parts = np.array((1 - part, part))
    jacobian, goal = np.hstack(nets), np.array((0, 0, weight, 0, 0, 0))
    loads = np.zeros((len(feet), 6 * len(feet)))
    loads[np.arange(len(feet)), 6 * np.arange(len(feet)) + 2] = 1
    torques = np.diag(np.tile((0.0, 0, 0, 1, 1, 1), len(feet)))
    P = NET * jacobian.T @ jacobian + RATIO * loads.T @ loads + ANKLE * torques + 1e-8 * np.eye(6 * len(feet))
    q = -NET * jacobian.T @ goal - RATIO * loads.T @ (parts * weight)
    G = np.concatenate((*rows, -loads))
    h = np.concatenate((np.zeros(sum(len(r) for r in rows)), np.full(len(feet), -MIN_LOAD)))
    found = solve_qp(P, q, G, h, solver="quadprog")
    return None if found is None else {foot: found[6 * k : 6 * k + 6] for k, foot in enumerate(feet)}
