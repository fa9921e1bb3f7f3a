"""Turn readings into contacts, wrench, CoP, ZMP and supporting polygons in a controller. Needs NumPy only."""

from .batch import Batch
from .body import Body, BodyFrame
from .contacts import Contact, Message
from .footprint import SupportingPolygon
from .frame import Frame, zero_moment_point
from .geometry import GroundGeometry, SkinGeometry
from .modalities import ModalityValues
from .moved import forward
from .plane import Plane
from .polygon import Polygon, convex_hull
from .skin import Skin, load
from .tare import Tare
from .trusted import Trusted

__all__ = [
    "Batch",
    "Body",
    "BodyFrame",
    "Contact",
    "Frame",
    "GroundGeometry",
    "Message",
    "ModalityValues",
    "Plane",
    "Polygon",
    "Skin",
    "SkinGeometry",
    "SupportingPolygon",
    "Tare",
    "Trusted",
    "convex_hull",
    "load",
    "zero_moment_point",
]

forward()
