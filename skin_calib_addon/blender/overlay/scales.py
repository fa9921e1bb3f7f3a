# SPDX-License-Identifier: GPL-3.0-or-later
"""Map numbers to colours, and describe them in a legend."""

from dataclasses import dataclass

import numpy as np

# Colours from zero to the maximum, and from the minimum over zero to the maximum; both are readable in grey.
RISING = np.array(((0.27, 0.0, 0.33), (0.23, 0.32, 0.55), (0.13, 0.57, 0.55), (0.37, 0.79, 0.38), (0.99, 0.91, 0.15)))
SIGNED = np.array(((0.13, 0.25, 0.65), (0.45, 0.65, 0.9), (0.92, 0.92, 0.92), (0.95, 0.6, 0.4), (0.7, 0.09, 0.15)))
UNKNOWN = (0.2, 0.2, 0.2)  # with red-green blindness a lighter grey is one of the colours of RISING
STOPS = len(RISING)


@dataclass(frozen=True)
class Legend:
    """Meaning of the colours of a layer."""

    title: str
    kind: str  # "LENGTH" [m], "ANGLE" [rad], "FRACTION" or "FORCE" [N]
    maximum: float  # value at the end of the scale; a signed scale starts at its opposite
    signed: bool = False
    note: str = ""  # meaning of dark grey
    exceeded: bool = False  # by values beyond the end of the scale; they have its last colour

    @property
    def minimum(self) -> float:
        """Value at the start of the scale."""
        return -self.maximum if self.signed else 0.0

    @property
    def scale(self) -> np.ndarray:
        """Colours (STOPS, 3) at equal steps from the minimum to the maximum."""
        return SIGNED if self.signed else RISING

    def colours(self, values: np.ndarray) -> np.ndarray:
        """Return opaque colours (..., 4) of values (...); unknown values are dark grey."""
        known = np.isfinite(values)
        position = (np.where(known, values, 0.0) - self.minimum) / ((self.maximum - self.minimum) or 1.0) * (STOPS - 1)
        colours = np.ones((*np.shape(values), 4), np.float32)
        for k, channel in enumerate(self.scale.T):
            colours[..., k] = np.where(known, np.interp(position, np.arange(STOPS), channel), UNKNOWN[k])
        return colours


def largest_size(values: np.ndarray) -> float:
    """Return the largest absolute value; zero if no value is known."""
    return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
