"""Samples of the mesh at the sites of a fit: sections through the rows of sites, and rays cast on them."""

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, IntArray, along, unit
from .basis import TensorBasis
from .lines import LineGrid
from .mesh import TriangleMesh
from .planes import Planes, perpendicular
from .rays import RayCaster
from .sections import Sections, cut_sections


@dataclass(frozen=True, eq=False)
class RaySamples:
    """Where rays through the surface's own points met the mesh, one per sample site."""

    residuals: Array  # (k, l) from the surface outward to the mesh along the ray [m]; NaN where there is none
    points: Array  # (k, l, 3) on the mesh [m]
    rays: Array  # (k, l, 3) unit
    faces: IntArray  # (k, l) that were met


@dataclass(frozen=True, eq=False)
class SampleRows:
    """Sections through the rows of sample sites, and where the rays start that sample them."""

    mesh: TriangleMesh
    sections: Sections
    caster: RayCaster
    points: Array  # (k, 3) origin of each row's plane frame [m]
    axes: Array  # (k, 2, 3) unit vectors in each row's plane
    origins: Array  # (k, l, 3) where the rays start [m]
    flat: bool  # whether rays stay in the plane of their row

    @classmethod
    def of(cls, mesh: TriangleMesh, lines: LineGrid, basis: TensorBasis) -> "SampleRows":
        """Cut the mesh with a plane through every row of sample sites; they lie between the author's planes too."""
        planes = lines.planes_u
        points = basis.N @ lines.origins[:, 0]
        flat = planes.are_parallel()
        if flat:
            first = perpendicular(planes.normals[0])
            frame = np.array((first, np.cross(planes.normals[0], first)))
            flat_vertices = np.stack([along(mesh.vertices, axis) for axis in frame], axis=1)
            normals = np.broadcast_to(planes.normals[0], points.shape)
            sections = cut_sections(mesh, Planes(points, normals), flat_vertices)
            ends = sections.ends - (points @ frame.T)[sections.plane, None]
            axes = np.broadcast_to(frame, (len(points), 2, 3))
        else:
            normals = unit(basis.N @ planes.normals)
            sections = cut_sections(mesh, Planes(points, normals))
            firsts = np.array([perpendicular(normal) for normal in normals])
            axes = np.stack((firsts, np.cross(normals, firsts)), axis=1)
            local = sections.ends - points[sections.plane, None]
            ends = np.matmul(local, axes[sections.plane].transpose(0, 2, 1))
        concurrent = (lines.origins == lines.origins[:, :1]).all()
        parallel = (lines.directions == lines.directions[0, 0]).all()
        caster = RayCaster(
            sections.plane,
            ends,
            len(points),
            centres=np.zeros((len(points), 2)) if concurrent else None,
            direction=axes[0] @ lines.directions[0, 0] if parallel else None,
        )
        return cls(mesh, sections, caster, points, axes, basis.blend(lines.origins), flat)

    def cast(self, arms: Array) -> RaySamples:
        """Cast rays from the origins along ``arms`` (k, l, 3), which end on the surface [m]."""
        length = np.linalg.norm(arms, axis=2)
        rays = arms / length[..., None]
        # 2-D frame of each row: what leaves the plane of a fanned row is put right below.
        origins = np.matmul(self.origins - self.points[:, None], self.axes.transpose(0, 2, 1))
        directions = np.matmul(rays, self.axes.transpose(0, 2, 1))
        distance, hit = self.caster.cast(origins, directions)
        if not self.flat:
            distance = self._onto_facets(distance, hit, rays)
        points = self.origins + distance[..., None] * rays
        return RaySamples(distance - length, points, rays, self.sections.face[hit])

    def _onto_facets(self, distance: Array, hit: IntArray, rays: Array) -> Array:
        """Distance to the planes of the facets that were hit, for rays that leave the plane of their row."""
        normal = self.mesh.face_normals[self.sections.face[hit]]
        slope = (rays * normal).sum(axis=2)
        offset = ((self.sections.ends[hit, 0] - self.origins) * normal).sum(axis=2)
        steep = np.abs(slope) > 0.2  # a facet seen edge-on says nothing of the distance
        return np.where(steep & ~np.isnan(distance), offset / np.where(steep, slope, 1.0), distance)
