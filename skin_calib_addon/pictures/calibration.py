"""Picture of a calibration without OpenGL: faces are sorted by depth and drawn from the back."""

import io
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..calibration.model import LinkCalibration, TaxelArray
from ..common.arrays import Array, unit
from ..common.atomic_file import write_bytes_safely
from ..common.errors import SkinCalibError
from ..common.packages import optional_package
from ..geometry.mesh.distance import closest
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..geometry.sampling.planes import perpendicular
from ..pipeline.calibrate import surface_of

# Faces of a drawn surface along u and v. Larger: smoother, slower.
QUAD_COUNTS = (60, 120)
LIGHT = unit(np.array((0.3, 0.5, 0.8)))  # direction of the light: from the right of the viewer and above
# Length of a drawn normal [m].
DRAWN_NORMAL_LENGTH = 0.006
CIRCLE_POINTS = 25  # of a drawn circle. Larger: rounder
PLAIN = np.array((0.78, 0.80, 0.83))  # colour of faces without a value
NOTE_COLOUR = "#8a2b06"  # of warnings
NOTE_LINE_HEIGHT = 0.15  # of a line of text [inches]
WRAP_WIDTH = 85  # characters of text below each panel. Larger: text is cut off.
MAX_WARNINGS_SHOWN = 12  # warnings in a picture. Larger: a higher picture.
# Values that can colour the cells; the first available one is used: name, scale, smallest end of the bar, label.
SHOWN = (
    ("strain", 100.0, 0.1, "strain of the cell [%]"),
    ("gap", 1e3, 0.1, "height of corners, or of the taxel [mm]"),
)


@dataclass(frozen=True, eq=False)
class Camera:
    """An orthographic view; the rows of ``axes`` point right, up and towards the viewer, in the link frame."""

    axes: Array

    def project(self, points: Array) -> Array:
        """Return points as right, up, towards the viewer [m]."""
        return points @ self.axes.T


def look_at(normals: Array, along: Array) -> Camera:
    """Return a view along the mean of ``normals``, from slightly above, with ``along`` upright."""
    front = unit(normals.mean(axis=0)) if np.linalg.norm(normals.mean(axis=0)) > 0.1 else unit(normals[0])
    towards = unit(front + 0.35 * along)
    right = np.cross(along, towards)
    right = unit(right) if np.linalg.norm(right) > 1e-6 else perpendicular(towards)  # the view is parallel to ``along``
    return Camera(np.array((right, np.cross(towards, right), towards)))


def draw_calibration(calibration: LinkCalibration, path: str | Path, mesh: TriangleMesh | None = None) -> None:
    """Draw mesh, fitted surface and taxels side by side into a PNG file."""
    if not calibration.surfaces:
        raise SkinCalibError(f"the calibration of '{calibration.link}' has no surface to draw; fit its plan")
    figure = blank(1, 1)  # raises before the computation if matplotlib is missing
    grids = [surface_of(s).grid_points(*(np.linspace(0, 1, k + 1) for k in QUAD_COUNTS)) for s in calibration.surfaces]
    grid, all_quads = grids[0], np.concatenate([quads_of(grid) for grid in grids])
    quads, all_normals = quads_of(grid), _quad_normals(all_quads)
    normals = all_normals[: len(quads)]
    camera = look_at(_visible_normals(calibration, normals), unit(grid[-1].mean(axis=0) - grid[0].mean(axis=0)))
    of_mesh = [_mesh_panel(calibration, mesh), _error_panel(calibration, all_quads, all_normals, mesh)] if mesh else []
    panels = [*of_mesh, _taxel_panel(calibration, all_quads, all_normals)]
    notes = _notes(calibration, WRAP_WIDTH * len(panels))
    height = 5 + NOTE_LINE_HEIGHT * len(notes)
    figure.set_size_inches(5 * len(panels), height)
    low, scale = 1 - 5 / height, 5 / height  # the panels are above the notes
    for i, line in enumerate(notes):
        figure.text(
            0.01, (len(notes) - i - 0.5) * NOTE_LINE_HEIGHT / height, line, size=7, va="center", color=NOTE_COLOUR
        )
    for i, panel in enumerate(panels):
        left, width = i / len(panels), 1 / len(panels)
        axis = figure.add_axes((left + 0.02 * width, low + 0.01 * scale, 0.76 * width, 0.9 * scale))
        axis.set_title(panel.title)
        paint(axis, camera, panel.layers)
        if panel is panels[-1]:
            _decorate(axis, camera, calibration)
        if panel.colours:
            bar = figure.add_axes((left + 0.82 * width, low + 0.15 * scale, 0.03 * width, 0.65 * scale))
            figure.colorbar(panel.colours, bar, label=panel.unit)
    save_png(figure, path)


