"""Uncertainty: how often the stated sigma of taxels covers their errors, by families of shapes.

    python benchmarks/uncertainty.py [--draws N] [--only FAMILY] [--cases] [--exact]

A draw mounts a sheet with random errors of its origin (1 mm per axis) and its direction (1 degree) on the true surface.
The error of a taxel is its distance from there along the rows and across, its distance from the true surface, and the
angle between the normals in the direction that is stated to be the worst. The true surface is a formula, or for real
links a net of 45 x 90 on the same mesh. Each draw displaces it by a random field, as much as a plan without the key
``mesh_uncertainty`` says, except with ``--exact``. Families of correlated noise have another mesh for each sheet, and
state its noise by the key; other scans are as their facets say. The fit has 10 x 20 or 20 x 40 control points. Half of
the sheets have their anchor at the middle, half at a corner. Draws whose sheet has a strain above 10 % on the true
surface are left out and counted. The figure goes to ``docs/uncertainty.png``, the table to ``out/uncertainty.csv``.
"""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import trimesh
from figure_style import DPI, OURS_COLOUR, figure_of
from links import MIDDLE, ROOT, Link, cover, link_of, shape_link, target_shapes
from scipy.spatial.transform import Rotation
from scipy.stats.qmc import MultivariateNormalQMC
from stability import WRIST_AXIS, noisy

from skin_calib_addon.calibration.model import Registration
from skin_calib_addon.common.arrays import unit
from skin_calib_addon.common.errors import PoorFit, SkinCalibError
from skin_calib_addon.common.mesh_uncertainty import MeshUncertainty
from skin_calib_addon.geometry import AcrossGrid, Axis, BSplineSurface, SurfaceFit, TriangleMesh, fit_surface, weld
from skin_calib_addon.geometry.fit.error_field import vertex_normals
from skin_calib_addon.geometry.fit.mesh_uncertainty import with_mesh_uncertainty
from skin_calib_addon.geometry.surface.footpoints import footpoints
from skin_calib_addon.skin import Landmark, SheetLattice, sheet_taxels, wrap_sheet
from skin_calib_addon.skin.uncertainty import (
    DIRECTION_UNCERTAINTY,
    MAX_KNOWN_STRAIN,
    ORIGIN_UNCERTAINTY,
    moved_within,
    taxel_uncertainty,
    usual_curvature,
)

ROWS, COLUMNS = 5, 13
MIDDLE_CELL, CORNER_CELL = (2, 6), (0, 0)
LARGEST_PITCH, CELLS_PER_SIZE = 0.008, 16  # [m], and cells along the size of a link
EXACT = MeshUncertainty(0.0)
WAVES = 300  # of a random field
MAX_HEADING = 0.35  # [rad] between the rows and the direction of v
DRAWS_PER_SHEET = 16  # a power of two balances the Sobol sequence
COMPONENTS = ("along", "normal", "angle")
Array = np.ndarray


@dataclass(frozen=True)
class Row:
    """Coverage of one component in one family."""

    family: str
    component: str
    draws: int  # taxels times draws
    one: float  # [%] within one sigma
    two: float  # [%] within two sigma
    error: float  # rms [mm] or [degrees]
    sigma: float  # rms of the stated one
    left_out: int  # draws whose sheet strains too much


@dataclass(frozen=True, eq=False)
class Case:
    """A mesh to fit, and its true surface."""

    link: Link
    true: BSplineSurface
    grid: Callable[[int, int], object]
    noise: MeshUncertainty | None = None  # of the vertices along their normals, anew for each sheet
    scan: bool = False  # whether the mesh has noise that its facets show


def random_field(points: Array, stated: MeshUncertainty, count: int, rng: np.random.Generator) -> Array:
    """Return Gaussian random fields at points (..., 3), shape (..., count) [m]."""
    phases = points @ rng.normal(0, np.sqrt(2) / stated.correlation_length, (3, WAVES))
    amplitudes = rng.normal(0, stated.standard_deviation / np.sqrt(WAVES), (2, WAVES, count))
    return np.cos(phases) @ amplitudes[0] + np.sin(phases) @ amplitudes[1]


def displaced(surface: BSplineSurface, stated: MeshUncertainty, point: Array, rng: np.random.Generator):
    """Return a part: a surface and a point on it, displaced by a random field along each axis."""
    net, s = surface.control_net, surface
    moves = random_field(np.concatenate((net.reshape(-1, 3), point[None])), stated, 3, rng)
    part = BSplineSurface(net + moves[:-1].reshape(net.shape), s.knots_u, s.knots_v, s.degree, s.closed)
    return part, point + moves[-1]


