"""Chains of boards: those that their ports connect; each has one cable to the robot."""

from ..common.arrays import IntArray
from .model import LinkCalibration, TaxelArray


def chain_channels(calibration: LinkCalibration) -> list[IntArray]:
    """Return the channels of each chain of boards of a link, (n,) each; those with the lowest channel first."""
    chains = [
        patch.taxels.channels[rows]
        for patch in calibration.patches
        if patch.taxels.ports
        for rows in _connected(patch.taxels)
    ]
    return sorted(chains, key=lambda channels: int(channels.min()))


def _connected(taxels: TaxelArray) -> list[list[int]]:
    """Return the rows of the boards of each chain."""
    row = {name: k for k, name in enumerate(taxels.ids)}
    left, found = dict.fromkeys(range(len(row))), []
    while left:
        chain = [left.popitem()[0]]
        for board in chain:  # grows
            others = [row[name] for name in taxels.ports[board] if name in row]
            chain += [other for other in others if other in left]
            for other in others:
                left.pop(other, None)
        found.append(chain)
    return found
