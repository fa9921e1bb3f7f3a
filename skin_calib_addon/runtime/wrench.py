r"""Move wrenches between points and frames.

A wrench (6,) is a force, then a moment about a named point, along the axes of a named frame [N, N m].

The ``wrench`` of a frame is about the origin of its link, along the axes of the link. With the Jacobian :math:`J` of
that origin in world axes and the rotation :math:`R` of the link, the joint torques are (thesis eq. 3.20 and 3.22, where
each wrench needs the rotation of its own link)

.. math::
    \boldsymbol{\tau} = J^T \begin{bmatrix} R & 0 \\ 0 & R \end{bmatrix} \mathbf{w} .

In code: ``tau = J.T @ turned(wrench, R)``.
"""

import math
from typing import Any

import numpy as np

from ..common.arrays import Array
from .moved import OF_WRENCH, moved
from .plane import cross


def about(wrench: Array, point: Any) -> Array:
    """Return the same wrench with its moment about another point: ``tau' = tau - point x f``.

    Parameters
    ----------
    wrench : array, shape (6,)
        About the origin of a frame [N, N m].
    point : array, shape (3,)
        In the same frame [m].
    """
    return np.concatenate((wrench[:3], wrench[3:] - cross(np.asarray(point, float), wrench[:3])))


def turned(wrench: Array, rotation: Array) -> Array:
    """Return the same wrench along the axes of another frame (thesis eq. 3.21): ``[R f; R tau]``.

    Parameters
    ----------
    wrench : array, shape (6,)
        [N, N m].
    rotation : array, shape (3, 3)
        ``R_other_frame``.
    """
    return np.concatenate((rotation @ wrench[:3], rotation @ wrench[3:]))


def carried(wrench: Array, pose: Array) -> Array:
    """Return a wrench about the origin of another frame, along the axes of that frame.

    With the rotation R and the position p of the link in the other frame::

        f' = R f        tau' = R tau + p x (R f)

    Parameters
    ----------
    wrench : array, shape (6,)
        About the origin of a link, along its axes [N, N m].
    pose : array, shape (4, 4)
        Of the link in the other frame, for example ``T_world_link``.
    """
    moved = turned(wrench, pose[:3, :3])
    return np.concatenate((moved[:3], moved[3:] + cross(pose[:3, 3], moved[:3])))


def line_of_action(wrench: Array) -> tuple[Array, float] | None:
    r"""Return the point (3,) of the line of action nearest to the origin [m], and the free moment along it [N m].

    .. math::
        \mathbf{e} = \frac{\mathbf{f} \times \boldsymbol{\tau}}{\lVert \mathbf{f} \rVert^2} , \qquad
        \tau_\parallel = \frac{\mathbf{f} \cdot \boldsymbol{\tau}}{\lVert \mathbf{f} \rVert}

    These are eq. 6 to 9 of the paper without their 0/0. The paper leaves out the moment along the force, which a real
    wrench has. None if the force is zero or not known (NaN).
    """
    force, moment = wrench[:3], wrench[3:]
    size = math.sqrt(float(force @ force))
    if not size > 0:
        return None
    direction = force / size
    return cross(direction, moment) / size, float(direction @ moment)


def __getattr__(name: str) -> Any:
    """Forward the virtual wrenches, which were here."""
    if name in OF_WRENCH:
        return moved(__name__, "skin_control.virtual", name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
