r"""Take off the creep of soft sensors: the part of a reading that follows the load late, and stays for a time after it.

With the part :math:`x` that follows the reading :math:`u` of a short load, a sensor with creep reads

.. math::
    r = u + k\,x , \qquad \tau\,\dot x = u - x .

The constants :math:`k` and :math:`\tau` are those of the material. The load before gives :math:`x`, so that the reading
without creep is :math:`u = r - k\,x`. Readings are relative to those without contact.
"""

import math

import numpy as np

from ..common.arrays import Array


class Creep:
    """Creep of the taxels of a skin, from the readings so far.

    Parameters
    ----------
    n : int
        Number of taxels.
    fraction : float
        Rise k of a reading under a constant load, relative to its first value.
    time : float
        Time constant of the rise [s].
    """

    def __init__(self, n: int, fraction: float, time: float):
        if not (0 <= fraction < math.inf and 0 < time < math.inf):
            raise ValueError(f"creep ({fraction}, {time}) must be a fraction of at least 0 and a time above 0 s")
        self._fraction, self._time = fraction, time
        self.part = np.zeros(n)  # of the signed readings
        self.restart()

    def restart(self) -> None:
        """Forget the readings so far."""
        self.part = np.zeros(len(self.part))
        self._last = math.nan  # time of the last frame [s]

    def add(self, reading: Array, time: float) -> None:
        """Add a frame.

        Parameters
        ----------
        reading : array, shape (n,)
            Signed readings without creep, relative to those without contact; NaN where a taxel has none.
        time : float
            Of the frame [s].
        """
        if not math.isfinite(time):
            return
        gap, self._last = time - self._last, time
        if gap > 0:
            change = -math.expm1(-gap / self._time) * (self._fraction * reading - self.part)
            self.part = self.part + np.where(np.isfinite(change), change, 0.0)
