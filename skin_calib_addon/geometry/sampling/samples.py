"""Samples of the mesh at the sites of a fit: sections through the rows of sites, and rays cast on them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy import ndimage

from ...common.arrays import Array, BoolArray, IntArray, tangential, unit
from ..mesh.triangle_mesh import TriangleMesh
from .basis import TensorBasis
from .lines import LineGrid
from .off_cover import off_cover
from .planes import Planes
from .rays import RayCaster
from .sections import Sections, coordinates, cut_sections

# [cosine] between a ray and a facet's normal below which the distance to the facet's plane is not used, because the
# facet is nearly parallel to the ray. Larger: fewer facets are used.
MIN_FACET_COSINE = 0.2

# [1] sections of one mesh that previews keep. Larger: more memory; smaller: more sections are cut again.
MAX_KNOWN_SECTIONS = 300


@dataclass(frozen=True, eq=False)
class RaySamples:
    r"""Intersections of the mesh with rays through the points of a surface, one per sample site.

    The residual at a site is

    .. math::

        e_{kl} = h_{kl} - \lVert \mathbf{a}_{kl} \rVert \quad [\text{m}]

    where :math:`h_{kl}` is the distance along the ray from its origin to the mesh, and the arm :math:`\mathbf{a}_{kl}`
    leads from the origin to the surface.
    """

    residuals: Array  # (k, l) from the surface outward to the mesh along the ray [m]; NaN without a hit on the cover
    origins: Array  # (k, l, 3) of the rays [m]
    arms: Array  # (k, l, 3) from there to the surface [m]
    faces: IntArray  # (k, l) faces that were hit
    folds: BoolArray  # (k,) rows whose section folds back, so that some rays intersect it more than once
    parts: BoolArray  # (k,) rows whose outside consists of several curves
    outside: BoolArray | None = None  # (k, l) rays outside the boundary, without residual; None: no boundary

    @property
    def missed(self) -> BoolArray:
        """Return which rays inside the boundary do not hit the mesh, or not the cover, shape (k, l)."""
        missed = np.isnan(self.residuals)
        return missed if self.outside is None else missed & ~self.outside

    @cached_property
    def holes(self) -> BoolArray:
        """Return which rays pass through holes of the mesh, shape (k, l): next to a boundary they only miss its rim."""
        return self.missed if self.outside is None else self.missed & ~ndimage.binary_dilation(self.outside)

    def outside_outline(self, closed: bool) -> BoolArray:
        """Return which missed rays pass outside of the outline of the mesh, (k, l): those connected to an open edge.

        With a boundary, there are none.
        """
        if self.outside is not None:
            return np.zeros(self.residuals.shape, bool)
        edge, turns = np.zeros(self.residuals.shape, bool), 2 if closed else 1
        edge[[0, -1]] = True
        edge[:, [0, -1]] |= not closed
        found = ndimage.binary_propagation(np.tile(edge & self.missed, turns), mask=np.tile(self.missed, turns))
        return np.asarray(found.reshape(len(edge), turns, -1).any(axis=1))

    @property
    def missing(self) -> float:
        """Return the fraction of the rays inside the boundary that are missed; 1 if all are outside."""
        inside = self.missed.size if self.outside is None else int((~self.outside).sum())
        return float(self.missed.sum()) / inside if inside else 1.0

    def without_new(self, before: "RaySamples") -> "RaySamples":
        """Return the samples without those at sites that had none before."""
        assert self.outside is not None and before.outside is not None
        new = np.isnan(before.residuals) & ~np.isnan(self.residuals)
        residuals, outside = np.where(new, np.nan, self.residuals), self.outside | (new & before.outside)
        return replace(self, residuals=residuals, outside=outside)

    @cached_property
    def rays(self) -> Array:
        """Return the unit directions of the rays, shape (k, l, 3)."""
        return unit(self.arms)

    @cached_property
    def points(self) -> Array:
        """Return the points where the rays hit the mesh, shape (k, l, 3) [m]; NaN where they did not."""
        return self.origins + self.arms + self.residuals[..., None] * self.rays


@dataclass(frozen=True, eq=False)
class SampleRows:
    """Sections through the rows of sample sites, and the origins of the rays that sample them."""

    mesh: TriangleMesh
    planes: Planes  # of the rows
    sections: Sections  # their ends are plane coordinates if the planes are parallel
    caster: RayCaster
    axes: Array  # (k, 2, 3) unit vectors in each row's plane; (1, 2, 3) where the rows are parallel
    origins: Array  # (k, l, 3) of the rays [m]
    local: Array  # (k, l, 2) or (1, 1, 2) the same in the frames of the rows [m]
    flat: bool  # whether rays are in the plane of their row
    region: Callable[[Array], BoolArray] | None = None  # whether points are inside the boundary
    closed: bool = False  # whether the last ray of a row is next to its first

    @classmethod
    def of(cls, mesh: TriangleMesh, lines: LineGrid, basis: TensorBasis, again: bool = False) -> "SampleRows":
        """Cut the mesh with a plane through every row of sample sites; most of them are between the author's planes."""
        points = basis.N @ lines.origins[:, 0]
        parallel = lines.planes_u.are_parallel()
        normals = np.broadcast_to(lines.planes_u.normals[0], points.shape)
        planes = Planes(points, normals if parallel else unit(basis.N @ lines.planes_u.normals))
        concurrent = bool((lines.origins == lines.origins[:, :1]).all())
        direction = lines.directions[0, 0] if (lines.directions == lines.directions[0, 0]).all() else None
        first = basis.N @ lines.directions[:, 0]
        rows = cls.cut(mesh, planes, basis.blend(lines.origins), first, concurrent, direction, again)
        return replace(rows, region=lines.region, closed=lines.closed)

    @classmethod
    def cut(
        cls,
        mesh: TriangleMesh,
        planes: Planes,
        origins: Array,
        first: Array,
        concurrent: bool,
        direction: Array | None,
        again: bool = False,
    ) -> "SampleRows":
        """Cut the mesh with the planes in which rays will start."""
        flat = planes.are_parallel()
        axes = frames_of(planes.normals[:1], first[:1]) if flat else frames_of(planes.normals, first)
        sections, ends = (known_sections if again else framed_sections)(mesh, planes, axes)
        caster = RayCaster(
            sections.plane,
            ends,
            len(planes),
            centres=np.zeros((len(planes), 2)) if concurrent else None,
            direction=axes[0] @ direction if direction is not None else None,
        )
        local = np.zeros((1, 1, 2)) if concurrent else across(origins - planes.points[:, None], axes)
        return cls(mesh, planes, sections, caster, axes, origins, local, flat)

    def on_cut_faces(self) -> "SampleRows":
        """Return the same rows on the part of the mesh that they cut, which takes less memory than all of it."""
        if not len(self.sections.face):
            return self
        faces, number = np.unique(self.sections.face, return_inverse=True)
        vertices, corners = np.unique(self.mesh.faces[faces], return_inverse=True)
        mesh = TriangleMesh(self.mesh.vertices[vertices], corners.reshape(-1, 3))
        return replace(self, mesh=mesh, sections=replace(self.sections, face=number))

    def cast(self, arms: Array) -> RaySamples:
        """Cast rays from the origins along ``arms`` (k, l, 3), which end on the surface [m].

        With a boundary, rays that hit another part than the cover have no hit (see ``off_cover``).
        """
        flat_arms = across(arms, self.axes)
        length = np.hypot(flat_arms[..., 0], flat_arms[..., 1])
        directions = flat_arms / length[..., None]
        origins = np.broadcast_to(self.local, directions.shape)
        distance, hit = self.caster.cast(origins, directions)
        if not self.flat:  # correct rays that leave the plane of a fanned row
            length = np.linalg.norm(arms, axis=2)
            distance = self._onto_facets(distance, hit, arms / length[..., None])
        residuals, outside = distance - length, None
        faces = self.sections.face[hit] if len(self.sections.face) else hit  # no plane intersects the mesh
        if self.region is not None:
            fraction = np.where(np.isnan(distance), 1.0, distance / length)  # a ray without a hit ends on the surface
            outside = ~self.region(self.origins + fraction[..., None] * arms)
            residuals = np.where(outside, np.nan, residuals)
            rays = arms / length[..., None]
            hits = self.origins + (length + residuals)[..., None] * rays
            residuals[off_cover(hits, rays, self.mesh.face_normals[faces], self.closed)] = np.nan
        return RaySamples(residuals, self.origins, arms, faces, self.caster.folds, self.caster.parts, outside)

    def _onto_facets(self, distance: Array, hit: IntArray, rays: Array) -> Array:
        r"""Return the distance to the planes of the facets that rays hit, for rays that leave the plane of their row.

        A ray from :math:`\mathbf{o}` in direction :math:`\mathbf{r}` hits the plane through :math:`\mathbf{p}` with the
        normal :math:`\mathbf{n}` at :math:`t = (\mathbf{p} - \mathbf{o}) \cdot \mathbf{n} / (\mathbf{r} \cdot
        \mathbf{n})`.
        """
        normal = self.mesh.face_normals[self.sections.face[hit]]
        slope = (rays * normal).sum(axis=2)
        offset = ((self.sections.ends[hit, 0] - self.origins) * normal).sum(axis=2)
        steep = np.abs(slope) > MIN_FACET_COSINE
        return np.where(steep & ~np.isnan(distance), offset / np.where(steep, slope, 1.0), distance)


