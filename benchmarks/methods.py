"""Ours and the paper's method, as surfaces that are measured like those of the peers."""

import numpy as np
import paper_letter
import paper_strengthened
from links import Array, Fan, Link
from measure import Surface, tensor
from paper_sections import PaperFit

from skin_calib_addon.geometry import (
    Planes,
    PlanesGrid,
    SurfaceFit,
    TriangleMesh,
    fit_surface,
    fit_to_count,
    fit_to_tolerance,
)
from skin_calib_addon.geometry.surface.bspline import clamped_knots

SAME, PLACED, BEST_NET, AUTO = "ours, same planes", "ours, placed planes", "ours, best net", "ours, auto"
MODES = (SAME, PLACED, BEST_NET)  # of ours, at a size that is given
LETTER, STRENGTHENED, STRENGTHENED_NLLS = "paper, letter", "paper, strengthened", "paper, strengthened, NLLS"


def is_peer(method: str) -> bool:
    """Return whether a method is neither ours nor the paper's."""
    return not method.startswith(("ours", "paper"))


def new_mesh(link: Link) -> TriangleMesh:
    """Return the mesh of a link without what earlier fits keep of it, so that warm calls do all the work."""
    return TriangleMesh(link.mesh.vertices, link.mesh.faces)


def ours(link: Link, n: int, lines: int, spacing: str = "auto") -> SurfaceFit:
    """Fit along ``n`` planes and ``lines`` lines."""
    return fit_surface(new_mesh(link), link.grid(n, lines, spacing))


def ours_best(link: Link, control_points: int) -> SurfaceFit:
    """Fit with the best ratio of planes to lines for a number of control points."""
    return fit_to_count(new_mesh(link), control_points, axis=link.axis, margin=link.margin, sector=link.sector)


def ours_fanned(link: Link, fan: Fan, n: int, lines: int) -> SurfaceFit:
    """Fit along planes that are not parallel, as an author places them."""
    s, angles = np.linspace(0, 1, n), np.arange(lines // 2) * 2 * np.pi / lines
    across = np.cos(angles)[:, None] * fan.e2 - np.sin(angles)[:, None] * fan.e1
    u = Planes(fan.origins(s), fan.normals(s))
    v = Planes(np.broadcast_to(fan.first, across.shape), across)
    return fit_surface(new_mesh(link), PlanesGrid(u, v, closed=True))


def auto(link: Link, tolerance: float) -> SurfaceFit:
    """Fit the smallest surface with a mean error within a tolerance [mm]."""
    return fit_to_tolerance(new_mesh(link), tolerance / 1e3, axis=link.axis, margin=link.margin, sector=link.sector)


def paper_planes(fan: Fan, n: int, lines: int) -> tuple[Array, Array]:
    """Return our even planes, or fanned ones, in the form of the paper's method."""
    if not fan.closed:
        raise ValueError("the paper's method closes its curves; this link is open")
    s, angles = np.linspace(0, 1, n), -np.arange(lines) * 2 * np.pi / lines  # counter-clockwise
    u_planes = np.stack((fan.origins(s), fan.normals(s)), axis=1)
    outward = np.cos(angles)[:, None] * fan.e1 + np.sin(angles)[:, None] * fan.e2
    return u_planes, np.stack(np.broadcast_arrays(fan.first, fan.e3, outward), axis=1)


def letter(link: Link, fan: Fan, n: int, lines: int, parameters: str = "greville") -> PaperFit:
    """Return the surface of the paper's method as its text says."""
    mesh = link.mesh
    return paper_letter.fit(mesh.vertices, mesh.faces, *paper_planes(fan, n, lines), parameters=parameters)


def strengthened(link: Link, fan: Fan, n: int, lines: int, solver: str = "linear") -> PaperFit:
    """Return the surface of the best form of the paper's method that we found."""
    mesh = link.mesh
    return paper_strengthened.fit(mesh.vertices, mesh.faces, *paper_planes(fan, n, lines), solver=solver)


def surface_of_ours(fit: SurfaceFit) -> Surface:
    """Convert our fit, with a note on missing samples."""
    made, count = fit.surface, int(np.prod(fit.lines.origins.shape[:2]))
    notes = [f"{fit.missing:.0%} of the samples missing"] if fit.missing else []
    return Surface(tensor(made.control_net, made.knots_u, made.knots_v, made.degree), count, "; ".join(notes))


def surface_of_paper(fit: PaperFit) -> Surface:
    """Convert a geomdl surface of cubic clamped uniform knots; its last column repeats the first."""
    n, m, _ = fit.control_net.shape
    return Surface(tensor(fit.control_net, clamped_knots(n, 3), clamped_knots(m, 3), (3, 3)), n * (m - 1))
