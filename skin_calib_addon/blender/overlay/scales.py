# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours that stand for numbers, and what a legend says of them."""

from dataclasses import dataclass

import numpy as np

# From nothing to the most, and from the least over zero to the most; each reads in grey as well.
RISING = np.array(((0.27, 0.0, 0.33), (0.23, 0.32, 0.55), (0.13, 0.57, 0.55), (0.37, 0.79, 0.38), (0.99, 0.91, 0.15)))
SIGNED = np.array(((0.13, 0.25, 0.65), (0.45, 0.65, 0.9), (0.92, 0.92, 0.92), (0.95, 0.6, 0.4), (0.7, 0.09, 0.15)))
UNKNOWN = (0.5, 0.5, 0.5)
STOPS = len(RISING)


@dataclass(frozen=True)
class Legend:
    """What the colours of a layer stand for."""

    title: str
    kind: str  # "LENGTH" [m], "ANGLE" [rad], "SHARE" or "FORCE" [N]
    most: float  # at the end of the scale; signed ones begin at its opposite
    signed: bool = False
    note: str = ""  # what is grey, or why all of it is

    @property
    def least(self) -> float:
        """At the beginning of the scale."""
        return -self.most if self.signed else 0.0

    @property
    def scale(self) -> np.ndarray:
        """Colours (STOPS, 3) at even steps from the least to the most."""
        return SIGNED if self.signed else RISING

    def colours(self, values: np.ndarray) -> np.ndarray:
        """Colours (..., 4) of values (...), opaque; those that are not known are grey."""
        known = np.isfinite(values)
        place = (np.where(known, values, 0.0) - self.least) / ((self.most - self.least) or 1.0) * (STOPS - 1)
        colours = np.ones((*np.shape(values), 4), np.float32)
        for k, channel in enumerate(self.scale.T):
            colours[..., k] = np.where(known, np.interp(place, np.arange(STOPS), channel), UNKNOWN[k])
        return colours


def most_of(values: np.ndarray) -> float:
    """The largest size among the values that are known; zero where none is."""
    return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
