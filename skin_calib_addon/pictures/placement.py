"""Picture of a skin at a place: the link, the surface with its planes, and the cells that fit or do not."""

from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

from ..common.arrays import Array, BoolArray, tangential, unit
from ..common.errors import millimetres
from ..geometry.mesh.distance import closest
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..proposal.one_skin import Placement
from .calibration import PLAIN, Camera, blank, look_at, paint, quads_of, save_png

SURFACE, FITS, OFF, NEAREST = (0.62, 0.75, 0.90), (0.0, 0.62, 0.45), (0.84, 0.37, 0.0), "#0072b2"  # colours
PLANE_COLOUR = (0.25, 0.3, 0.4, 0.6)
FAR = 0.1  # of the size of the link: what is farther from it is not drawn. Larger: the link is smaller
WRAP_WIDTH = 110  # characters of a line of text. Larger: text is cut off


def draw_placement(mesh: TriangleMesh, placed: Placement, nearest: Placement | None, path: str | Path) -> None:
    """Draw a placement from outside into a PNG file, and the outline of the nearest one that fits."""
    figure = blank(8, 8.6)
    axis = figure.add_axes((0.02, 0.1, 0.96, 0.84))
    spot = placed.spot
    along = tangential(np.array([spot.direction]), spot.normal[None])[0]
    camera = look_at(spot.normal[None], np.cross(spot.normal, along) if along.any() else spot.normal)
    layers: list[Any] = [(mesh.triangles, mesh.face_normals, PLAIN, (0.45, 0.47, 0.5, 0.35))]
    if placed.proposed is not None:
        layers.append(_surface_layer(placed))
    layers += [
        (c, _normals(c), colour, "white")
        for cells, colour in ((placed.on, FITS), (placed.off, OFF))
        if len(c := cells[_is_near(cells, mesh).all(axis=1)])
    ]
    paint(axis, camera, layers)
    if placed.proposed is not None:
        _draw_planes(axis, camera, placed, mesh)
    notes = [f"{millimetres(spot.point)}: {placed.problem or 'the skin fits'}"]
    if nearest is not None:
        for outline in nearest.on:
            x, y = 1e3 * camera.project(np.vstack((outline, outline[:1])))[:, :2].T
            axis.plot(x, y, color=NEAREST, linewidth=0.8)
        notes.append(f"blue outlines: it fits at {millimetres(nearest.spot.point)}")
    x, y = 1e3 * camera.project(np.array(spot.point))[:2]
    axis.plot(x, y, "k+", markersize=14, markeredgewidth=2)
    axis.set_title(
        "cross: the point; light blue: its surface; lines: planes; green: cells that fit; orange: cells that do not",
        fontsize=9,
    )
    lines = [line for note in notes for line in wrap(note, WRAP_WIDTH)]
    figure.text(0.02, 0.02, "\n".join(lines), size=8, va="bottom")
    save_png(figure, path)


def _surface_layer(placed: Placement) -> tuple[Array, Array, tuple[float, float, float], None]:
    """Return the quads of the surface of a placement inside its boundary."""
    assert placed.proposed is not None
    fit = placed.proposed.fit
    u, v = (np.linspace(0, 1, 6 * n) for n in fit.offsets.shape)
    grid = fit.error_field.surface.grid_points(u, v)
    inside = fit.is_trusted(np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)).reshape(grid.shape[:2])
    quads = quads_of(grid)[quads_of(inside[..., None]).all(axis=(1, 2))]
    return quads, _normals(quads), SURFACE, None


def _normals(polygons: Array) -> Array:
    """Return the unit normals of polygons (k, c, 3)."""
    return unit(np.cross(polygons[:, 1] - polygons[:, 0], polygons[:, 2] - polygons[:, 0]))


def _is_near(points: Array, mesh: TriangleMesh) -> BoolArray:
    """Return which points (..., 3) are near the link: others are on an extrapolated surface."""
    return (closest(mesh, points.reshape(-1, 3))[0] < FAR * mesh.size).reshape(points.shape[:-1])


def _draw_planes(axis: Any, camera: Camera, placed: Placement, mesh: TriangleMesh) -> None:
    """Draw the lines of control points in each plane, where they face the viewer."""
    from matplotlib.collections import LineCollection

    assert placed.proposed is not None
    fit = placed.proposed.fit
    net, facing = fit.surface.control_net, fit.lines.directions @ camera.axes[2] > 0
    more = [(0, n - k) for n, k in zip(net.shape, facing.shape)]  # a closed surface repeats its first control points
    facing = np.pad(facing, more, mode="wrap") & _is_near(net, mesh)
    points = 1e3 * np.where(facing[..., None], camera.project(net), np.nan)[..., :2]
    axis.add_collection(LineCollection([*points, *points.swapaxes(0, 1)], colors=[PLANE_COLOUR], linewidths=0.5))
