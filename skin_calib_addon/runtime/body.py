"""Combine several links, or two feet: poses in; wrench, ZMP and supporting polygon of all of them out."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..common.arrays import Array, BoolArray, lock, locked
from ..common.errors import UnknownLink
from .footprint import NO_POLYGON, SupportingPolygon
from .frame import MIN_LOAD, Frame, zero_moment_point
from .plane import Plane
from .polygon import EMPTY_POLYGON, Polygon, convex_hull
from .poses import checked_pose
from .skin import Skin
from .trusted import Trusted, trusted_together
from .wrench import carried

if TYPE_CHECKING:
    from ..common.warnings import Warning

# [m] Difference in height of two soles from which on they stand on different planes. Larger: small steps are not
# reported, and the hull of the polygons is wrong by more.
MAX_HEIGHT_DIFFERENCE = 0.005
# [rad] Angle between a sole and the ground from which on they are different planes. Larger: as above, for tilts.
MAX_TILT = np.radians(3.0)


@dataclass(frozen=True, eq=False)
class BodyFrame:
    """The state of several skins at one time, in the world frame; points on the ground have its coordinates.

    ``flags`` has the flags of the links as ``"name:flag"``, and those of the body. ``"name:no_reading"`` and
    ``"name:no_pose"``: the link has no reading, or no finite pose. ``"name:wrong_pose"``: its pose is no rigid motion.
    ``not_coplanar``: feet stand at different heights or are tilted to the ground. The true region of the ZMP is then
    not the hull of their polygons.

    A link whose contact is not known may carry any load. Then the wrench is None. If this link has a ground, ZMP, CoP
    and polygon are None, too: the other feet alone would give wrong ones. ``reason`` names the link.

    Its arrays and mappings are read-only.
    """

    links: Mapping[str, Frame]
    poses: Mapping[str, Array]  # (4, 4) T_world_link of the links that have a frame
    ground: Plane  # in the world frame
    flags: frozenset[str]
    lost: Mapping[str, str] = field(default_factory=dict)  # links whose contact is not known: why
    lost_feet: frozenset[str] = frozenset()  # those that may stand

    def __post_init__(self) -> None:
        lock(*self.poses.values())
        for name in ("links", "poses", "lost"):
            object.__setattr__(self, name, MappingProxyType(getattr(self, name)))

    @cached_property
    def trusted(self) -> Trusted:
        """Which statements hold of all links together: its point and polygon are those of the links with a ground.

        Feet that are not coplanar take ``guaranteed`` away, and a link whose contact is not known all but that, or that
        too if it may stand.
        """
        each = {name: frame.trusted for name, frame in self.links.items()}
        links = trusted_together(each)
        feet = trusted_together({n: t for n, t in each.items() if self.links[n].ground is not None})
        is_known, is_flat = not self.lost_feet, "not_coplanar" not in self.flags
        why = {*links.why, *(() if is_flat else ("not_coplanar",)), *self.lost}
        return Trusted(
            links.touched and not self.lost,
            links.wrench and not self.lost,
            feet.point and is_known,
            feet.guaranteed and is_known and is_flat,
            tuple(sorted(why)),
        )

    @cached_property
    def wrench(self) -> Array | None:
        """Wrench (6,) of all links about the origin of the world, along its axes [N, N m]; None if one is unknown."""
        return None if self.lost else locked(self._total(self.links))

    @cached_property
    def standing(self) -> tuple[str, ...]:
        """Names of the links that carry enough load for a CoP: the feet on the ground."""
        return tuple(name for name, frame in self.links.items() if frame.reason is None)

    @property
    def reason(self) -> str | None:
        """Why there is no ZMP, as a sentence; None if there is one."""
        if self.lost_feet:
            name = min(self.lost_feet)
            return f"{name!r} may stand, but its contact is not known: {self.lost[name]}"
        if not self.standing:
            frames = [frame for frame in self.links.values() if frame.ground is not None]
            if frames and all(frame.sets is not None and frame.sets.stands is False for frame in frames):
                return "no link carries a load that differs from its noise, which a ZMP needs"
            return f"no link carries a load of {MIN_LOAD:g} N, which a ZMP needs"
        return None

    @cached_property
    def zmp(self) -> Array | None:
        """Zero moment point (2,) of all standing links, on the ground [m] (thesis eq. 4.7 and 4.8, corrected).

        It is :func:`.zero_moment_point` of the sum of the wrenches of the standing links, in the coordinates of the
        ground. It is therefore correct for feet at different heights. Taxels do not measure lateral forces: on a step
        of 100 mm this costs up to 9 mm, and the frame has the flag ``not_coplanar``. None with a :attr:`reason`.
        """
        if self.reason is not None:
            return None
        point = zero_moment_point(self.ground.wrench(self._total(self.standing)))
        return None if point is None else locked(point)

    @cached_property
    def cop(self) -> Array | None:
        """Mean (2,) of the CoPs of the standing feet on the ground, weighted by their loads [m]; None with a reason."""
        if self.reason is not None:
            return None
        loads = np.array([self.links[name].load for name in self.standing])
        points = np.stack([self._on_ground(name, self.links[name].cop)[0] for name in self.standing])
        return locked(loads @ points / loads.sum())

    @cached_property
    def zmp_sigma(self) -> Array | None:
        """Standard deviations (2,) of the ZMP along the axes of the ground [m]; None if they are not known."""
        return self._sigma(self.zmp, "zmp")

    @cached_property
    def cop_sigma(self) -> Array | None:
        """Standard deviations (2,) of the CoP along the axes of the ground [m]; None if they are not known."""
        return self._sigma(self.cop, "cop")

    def _sigma(self, point: Array | None, name: str) -> Array | None:
        """Return the standard deviations (2,) of the mean of points of the feet, weighted by their loads.

        Each foot adds that of its point, and the distance of its point times that of its load. A foot that does not
        stand may carry a load that its noise hides, at its middle.
        """
        if point is None:
            return None
        feet = [(self.links[link], link) for link in self.standing]
        total, variance = sum(foot.load for foot, _ in feet), np.zeros(2)
        for foot, link in feet:
            own, spread, load_sigma = getattr(foot, name), getattr(foot, f"{name}_sigma"), foot.load_sigma
            if own is None or spread is None or load_sigma is None or foot.ground is None:
                return None
            axes = self.ground.axes[:2] @ self.poses[link][:3, :3] @ foot.ground.plane.axes[:2].T
            apart = self._on_ground(link, own)[0] - point
            variance += (axes**2 @ spread**2) * (foot.load / total) ** 2 + (apart * load_sigma / total) ** 2
        for link, foot in self.links.items():
            if foot.ground is not None and foot.reason is not None and foot.load_sigma:
                apart = self._on_ground(link, foot.ground.middle)[0] - point
                variance += (apart * foot.load_sigma / total) ** 2
        return locked(np.sqrt(variance))

    @cached_property
    def polygon(self) -> SupportingPolygon | None:
        """Hulls of the outer, nominal and guaranteed polygons of the standing feet (thesis eq. 4.25), on the ground.

        None if the contact of a foot is not known. The probabilities are those that all feet are right.
        """
        if self.lost_feet:
            return None
        feet = {name: self.links[name].polygon for name in self.standing}
        if not feet:
            return NO_POLYGON
        outer, nominal, guaranteed = (
            self._joined({n: getattr(p, kind) for n, p in feet.items()}) for kind in ("outer", "nominal", "guaranteed")
        )
        return SupportingPolygon(
            outer,
            nominal,
            guaranteed,
            _all_right(p.outer_probability for p in feet.values()),
            _all_right(p.guaranteed_probability for p in feet.values()),
        )

    def _total(self, names: Iterable[str]) -> Array:
        return sum((carried(self.links[name].wrench, self.poses[name]) for name in names), np.zeros(6))

    def _joined(self, polygons: dict[str, Polygon]) -> Polygon:
        corners = [self._on_ground(name, polygon.corners) for name, polygon in polygons.items() if len(polygon.corners)]
        return convex_hull(np.concatenate(corners)) if corners else EMPTY_POLYGON

    def _on_ground(self, name: str, points: Any) -> Array:
        """Return points (k, 2) in the ground coordinates of a foot, projected on the common ground (k, 2)."""
        foot, pose = self.links[name].ground, self.poses[name]
        assert foot is not None
        spatial = foot.plane.spatial(np.atleast_2d(points)) @ pose[:3, :3].T + pose[:3, 3]
        return self.ground.flat(spatial)


def _all_right(probabilities: Iterable[float | None]) -> float | None:
    """Return the smallest probability that several statements hold together; None if one is not known."""
    wrong = 0.0
    for probability in probabilities:
        if probability is None:
            return None
        wrong += 1 - probability
    return max(0.0, 1 - wrong)


class Body:
    """The skins of several links of one robot.

    Parameters
    ----------
    skins : mapping of str to Skin
        The keys are the link names of readings and poses.
    ground : Plane, optional
        In the world frame. Default: the plane z = 0, with the x and y axes of the world.
    """

    def __init__(self, skins: Mapping[str, Skin], ground: Plane | None = None):
        self.skins = dict(skins)
        self.ground = ground or Plane.through((0, 0, 0), (0, 0, 1))
        self.warnings: tuple[Warning, ...] = ()

    @classmethod
    def load(cls, path: str | Path, ground: Plane | None = None, noise: str | Path | None = None) -> "Body":
        """Return the skins of all links of a robot.

        Its ``warnings`` are about the links together: a calibration in the folder that ``robot.json`` does not list,
        which has no skin in the body, or channels and ids of two links. Those of one link are in its skin.

        Parameters
        ----------
        path : path
            Of ``robot.json``, which ``skin-calib fit`` writes, or of its folder.
        ground : Plane, optional
            As for :class:`Body`.
        noise : path, optional
            Of a folder with ``LINK.noise.json``, see :meth:`.Skin.load_noise`. A link without a file learns its noise.

        Raises
        ------
        CalibrationFormatError
            If the file or a calibration is missing, not valid or changed; ``findings`` has every problem.
        """
        from ..calibration.robot_set import load_links  # imported late: only a caller with a file needs these modules

        calibrations, warnings = load_links(path)
        body = cls({name: Skin(calibration) for name, calibration in calibrations.items()}, ground)
        body.warnings = warnings
        if noise is not None:
            for name, skin in body.skins.items():
                if (file := Path(noise, f"{name}.noise.json")).exists():
                    skin.load_noise(file)
        return body

    @property
    def observable(self) -> BoolArray:
        """Which components (6,) of a wrench at least one link observes, each along the axes of its own link."""
        return np.any([np.zeros(6, bool), *(skin.observable for skin in self.skins.values())], axis=0)

    def update(self, readings: Mapping[str, Any] | None, time: float, poses: Mapping[str, Any] | None) -> BodyFrame:
        """Return the frame of all links in one cycle. A wrong reading raises no error.

        Parameters
        ----------
        readings : mapping of str to array, or to a mapping of modalities
            By link, as for :meth:`.Skin.update`; a link without a reading is flagged, and its contact is not known.
            None: no link has one.
        time : float
            Of the readings [s].
        poses : mapping of str to array, shape (4, 4)
            ``T_world_link`` of each link from the forward kinematics; :mod:`.poses` makes them from those of other
            libraries. The contact of a link is not known without a rigid one, unless the link is free. None: no link
            has one.

        Raises
        ------
        UnknownLink
            If readings or poses have a link without a skin. This is an error of the program, not of a sensor.
        """
        readings, poses = readings or {}, poses or {}
        for name in (*readings, *poses):
            if name not in self.skins:
                raise UnknownLink(f"no link {name!r} in this body; it has {sorted(self.skins)}")
        links, link_poses, flags, lost = {}, {}, set(), {}
        for name, skin in self.skins.items():
            if name not in readings:
                flags.add(f"{name}:no_reading")
                lost[name] = "it has no reading"
                continue
            frame = skin.update(readings[name], time)
            flags.update(f"{name}:{flag}" for flag in frame.flags)
            pose, problem = checked_pose(poses.get(name))
            if frame.problem is not None:
                lost[name] = frame.problem
            if pose is None:
                flags.add(f"{name}:{problem}")
                if frame.touched:
                    lost[name] = "it has no pose" if problem == "no_pose" else "its pose is not a rigid motion"
                continue
            links[name], link_poses[name] = frame, pose
        if not self._is_coplanar(links, link_poses):
            flags.add("not_coplanar")
        feet = frozenset(name for name in lost if self.skins[name].ground is not None)
        return BodyFrame(links, link_poses, self.ground, frozenset(flags), lost, feet)

    def _is_coplanar(self, links: dict[str, Frame], poses: dict[str, Array]) -> bool:
        """Return whether all standing feet are at one height and parallel to the ground."""
        heights = []
        for name, frame in links.items():
            if frame.reason is not None or frame.ground is None:
                continue
            plane, pose = frame.ground.plane, poses[name]
            heights.append(float(self.ground.heights(pose[:3, :3] @ plane.origin + pose[:3, 3])))
            if pose[:3, :3] @ plane.axes[2] @ self.ground.axes[2] < np.cos(MAX_TILT):
                return False
        return not heights or max(heights) - min(heights) <= MAX_HEIGHT_DIFFERENCE
