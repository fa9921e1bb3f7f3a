"""Contacts in one frame of readings: connected active taxels, and the force they feel."""

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, BoolArray, IntArray, unit


@dataclass(frozen=True, eq=False)
class Contact:
    """Active taxels that touch each other, and what presses on them; link frame and SI units."""

    taxels: IntArray  # rows in the skin's arrays, ascending
    ids: tuple[str, ...]
    position: Array  # (3,) force-weighted mean of the taxels [m]
    normal: Array  # (3,) force-weighted mean of the outward normals, unit
    force: float  # sum over the taxels [N]
    area: float  # of the taxels [m^2]
    wrench: Array  # (6,) force and moment about the link's origin that the contact applies to the robot [N, N m]


@dataclass(frozen=True, eq=False)
class Frame:
    """What the skin feels at one time."""

    time: float  # [s]
    forces: Array  # (n,) on each taxel [N]; 0 where the reading is not a number
    contacts: tuple[Contact, ...]
    wrench: Array  # (6,) of all contacts about the link's origin [N, N m]
    flags: frozenset[str]  # doubts: "not_finite" when a reading is no number


def components(active: BoolArray, pairs: IntArray) -> list[IntArray]:
    """Rows of the active taxels, split into groups that hang together over neighbouring ``pairs`` (e, 2).

    Each group is named by its lowest row; names spread over the pairs, and jump to the name of their name, until
    none changes.
    """
    pairs = pairs[active[pairs].all(axis=1)]
    name = np.arange(len(active))
    while True:
        spread = name.copy()
        np.minimum.at(spread, pairs[:, 0], name[pairs[:, 1]])
        np.minimum.at(spread, pairs[:, 1], name[pairs[:, 0]])
        spread = spread[spread]
        if (spread == name).all():
            break
        name = spread
    rows = np.flatnonzero(active)
    return [rows[name[rows] == first] for first in np.unique(name[rows])]


def wrench_of(forces: Array, positions: Array, normals: Array) -> Array:
    """Wrench that presses of ``forces`` newtons apply to the robot: sum of [F; p x F], F = -f n (thesis 3.16-3.18).

    Returns
    -------
    array, shape (6,)
        Force, then moment about the origin of the link.
    """
    pressed = -forces[:, None] * normals
    return np.concatenate((pressed.sum(axis=0), np.cross(positions, pressed).sum(axis=0)))


def contact_of(rows: IntArray, ids: tuple[str, ...], forces: Array, geometry: tuple[Array, Array, Array]) -> Contact:
    """The contact on some rows of the skin; ``geometry`` is the skin's positions, normals and areas."""
    positions, normals, areas = (a[rows] for a in geometry)
    f = forces[rows]
    return Contact(
        taxels=rows,
        ids=tuple(ids[i] for i in rows),
        position=f @ positions / f.sum(),
        normal=unit(f @ normals),
        force=float(f.sum()),
        area=float(areas.sum()),
        wrench=wrench_of(f, positions, normals),
    )
