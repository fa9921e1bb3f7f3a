"""Turn readings into contacts, wrench, CoP, ZMP and supporting polygons in a controller. Needs NumPy only."""

from .balance.polygon import Polygon, convex_hull
from .batch import Batch
from .body import Body, BodyFrame
from .contacts import Contact, Message
from .footprint import SupportingPolygon
from .frame import Frame, zero_moment_point
from .modalities import ModalityValues
from .plane import Plane
from .skin import Skin, load

__all__ = [
    "Batch",
    "Body",
    "BodyFrame",
    "Contact",
    "Frame",
    "Message",
    "ModalityValues",
    "Plane",
    "Polygon",
    "Skin",
    "SupportingPolygon",
    "convex_hull",
    "load",
    "zero_moment_point",
]
