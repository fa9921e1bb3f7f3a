"""Samples of the mesh at the sites of a fit: sections through the rows of sites, and rays cast on them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...common.arrays import Array, IntArray, along, unit
from ..mesh.triangle_mesh import TriangleMesh
from .basis import TensorBasis
from .lines import LineGrid
from .planes import Planes, perpendicular
from .rays import RayCaster
from .sections import Sections, cut_sections


@dataclass(frozen=True, eq=False)
class RaySamples:
    """Where rays through the surface's own points met the mesh, one per sample site."""

    residuals: Array  # (k, l) from the surface outward to the mesh along the ray [m]; NaN where there is none
    origins: Array  # (k, l, 3) where the rays start [m]
    arms: Array  # (k, l, 3) from there to the surface [m]
    faces: IntArray  # (k, l) that were met

    @cached_property
    def rays(self) -> Array:
        """Unit directions, shape (k, l, 3)."""
        return unit(self.arms)

    @cached_property
    def points(self) -> Array:
        """Where the rays met the mesh, shape (k, l, 3) [m]; NaN where they did not."""
        return self.origins + self.arms + self.residuals[..., None] * self.rays


@dataclass(frozen=True, eq=False)
class SampleRows:
    """Sections through the rows of sample sites, and where the rays start that sample them."""

    mesh: TriangleMesh
    planes: Planes  # of the rows
    sections: Sections  # with ends across the planes where these are parallel
    caster: RayCaster
    axes: Array  # (k, 2, 3) unit vectors in each row's plane; (1, 2, 3) where the rows are parallel
    origins: Array  # (k, l, 3) where the rays start [m]
    local: Array  # (k, l, 2) or (1, 1, 2) the same in the frames of the rows [m]
    flat: bool  # whether rays stay in the plane of their row

    @classmethod
    def of(cls, mesh: TriangleMesh, lines: LineGrid, basis: TensorBasis) -> "SampleRows":
        """Cut the mesh with a plane through every row of sample sites; they lie between the author's planes too."""
        points = basis.N @ lines.origins[:, 0]
        parallel = lines.planes_u.are_parallel()
        normals = np.broadcast_to(lines.planes_u.normals[0], points.shape)
        planes = Planes(points, normals if parallel else unit(basis.N @ lines.planes_u.normals))
        concurrent = bool((lines.origins == lines.origins[:, :1]).all())
        direction = lines.directions[0, 0] if (lines.directions == lines.directions[0, 0]).all() else None
        return cls.cut(mesh, planes, basis.blend(lines.origins), concurrent, direction)

    @classmethod
    def cut(
        cls, mesh: TriangleMesh, planes: Planes, origins: Array, concurrent: bool, direction: Array | None
    ) -> "SampleRows":
        """Cut the mesh with planes in which rays will start.

        Parameters
        ----------
        origins : array, shape (k, l, 3)
            Of the rays in each plane [m].
        concurrent : bool
            Whether the rays of each plane all start at its point.
        direction : array, shape (3,), or None
            Where all rays run to, if they do.
        """
        flat = planes.are_parallel()
        if flat:
            axes = frames_of(planes.normals[:1])
            flat_vertices = np.stack([along(mesh.vertices, axis) for axis in axes[0]]).T
            sections = cut_sections(mesh, planes, flat_vertices)
        else:
            axes = frames_of(planes.normals)
            sections = cut_sections(mesh, planes)
        ends = flat_ends(sections, planes, axes)
        caster = RayCaster(
            sections.plane,
            ends,
            len(planes),
            centres=np.zeros((len(planes), 2)) if concurrent else None,
            direction=axes[0] @ direction if direction is not None else None,
        )
        local = np.zeros((1, 1, 2)) if concurrent else across(origins - planes.points[:, None], axes)
        return cls(mesh, planes, sections, caster, axes, origins, local, flat)

    def flat_ends(self) -> Array:
        """Ends of the segments in the frames of their rows, shape (s, 2, 2) [m]."""
        return flat_ends(self.sections, self.planes, self.axes)

    def cast(self, arms: Array) -> RaySamples:
        """Cast rays from the origins along ``arms`` (k, l, 3), which end on the surface [m]."""
        flat_arms = across(arms, self.axes)
        length = np.hypot(flat_arms[..., 0], flat_arms[..., 1])
        directions = flat_arms / length[..., None]
        origins = np.broadcast_to(self.local, directions.shape)
        distance, hit = self.caster.cast(origins, directions)
        if not self.flat:  # what leaves the plane of a fanned row is put right
            length = np.linalg.norm(arms, axis=2)
            distance = self._onto_facets(distance, hit, arms / length[..., None])
        return RaySamples(distance - length, self.origins, arms, self.sections.face[hit])

    def _onto_facets(self, distance: Array, hit: IntArray, rays: Array) -> Array:
        """Distance to the planes of the facets that were hit, for rays that leave the plane of their row."""
        normal = self.mesh.face_normals[self.sections.face[hit]]
        slope = (rays * normal).sum(axis=2)
        offset = ((self.sections.ends[hit, 0] - self.origins) * normal).sum(axis=2)
        steep = np.abs(slope) > 0.2  # a facet seen edge-on says nothing of the distance
        return np.where(steep & ~np.isnan(distance), offset / np.where(steep, slope, 1.0), distance)


def cast_rays(mesh: TriangleMesh, planes: Planes, origins: Array, directions: Array) -> Array:
    """Distance along rays in some planes to the mesh, shape (k, l) [m]; NaN where there is none.

    Parameters
    ----------
    origins, directions : array, shape (k, l, 3)
        Of the rays of each plane [m]; they all start at its point, or all run one way.
    """
    concurrent = bool((origins == planes.points[:, None]).all())
    rows = SampleRows.cut(mesh, planes, origins, concurrent, None if concurrent else directions[0, 0])
    return rows.cast(directions).residuals + 1


def flat_ends(sections: Sections, planes: Planes, axes: Array) -> Array:
    """Ends of segments in the frames of their rows; sections of parallel planes have them so but for the origin."""
    if len(axes) == 1:
        return sections.ends - (planes.points @ axes[0].T)[sections.plane, None]
    return across(sections.ends - planes.points[sections.plane, None], axes[sections.plane])


def frames_of(normals: Array) -> Array:
    """Two unit vectors across each normal, shape (k, 2, 3)."""
    firsts = np.array([perpendicular(normal) for normal in normals])
    return np.stack((firsts, np.cross(normals, firsts)), axis=1)


def across(vectors: Array, axes: Array) -> Array:
    """Components of vectors (k, l, 3) along the axes of their rows (k, 2, 3), shape (k, l, 2), stored by component."""
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    e = axes[:, None]
    return np.moveaxis(np.stack([x * e[..., i, 0] + y * e[..., i, 1] + z * e[..., i, 2] for i in (0, 1)]), 0, -1)