def remeasured(case: Case, rng: np.random.Generator) -> TriangleMesh:
    """Return the mesh of a case with correlated noise."""
    mesh = case.link.mesh
    shift = random_field(mesh.vertices, case.noise, 1, rng) * vertex_normals(mesh.vertices, mesh.faces)
    return weld(mesh.vertices + shift, mesh.faces)


class Saddle:
    """The graph z = (a x² + b y²) / 2 in millimetres."""

    a, b, half = 1 / 120, -1 / 90, 60.0

    def points(self, x: Array, y: Array) -> Array:
        return np.stack((x, y, (self.a * x**2 + self.b * y**2) / 2), axis=-1)

    def closest(self, points: Array) -> tuple[Array]:
        """Return the distances of points, by iterations of the foot."""
        x, y, z = points.T
        fx, fy = x.copy(), y.copy()
        for _ in range(30):
            height = z - (self.a * fx**2 + self.b * fy**2) / 2
            fx, fy = x + self.a * fx * height, y + self.b * fy * height  # the normal is (-a x, -b y, 1)
        return (np.linalg.norm(points - self.points(fx, fy), axis=1),)

    def shape(self, cells: int) -> dict:
        """Return the mesh of a grid whose inner lines are shaken, and the truth."""
        rng, step = np.random.default_rng(3), 2 * self.half / cells
        x, y = np.meshgrid(*(np.linspace(-self.half, self.half, cells + 1),) * 2, indexing="ij")
        x[1:-1] += rng.uniform(-0.2, 0.2, x[1:-1].shape) * step
        y[:, 1:-1] += rng.uniform(-0.2, 0.2, y[:, 1:-1].shape) * step
        i, j = (k.ravel() for k in np.indices((cells, cells)))
        p, even = i * (cells + 1) + j, ((i + j) % 2 == 0)[:, None]
        q, r, s = p + cells + 1, p + cells + 2, p + 1
        first = np.where(even, np.column_stack((p, q, s)), np.column_stack((p, q, r)))
        second = np.where(even, np.column_stack((q, r, s)), np.column_stack((p, r, s)))
        vertices = self.points(x.ravel(), y.ravel())
        return {"mesh": trimesh.Trimesh(vertices, np.concatenate((first, second)), process=False), "truth": self}


def tube_case(link: Link, fine: Link, net: tuple[int, int] = (40, 80), spacing: str = "uniform") -> Case:
    """Return a case whose true surface is fitted to a much finer mesh of the same formula."""
    true = fit_surface(fine.mesh, fine.grid(*net, spacing)).error_field.surface
    return Case(link, true, link.grid)


@cache
def fine_wrist() -> Link:
    """Return the wrist with 160 000 faces."""
    return shape_link("wrist", target_shapes().wrist(nt=400, nz=200), WRIST_AXIS)


def shape_case(function: str, coarse: dict, fine: dict, axis=MIDDLE, **of_truth) -> Case:
    """Return a case of one of the shapes with a known surface."""
    make = getattr(target_shapes(), function)
    return tube_case(shape_link(function, make(**coarse), axis), shape_link(function, make(**fine), axis), **of_truth)


def saddle_case(cells: int) -> Case:
    """Return a saddle; its grid is across a face."""

    def grid(n: int, lines: int, spacing: str = "auto"):
        return AcrossGrid(n, lines, (0, 0, 1.0), (1.0, 0, 0), 0.002, spacing)

    link, fine = (shape_link("saddle", Saddle().shape(k), MIDDLE) for k in (cells, 200))
    return Case(link, fit_surface(fine.mesh, grid(40, 40, "uniform")).error_field.surface, grid)


def held_back(name: str) -> Case:
    """Return a real link, and a net of 45 x 90 as its true surface."""
    link = link_of(name)
    return Case(link, fit_surface(link.mesh, link.grid(45, 90)).error_field.surface, link.grid)


def tube_shape(radius: Callable, around: int, along: int, skew: float = 0.0, jitter: float = 0.0, lean: float = 0.0):
    """Return the mesh and the truth of a tube of 80 mm, whose radius [mm] depends on angle and height."""
    shapes = target_shapes()
    truth = shapes.PolarTruth(radius, lambda z: (lean * z, 0 * z), zr=(0.0, 80.0))
    angles, heights = np.arange(around) * 2 * np.pi / around, np.linspace(0, 80.0, along)
    mesh = shapes.grid_mesh(lambda th, z: truth.X(th + skew * z, z), angles, heights, True, jitter=jitter)
    return {"mesh": mesh, "truth": truth}


