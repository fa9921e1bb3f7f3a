"""Warnings about the placement of a skin on its surface."""

from collections.abc import Iterator

import numpy as np

from ..calibration.model import Patch
from ..common.arrays import Array, IntArray, unit
from ..common.errors import InvalidPlan, OutsideSurface, counted
from ..common.warnings import Place, Warning, point_of
from ..geometry.mesh.distance import closest
from ..geometry.mesh.triangle_mesh import TriangleMesh
from .boards.ground import GAP_LIMIT, MAX_ANGLE
from .sheet.closure import Closure

# Limits of what real skins tolerate. Larger: fewer warnings.
STRAIN_LIMIT = 0.05  # relative stretch of a cell of a sheet
MAX_OVERLAP_FRACTION = 0.1  # overlap of the ends of a sheet in cells; more is an error unless the plan allows it
OVERLAP_LIMIT = 5e-4  # overlap of the ends of a sheet [m]
OVERHANG_LIMIT = 1e-3  # overhang of a board or a cell over an edge [m]
EDGES = "an edge, a hole or the boundary"

BOARD_LIMITS = (
    (
        "gap",
        "board-gap",
        GAP_LIMIT,
        "have a corner more than {limit:g} mm off the surface",
        "Leave them out, or use smaller boards: the curvature is too high there.",
    ),
    (
        "overhang",
        "board-overhang",
        OVERHANG_LIMIT,
        "protrude over an edge by more than {limit:g} mm",
        "Leave them out, or move the origin.",
    ),
)


def cells_warning(code: str, patch: Patch, which: IntArray, message: str, value: float, advice: str) -> Warning:
    """Return a warning about the taxels of some rows of a patch; the window shows the first of them."""
    taxels = tuple(patch.taxels.ids[i] for i in which)
    place = Place(point_of(patch.taxels.positions_link[which[0]]), skin=patch.name, taxels=taxels)
    return Warning(code, "warning", message, place, value, advice)


def _above(values: Array, limit: float) -> IntArray:
    """Return the rows of the values above a limit, the largest first."""
    order = np.argsort(-values, kind="stable")
    return order[values[order] > limit]


def placement_warnings(patch: Patch, closure: Closure | None = None) -> Iterator[Warning]:
    """Yield a warning for each kind of defect: strain, overlap, or boards that do not fit the surface."""
    quality, ids = patch.taxels.quality, patch.taxels.ids
    if "strain" in quality:
        strain = np.abs(quality["strain"][:, :2]).max(axis=1)
        if len(which := _above(strain, STRAIN_LIMIT)):
            worst = float(strain[which[0]])
            message = (
                f"{len(which)} of {len(strain)} cells of {patch.name} are strained by more than {STRAIN_LIMIT:.0%}, "
                f"the most {ids[which[0]]} by {worst:.1%}. The sheet will wrinkle or lift there."
            )
            yield cells_warning("strain", patch, which, message, worst, "Move the sheet, or use a smaller one.")
        overhang = quality.get("overhang", np.zeros(0))
        if len(which := _above(overhang, OVERHANG_LIMIT)):
            worst = float(overhang[which[0]])
            message = (
                f"{len(which)} of {len(overhang)} cells of {patch.name} protrude over {EDGES} by more than "
                f"{OVERHANG_LIMIT * 1e3:g} mm, the most {ids[which[0]]} by {worst * 1e3:.1f} mm. Their outlines and "
                "areas end there."
            )
            advice = "Move the sheet, or use fewer cells there."
            yield cells_warning("overhang", patch, which, message, worst, advice)
    if closure is not None and closure.overlap > OVERLAP_LIMIT:
        yield Warning(
            "overlap",
            "warning",
            f"{patch.name} {overlap_words(closure)}.",
            _closing(closure, patch),
            closure.overlap,
            "Use fewer cells, or a smaller pitch.",
        )
    if "pitch_error" not in quality:
        return
    for key, code, limit, statement, advice in BOARD_LIMITS:
        values = np.abs(quality.get(key, np.zeros(0)))
        if len(which := _above(values, limit)):
            worst = float(values[which[0]])
            message = (
                f"{len(which)} of {len(values)} boards of {patch.name} {statement.format(limit=limit * 1e3)}, the most "
                f"{ids[which[0]]} by {worst * 1e3:.1f} mm."
            )
            yield cells_warning(code, patch, which, message, worst, advice)


