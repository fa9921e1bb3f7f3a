"""Several links, or two feet, felt as one: poses in, the wrench, ZMP and supporting polygon of all out."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..common.arrays import Array, BoolArray
from ..common.errors import UnknownLink
from .balance.polygon import NOTHING, Polygon, convex_hull
from .footprint import SupportingPolygon
from .frame import LEAST_LOAD, Frame, zero_moment_point
from .plane import Plane
from .skin import Skin
from .wrench import carried

# Feet whose soles are this much apart in height [m], or tilted to the ground, stand on no common plane.
STEP, TILT = 0.005, np.cos(np.radians(3.0))


@dataclass(frozen=True, eq=False)
class BodyFrame:
    """What several links feel at one time, in the world's frame; the ground's coordinates for what lies on it.

    ``flags`` are those of the links as ``"name:flag"``, and of the body: ``no_reading`` and ``no_pose`` as
    ``"name:..."`` for links of which nothing came, and ``not_coplanar`` where feet stand at different heights or
    tilted to the ground: the true region of the ZMP is then not the hull of their polygons.
    """

    links: dict[str, Frame]
    poses: dict[str, Array]  # (4, 4) T_world_link of the links that gave a frame
    ground: Plane  # in the world's frame
    flags: frozenset[str]

    @cached_property
    def wrench(self) -> Array:
        """(6,) of all links about the world's origin, along its axes [N, N m]; NaN where a link's is not known."""
        return self._total(self.links)

    @cached_property
    def standing(self) -> tuple[str, ...]:
        """Links that carry a load worth a CoP: the feet on the ground."""
        return tuple(name for name, frame in self.links.items() if frame.reason is None)

    @property
    def reason(self) -> str | None:
        """Why there is no ZMP, in words; None where there is one."""
        if not self.standing:
            return f"no link is pressed by the {LEAST_LOAD:g} N that a ZMP needs"
        return None

    @cached_property
    def zmp(self) -> Array | None:
        """Zero moment point (2,) of all standing links in the ground's coordinates [m] (thesis 4.7, 4.8, corrected).

        From the whole wrench, so that feet at different heights count rightly; taxels feel no shear, which on a step of
        100 mm costs up to 9 mm: ``not_coplanar`` says so. None with a :attr:`reason`.
        """
        if self.reason is not None:
            return None
        return zero_moment_point(self.ground.wrench(self._total(self.standing)))

    @cached_property
    def cop(self) -> Array | None:
        """Mean (2,) of the standing feet's CoPs on the ground, weighted by their loads [m]; None with a reason."""
        if self.reason is not None:
            return None
        loads = np.array([self.links[name].load for name in self.standing])
        return (
            loads @ np.stack([self._on_ground(name, self.links[name].cop)[0] for name in self.standing]) / loads.sum()
        )

    @cached_property
    def polygon(self) -> SupportingPolygon:
        """Hulls of the standing feet's outer, nominal and guaranteed polygons (thesis 4.25), on the ground."""
        feet = [(name, self.links[name].polygon) for name in self.standing]
        return SupportingPolygon(
            *(self._joined({n: getattr(p, k) for n, p in feet}) for k in ("outer", "nominal", "guaranteed"))
        )

    def _total(self, names: Iterable[str]) -> Array:
        return sum((carried(self.links[name].wrench, self.poses[name]) for name in names), np.zeros(6))

    def _joined(self, polygons: dict[str, Polygon]) -> Polygon:
        corners = [self._on_ground(name, polygon.corners) for name, polygon in polygons.items() if len(polygon.corners)]
        return convex_hull(np.concatenate(corners)) if corners else NOTHING

    def _on_ground(self, name: str, points: Any) -> Array:
        """Points (k, 2) in a foot's own ground coordinates, projected on the common ground (k, 2)."""
        foot, pose = self.links[name].ground, self.poses[name]
        assert foot is not None
        spatial = foot.plane.spatial(np.atleast_2d(points)) @ pose[:3, :3].T + pose[:3, 3]
        return self.ground.flat(spatial)


def _pose(given: Any) -> Array | None:
    """A pose (4, 4) of finite numbers, or none."""
    try:
        pose = np.asarray(given, float)
    except (TypeError, ValueError):
        return None
    return pose if pose.shape == (4, 4) and np.isfinite(pose).all() else None


class Body:
    """The skins of several links of one robot.

    Parameters
    ----------
    skins : mapping of str to Skin
        By the names that readings and poses come with.
    ground : Plane, optional
        In the world's frame; by default the plane z = 0, whose coordinates are the world's x and y.
    """

    def __init__(self, skins: Mapping[str, Skin], ground: Plane | None = None):
        self.skins = dict(skins)
        self.ground = ground or Plane.through((0, 0, 0), (0, 0, 1))

    @property
    def observable(self) -> BoolArray:
        """(6,) which components of a wrench some link can feel, each along the axes of its own link."""
        return np.any([np.zeros(6, bool), *(skin.observable for skin in self.skins.values())], axis=0)

    def update(self, readings: Mapping[str, Any], time: float, poses: Mapping[str, Any]) -> BodyFrame:
        """What all links feel in one cycle; no reading raises an error.

        Parameters
        ----------
        readings : mapping of str to array
            By link; a link without is left out and flagged.
        time : float
            [s].
        poses : mapping of str to array, shape (4, 4)
            ``T_world_link`` of each link, from the forward kinematics; a link without a finite one is left out.

        Raises
        ------
        UnknownLink
            If readings come for a link that has no skin here: a mistake of the program, not of a sensor.
        """
        for name in (*readings, *poses):
            if name not in self.skins:
                raise UnknownLink(f"no link {name!r} in this body; it has {sorted(self.skins)}")
        links, placed, flags = {}, {}, set()
        for name, skin in self.skins.items():
            if name not in readings:
                flags.add(f"{name}:no_reading")
                continue
            frame = skin.update(readings[name], time)
            flags.update(f"{name}:{flag}" for flag in frame.flags)
            pose = _pose(poses.get(name))
            if pose is None:
                flags.add(f"{name}:no_pose")
                continue
            links[name], placed[name] = frame, pose
        if self._apart(links, placed):
            flags.add("not_coplanar")
        return BodyFrame(links, placed, self.ground, frozenset(flags))

    def _apart(self, links: dict[str, Frame], poses: dict[str, Array]) -> bool:
        """Whether the feet that stand do so at different heights, or tilted to the ground."""
        heights = []
        for name, frame in links.items():
            if frame.reason is not None or frame.ground is None:
                continue
            plane, pose = frame.ground.plane, poses[name]
            heights.append(float(self.ground.heights(pose[:3, :3] @ plane.origin + pose[:3, 3])))
            if pose[:3, :3] @ plane.axes[2] @ self.ground.axes[2] < TILT:
                return True
        return bool(heights) and max(heights) - min(heights) > STEP
