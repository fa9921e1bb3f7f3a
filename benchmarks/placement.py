"""Placement: positions of the cells of a sheet and the time to compute them, for ours, the paper's rule and equal arcs.

The truth is the exact unrolling of a cylinder and of two cones. On the wrist sample, which is doubly curved and scaled
by 1.18, it is a lattice four times as fine. The sheet is the paper's: 6 x 22 cells of 10 mm.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from links import has_shapes
from measure import timed
from stability import wrist_link

from skin_calib_addon.geometry import Axis, BSplineSurface, TriangleMesh, TubeGrid, fit_surface, weld
from skin_calib_addon.skin import SheetLattice, WrappedSheet, wrap_sheet

ROWS, COLUMNS, PITCH = 6, 22, 0.01
SHEET = SheetLattice(ROWS, COLUMNS, (PITCH, PITCH))
LENGTH = 0.16  # of the tubes [m]
TUBES = {"cylinder 35 mm": (0.035, 0.035), "cone 4.3 degrees": (0.042, 0.030), "cone 11.3 degrees": (0.058, 0.026)}
WRIST_SCALE = 1.18
GRID = TubeGrid(20, 60, margin=1e-4)
Z_AXIS = Axis((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
Array = np.ndarray


@dataclass(frozen=True)
class Row:
    """One method that places 132 cells on one surface."""

    surface: str
    method: str
    mean: float  # [mm] off the truth
    max: float  # [mm]
    milliseconds: float


def measure(repeats: int) -> Iterator[Row]:
    """Yield all rows."""
    for name, ends in TUBES.items():
        mesh = tube(*ends)
        for kind, chords in (("facets", False), ("facets as chords", True)):
            surface = fit_surface(mesh, TubeGrid(20, 60, Z_AXIS, 1e-4), chords=chords).surface
            yield from rows(f"{name}, {kind}", surface, lambda s, e=ends: unrolled(s, e), repeats)
    if has_shapes():
        mesh = wrist_link().mesh
        surface = fit_surface(weld(WRIST_SCALE * mesh.vertices, mesh.faces), GRID).surface
        yield from rows("wrist x 1.18", surface, finer, repeats)


def rows(name: str, surface: BSplineSurface, truth: Callable[[WrappedSheet], Array], repeats: int) -> Iterator[Row]:
    """Yield every method on one surface, compared with the truth for the same middle and direction."""
    sheet = wrap_sheet(surface, SHEET, None, across(surface))
    exact, middle = truth(sheet), sheet.uv[ROWS, COLUMNS]
    for method, place in METHODS.items():
        found, milliseconds = timed(lambda place=place: place(surface, middle), repeats)
        off = 1e3 * np.linalg.norm(found - exact, axis=1)
        yield Row(name, method, float(off.mean()), float(off.max()), milliseconds)


def across(surface: BSplineSurface) -> Array:
    """Return the direction of the rows: the one along y on tubes about z, and across the bent wrist."""
    tangent = surface.derivatives(np.array((0.5, 0.5)))[0, 1, 0]
    return tangent * np.sign(tangent[1])


def ours(surface: BSplineSurface, middle: Array) -> Array:
    """Place cells with the least strain; the middle is found automatically."""
    return surface.points(wrap_sheet(surface, SHEET, None, across(surface)).uv[1::2, 1::2].reshape(-1, 2))


def paper_rule(surface: BSplineSurface, middle: Array) -> Array:
    """Place cells by the paper's rule at its best: equal steps of the parameters around the middle of the sheet.

    In the paper, S(k / 6, l / 22) covers the whole surface, and corners of cells stand for their centres. Here the
    steps are those of the sheet, to the centres of the cells.
    """
    steps = PITCH / np.linalg.norm(surface.derivatives(middle)[(1, 0), (0, 1), 0], axis=1)
    return surface.points(middle + cells_about_the_middle() * steps * facing(surface, middle))


def equal_arcs(surface: BSplineSurface, middle: Array) -> Array:
    """Place cells at equal lengths along the curve of constant v in the middle, then along curves of constant u."""
    fine = np.linspace(0, 1, 2001)
    sign = facing(surface, middle)
    along_u = arcs(surface.points(np.column_stack((fine, np.full_like(fine, middle[1])))))
    here = np.interp(middle[0], fine, along_u)
    u = np.interp(here + sign[0] * (np.arange(ROWS) - (ROWS - 1) / 2) * PITCH, along_u, fine)
    places = []
    for height in u:
        round_ = np.column_stack((np.full_like(fine, height), fine))
        along_v = arcs(surface.points(round_))
        wanted = np.interp(middle[1], fine, along_v) + sign[1] * (np.arange(COLUMNS) - (COLUMNS - 1) / 2) * PITCH
        turns = np.floor(wanted / along_v[-1])
        places.append(surface.points(np.column_stack((
            np.full(COLUMNS, height), turns + np.interp(wanted - turns * along_v[-1], along_v, fine)
        ))))  # fmt: skip
    return np.concatenate(places)


def arcs(points: Array) -> Array:
    """Return the length of a polyline from its first point to each point."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))


