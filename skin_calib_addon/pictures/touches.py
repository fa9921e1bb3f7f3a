"""Picture of touches: on the flat skin, all of them on one cell, and the angles of their forces."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..common.errors import SkinCalibError
from ..validation.directions import Directions
from ..validation.flat import flat_places
from ..validation.placement import Placement
from .calibration import blank, save_png

FIGURE_WIDTH = 12.0  # [inches]
ANGLE_STEP = 2.5  # of the histogram of angles [degrees]
PATCH_HEIGHT = 4.8  # height of one patch [inches]


def draw_touches(found: Sequence[Placement], path: str | Path, directions: Directions | None = None) -> None:
    """Draw each flat patch with its touches, all touches on one cell, and the angles of forces, into a PNG file."""
    shown = [placement for placement in found if placement.patch.kind != "imported" and len(placement.rows)]
    if not shown:
        raise SkinCalibError("no picture: only touches on sheets and boards can be drawn, as these have a flat shape")
    rows = len(shown) + (directions is not None)
    figure = blank(FIGURE_WIDTH, PATCH_HEIGHT * rows)
    figure.set_layout_engine("constrained")  # legends are below the axes
    axes = figure.subplots(rows, 2, squeeze=False, width_ratios=(2, 1))
    for (map_axis, cell_axis), placement in zip(axes, shown):
        _draw_map(map_axis, placement)
        _draw_cell(cell_axis, placement)
    if directions is not None:
        _draw_angles(axes[-1, 0], axes[-1, 1], directions)
    save_png(figure, path)


def _draw_map(axis: Any, placement: Placement) -> None:
    """Draw the flat skin, and lines from each taxel to its touches."""
    from matplotlib.collections import PolyCollection

    patch = placement.patch
    points = flat_places(patch, patch.taxels.index) * 1e3
    outlines = points[:, None] + patch.taxels.flat_corners * 1e3
    touched = np.zeros(len(points), bool)
    touched[placement.rows] = True
    colours = np.where(touched[:, None], (0.80, 0.87, 0.95), (0.94, 0.94, 0.95))
    axis.add_collection(PolyCollection(list(outlines), facecolors=colours, edgecolors="0.7", linewidths=0.5))
    starts, offsets = placement.flat * 1e3, placement.offsets[:, :2] * 1e3
    outliers = np.zeros(len(starts), bool)
    outliers[placement.outliers] = True
    for rows, colour, mark, label in (
        (~outliers, "#1f77b4", "o", "touch"),
        (outliers, "#d62728", "x", "far from its taxel"),
    ):
        if rows.any():
            (x, y), (u, v) = starts[rows].T, offsets[rows].T
            axis.plot([x, x + u], [y, y + v], color=colour, linewidth=1.0, alpha=0.7)
            axis.plot(x + u, y + v, mark, color=colour, markersize=4, label=label)
    axis.set_title(f"{patch.name}: {len(placement.rows)} touches, from the taxels that felt them", loc="left")
    axis.set_xlabel("along the rows [mm]")
    axis.set_ylabel("across [mm]")
    axis.set_aspect("equal")
    axis.autoscale_view()
    _add_legend(axis)


def _draw_cell(axis: Any, placement: Placement) -> None:
    """Draw all touches on one cell, and their mean."""
    from matplotlib.patches import Ellipse

    offsets, outline = placement.offsets[:, :2] * 1e3, placement.patch.taxels.flat_corners[placement.rows[0]] * 1e3
    closed = np.concatenate((outline, outline[:1]))
    axis.plot(*closed.T, color="0.5", linewidth=1.0, label="cell")
    axis.plot(*offsets.T, "o", color="#1f77b4", markersize=3, alpha=0.6, label="touch")
    motion = placement.motion
    if motion is not None:
        centre = motion.shift * 1e3
        width, height = 4e3 * motion.shift_error  # two standard errors to either side
        axis.add_patch(Ellipse((centre[0], centre[1]), width, height, color="#ff7f0e", alpha=0.5))
        axis.plot(*centre, "+", color="#d62728", markersize=12, markeredgewidth=2, label="shift of the skin")
        turn = f", turned {np.rad2deg(motion.turn):.2f}°" if np.isfinite(motion.turn_error) else ""
        x, y = np.round(centre, 2) + 0.0  # no minus zero
        axis.set_title(f"shifted {x:.2f}, {y:.2f} mm{turn}", loc="left")
    near = np.delete(offsets, placement.outliers, axis=0)
    half_width = 1.1 * max(np.abs(closed).max(), np.abs(near).max(initial=0.0))
    axis.set_xlim(-half_width, half_width)
    axis.set_ylim(-half_width, half_width)
    axis.axhline(0, color="0.8", linewidth=0.6, zorder=0)
    axis.axvline(0, color="0.8", linewidth=0.6, zorder=0)
    axis.set_aspect("equal")
    axis.set_xlabel("along the row [mm]")
    axis.set_ylabel("across [mm]")
    _add_legend(axis)


def _draw_angles(angle_axis: Any, tilt_axis: Any, directions: Directions) -> None:
    """Draw how many forces have which angle to the normal, and how they lean along the rows and across."""
    angles, tilts = np.rad2deg(directions.angles), np.rad2deg(directions.tilts)
    angle_axis.hist(angles, bins=np.arange(0, 91, ANGLE_STEP), color="#1f77b4", alpha=0.7, label="touches")
    angle_axis.axvline(angles.mean(), color="#d62728", label="mean")
    if directions.resolution is not None:
        angle_axis.axvline(np.rad2deg(directions.resolution), color="0.4", linestyle="--", label="noise of the sensor")
    angle_axis.set_title(f"angle between force and normal: mean {angles.mean():.1f}°", loc="left")
    angle_axis.set_xlabel("angle [degrees]")
    angle_axis.set_ylabel("touches")
    tilt_axis.plot(*tilts.T, "o", color="#1f77b4", markersize=3, alpha=0.6, label="touch")
    x, y = np.rad2deg(directions.mean_tilt)
    dx, dy = 2 * np.rad2deg(directions.tilt_error)
    tilt_axis.errorbar(x, y, dy, dx, color="#d62728", linewidth=2, label="mean, two standard errors")
    tilt_axis.set_title(f"leans by {x:.1f}° along, {y:.1f}° across", loc="left")
    tilt_axis.set_xlabel("along the row [degrees]")
    tilt_axis.set_ylabel("across [degrees]")
    tilt_axis.axhline(0, color="0.8", linewidth=0.6, zorder=0)
    tilt_axis.axvline(0, color="0.8", linewidth=0.6, zorder=0)
    tilt_axis.set_aspect("equal", adjustable="datalim")
    for axis in (angle_axis, tilt_axis):
        _add_legend(axis)


def _add_legend(axis: Any) -> None:
    """Add a legend below the drawing."""
    # a fixed distance below the axis: its label and ticks are in between
    axis.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, 0), borderaxespad=5, ncols=3, frameon=False)