def radius_case(radius: Callable, around: int, along: int, lean: float = 0.0, **of_mesh) -> Case:
    """Return a tube by its radius."""
    axis = Axis((0.0, 0.0, 0.0), (lean, 0.0, 1.0))
    coarse, fine = (
        shape_link("tube", tube_shape(radius, *size, lean=lean, **more), axis)
        for size, more in (((around, along), of_mesh), ((400, 120), {}))
    )
    return tube_case(coarse, fine)


def sphere(angle: Array, z: Array) -> Array:
    """Return the radius of a sphere of 55 mm."""
    return np.sqrt(55.0**2 - (z - 40) ** 2) + 0 * angle


def torus(angle: Array, z: Array) -> Array:
    """Return the radius of the outer side of a torus of 15 and 45 mm."""
    return 15 + np.sqrt(45.0**2 - (z - 40) ** 2) + 0 * angle


def dome(angle: Array, z: Array) -> Array:
    """Return the radius of an ellipsoid that ends 2 mm beyond both ends of the tube."""
    return 35 * np.sqrt(1 - ((z - 40) / 42) ** 2) + 0 * angle


def waist(angle: Array, z: Array) -> Array:
    """Return the radius of the inner side of a torus of 95 and 60 mm."""
    return 95 - np.sqrt(60.0**2 - (z - 40) ** 2) + 0 * angle


def oval(angle: Array, z: Array) -> Array:
    """Return the radius of an ellipse of 45 and 27 mm."""
    return 45 * 27 / np.hypot(27 * np.cos(angle), 45 * np.sin(angle)) + 0 * z


def subdivided(case: Case) -> Case:
    """Return a case whose triangles are divided into four without a change of the shape."""
    mesh = case.link.mesh
    return replace(case, link=replace(case.link, mesh=weld(*trimesh.remesh.subdivide(mesh.vertices, mesh.faces))))


def scanned(case: Case, noise: float, together: int) -> Case:
    """Return a case with noise [m] along all axes, averaged over neighbours a number of times."""
    mesh = case.link.mesh
    shift = np.random.default_rng(11).normal(size=mesh.vertices.shape)
    edges = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    for _ in range(together):
        total = shift.copy()
        np.add.at(total, edges[:, 0], shift[edges[:, 1]])
        shift = total / (1 + np.bincount(edges[:, 0], minlength=len(shift)))[:, None]
    shift *= noise / shift.std()
    return replace(case, link=replace(case.link, mesh=weld(mesh.vertices + shift, mesh.faces)), scan=True)


def correlated(length: float) -> tuple[Callable[[], Case], ...]:
    """Return scans whose noise has a correlation length [mm]."""
    return tuple(
        lambda make=make, s=s: replace(make(), noise=MeshUncertainty(s * 1e-3, length * 1e-3))
        for make in (lambda: tube_case(wrist(100), fine_wrist()), lambda: radius_case(oval, 100, 40, jitter=0.2))
        for s in (0.1, 0.3)
    )


def other_link(name: str) -> Case:
    """Return a real link with the axis that is found."""
    mesh = cover(name)
    link = Link(name, mesh, None, None, real=True)
    return Case(link, fit_surface(mesh, link.grid(45, 90)).error_field.surface, link.grid)


