"""The paper's method, strengthened: the best that we found within Algorithm 1 of Sensors 2023, 23, 4569.

Where the text leaves a choice open, this takes the best one for the paper. It fits dense samples of each section, not
only its crossings. The parameter of a sample is that of the curve at the sample's angle. One linear least-squares solve
per curve replaces nonlinear least squares: with fixed parameters the problem is linear in the offsets.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from paper_sections import MILLIMETRE, Array, PaperFit, Section, basis, fit_tube, on_lines
from scipy.optimize import least_squares

POINTS_PER_SPAN = 20  # a curve is a polygon this fine where samples are matched to it: 1 um off it on a wrist


def fit(
    vertices: ArrayLike,
    faces: ArrayLike,
    u_planes: ArrayLike,
    v_half_planes: ArrayLike,
    degree: int = 3,
    solver: Literal["linear", "nlls"] = "linear",
) -> PaperFit:
    """Construct the surface from dense samples of each section.

    Parameters
    ----------
    vertices, faces, u_planes, v_half_planes, degree
        As of :func:`paper_sections.fit_tube`.
    solver : "linear" or "nlls"
        One least-squares solve per curve with the parameters of the curve through the crossings as control points; or
        from its result SciPy's nonlinear least squares (its defaults: derivatives by differences) with the parameters
        chosen again at every evaluation.

    Returns
    -------
    PaperFit
    """
    if solver not in ("linear", "nlls"):
        raise ValueError(f"unknown solver {solver!r}: give 'linear' or 'nlls'")
    spans = len(np.asarray(v_half_planes)) + 1 - degree
    fine = np.linspace(0, 1, POINTS_PER_SPAN * spans + 1)
    fine_basis = None

    def curve(section: Section, knots: list[float], degree: int) -> Array:
        nonlocal fine_basis
        if fine_basis is None:  # all curves have the same knots
            fine_basis = basis(fine, knots, degree)
        return control_points(section, knots, degree, fine, fine_basis, solver)

    return fit_tube(vertices, faces, u_planes, v_half_planes, degree, curve)


def control_points(
    section: Section, knots: list[float], degree: int, fine: Array, fine_basis: Array, solver: str
) -> Array:
    """Find the control points of one curve on their lines (eq. 4); shape (M + 1, 2), [m]."""
    Q, L, samples = section.crossings, section.directions, section.samples
    N = basis(at_angles(samples, fine_basis @ Q, fine[:, None])[:, 0], knots, degree)
    A = np.concatenate([N[:, 1:-1] * x for x in L[1:-1].T])
    offsets = np.linalg.lstsq(A, (samples - N @ Q).T.ravel(), rcond=None)[0]
    if solver == "linear":
        return on_lines(section, offsets)

    def residuals(offsets_mm: Array) -> Array:
        polygon = fine_basis @ on_lines(section, offsets_mm * MILLIMETRE)
        return (samples - at_angles(samples, polygon, polygon)).ravel() / MILLIMETRE

    return on_lines(section, least_squares(residuals, offsets / MILLIMETRE).x * MILLIMETRE)


def at_angles(samples: Array, curve: Array, values: Array) -> Array:
    """Read values (k, c) given along a curve where it has each sample's angle; both start on Q_0."""
    seen, known = (np.unwrap(np.arctan2(y, x)) for x, y in (samples.T, curve.T))
    return np.column_stack([np.interp(seen - seen[0], known - known[0], x) for x in values.T])
