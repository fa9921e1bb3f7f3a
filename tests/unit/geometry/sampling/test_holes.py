"""Least squares with missing samples, against a dense solution."""

import numpy as np
import pytest

from skin_calib_addon.geometry.grid.grids import AcrossGrid, TubeGrid
from skin_calib_addon.geometry.sampling.basis import HOLE_STIFFNESS, TensorBasis, bending_matrix
from tests.shapes import Z_AXIS, cylinder


@pytest.mark.parametrize(
    "grid", [TubeGrid(14, 18, Z_AXIS, 0.004, "uniform"), AcrossGrid(11, 9, (1.0, 0.0, 0.0), spacing="uniform")]
)
@pytest.mark.parametrize(("known", "stiffness"), [(0.9, 0.0), (0.15, 0.0), (0.9, 0.3), (1.0, 0.3)])
def test_step_is_the_least_squares_solution(grid, known, stiffness):
    """A corner of the sites is known, all but a corner, or all: the dense normal equations have the same solution."""
    basis = TensorBasis.of(grid.line_grid(cylinder()), 3, 3)
    rng = np.random.default_rng(1)
    residuals = rng.standard_normal((len(basis.N), len(basis.B))) * 1e-3
    edge = int(np.sqrt(known) * len(basis.N)), int(np.sqrt(known) * len(basis.B))
    is_known = np.zeros(residuals.shape, bool)
    is_known[: edge[0], : edge[1]] = True
    offsets = rng.standard_normal((basis.N.shape[1], basis.M.shape[1])) * 1e-2
    step = basis.solve(np.where(is_known, residuals, np.nan), offsets, stiffness)
    stiffness = max(stiffness, HOLE_STIFFNESS)
    sites = np.kron(basis.N, basis.B)[is_known.ravel()]
    bend = np.kron(bending_matrix(len(offsets), False), basis.B.T @ basis.B)
    bend += np.kron(basis.N.T @ basis.N, bending_matrix(offsets.shape[1], basis.is_closed))
    matrix = sites.T @ sites + stiffness * bend
    right = sites.T @ residuals[is_known] - stiffness * bend @ offsets.ravel()
    dense = np.linalg.solve(matrix, right).reshape(offsets.shape)
    np.testing.assert_allclose(step, dense, atol=1e-6 * np.abs(dense).max())
    moved = np.abs(basis.N @ (step - dense) @ basis.B.T)[is_known].max()
    assert moved < 1e-10  # of the surface where it is sampled [m]