ROUND = {"net": (12, 160), "spacing": "curvature"}
FAMILIES: dict[str, tuple[Callable[[], Case], ...]] = {
    "cylinders": tuple(
        lambda n=n: shape_case("cylinder", {"nt": n, "nz": max(n // 4, 5)}, {"nt": 400, "nz": 100})
        for n in (12, 24, 96)
    ),
    "cones": tuple(lambda n=n: shape_case("cone", {"nt": n, "nz": n // 4}, {"nt": 400, "nz": 100}) for n in (32, 96)),
    "wrists, fine": tuple(lambda n=n: tube_case(wrist(n), fine_wrist()) for n in (100, 240)),
    "wrists, coarse": tuple(lambda n=n: tube_case(wrist(n), fine_wrist()) for n in (32, 40)),
    "rounded squares": tuple(
        lambda r=r: shape_case("rounded_square", {"rc": r}, {"rc": r, "ncorner": 60, "nflat": 60, "nz": 80}, **ROUND)
        for r in (8.0, 12.0)
    ),
    "fillets": tuple(
        lambda n=n: shape_case(
            "rounded_square",
            {"rc": 1.5, "ncorner": n},
            {"rc": 1.5, "ncorner": 60, "nflat": 60, "nz": 80},
            **ROUND,
        )
        for n in (4, 12)
    ),
    "uneven facets": tuple(
        lambda r=r, n=n: radius_case(r, *n, jitter=0.1)
        for r, n in ((sphere, (120, 4)), (torus, (120, 5)), (waist, (120, 3)), (oval, (120, 3)))
    )
    + tuple(lambda n=n: tube_case(wrist(*n), fine_wrist()) for n in ((120, 5), (120, 3), (16, 80))),
    "poles": tuple(lambda n=n: radius_case(dome, *n) for n in ((64, 48), (24, 24))),
    "saddles": tuple(lambda n=n: saddle_case(n) for n in (20, 80)),
    "noisy scans": tuple(lambda s=s: replace(tube_case(noisy(s), fine_wrist()), scan=True) for s in (0.1, 0.3, 1.0)),
    "correlated 4 mm": correlated(4),
    "correlated 8 mm": correlated(8),
    "correlated 15 mm": correlated(15),
    "real links": tuple(
        lambda n=n: held_back(n) for n in ("HRP-4C wrist", "TALOS forearm, twin", "JVRC-1 forearm", "iCub thigh")
    ),
    "spheres": tuple(lambda n=n: radius_case(sphere, n, n // 3, jitter=0.2) for n in (24, 60)),
    "tori": tuple(lambda r=r, n=n: radius_case(r, n, n // 3) for r in (torus, waist) for n in (24, 72)),
    "leaning ovals": tuple(lambda n=n: radius_case(oval, n, n // 3, lean=0.3, skew=0.01) for n in (30, 80)),
    "subdivided": (
        lambda: subdivided(shape_case("cylinder", {"nt": 24, "nz": 6}, {"nt": 400, "nz": 100})),
        lambda: subdivided(tube_case(wrist(40), fine_wrist())),
        lambda: subdivided(radius_case(waist, 30, 10, jitter=0.2)),
    ),
    "other noise": (
        lambda: scanned(tube_case(wrist(100), fine_wrist()), 0.2e-3, 0),
        lambda: scanned(tube_case(wrist(100), fine_wrist()), 0.2e-3, 2),
        lambda: scanned(radius_case(oval, 60, 30, jitter=0.2), 0.5e-3, 0),
        lambda: scanned(radius_case(sphere, 150, 80, jitter=0.2), 0.05e-3, 0),
    ),
    "other links": tuple(
        lambda n=n: other_link(n) for n in ("icub27_l_forearm", "hrp4c_r_elbow_p", "talos_tibia_light")
    ),
}


KINDS = {
    "all shapes": (
        "cylinders", "cones", "wrists, fine", "wrists, coarse", "rounded squares", "saddles", "spheres", "tori",
        "leaning ovals", "fillets", "poles",
    ),
    "all scans": ("noisy scans", "other noise", "correlated 4 mm", "correlated 8 mm", "correlated 15 mm"),
    "all links": ("real links", "other links"),
}  # fmt: skip


def wrist(around: int, along: int = 0) -> Link:
    """Return the wrist with numbers of vertices around and along."""
    return shape_link("wrist", target_shapes().wrist(nt=around, nz=along or around // 2 + 2), WRIST_AXIS)


def measure(draws: int, only: str | None = None, cases: bool = False, exact: bool = False) -> Iterator[Row]:
    """Yield three rows for each family, or for each case and net of it."""
    for family, makes in FAMILIES.items():
        if only not in (None, family):
            continue
        found, left_out, rng = [], 0, np.random.default_rng(5)
        for number, make in enumerate(makes):
            case = make()
            for net in ((10, 20), (20, 40)):
                try:
                    fit, of_net, out = fit_surface(case.link.mesh, case.grid(*net)), [], 0
                except PoorFit:  # this net is refused
                    continue
                stated = case.noise or (EXACT if exact or case.scan else MeshUncertainty())
                of_each = DRAWS_PER_SHEET // 8 if case.noise else DRAWS_PER_SHEET
                sheets = -(-draws // (2 * len(makes) * ROWS * COLUMNS * of_each))
                for sheet in range(2 * -(-sheets // 2)):
                    if case.noise:
                        fit = fit_surface(remeasured(case, rng), case.grid(*net))
                    cell = MIDDLE_CELL if sheet % 2 else CORNER_CELL
                    errors, missing = of_sheet(case, fit, cell, stated, of_each, rng)
                    of_net += errors
                    out += missing
                found += of_net
                left_out += out
                if cases:
                    yield from rows_of(f"  {number} {net}", of_net, out)
        yield from rows_of(family, found, left_out)


def rows_of(name: str, found: list, left_out: int) -> Iterator[Row]:
    """Yield the coverage of each component."""
    for component, parts in zip(COMPONENTS, zip(*found)):
        error, sigma = np.concatenate(parts, axis=1)
        ratio, scale = np.abs(error) / sigma, np.rad2deg(1.0) if component == "angle" else 1e3
        one, two = (100 * float((ratio < k).mean()) for k in (1, 2))
        sizes = (scale * float(np.sqrt((x**2).mean())) for x in (error, sigma))
        yield Row(name, component, len(error) // (2 if component == COMPONENTS[0] else 1), one, two, *sizes, left_out)


def of_sheet(
    case: Case, fit: SurfaceFit, cell: tuple[int, int], stated: MeshUncertainty, draws: int, rng: np.random.Generator
) -> tuple[list, int]:
    """Return errors and sigmas of the draws of one sheet, by component, and the number of draws that are left out."""
    field = with_mesh_uncertainty(fit, stated)
    surface, true = field.surface, case.true
    pitch = min(LARGEST_PITCH, case.link.mesh.size / CELLS_PER_SIZE)
    lattice = SheetLattice(ROWS, COLUMNS, (pitch, pitch))
    for _ in range(100):
        u = rng.uniform(0.35, 0.65) if cell == MIDDLE_CELL else rng.uniform(0.05, 0.95)
        v = rng.uniform() if surface.closed[1] else rng.uniform(0.45, 0.55) if cell == MIDDLE_CELL else rng.uniform()
        uv = np.array(((u, v),))
        point, normal = surface.points(uv)[0], surface.normals(uv)[0]
        heading = Rotation.from_rotvec(normal * rng.uniform(-MAX_HEADING, MAX_HEADING))
        along = heading.apply(unit(surface.derivatives(uv)[0, 1, 0]))
        try:
            sheet = wrap_sheet(surface, lattice, None, along, landmarks=(Landmark(cell, tuple(point)),))
            start = mounted(true, lattice, cell, point, along)
            break
        except SkinCalibError:
            continue
    else:
        return [], 0
    taxels = sheet_taxels(sheet, "t")
    arms = pitch * (taxels.index - cell)[:, ::-1]
    strain = np.abs(taxels.quality["strain"][:, :2]).max(axis=1)
    registration = Registration(ORIGIN_UNCERTAINTY, DIRECTION_UNCERTAINTY, tuple(point))
    along_rows = moved_within(arms, registration.covariance, usual_curvature(surface, taxels.uv))
    uncertainty = taxel_uncertainty(taxels, field, along_rows + stated.variance * np.eye(2))
    sigma, worst = uncertainty.sigma, np.linalg.eigh(uncertainty.angle)[1][:, :, 1]
    axes = np.stack((taxels.tangents_link, np.cross(taxels.normals_link, taxels.tangents_link)), axis=1)
    truth = case.link.truth
    height = truth(taxels.positions_link) if truth else footpoints(true, taxels.positions_link)[1]
    row_of = {taxel: row for row, taxel in enumerate(taxels.ids)}
    here = row_of[f"t.{cell[0]}.{cell[1]}"]
    known = (strain < MAX_KNOWN_STRAIN) & fit.is_trusted(taxels.uv) & np.isfinite(sigma).all(axis=1)
    found, left_out = [], 0
    even = MultivariateNormalQMC(np.zeros(3), rng=rng).random(DRAWS_PER_SHEET)
    for x, y, turn in rng.normal(size=(draws, 3)) if case.noise else even:
        marked = point
        if stated.variance and not case.noise:
            true, marked = displaced(case.true, stated, point, rng)
            height = footpoints(true, taxels.positions_link)[1]
        shifted = marked + ORIGIN_UNCERTAINTY * np.array((x, y)) @ axes[here]
        turned = true.normals(footpoints(true, shifted[None])[0])[0]
        carried = Rotation.align_vectors(turned[None], normal[None])[0].apply(along)
        carried = Rotation.from_rotvec(turned * turn * DIRECTION_UNCERTAINTY).apply(carried)
        try:
            placed = sheet_taxels(mounted(true, lattice, cell, shifted, carried, start), "t")
        except SkinCalibError:
            left_out += 1
            continue
        if np.abs(placed.quality["strain"][:, :2]).max() > MAX_KNOWN_STRAIN:
            left_out += 1
            continue
        rows = np.array([row_of[taxel] for taxel in placed.ids])
        both = known[rows]
        rows = rows[both]
        moved = np.einsum("nij,nj->ni", axes[rows], placed.positions_link[both] - taxels.positions_link[rows])
        tilted = np.einsum("nij,nj->ni", axes[rows], placed.normals_link[both] - taxels.normals_link[rows])
        found.append((
            np.stack((moved.ravel(), np.repeat(sigma[rows, 0], 2))),
            np.stack((height[rows], sigma[rows, 1])),
            np.stack(((tilted * worst[rows]).sum(axis=1), sigma[rows, 2])),
        ))  # fmt: skip
    return found, left_out


def mounted(surface: BSplineSurface, lattice: SheetLattice, cell, point: Array, along: Array, near=None):
    """Return a sheet on a surface with a cell at a point; cells beyond the edges are left out."""
    foot = surface.points(footpoints(surface, point[None])[0])[0]
    return wrap_sheet(surface, lattice, None, along, landmarks=(Landmark(cell, tuple(foot)),), trim=True, near=near)


def pooled(rows: list[Row]) -> Iterator[Row]:
    """Yield the coverage of the kinds of families together; those that are known to fail are not in a kind."""
    for kind, families in KINDS.items():
        for component in COMPONENTS:
            chosen = [r for r in rows if r.family in families and r.component == component]
            if chosen:
                draws = np.array([r.draws for r in chosen])
                one, two, error, sigma = np.average(
                    [(r.one, r.two, r.error**2, r.sigma**2) for r in chosen], axis=0, weights=draws
                )
                left_out = sum(r.left_out for r in chosen)
                yield Row(
                    kind, component, int(draws.sum()), one, two, float(np.sqrt(error)), float(np.sqrt(sigma)), left_out
                )


def table(rows: list[Row]) -> str:
    """Return the rows as columns of text."""
    lines = ["family            component    draws   1 sigma   2 sigma   rms error   rms sigma   left out"]
    for r in rows:
        numbers = f"{r.draws:8} {r.one:9.1f} {r.two:9.1f} {r.error:11.4f} {r.sigma:11.4f} {r.left_out:10}"
        lines.append(f"{r.family:17} {r.component:9} {numbers}")
    return "\n".join(lines)


def draw(rows: list[Row]):
    """Draw the coverage within one and two sigma of each component; bands are the targets."""
    figure, panels = figure_of(3, 3, "Errors of taxels within one sigma (circles) and two sigma (squares)", 3.6)
    for panel, component in zip(panels, COMPONENTS):
        chosen = [r for r in rows if r.component == component]
        at = np.arange(len(chosen))
        for low, high in ((62, 74), (92, 98)):
            panel.axvspan(low, high, color="#dcebd8")
        panel.plot([r.one for r in chosen], at, "o", color=OURS_COLOUR)
        panel.plot([r.two for r in chosen], at, "s", color=OURS_COLOUR)
        panel.set_yticks(at, [r.family for r in chosen] if component == COMPONENTS[0] else [""] * len(at))
        panel.set_ylim(len(at) - 0.5, -0.5)
        panel.set_xlim(40, 101)
        panel.set_title({"along": "along the surface", "normal": "along the normal", "angle": "normal"}[component])
        panel.set_xlabel("errors within sigma [%]")
    return figure


def main() -> None:
    """Measure, print, write, draw."""
    from run import write

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=11000, help="taxel draws of each family, at least")
    parser.add_argument("--only", choices=FAMILIES)
    parser.add_argument("--cases", action="store_true", help="print each mesh and net, too")
    parser.add_argument("--exact", action="store_true", help="parts are as their meshes")
    arguments = parser.parse_args()
    rows = []
    for row in measure(arguments.draws, arguments.only, arguments.cases, arguments.exact):
        if row.family in FAMILIES:
            rows.append(row)
        print(table([row]).splitlines()[1], flush=True)
    print(table(rows + list(pooled(rows))))
    if arguments.only is None and not arguments.exact:
        write(rows, ROOT / "out" / "uncertainty.csv")
        draw(rows).savefig(ROOT / "docs" / "uncertainty.png", dpi=DPI, metadata={"Software": None})


if __name__ == "__main__":
    main()
