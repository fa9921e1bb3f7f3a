"""What a controller loads: readings in, contacts out. NumPy and the standard library only."""

from .contacts import Contact, Frame
from .skin import Skin, load

__all__ = ["Contact", "Frame", "Skin", "load"]