def check_overhang(patch: Patch, limit: float | None) -> None:
    """Check that no cell or board of a skin protrudes by more than the limit of its plan [m]."""
    overhang = patch.taxels.quality.get("overhang", np.zeros(0))
    if limit is not None and len(which := _above(overhang, limit)):
        worst, first = float(overhang[which[0]]), which[0]
        cells = "cell" if patch.kind == "sheet" else "board"
        raise OutsideSurface(
            f"Overhang of {counted(len(which), cells)} of skin {patch.name!r} over {EDGES} by more than "
            f"{limit * 1e3:g} mm, the most {patch.taxels.ids[first]} by {worst * 1e3:.1f} mm. Move the skin, use fewer "
            f"{cells}s there, or increase the maximum overhang",
            distance=worst,
            place=Place(point_of(patch.taxels.positions_link[first]), skin=patch.name),
        )


def normal_warnings(patch: Patch, mesh: TriangleMesh) -> Iterator[Warning]:
    """Yield a warning if normals are oblique to the faces below their cells.

    The faces are those nearest to the centre of a cell and to the points halfway to its corners. Their mean normal is
    compared, so that facets, or the noise of a scan, do not count.
    """
    taxels = patch.taxels
    halfway = [(corners + centre) / 2 for corners, centre in zip(taxels.corners_link, taxels.positions_link)]
    points = np.concatenate((taxels.positions_link, *halfway))
    cell = np.concatenate((np.arange(len(halfway)), np.repeat(np.arange(len(halfway)), list(map(len, halfway)))))
    normals = taxels.normals_link[cell]
    below = mesh.face_normals[closest(mesh, points - patch.offset * normals)[1]]
    below = below * np.where((below * normals).sum(axis=1) < 0, -1.0, 1.0)[:, None]  # winding is not trusted
    sums = np.column_stack([np.bincount(cell, x, len(halfway)) for x in below.T])
    angles = np.arccos(np.clip((unit(sums) * taxels.normals_link).sum(axis=1), -1.0, 1.0))
    if len(which := _above(angles, MAX_ANGLE)):
        worst = float(angles[which[0]])
        message = (
            f"{len(which)} of {len(angles)} normals of {patch.name} are more than {np.rad2deg(MAX_ANGLE):.0f} degrees "
            f"from the faces below, the most that of {taxels.ids[which[0]]} by {np.rad2deg(worst):.1f} degrees."
        )
        advice = "Move the skin away from the step or ridge there, or use more lines."
        yield cells_warning("oblique", patch, which, message, worst, advice)


def overlap_words(closure: Closure) -> str:
    """Return the part of a sentence that states the overlap of a sheet."""
    return (
        f"overlaps itself by up to {closure.overlap * 1e3:.1f} mm where its {closure.of} close ({closure.worst_line})"
    )


def check_overlap(patch: Patch, closure: Closure | None) -> None:
    """Check that a sheet does not overlap itself by more than a tenth of a cell where it closes around the link."""
    if closure is None:
        return
    cell = patch.pitch[1 if closure.of == "rows" else 0]
    if closure.overlap > MAX_OVERLAP_FRACTION * cell:
        count = int(np.ceil(closure.overlap / cell - MAX_OVERLAP_FRACTION))
        what = "columns" if closure.of == "rows" else "rows"
        raise InvalidPlan(
            f"skin {patch.name!r} {overlap_words(closure)}. Use {count} fewer {what}, a smaller pitch, or allow "
            "the overlap",
            overlap=closure.overlap,
            code="overlap",
            place=_closing(closure, patch),
        )


def _closing(closure: Closure, patch: Patch) -> Place:
    """Return where a sheet overlaps itself most."""
    return Place(point_of(closure.place), closure.worst_line, patch.name)
