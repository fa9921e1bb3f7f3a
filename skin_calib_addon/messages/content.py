"""Fill messages from a calibration, a reading and a frame; read the numbers of a reading."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..calibration.model import LinkCalibration
from ..common.arrays import Array
from ..common.errors import InvalidReading
from ..runtime import Frame, Skin
from ..runtime.contacts import Contact
from ..runtime.modalities import FORCE
from ..runtime.polygon import Polygon

LAYOUT_VERSION = 1  # Contract
SECONDS = range(-(2**31), 2**31)  # Derived: of builtin_interfaces/Time
NO_POINT, NO_WRENCH, NO_VECTOR = np.full(2, np.nan), np.full(6, np.nan), np.zeros(3)
Message = dict[str, Any]


def nanoseconds(time: float) -> int:
    """Return a time [s] in nanoseconds.

    Raises
    ------
    InvalidReading
        If messages cannot have this time.
    """
    if not math.isfinite(time) or math.floor(time) not in SECONDS:
        raise InvalidReading(f"a message cannot have the time {time:g} s; give a finite time in seconds", "wrong_type")
    whole = math.floor(time)
    return whole * 10**9 + round((time - whole) * 1e9)  # time * 1e9 would round to 256 ns in the present century


def seconds(stamp: Mapping[str, int]) -> float:
    """Return the time [s] of a stamp: that of `nanoseconds` for times with up to nine decimals."""
    return (stamp["sec"] * 10**9 + stamp["nanosec"]) / 10**9  # of integers: correctly rounded


def header(link: str, time: float) -> Message:
    """Return the header of a message of a link at a time [s]."""
    sec, nanosec = divmod(nanoseconds(time), 10**9)
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": link}


def layout_message(calibration: LinkCalibration, skin: Skin, time: float = 0.0, is_virtual: bool = False) -> Message:
    """Return a ``TaxelLayout`` of a skin of this calibration."""
    plane = None if skin.ground is None else skin.ground.plane
    taxels = [patch.taxels for patch in calibration.patches]
    sigma = np.concatenate([np.empty((0, 3)), *(t.known_sigma for t in taxels)])
    return {
        "header": header(skin.link, time),
        "version": LAYOUT_VERSION,
        "calibration": skin.checksum,
        "is_virtual": is_virtual,
        "ids": skin.ids,
        "channels": skin.channels,
        "positions": skin.positions,
        "normals": skin.normals,
        "tangents": np.concatenate([np.empty((0, 3)), *(t.tangents_link for t in taxels)]),
        "areas": skin.areas,
        "sigma_along": sigma[:, 0],
        "sigma_normal": sigma[:, 1],
        "sigma_angle": sigma[:, 2],
        "thresholds": skin.thresholds,
        "has_ground": plane is not None,
        "ground_origin": NO_VECTOR if plane is None else plane.origin,
        "ground_x": NO_VECTOR if plane is None else plane.axes[0],
        "ground_z": NO_VECTOR if plane is None else plane.axes[2],
    }


def reading_message(
    link: str, reading: Array, time: float, cycle: int, lost: int = 0, calibration: str = "", quantity: str = FORCE
) -> Message:
    """Return a ``SkinReading`` of a reading (channels,) of any real data type; whole numbers stay whole."""
    reading = np.asarray(reading)
    limits = np.iinfo(np.int32)
    is_whole = reading.dtype.kind in "ui" and bool(((reading >= limits.min) & (reading <= limits.max)).all())
    return {
        "header": header(link, time),
        "cycle": cycle,
        "lost": lost,
        "calibration": calibration,
        "quantity": quantity,
        "counts": reading.astype(np.int32) if is_whole else (),
        "values": () if is_whole else reading.astype(float),
    }


def reading_of(message: Mapping[str, Any]) -> tuple[float, Array]:
    """Return time [s] and reading (channels,) of a ``SkinReading``."""
    counts, values = message["counts"], message["values"]
    return seconds(message["header"]["stamp"]), counts if len(counts) else values


def frame_message(
    link: str, frame: Frame, cycle: int, lost: int = 0, calibration: str = "", with_forces: bool = True
) -> Message:
    """Return a ``SkinFrame``."""
    trusted, polygon = frame.trusted, frame.polygon
    return {
        "header": header(link, frame.time),
        "cycle": cycle,
        "lost": lost,
        "calibration": calibration,
        "trusted": bool(trusted),
        "trusted_touched": trusted.touched,
        "trusted_wrench": trusted.wrench,
        "trusted_point": trusted.point,
        "trusted_guaranteed": trusted.guaranteed,
        "flags": sorted(frame.flags),
        "problem": frame.problem or "",
        "touched": bool(frame.touched),
        "touched_known": frame.touched is not None,
        "contacts": [_contact(contact) for contact in frame.contacts],
        "wrench": frame.wrench,
        "wrench_sigma": _or(frame.wrench_sigma, NO_WRENCH),
        "stands": frame.stands,
        "reason": frame.reason or "",
        "load": frame.load,
        "load_sigma": _or(frame.load_sigma, math.nan),
        "cop": _or(frame.cop, NO_POINT),
        "cop_sigma": _or(frame.cop_sigma, NO_POINT),
        "zmp": _or(frame.zmp, NO_POINT),
        "zmp_sigma": _or(frame.zmp_sigma, NO_POINT),
        "outer": _polygon(polygon.outer, polygon.outer_probability),
        "nominal": _polygon(polygon.nominal, None),
        "guaranteed": _polygon(polygon.guaranteed, polygon.guaranteed_probability),
        "forces": np.where(frame.known, frame.forces, np.nan) if with_forces else (),
        "quantities": [
            {"name": name, "unit": m.unit, "values": m.values} for name, m in frame.modalities.items() if not m.problem
        ],
    }


def _contact(contact: Contact) -> Message:
    return {
        "number": contact.number,
        "taxels": contact.taxels,
        "force": contact.force,
        "area": contact.area,
        "peak_pressure": contact.peak_pressure,
        "position": contact.position,
        "normal": contact.normal,
        "wrench": contact.wrench,
    }


def _polygon(polygon: Polygon, probability: float | None) -> Message:
    x, y = polygon.corners.T
    return {"x": x, "y": y, "probability": _or(probability, math.nan)}


def _or(value: Any, unknown: Any) -> Any:
    return unknown if value is None else value
