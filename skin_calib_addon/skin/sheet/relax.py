"""Minimization of the strain of a net on a surface, subject to constraints."""

import numpy as np

from ...common.arrays import Array, IntArray, cross, unit
from ...common.errors import InvalidPlan
from ...geometry.surface.bspline import BSplineSurface
from ...geometry.surface.footpoints import PARAMETER_TOLERANCE
from .constraints import Constraints
from .equations import equations_of
from .net import Net

# Limit of the Newton steps; 3 to 10 are usual. Larger: more time where a net oscillates.
MAX_NEWTON_STEPS = 30
# A step that increases the energy by more than this factor is halved. A small increase is harmless: the gradients are
# those of geodesics, the lengths are those of cubics, and their minima differ slightly. Larger: may diverge.
MAX_ENERGY_RATIO = 1.01
# Movement of the nodes in the step after the last, as a fraction of the pitch. Larger: fewer steps, less exact.
STEP_TOLERANCE = 1e-4
DRAFT_STEP_TOLERANCE = 0.02  # the same for a preview


def relax(
    surface: BSplineSurface,
    net: Net,
    uv: Array,
    constraints: Constraints,
    weights: Array,
    tolerance: float = STEP_TOLERANCE,
) -> Array:
    r"""Return the parameters of the nodes that minimize the strain of a net (Newton's method with constraints).

    .. math::
        \min_{(u, v)} \sum_e w_e \left(\frac{\ell_e(u, v)}{L_e} - 1\right)^2 \quad \text{subject to} \quad c(u, v) = 0

    L are the flat lengths of the pairs and l their lengths on the surface [m]; w are the weights and c the constraints.
    Constraint forces act as distributed loads, see :class:`Constraints`. A step that increases the energy is halved,
    unless it reduces the violation of the constraints. After it, the steps are Gauss-Newton steps.
    """
    system, (start, stop) = equations_of(net), net.pairs.T
    scale = np.sqrt(weights)
    per_length = (scale / net.lengths)[:, None, None]
    x, best, lowest_energy, violation, use_turn_stiffness = uv, uv, np.inf, 0.0, True
    last_move = net.pitch
    for _ in range(MAX_NEWTON_STEPS):
        r = surface.derivatives(x)
        points, basis = r[0, 0], np.stack((r[1, 0], r[0, 1]), axis=1)
        normals = unit(cross(r[1, 0], r[0, 1]))
        measured, pull = pair_lengths(points, normals, net.pairs)
        strain = scale * (measured / net.lengths - 1)
        energy, violations = float(strain @ strain), constraints.violations(x, points)
        closer = violation > PARAMETER_TOLERANCE and np.abs(violations).max() < violation / 2
        if energy > MAX_ENERGY_RATIO * lowest_energy and not closer:
            x, use_turn_stiffness = (best + x) / 2, False
            continue
        best, lowest_energy, violation = (
            x,
            energy if closer else min(energy, lowest_energy),
            float(np.abs(violations).max()),
        )
        ends = np.stack((basis[start], basis[stop]), axis=1)
        strain_slopes = np.matmul(ends, pull[..., None])[..., 0] * per_length
        across = cross(np.stack((normals[start], normals[stop]), axis=1), pull)
        turn_slopes = np.matmul(ends, across[..., None])[..., 0] * per_length
        loads = np.matmul(basis, constraints.loads[..., None])[..., 0]
        rows = constraints.rows(basis)
        step = None
        if use_turn_stiffness:
            step = system.step(strain_slopes, turn_slopes, 1 - net.lengths / measured, strain, rows, violations, loads)
        if step is None:  # a compressed net buckles: its stiffness against rotation makes H indefinite
            use_turn_stiffness = False
            step = system.step(strain_slopes, turn_slopes, None, strain, rows, violations, loads)
        if step is None:
            raise InvalidPlan(
                "the placement did not converge on this surface: the surface is folded under the skin, or its "
                "curvature is too high. Fit a smoother surface, or move the skin"
            )
        x = x + step
        moved = float(np.linalg.norm(np.matmul(step[:, None], basis)[:, 0], axis=1).max())
        # Linear convergence predicts the next step from the ratio of the last two; the first ratio is to the pitch.
        if moved * min(moved / last_move, 1.0) < tolerance * net.pitch:
            break
        last_move = moved
    return x


def pair_lengths(points: Array, normals: Array, pairs: IntArray) -> tuple[Array, Array]:
    r"""Return the lengths (e,) [m] of pairs of points along a surface, and their gradients (e, 2, 3).

    The length of a pair is the arc of the cubic that has the slopes of the surface at both ends:

    .. math:: \ell = c \left(1 + \frac{2 s^2 - s t + 2 t^2}{30}\right) \quad [m]

    with the chord c [m] and its slopes s and t against the surface at the two ends [rad].
    """
    chord = points[pairs[:, 1]] - points[pairs[:, 0]]
    straight = np.linalg.norm(chord, axis=1)
    heading = chord / straight[:, None]
    sines = np.einsum("ec,ekc->ek", heading, normals[pairs])
    s, t = np.arcsin(np.clip(sines, -1, 1)).T
    length = straight * (1 + (2 * s * s - s * t + 2 * t * t) / 30)
    # The first variation of a geodesic's length: minus its tangent at the start, plus its tangent at the end.
    tangents = unit(heading[:, None] - sines[..., None] * normals[pairs])
    return length, tangents * np.array((-1.0, 1.0))[:, None]