def _notes(calibration: LinkCalibration, width: int) -> list[str]:
    """Return the first `MAX_WARNINGS_SHOWN` warnings of a calibration as numbered lines of limited width."""
    shown = calibration.warnings[:MAX_WARNINGS_SHOWN]
    texts = [f"{number} {w.severity}: {w}" for number, w in enumerate(shown, 1)]
    left = len(calibration.warnings) - len(shown)
    texts += [f"{left} more: see show or check"] if left else []
    return [line for text in texts for line in wrap(text, width, subsequent_indent="   ")]


def quads_of(grid: NDArray[Any]) -> NDArray[Any]:
    """Return the corners (k, 4, c) of the faces between the points (n, m, c) of a grid."""
    return np.stack((grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]), axis=2).reshape(-1, 4, grid.shape[2])


def _quad_normals(quads: Array) -> Array:
    return unit(np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1]))


def blank(width: float, height: float) -> Any:
    """Return an empty figure without a window."""
    with optional_package("a picture needs matplotlib", "picture"):
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    figure = Figure(figsize=(width, height), dpi=110, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def save_png(figure: Any, path: str | Path) -> None:
    """Write a figure; the same drawing gives the same bytes."""
    data = io.BytesIO()
    figure.savefig(data, format="png", metadata={"Software": None})
    write_bytes_safely(path, data.getvalue())


def _visible_normals(calibration: LinkCalibration, normals: Array) -> Array:
    """Return normals of the side to look at: the taxels of an open surface, the side of a tube opposite its seam."""
    taxels = [p.taxels.normals_link for p in calibration.patches]
    if taxels and not calibration.surfaces[0].closed[1]:
        return np.concatenate(taxels)
    return normals[np.abs(np.arange(len(normals)) % QUAD_COUNTS[1] / QUAD_COUNTS[1] - 0.5) < 0.2]


@dataclass(frozen=True, eq=False)
class _Panel:
    """One drawing: layers of polygons with normals, colours and outlines, and a colour bar from zero."""

    title: str
    layers: list[Any]
    colours: Any = None
    unit: str = ""


def _scale(name: str, largest: float) -> Any:
    """Return colours from zero to a largest value."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    return ScalarMappable(Normalize(0, largest), name)


def _mesh_panel(calibration: LinkCalibration, mesh: TriangleMesh) -> _Panel:
    layer = (mesh.triangles, mesh.face_normals, PLAIN, (0.45, 0.47, 0.5, 0.35))
    return _Panel(f"{calibration.link}: cover, {len(mesh.faces)} faces", [layer])


def _error_panel(calibration: LinkCalibration, quads: Array, normals: Array, mesh: TriangleMesh) -> _Panel:
    errors = [surface.errors.surface_to_mesh for surface in calibration.surfaces]
    largest = max(e.max for e in errors)
    which = "surface" if len(errors) == 1 else f"worst of {len(errors)} surfaces"
    title = f"{which}: mean {max(e.mean for e in errors) * 1e3:.3f} mm, max {largest * 1e3:.3f} mm"
    u, v = ((np.arange(k) + 0.5) / k for k in QUAD_COUNTS)
    # Points of the surfaces; a quad is a chord of them.
    middles = [surface_of(surface).grid_points(u, v).reshape(-1, 3) for surface in calibration.surfaces]
    distance = closest(mesh, np.concatenate(middles))[0]
    scale = _scale("turbo", 1e3 * min(largest, 5 * max(e.rms for e in errors)))
    beyond = distance > 2 * largest  # the surface extends beyond the mesh
    colours = np.where(beyond[:, None], PLAIN, scale.to_rgba(1e3 * distance)[:, :3])
    return _Panel(title, [(quads, normals, colours, None)], scale, "distance to the mesh [mm]")


def _taxel_panel(calibration: LinkCalibration, quads: Array, normals: Array) -> _Panel:
    taxels = [p.taxels for p in calibration.patches]
    title = f"{sum(len(t.ids) for t in taxels)} taxels and their normals"
    if any(np.isfinite(t.sigma).any() for t in taxels):
        title += "\ncircles: one sigma along the surface"
    shown = {name for t in taxels for name in t.quality}
    name, factor, least, unit = next((q for q in SHOWN if q[0] in shown), SHOWN[0])
    values = [factor * np.abs(t.quality.get(name, np.zeros((len(t.ids), 1)))) for t in taxels]
    values = [v.reshape(len(v), -1)[:, :2].max(axis=1) for v in values]
    colours = _scale("viridis", max(least, *(float(v.max()) for v in values)) if values else least)
    cells = [(t.corners_link, t.normals_link, colours.to_rgba(v)[:, :3], "white") for t, v in zip(taxels, values)]
    return _Panel(title, [(quads, normals, PLAIN, None), *cells], colours, unit)


def _decorate(axis: Any, camera: Camera, calibration: LinkCalibration) -> None:
    """Draw normals and uncertainties of the taxels, and the numbers of the warnings at their places."""
    for patch in calibration.patches:
        _draw_normals(axis, camera, patch.taxels.positions_link, patch.taxels.normals_link)
        _draw_sigma(axis, camera, patch.taxels)
    for number, warning in enumerate(calibration.warnings[:MAX_WARNINGS_SHOWN], 1):
        if warning.where.point is not None:
            x, y = 1e3 * camera.project(np.array(warning.where.point))[:2]
            axis.plot(x, y, "o", markersize=11, markerfacecolor="white", markeredgecolor=NOTE_COLOUR)
            axis.text(x, y, str(number), size=7, ha="center", va="center", color=NOTE_COLOUR)


def paint(axis: Any, camera: Camera, layers: list[Any]) -> None:
    """Draw layers of polygons (k, c, 3) with their normals and colours.

    Faces that point away are drawn first. Then the layers follow in order, each from far to near. The depths of a cell
    and of the surface under it are too similar for a common order.
    """
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import to_rgba

    outlines, faces, edges, keys = [], [], [], []
    for number, (polygons, normals, colour, edge) in enumerate(layers):
        view = camera.project(polygons)
        facing = normals @ camera.axes[2]
        shade = 0.45 + 0.55 * np.clip((normals @ camera.axes.T) @ LIGHT, 0, 1)
        shade = np.where(facing > 0, shade, 0.35)
        rgb = np.clip(np.broadcast_to(colour, (len(polygons), 3)) * shade[:, None], 0, 1)
        rgba = np.column_stack((rgb, np.ones(len(rgb))))
        outlines += list(view[..., :2] * 1e3)
        faces.append(rgba)
        edges.append(rgba if edge is None else np.broadcast_to(to_rgba(edge), rgba.shape))
        keys.append(np.column_stack((view[..., 2].mean(axis=1), np.full(len(view), number), facing > 0)))
    order = np.lexsort(np.concatenate(keys).T)
    collection = PolyCollection(
        [outlines[i] for i in order],
        facecolors=np.concatenate(faces)[order],
        edgecolors=np.concatenate(edges)[order],
        linewidths=0.4,
    )
    axis.add_collection(collection)
    axis.set_aspect("equal")
    axis.set_axis_off()
    shown = np.concatenate([camera.project(layer[0])[..., :2].reshape(-1, 2) for layer in layers]) * 1e3
    middle, half_width = (shown.min(axis=0) + shown.max(axis=0)) / 2, 0.52 * np.ptp(shown, axis=0).max()
    axis.set_xlim(middle[0] - half_width, middle[0] + half_width)
    axis.set_ylim(middle[1] - half_width, middle[1] + half_width)


def _draw_sigma(axis: Any, camera: Camera, taxels: TaxelArray) -> None:
    """Draw a circle of one sigma along the surface around the taxels that face the viewer, where it is known."""
    from matplotlib.collections import LineCollection

    sigma = taxels.known_sigma[:, 0]
    seen = (taxels.normals_link @ camera.axes[2] > 0) & np.isfinite(sigma)
    angles = np.linspace(0, 2 * np.pi, CIRCLE_POINTS)
    arms = np.stack((np.cos(angles), np.sin(angles)), axis=1) @ taxels.axes_link
    circles = (taxels.positions_link[:, None] + sigma[:, None, None] * arms)[seen]
    axis.add_collection(LineCollection(list(camera.project(circles)[..., :2] * 1e3), colors="#d62728", linewidths=0.6))


def _draw_normals(axis: Any, camera: Camera, positions: Array, normals: Array) -> None:
    """Draw lines along the normals of the taxels that face the viewer."""
    from matplotlib.collections import LineCollection

    seen = normals @ camera.axes[2] > 0
    sticks = np.stack((positions, positions + DRAWN_NORMAL_LENGTH * normals), axis=1)[seen]
    axis.add_collection(LineCollection(list(camera.project(sticks)[..., :2] * 1e3), colors="#d62728", linewidths=1.1))
    dots = camera.project(positions[seen])[:, :2] * 1e3
    axis.plot(dots[:, 0], dots[:, 1], "o", color="#d62728", markersize=2)
