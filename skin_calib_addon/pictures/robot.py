"""Picture of a robot in its zero pose: its links, and the cells of its skins."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from ..calibration.model import LinkCalibration
from ..common.arrays import Array, BoolArray, IntArray, ranges, unit
from ..geometry.mesh.triangle_mesh import TriangleMesh
from .calibration import LIGHT, PLAIN, Camera, blank, look_at, save_png

COVERED = np.array((0.93, 0.42, 0.13))  # colour of cells
KEPT_OUT = np.array((0.45, 0.56, 0.72))  # colour of faces that other links cover
# Directions from which the robot is seen, with z upwards. Most robots look along x (REP 103), some along -x.
VIEWS = {"from +x": (1.0, 0.6, 0.0), "from -x": (-1.0, -0.6, 0.0)}
HEAD_HEIGHT = 0.5  # of title and legend [inches]. Larger: more distance to the robot.
DARKEST = 0.45  # brightness of faces without light. Larger: the shape is less visible.
LEGEND_SHIFT = 0.07  # of the entries of the legend to the left, by half their text. Larger: farther to the left.
MEAN_SHADE = 0.85  # brightness of the colours in the legend. Larger: lighter than most faces.
PICTURE_HEIGHT = 1100  # of a view [pixels]. Larger: finer, slower.
MIN_WIDTH = 350  # of a view [pixels]. Larger: more empty space next to slim robots; smaller: the title may be cut off.
# Distance by which cells are drawn nearer to the viewer [m]. Larger: fewer faces hide cells that are below them, but
# cells show through thin covers.
CELL_LIFT = 0.004
DRAWN_CELL_FRACTION = 0.9  # drawn part of the side of a cell. Larger: narrower gaps between cells.
MIN_TRIANGLE_AREA = 1e-6  # in the picture [pixels^2]; smaller ones have no depth. Larger: thin faces are missing.


def draw_robot(
    meshes: Mapping[str, TriangleMesh],
    poses: Mapping[str, Array],
    calibrations: Mapping[str, LinkCalibration],
    title: str,
    path: str | Path,
    kept_out: Mapping[str, BoolArray] | None = None,
) -> None:
    """Draw a robot from both sides into a PNG file: skin coloured, other faces grey."""
    figure = blank(1, 1)  # raises before the computation if matplotlib is missing
    bodies = [_moved(mesh.triangles, poses[link]) for link, mesh in meshes.items()]
    cells = [_moved(part, poses[link]) for link, found in calibrations.items() for part in _cells(found)]
    triangles = np.concatenate([np.empty((0, 3, 3)), *bodies, *cells])
    covered = np.arange(len(triangles)) >= sum(map(len, bodies))
    colours = np.where(covered[:, None], COVERED, PLAIN)
    if kept_out is not None:
        colours[~covered] = np.where(np.concatenate([kept_out[link] for link in meshes])[:, None], KEPT_OUT, PLAIN)
    up, images = np.array((0.0, 0.0, 1.0)), []
    for direction in VIEWS.values():
        images.append(_image(triangles, covered, colours, look_at(unit(np.array((direction,))), up)))
    width, height = sum(image.shape[1] for image in images), PICTURE_HEIGHT
    total = height + HEAD_HEIGHT * figure.dpi
    figure.set_size_inches(width / figure.dpi, total / figure.dpi)
    figure.text(0.5, 1 - 0.3 * HEAD_HEIGHT * figure.dpi / total, title, size=10, ha="center", va="center")
    entries = [(COVERED, "cells of skins"), (PLAIN, "faces without skin")]
    if kept_out is not None:
        entries[1:] = [(PLAIN, "free, without skin"), (KEPT_OUT, "not free")]
    for k, (colour, words) in enumerate(entries):
        x = (k + 1) / (len(entries) + 1) - LEGEND_SHIFT
        y = 1 - 0.75 * HEAD_HEIGHT * figure.dpi / total
        figure.text(x, y, "\u25a0", size=14, color=colour * MEAN_SHADE, ha="right", va="center")
        figure.text(x + 0.01, y, words, size=9, va="center")
    left = 0.0
    for name, image in zip(VIEWS, images):
        axis = figure.add_axes((left, 0, image.shape[1] / width, height / total))
        axis.imshow(image)
        axis.set_axis_off()
        axis.text(0.02, 0.02, name, transform=axis.transAxes)
        left += image.shape[1] / width
    save_png(figure, path)


def _moved(triangles: Array, pose: Array) -> Array:
    return triangles @ pose[:3, :3].T + pose[:3, 3]


def _cells(calibration: LinkCalibration) -> Iterator[Array]:
    """Yield triangles (k, 3, 3) of the cells of each patch in the link frame."""
    for patch in calibration.patches:
        centres = patch.taxels.corners_link.mean(axis=1, keepdims=True)
        corners = centres + DRAWN_CELL_FRACTION * (patch.taxels.corners_link - centres)
        first, rest = corners[:, :1], corners[:, 1:]
        fans = np.stack((np.broadcast_to(first, rest[:, 1:].shape), rest[:, :-1], rest[:, 1:]), axis=2)
        yield fans.reshape(-1, 3, 3)


def _image(triangles: Array, covered: BoolArray, colours: Array, camera: Camera) -> Array:
    """Return the picture (height, width, 3) of triangles (f, 3, 3): the nearest of each pixel, lit from the viewer."""
    view = camera.project(triangles)
    normals = unit(np.cross(view[:, 1] - view[:, 0], view[:, 2] - view[:, 0]))
    low, high = view.min(axis=(0, 1)), view.max(axis=(0, 1))
    scale = 0.96 * PICTURE_HEIGHT / max(high[1] - low[1], 1e-9)  # pixels per metre
    width = max(np.ceil((high[0] - low[0]) * scale) + 0.04 * PICTURE_HEIGHT, MIN_WIDTH)
    size = np.array((width, PICTURE_HEIGHT), int)
    pixels = np.empty_like(view)
    pixels[..., 0] = (view[..., 0] - (low[0] + high[0]) / 2) * scale + size[0] / 2
    pixels[..., 1] = ((low[1] + high[1]) / 2 - view[..., 1]) * scale + size[1] / 2
    pixels[..., 2] = view[..., 2] + CELL_LIFT * covered[:, None]
    visible = ~covered | (normals[:, 2] > 0)  # the cells of the other side do not show through thin covers
    front = _nearest(pixels, visible, size)
    # The winding of meshes is not trusted: each face is lit as if it looks at the viewer.
    towards = normals * np.where(normals[:, 2:] < 0, -1, 1)
    shade = DARKEST + (1 - DARKEST) * np.clip(towards @ LIGHT, 0, 1)
    lit = np.vstack((colours * shade[:, None], np.ones(3)))
    return lit[front].reshape(size[1], size[0], 3)


def _nearest(pixels: Array, visible: BoolArray, size: IntArray) -> IntArray:
    """Return the nearest triangle of each pixel, shape (height * width,); -1 where there is none."""
    a, b, c = pixels[:, 0], pixels[:, 1], pixels[:, 2]
    area: Array = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (c[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1])
    drawn = np.flatnonzero(visible & (np.abs(area) > MIN_TRIANGLE_AREA))
    face, row = _spans(drawn, pixels[drawn, :, 1].min(axis=1), pixels[drawn, :, 1].max(axis=1))
    ends = []  # columns at which the row crosses the sides of the triangle; inside out where it does not
    for start, end in ((a, b), (b, c), (c, a)):
        p, q = start[face], end[face]
        crosses = (p[:, 1] <= row) != (q[:, 1] <= row)
        fraction = (row - p[:, 1]) / np.where(crosses, q[:, 1] - p[:, 1], 1)
        ends.append(np.where(crosses, p[:, 0] + fraction * (q[:, 0] - p[:, 0]), np.nan))
    left, right = np.fmin.reduce(ends), np.fmax.reduce(ends)
    known = np.flatnonzero(np.isfinite(left))
    span, column = _spans(known, left[known], right[known])
    face, row = face[span], row[span]
    p, q, r = a[face], b[face], c[face]
    u: Array = ((column - p[:, 0]) * (r[:, 1] - p[:, 1]) - (row - p[:, 1]) * (r[:, 0] - p[:, 0])) / area[face]
    v: Array = ((row - p[:, 1]) * (q[:, 0] - p[:, 0]) - (column - p[:, 0]) * (q[:, 1] - p[:, 1])) / area[face]
    depth = p[:, 2] + u * (q[:, 2] - p[:, 2]) + v * (r[:, 2] - p[:, 2])
    order = np.argsort(depth, kind="stable")
    nearest = np.full(size[0] * size[1], -1)
    nearest[row[order] * size[0] + column[order]] = face[order]  # of repeated pixels the last, which is the nearest
    return nearest


def _spans(owners: IntArray, first: Array, last: Array) -> tuple[IntArray, IntArray]:
    """Return the integers between ``first`` and ``last`` of all owners in a row, with the owner of each."""
    start = np.ceil(first).astype(np.int64)
    counts = np.maximum(np.floor(last).astype(np.int64) - start + 1, 0)
    return np.repeat(owners, counts), ranges(start, counts)
