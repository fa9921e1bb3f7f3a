"""Poses of taxels for Isaac Lab: the NPZ of a DEX-01 ``CustomPatternCfg``, metres."""

import io

import numpy as np

from ..model import LinkCalibration
from .link_taxels import taxels_of


def write_npz(calibration: LinkCalibration) -> bytes:
    """``poses`` (n, 3, 4), whose third column is the normal and whose last is the position, and ``taxel2pixel`` (n, 2).

    A pixel is row and column of a cell, the patches one below the other. ``channel`` and ``id`` tell the taxels.
    """
    taxels = taxels_of(calibration)
    file = io.BytesIO()
    np.savez(
        file,
        poses=np.concatenate((taxels.axes, taxels.positions[:, :, None]), axis=2),
        taxel2pixel=taxels.pixels,
        channel=taxels.channels,
        id=np.array(taxels.ids),
    )
    return file.getvalue()
