"""A reference of the ZMP that is linear between points in time, and its DCM."""

from dataclasses import dataclass

import numpy as np

Array = np.ndarray


@dataclass(frozen=True)
class Reference:
    """What the plan wants at one time."""

    zmp: Array  # (2,) [m]
    dcm: Array  # (2,) [m]


class ZmpPlan:
    r"""A ZMP that is linear in each section, and the DCM that ends at its last point.

    In a section in which the ZMP moves with the velocity :math:`v`, the solution of
    :math:`\dot\xi = \omega (\xi - p)` (thesis eq. 4.12) is

    .. math::
        \xi(t) = p(t) + \frac{v}{\omega} + e^{\omega (t - T)} \left( \xi(T) - p(T) - \frac{v}{\omega} \right)

    Its values at the ends of the sections follow backwards from the last one. For a ZMP that is constant in each
    section these are the DCM waypoints of the corrected thesis eq. 4.14.

    Parameters
    ----------
    times : sequence of float
        Of the points [s], increasing.
    points : array, shape (n, 2)
        ZMP at these times [m].
    omega : float
        Of the pendulum [1/s].
    """

    def __init__(self, times, points, omega: float):
        self.times, self.points, self.omega = np.asarray(times, float), np.asarray(points, float), omega
        spans = np.diff(self.times)
        self.velocities = np.diff(self.points, axis=0) / spans[:, None]
        self.ends = np.empty_like(self.points)  # DCM at the times
        self.ends[-1] = self.points[-1]
        for k in range(len(spans) - 1, -1, -1):
            lead = self.velocities[k] / omega
            self.ends[k] = self.points[k] + lead
            self.ends[k] += np.exp(-omega * spans[k]) * (self.ends[k + 1] - self.points[k + 1] - lead)

    def at(self, time: float) -> Reference:
        """Return the reference at a time; after the end it stays at the last point."""
        if time >= self.times[-1]:
            return Reference(self.points[-1], self.ends[-1])
        k = max(int(np.searchsorted(self.times, time, side="right")) - 1, 0)
        zmp = self.points[k] + self.velocities[k] * (time - self.times[k])
        lead = self.velocities[k] / self.omega
        left = np.exp(self.omega * (time - self.times[k + 1]))
        return Reference(zmp, zmp + lead + left * (self.ends[k + 1] - self.points[k + 1] - lead))
