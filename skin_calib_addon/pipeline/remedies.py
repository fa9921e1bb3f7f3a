"""Whether a simple change of a plan mends a surface: the window tries it before it makes it."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..common.errors import SkinCalibError
from ..common.warnings import Warning, point_of
from ..geometry.grid.cut_planes import cut_normal
from ..geometry.grid.grids import Grid, Sector, Tube
from ..geometry.mesh.cover import Cut
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..plan.keys import FROM, TO
from ..plan.plan import Plan, Surface
from .calibrate import cut_for, fit_of

# [fraction of the longest side of the link] that a wider margin adds at both ends. Larger: less of the link is covered.
MARGIN_STEP = 0.02


def mends(change: str, plan: Plan, mesh: TriangleMesh, problem: Warning) -> bool:
    """Return whether a change mends a problem of a surface: after it the surface is fitted without this warning."""
    surface = next((one for one in plan.surfaces if one.name == problem.where.surface), plan.surfaces[0])
    changed = CHANGES[change](surface, mesh, problem)
    if changed is None:
        return False
    try:
        fit = fit_of(plan, changed, mesh, cut_for(plan, changed, mesh))
    except SkinCalibError:
        return False
    return problem.severity == "error" or problem.code not in {warning.code for warning in fit.warnings}


def _cut(surface: Surface, mesh: TriangleMesh, problem: Warning) -> Surface | None:
    """Return a surface with a cut across the link at the place of a problem."""
    point, axis = problem.where.point, surface.grid.region.axis if isinstance(surface.grid, Grid) else None
    if point is None:
        return None
    normal = point_of(cut_normal(mesh, np.array(point), None if axis is None else np.array(axis.direction)))
    return replace(surface, cover=replace(surface.cover, cuts=(*surface.cover.cuts, Cut(point, normal))))


def _sector(surface: Surface, _mesh: TriangleMesh, _problem: Warning) -> Surface | None:
    """Return a surface over a part of the turn of a tube."""
    grid = surface.grid
    if not isinstance(grid, Grid) or not isinstance(grid.region, Tube):
        return None
    region = Sector(grid.region.axis, grid.region.margin, grid.region.boundary, start=FROM.first, stop=TO.first)
    return replace(surface, grid=replace(grid, region=region))


def _margin(surface: Surface, mesh: TriangleMesh, _problem: Warning) -> Surface | None:
    """Return a surface that leaves more of both ends free."""
    grid = surface.grid
    if not isinstance(grid, Grid):
        return None
    margin = (grid.region.margin or 0.0) + MARGIN_STEP * float(np.ptp(mesh.vertices, axis=0).max())
    return replace(surface, grid=replace(grid, region=replace(grid.region, margin=margin)))


def _seen(surface: Surface, _mesh: TriangleMesh, _problem: Warning) -> Surface:
    """Return a surface of the faces that can be seen from outside."""
    return replace(surface, cover=replace(surface.cover, shell="seen"))


CHANGES: dict[str, Callable[[Surface, TriangleMesh, Warning], Surface | None]] = {
    "cut": _cut,
    "sector": _sector,
    "margin": _margin,
    "seen": _seen,
}
