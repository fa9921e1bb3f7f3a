"""Picture of a replayed recording: largest forces, paths of contacts, CoP and supporting polygons."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..common.arrays import Array
from ..runtime.frame import Frame
from ..runtime.skin import Skin
from .calibration import blank, save_png

STYLES = {"outer": ("#9aa7b8", ":"), "nominal": ("#1552c0", "--"), "guaranteed": ("#1a9a3a", "-")}  # of polygons
# Number of frames with drawn polygons.
MAX_POLYGONS = 6


def draw_replay(skin: Skin, frames: Sequence[Frame], path: str | Path) -> None:
    """Draw the largest force on each taxel, the paths of the contacts, and forces over time into a PNG file.

    A skin with a ground is drawn on it, seen from the robot, with the CoP and some supporting polygons. Another skin is
    drawn patch by patch in its rows and columns.
    """
    figure = blank(12, 5.2)
    place, course = figure.subplots(1, 2, width_ratios=(1.35, 1))
    peak = np.array([frame.forces for frame in frames]).max(axis=0)
    cells = _cells(skin)
    _draw_cells(figure, place, cells, peak)
    if skin.ground is None:
        _draw_paths(place, skin, frames)
        place.set(title="largest force on each taxel, and paths of the contacts", xlabel="column", ylabel="row")
    else:
        _draw_support(place, frames)
        place.set(title="largest force, CoP and supporting polygons", xlabel="x on the ground [mm]", ylabel="y [mm]")
    place.set_aspect("equal")
    _draw_forces(course, frames)
    figure.tight_layout()
    save_png(figure, path)


def _cells(skin: Skin) -> Array:
    """Return outlines (n, k, 2): on the ground [mm], or unit squares in rows and columns, patch above patch."""
    if skin.ground is not None:
        return 1e3 * skin.ground.corners
    return _index(skin)[:, None, ::-1] + np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])


def _index(skin: Skin) -> Array:
    """Return row and column (n, 2) of each taxel, patch above patch."""
    index = skin.geometry.index.astype(float)
    for patch in range(1, int(skin.geometry.patch.max(initial=0)) + 1):
        mine = skin.geometry.patch == patch
        index[mine, 0] += index[~mine & (skin.geometry.patch < patch), 0].max() + 2 - index[mine, 0].min()
    return index


def _draw_cells(figure: Any, axes: Any, cells: Array, forces: Array) -> None:
    from matplotlib.collections import PolyCollection

    drawn = PolyCollection(list(cells), array=forces, cmap="YlOrRd", edgecolors="0.75", linewidths=0.4)
    drawn.set_clim(0, max(float(forces.max(initial=0.0)), 1e-9))
    axes.add_collection(drawn)
    axes.autoscale_view()
    figure.colorbar(drawn, ax=axes, shrink=0.75, label="force [N]")


def _draw_paths(axes: Any, skin: Skin, frames: Sequence[Frame]) -> None:
    """Draw the path of each contact in rows and columns."""
    index = _index(skin)
    paths: dict[int, list[Array]] = {}
    for frame in frames:
        for contact in frame.contacts:
            strongest = contact.taxels[contact.forces.argmax()]
            near = np.abs(index[contact.taxels] - index[strongest]).max(axis=1) < 8  # not across the seam
            paths.setdefault(contact.number, []).append(
                contact.forces[near] @ index[contact.taxels[near]] / contact.forces[near].sum()
            )
    for k, path_ in enumerate(paths.values()):
        row, column = np.array(path_).T
        axes.plot(column, row, "-", color=f"C{k % 10}", linewidth=1.2)
        axes.plot(column[-1], row[-1], "o", color=f"C{k % 10}", markersize=4)


def _draw_support(axes: Any, frames: Sequence[Frame]) -> None:
    """Draw the path of the CoP, and the polygons of some frames."""
    standing = [frame for frame in frames if frame.cop is not None]
    if not standing:
        return
    x, y = 1e3 * np.array([frame.cop for frame in standing]).T
    for k, frame in enumerate(standing[:: max(1, len(standing) // MAX_POLYGONS)]):
        for name, (colour, style) in STYLES.items():
            corners = 1e3 * getattr(frame.polygon, name).corners
            if len(corners):
                loop = np.concatenate((corners, corners[:1]))
                axes.plot(*loop.T, style, color=colour, linewidth=1.0, alpha=0.7, label=None if k else name)
    axes.plot(x, y, "-", color="black", linewidth=1.3, label="CoP")
    axes.plot(x[-1], y[-1], "o", color="black", markersize=4)
    axes.legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.08), ncols=4, frameon=False)


def _draw_forces(axes: Any, frames: Sequence[Frame]) -> None:
    """Draw the force of each contact over time, and mark flagged frames."""
    courses: dict[int, list[tuple[float, float]]] = {}
    for frame in frames:
        for contact in frame.contacts:
            courses.setdefault(contact.number, []).append((frame.time, contact.force))
    for k, (number, course) in enumerate(courses.items()):
        label = f"contact {number}" if len(courses) <= 10 else None
        axes.plot(*np.array(course).T, ".-", color=f"C{k % 10}", markersize=2, linewidth=1.0, label=label)
    flagged = [frame.time for frame in frames if frame.flags]
    axes.plot(flagged, np.zeros(len(flagged)), "|", color="#d62728", markersize=9, label="flagged" if flagged else None)
    axes.set(title="force of each contact", xlabel="time [s]", ylabel="force [N]")
    axes.grid(alpha=0.3)
    if len(courses) <= 10 and (courses or flagged):
        axes.legend(fontsize=8)
