"""Write poses of taxels for Isaac Lab: the NPZ file of a DEX-01 ``CustomPatternCfg``, in metres."""

import io

import numpy as np

from ..model import LinkCalibration
from .link_taxels import taxels_of


def write_npz(calibration: LinkCalibration) -> bytes:
    """Write ``poses`` (n, 3, 4) and ``taxel2pixel`` (n, 2).

    The columns of a pose are tangent, normal x tangent, normal, and position. A pixel is row and column of the cell,
    with the patches one below the other. ``channel`` and ``id`` identify the taxels.
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
