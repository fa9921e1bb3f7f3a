"""A picture of a calibration without OpenGL: faces are sorted by depth and drawn from the back."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .arrays import Array, unit
from .calibration.model import LinkCalibration
from .errors import SkinCalibError
from .geometry.distance import MeshDistance
from .geometry.mesh import TriangleMesh
from .pipeline import surface_of

QUADS = (60, 120)  # how finely a surface is drawn, along u and v
LIGHT = unit(np.array((0.3, 0.5, 0.8)))  # from the viewer's right and above
NORMAL_LENGTH = 0.006  # [m]


@dataclass(frozen=True, eq=False)
class Camera:
    """An orthographic view: rows are right, up and towards the viewer, in the link frame."""

    axes: Array

    def project(self, points: Array) -> Array:
        """Points as right, up, towards the viewer [m]."""
        return points @ self.axes.T


def look_at(normals: Array, along: Array) -> Camera:
    """A view that sees the mean of ``normals``, from a little above, with ``along`` upright."""
    front = unit(normals.mean(axis=0)) if np.linalg.norm(normals.mean(axis=0)) > 0.1 else unit(normals[0])
    towards = unit(front + 0.35 * along)
    right = unit(np.cross(along, towards))
    return Camera(np.array((right, np.cross(towards, right), towards)))


def draw_calibration(calibration: LinkCalibration, path: str | Path, mesh: TriangleMesh | None = None) -> None:
    """Draw mesh, fitted surface and taxels side by side into a PNG.

    Parameters
    ----------
    calibration : LinkCalibration
    path : path
    mesh : TriangleMesh, optional
        The cover; the surface is then coloured by its distance to it.

    Raises
    ------
    SkinCalibError
        If matplotlib is not there.
    """
    try:
        import matplotlib
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise SkinCalibError(
            "a picture needs matplotlib, which is not installed here: pip install 'skin-calib[picture]'"
        ) from error
    surface = surface_of(calibration.surfaces[0])
    u, v = (np.linspace(0, 1, k + 1) for k in QUADS)
    grid = surface.grid_points(u, v)
    quads = np.stack((grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]), axis=2).reshape(-1, 4, 3)
    quad_normals = unit(np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1]))
    taxel_normals = [p.taxels.normals_link for p in calibration.patches]
    along = unit(grid[-1].mean(axis=0) - grid[0].mean(axis=0))
    front = quad_normals[
        (np.arange(len(quads)) % QUADS[1] > 0.3 * QUADS[1]) & (np.arange(len(quads)) % QUADS[1] < 0.7 * QUADS[1])
    ]
    camera = look_at(front if surface.closed[1] or not taxel_normals else np.concatenate(taxel_normals), along)

    figure = Figure(figsize=(15, 5.6), dpi=110, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, 3)
    plain = np.array((0.78, 0.80, 0.83))
    if mesh is not None:
        _paint(axes[0], camera, [(mesh.triangles, mesh.face_normals, plain, (0.45, 0.47, 0.5, 0.35))])
        axes[0].set_title(f"{calibration.link}: cover, {len(mesh.faces)} faces")
        distance = MeshDistance(mesh)(quads.mean(axis=1))[0] * 1e3
        scale = matplotlib.colors.Normalize(0, float(np.quantile(distance, 0.995)))
        colours = matplotlib.colormaps["turbo"](scale(distance))[:, :3]
        bar = figure.colorbar(matplotlib.cm.ScalarMappable(scale, "turbo"), ax=axes[1], shrink=0.75)
        bar.set_label("distance to the mesh [mm]")
    else:
        _paint(axes[0], camera, [(quads, quad_normals, plain, None)])
        axes[0].set_title(f"{calibration.link}: surface")
        colours = np.broadcast_to(plain, (len(quads), 3))
    _paint(axes[1], camera, [(quads, quad_normals, colours, None)])
    axes[1].set_title("fitted surface")

    layers: list[Any] = [(quads - 2e-4 * quad_normals[:, None], quad_normals, plain, None)]
    strains = [
        np.abs(p.taxels.quality["strain"][:, :2]).max(axis=1)
        for p in calibration.patches
        if "strain" in p.taxels.quality
    ]
    scale = matplotlib.colors.Normalize(0, max(100 * float(np.concatenate(strains).max()), 0.1) if strains else 1)
    for patch in calibration.patches:
        t = patch.taxels
        strain = 100 * np.abs(t.quality["strain"][:, :2]).max(axis=1) if "strain" in t.quality else np.zeros(len(t.ids))
        colours = matplotlib.colormaps["viridis"](scale(strain))[:, :3]
        layers.append((t.corners_link + 3e-4 * t.normals_link[:, None], t.normals_link, colours, "white"))
    _paint(axes[2], camera, layers)
    for patch in calibration.patches:
        _draw_normals(axes[2], camera, patch.taxels.positions_link, patch.taxels.normals_link)
    if strains:
        bar = figure.colorbar(matplotlib.cm.ScalarMappable(scale, "viridis"), ax=axes[2], shrink=0.75)
        bar.set_label("strain of the cell [%]")
    axes[2].set_title(f"{sum(len(p.taxels.ids) for p in calibration.patches)} taxels and their normals")
    figure.tight_layout()
    figure.savefig(path, metadata={"Software": None})


def _paint(axis: Any, camera: Camera, layers: list[Any]) -> None:
    """Draw layers of polygons (k, c, 3) with their normals and colours.

    What faces away comes first, then layer by layer, the further ones first: a cell and the surface it lies on are
    too close for their depths to tell which is in front.
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
    middle, reach = (shown.min(axis=0) + shown.max(axis=0)) / 2, 0.52 * np.ptp(shown, axis=0).max()
    axis.set_xlim(middle[0] - reach, middle[0] + reach)
    axis.set_ylim(middle[1] - reach, middle[1] + reach)


def _draw_normals(axis: Any, camera: Camera, positions: Array, normals: Array) -> None:
    """Sticks along the normals of the taxels that face the viewer."""
    from matplotlib.collections import LineCollection

    seen = normals @ camera.axes[2] > 0
    sticks = np.stack((positions, positions + NORMAL_LENGTH * normals), axis=1)[seen]
    axis.add_collection(LineCollection(list(camera.project(sticks)[..., :2] * 1e3), colors="#d62728", linewidths=1.1))
    dots = camera.project(positions[seen])[:, :2] * 1e3
    axis.plot(dots[:, 0], dots[:, 1], "o", color="#d62728", markersize=2)
