"""Write poses of taxels for Isaac Lab: the NPZ file of a DEX-01 ``CustomPatternCfg``, in metres."""

import io
from typing import Any

import numpy as np

from ..model import LinkCalibration
from .link_taxels import taxels_of


def write_npz(calibration: LinkCalibration) -> bytes:
    """Write ``poses`` (n, 3, 4) and ``taxel2pixel`` (n, 2).

    The columns of a pose are tangent, normal x tangent, normal, and position. A pixel is row and column of the cell,
    with the patches one below the other. ``channel`` and ``id`` identify the taxels. ``sigma`` (n, 3) is their standard
    uncertainty, if it is stated: along the surface [m], along the normal [m], of the normal [rad]; NaN where unknown.
    """
    taxels = taxels_of(calibration)
    file = io.BytesIO()
    arrays: dict[str, Any] = {
        "poses": np.concatenate((taxels.axes, taxels.positions[:, :, None]), axis=2),
        "taxel2pixel": taxels.pixels,
        "channel": taxels.channels,
        "id": np.array(taxels.ids),
    }
    if np.isfinite(taxels.sigma).any():
        arrays["sigma"] = taxels.sigma
    np.savez(file, **arrays)  # NumPy 1 would write an option as an array, too
    return file.getvalue()