def cells_about_the_middle() -> Array:
    """Return row and column of each cell relative to the middle of the sheet, shape (132, 2)."""
    i, j = np.divmod(np.arange(ROWS * COLUMNS), COLUMNS)
    return np.column_stack((i - (ROWS - 1) / 2, j - (COLUMNS - 1) / 2))


def facing(surface: BSplineSurface, middle: Array) -> Array:
    """Return for u and v whether the rows along y run with the parameter (1) or against it (-1)."""
    r = surface.derivatives(middle)
    normal = np.cross(r[1, 0, 0], r[0, 1, 0])
    row = np.array((0, 1.0, 0))
    return np.sign((np.cross(normal, row) @ r[1, 0, 0], row @ r[0, 1, 0]))


METHODS = {
    "ours": ours,
    "equal arc lengths": equal_arcs,
    "paper's rule": paper_rule,
}


def tube(bottom: float, top: float, around: int = 96, along: int = 49) -> TriangleMesh:
    """Return a tube about z with radii from ``bottom`` to ``top`` [m]."""
    height, angle = np.meshgrid(np.linspace(0, 1, along), 2 * np.pi * np.arange(around) / around, indexing="ij")
    radius = bottom + (top - bottom) * height
    points = np.stack((radius * np.cos(angle), radius * np.sin(angle), LENGTH * height), axis=-1).reshape(-1, 3)
    i, j = (k.ravel() for k in np.indices((along - 1, around)))
    a, b = i * around + j, i * around + (j + 1) % around
    faces = np.concatenate((np.column_stack((a, b, b + around)), np.column_stack((a, b + around, a + around))))
    return weld(points, faces)


def unrolled(sheet: WrappedSheet, ends: tuple[float, float]) -> Array:
    """Return exact positions of the cells on a cone about z, for the sheet's middle and rows along y."""
    bottom, top = ends
    x, y, height = sheet.surface.points(sheet.uv[ROWS, COLUMNS][None])[0]
    start, slope = np.arctan2(y, x), np.arctan((bottom - top) / LENGTH)
    radius = bottom + (top - bottom) * height / LENGTH
    round_ = np.array((-np.sin(start), np.cos(start), 0))
    up = np.array((-np.sin(slope) * np.cos(start), -np.sin(slope) * np.sin(start), np.cos(slope)))
    along = np.array((0, 1.0, 0))
    heading = np.arctan2(along @ up, along @ round_)
    i, j = cells_about_the_middle().T * PITCH
    a = np.cos(heading) * j - np.sin(heading) * i
    b = np.sin(heading) * j + np.cos(heading) * i
    if slope == 0:
        turn, far, z = a / radius, np.full_like(a, radius), height + b
    else:
        tip = radius / np.sin(slope)
        limit, turn = np.hypot(a, tip - b), np.arctan2(a, tip - b) / np.sin(slope)
        far, z = limit * np.sin(slope), height + (tip - limit) * np.cos(slope)
    return np.column_stack((far * np.cos(start + turn), far * np.sin(start + turn), z))


def finer(sheet: WrappedSheet) -> Array:
    """Return the centres of the same cells in a lattice four times as fine."""
    fine = SheetLattice(4 * ROWS, 4 * COLUMNS, (PITCH / 4, PITCH / 4))
    uv = wrap_sheet(sheet.surface, fine, None, across(sheet.surface)).uv[4::8, 4::8]
    return sheet.surface.points(uv.reshape(-1, 2))


def table(rows: list[Row]) -> str:
    """Return the rows as columns of text."""
    lines = ["surface                              method                      mean mm    max mm       ms"]
    lines += [f"{r.surface:36} {r.method:24} {r.mean:10.4f} {r.max:9.4f} {r.milliseconds:8.1f}" for r in rows]
    return "\n".join(lines)
