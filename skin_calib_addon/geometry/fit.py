"""The constrained fit: every control point moves on its line P_u ∩ P_v until the surface lies on the mesh."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Array, IntArray, unit
from ..deviation import SurfaceErrors
from ..errors import EmptySection
from .basis import TensorBasis
from .bspline import BSplineSurface
from .distance import surface_errors
from .grids import Grid
from .lines import LineGrid
from .mesh import TriangleMesh
from .planes import Planes, perpendicular
from .rays import RayCaster
from .sections import Sections, cut_sections

MOST_PASSES = 10
# A pass that moves no control point by more than this share of the mesh's size is the last.
SETTLED = 1e-4
# With more samples missing than this, the surface would be made up rather than fitted.
LARGEST_GAP = 0.5


@dataclass(frozen=True, eq=False)
class SurfaceFit:
    """A surface fitted to a mesh, and how well it lies there."""

    mesh: TriangleMesh
    lines: LineGrid
    surface: BSplineSurface
    residuals: Array  # (k, l) along the sample rays [m]; NaN where the mesh has nothing
    passes: int

    @cached_property
    def errors(self) -> SurfaceErrors:
        """Distances between mesh and surface, both ways [m]."""
        return surface_errors(self.mesh, self.surface, ~np.isnan(self.residuals))

    @property
    def missing(self) -> float:
        """Share of the sample rays that meet no mesh: holes that the surface spans."""
        return float(np.isnan(self.residuals).mean())


def fit_surface(mesh: TriangleMesh, grid: Grid | LineGrid, degree: int | tuple[int, int] = 3) -> SurfaceFit:
    """Fit a B-spline surface whose control points lie on the lines of a plane grid (paper, Algorithm 1).

    With the lines and the sample sites fixed, the offsets along the lines are a linear least-squares problem that
    splits into one small factor per direction. Each pass casts the samples anew from the axis through the surface's
    own points, so that the residuals measure distance and not a slip along the surface.

    Parameters
    ----------
    mesh : TriangleMesh
        The cover, [m] in the link frame.
    grid : TubeGrid, SectorGrid, AcrossGrid or PlanesGrid, or lines that are placed already
    degree : int or pair of int
        2 to 5, along u and v.

    Raises
    ------
    UnderdeterminedFit
        If there are too few planes for the degree.
    EmptySection
        If a plane misses the mesh, or half of the samples find none.
    """
    degree_u, degree_v = (degree, degree) if isinstance(degree, int) else degree
    lines = grid if isinstance(grid, LineGrid) else grid.line_grid(mesh, (degree_u, degree_v))
    basis = TensorBasis.of(lines, degree_u, degree_v)
    rows = SampleRows.of(mesh, lines, basis)
    offsets = np.full(lines.origins.shape[:2], 0.5 * mesh.size)
    for passes in range(1, MOST_PASSES + 1):
        residuals = rows.residuals(basis.blend(offsets[..., None] * lines.directions))
        if passes == 1:
            check_coverage(lines, basis, residuals)
        step = basis.solve(residuals, offsets)
        offsets = offsets + step
        if np.abs(step).max() < SETTLED * mesh.size:
            break
    net = basis.close(lines.origins + offsets[..., None] * lines.directions)
    surface = BSplineSurface(net, basis.u.knots, basis.v.knots, (degree_u, degree_v), (False, lines.closed))
    return SurfaceFit(mesh, lines, surface, residuals, passes)


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
            normals = np.broadcast_to(planes.normals[0], points.shape)
            sections = cut_sections(mesh, Planes(points, normals), mesh.vertices @ frame.T)
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

    def residuals(self, arms: Array) -> Array:
        """Distance from the points ``origins + arms`` outward to the mesh, along the arms; shape (k, l) [m]."""
        length = np.linalg.norm(arms, axis=2)
        rays = arms / length[..., None]
        # 2-D frame of each row: what leaves the plane of a fanned row is put right below.
        origins = np.matmul(self.origins - self.points[:, None], self.axes.transpose(0, 2, 1))
        directions = np.matmul(rays, self.axes.transpose(0, 2, 1))
        distance, hit = self.caster.cast(origins, directions)
        if not self.flat:
            distance = self._onto_facets(distance, hit, rays)
        return distance - length

    def _onto_facets(self, distance: Array, hit: IntArray, rays: Array) -> Array:
        """Distance to the planes of the facets that were hit, for rays that leave the plane of their row."""
        normal = self.mesh.face_normals[self.sections.face[hit]]
        slope = (rays * normal).sum(axis=2)
        offset = ((self.sections.ends[hit, 0] - self.origins) * normal).sum(axis=2)
        steep = np.abs(slope) > 0.2  # a facet seen edge-on says nothing of the distance
        return np.where(steep & ~np.isnan(distance), offset / np.where(steep, slope, 1.0), distance)


def check_coverage(lines: LineGrid, basis: TensorBasis, residuals: Array) -> None:
    """Refuse planes that miss the mesh.

    Raises
    ------
    EmptySection
        Names the first u-plane or v-line near which no ray meets the mesh, or the share of all rays that do not.
    """
    missed = np.isnan(residuals)
    for what, weights, empty in (("u", basis.N, missed.all(axis=1)), ("v", basis.M, missed.all(axis=0))):
        nearest = weights.argmax(axis=0)  # the site at which each plane counts most
        lost = np.flatnonzero(empty[nearest])
        if len(lost):
            i = int(lost[0])
            name, place = (
                (f"u-plane {i}", lines.origins[i, 0]) if what == "u" else (lines.v_names[i], lines.origins[0, i])
            )
            at = ", ".join(f"{x * 1e3:.1f}" for x in place)
            raise EmptySection(f"{name}, through ({at}) mm, misses the mesh; move it, or widen the margin", plane=i)
    if missed.mean() > LARGEST_GAP:
        raise EmptySection(
            f"{missed.mean():.0%} of the sample rays meet no mesh; move the axis or the planes, or use a patch grid",
            missing=float(missed.mean()),
        )
