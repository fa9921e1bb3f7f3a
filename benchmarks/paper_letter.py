"""The paper's method by the letter: what section 3.4 of Sensors 2023, 23, 4569 says.

Of each section curve only the crossings Q_k with the v planes are fitted: one sample per control point. Nonlinear
least squares (SciPy's default) move the control points along their lines, from the crossings themselves (eq. 4). The
text does not give the parameters v_k of the crossings. Two choices suit its uniform knots: v_k = k / M ("uniform"), and
the Greville abscissae of these knots ("greville"), which are the better choice.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from paper_sections import MILLIMETRE, Array, PaperFit, Section, basis, fit_tube, on_lines
from scipy.optimize import least_squares


def fit(
    vertices: ArrayLike,
    faces: ArrayLike,
    u_planes: ArrayLike,
    v_half_planes: ArrayLike,
    degree: int = 3,
    parameters: Literal["greville", "uniform"] = "greville",
) -> PaperFit:
    """Construct the surface with one sample for each crossing.

    Parameters
    ----------
    vertices, faces, u_planes, v_half_planes, degree
        As of :func:`paper_sections.fit_tube`.
    parameters : "greville" or "uniform"
        The parameters v_k of the crossings.

    Returns
    -------
    PaperFit
    """
    if parameters not in ("greville", "uniform"):
        raise ValueError(f"unknown parameters {parameters!r}: give 'greville' or 'uniform'")

    def curve(section: Section, knots: list[float], degree: int) -> Array:
        return control_points(section, knots, degree, parameters)

    return fit_tube(vertices, faces, u_planes, v_half_planes, degree, curve)


def control_points(section: Section, knots: list[float], degree: int, parameters: str) -> Array:
    """Find the control points of one curve on their lines (eq. 4); shape (M + 1, 2), [m]."""
    count = len(section.crossings)
    v = np.linspace(0, 1, count) if parameters == "uniform" else greville(knots, degree)
    N = basis(v, knots, degree)

    def residuals(offsets_mm: Array) -> Array:
        return (section.crossings - N @ on_lines(section, offsets_mm * MILLIMETRE)).ravel() / MILLIMETRE

    return on_lines(section, least_squares(residuals, np.zeros(count - 2)).x * MILLIMETRE)


def greville(knots: list[float], degree: int) -> Array:
    """Return the mean of the ``degree`` inner knots of each control point; from 0 to 1."""
    inner = np.array([knots[k + 1 : k + degree + 1] for k in range(len(knots) - degree - 1)])
    return np.clip(inner.mean(axis=1), 0, 1)