def cast_rays(mesh: TriangleMesh, planes: Planes, origins: Array, directions: Array) -> Array:
    """Return the distance (k, l) [m] along rays in k planes to the mesh; NaN where a ray hits nothing."""
    concurrent = bool((origins == planes.points[:, None]).all())
    rows = SampleRows.cut(mesh, planes, origins, directions[:, 0], concurrent, None if concurrent else directions[0, 0])
    return rows.cast(directions).residuals + 1


def framed_sections(mesh: TriangleMesh, planes: Planes, axes: Array) -> tuple[Sections, Array]:
    """Cut a mesh, and return the sections with their ends (s, 2, 2) [m] in the frames of their rows."""
    flat_vertices = np.stack([coordinates(mesh, axis) for axis in axes[0]]).T if len(axes) == 1 else None
    sections = cut_sections(mesh, planes, flat_vertices)
    return sections, flat_ends(sections, planes, axes)


def known_sections(mesh: TriangleMesh, planes: Planes, axes: Array) -> tuple[Sections, Array]:
    """Return the same as :func:`framed_sections` for a preview: only planes that are not known are cut."""
    known, flat = _known_sections(mesh), len(axes) == 1
    frames = np.broadcast_to(axes, (len(planes), 2, 3)).reshape(-1, 6)
    keys = [(flat, row.tobytes()) for row in np.hstack((planes.points, planes.normals, frames))]
    moved = [i for i, key in enumerate(keys) if key not in known]
    if len(known) + len(moved) > MAX_KNOWN_SECTIONS:
        known.clear()
        moved = list(range(len(keys)))
    if moved:
        cut = Planes(planes.points[moved], planes.normals[moved])
        sections, ends = framed_sections(mesh, cut, axes if flat else axes[moved])
        bounds = np.searchsorted(sections.plane, np.arange(len(moved) + 1))
        for i, start, stop in zip(moved, bounds, bounds[1:]):
            known[keys[i]] = sections.face[start:stop], sections.ends[start:stop], ends[start:stop]
    face, ends, flat_ones = (np.concatenate(parts) for parts in zip(*(known[key] for key in keys)))
    plane = np.repeat(np.arange(len(keys)), [len(known[key][0]) for key in keys])
    return Sections(plane, face, ends, len(keys)), flat_ones


@lru_cache(maxsize=4)
def _known_sections(mesh: TriangleMesh) -> dict[tuple[bool, bytes], tuple[IntArray, Array, Array]]:
    """Return faces and ends of the known sections of a mesh, by the kind of the ends and by plane with frame."""
    return {}


def flat_ends(sections: Sections, planes: Planes, axes: Array) -> Array:
    """Return the ends (s, 2, 2) [m] of segments in the frames of their rows."""
    if len(axes) == 1:
        return sections.ends - (planes.points @ axes[0].T)[sections.plane, None]
    return across(sections.ends - planes.points[sections.plane, None], axes[sections.plane])


def frames_of(normals: Array, first: Array) -> Array:
    """Return two unit vectors (k, 2, 3) perpendicular to each normal (k, 3)."""
    firsts = tangential(first, normals)
    return np.stack((firsts, np.cross(normals, firsts)), axis=1)


def across(vectors: Array, axes: Array) -> Array:
    """Return the components (k, l, 2) of vectors (k, l, 3) along the axes of their rows."""
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    e = axes[:, None]
    return np.moveaxis(np.stack([x * e[..., i, 0] + y * e[..., i, 1] + z * e[..., i, 2] for i in (0, 1)]), 0, -1)
