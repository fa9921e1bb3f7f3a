"""Frames of a sole for tests of the control examples."""

from types import SimpleNamespace

import numpy as np


def frame_of(foothold, pressed, force=10.0):
    """What a foothold reads of a frame, with the same force on each pressed cell."""
    sets = SimpleNamespace(active=pressed, possible=pressed)
    return SimpleNamespace(
        known=np.ones(len(pressed), bool), sets=sets, load=force * pressed.sum(), forces=force * pressed
    )
