"""Write MuJoCo models: a touch sensor for each taxel, and a tactile sensor for each patch."""

from collections.abc import Iterator

import numpy as np

from ...common.arrays import Array, IntArray
from ..model import LinkCalibration
from .link_taxels import LinkTaxels, refuse_repeats, taxels_of
from .xml_text import HEAD, numbers, quoted

MIN_VERTICES = 4  # Format: MuJoCo accepts no smaller mesh
GEOM_THICKNESS = 0.002  # of the cells that make contact [m]. Larger: contacts of deeper bodies are found.
# Half height of a site, as a fraction of the smaller side of its cell. Larger: contacts farther from the skin count.
SITE_HALF_HEIGHT = 0.5
# Area of the triangles of a mesh, as a fraction of its squared size. Larger: narrow patches have no tactile sensor.
MIN_AREA_FRACTION = 1e-6


def write_mjcf(calibration: LinkCalibration) -> bytes:
    """Write a complete model: one body with a thin geom and a touch sensor for each taxel.

    Each patch has a tactile sensor on a mesh. Vertex i of the mesh is the i-th taxel of the patch in the order of
    channels. The tactile sensor outputs the depth of all vertices, then the slip along and across the tangent. A patch
    with fewer than four taxels, or with taxels on a line, has no mesh and only touch sensors.

    Raises
    ------
    CalibrationFormatError
        If two sensors or two patches would have the same name.
    """
    taxels = taxels_of(calibration)
    patches = [patch.name for patch in calibration.patches]
    refuse_repeats((*patches, *taxels.ids), "MuJoCo")
    meshes = {patch: mesh for patch in patches if (mesh := _mesh(taxels, patch))}
    link, ids = quoted(taxels.link), [quoted(name) for name in taxels.ids]
    lines = [
        f"{HEAD}<mujoco model={link}>",
        '<default><default class="skin">',
        '<geom mass="0" group="3"/><site group="4" rgba="0 1 0 0.5"/>',
        "</default></default>",
        "<asset>",
        *meshes.values(),
        "</asset>",
        f'<worldbody><body name={link} childclass="skin">',
        *(
            f'<geom name={quoted(patch)} type="mesh" mesh={quoted(patch)} contype="0" conaffinity="0"/>'
            for patch in meshes
        ),
        *_cells(taxels),
        *_sites(taxels, ids),
        "</body></worldbody>",
        "<sensor>",
        *(f"<touch name={name} site={name}/>" for name in ids),
        *(f"<tactile name={quoted(patch)} geom={quoted(patch)} mesh={quoted(patch)}/>" for patch in meshes),
        "</sensor>",
    ]
    return ("\n".join(lines) + "\n</mujoco>\n").encode()


def _mesh(taxels: LinkTaxels, patch: str) -> str:
    """Return the mesh whose vertices are the taxels of a patch; empty if they span no area."""
    rows = taxels.of(patch)
    positions, axes = taxels.positions[rows], taxels.axes[rows]
    faces = triangles(taxels, rows)
    size = float(np.linalg.norm(np.ptp(positions, axis=0)))
    if len(rows) < MIN_VERTICES or _area(positions[faces]) < MIN_AREA_FRACTION * size**2:
        return ""
    frames = np.stack(
        (axes[:, :, 2], axes[:, :, 0], axes[:, :, 1]), axis=1
    )  # columns of a vertex: normal, tangent, across
    return (
        f'<mesh name={quoted(patch)} inertia="shell" vertex="{numbers(positions)}"\nnormal="{numbers(frames)}"\n'
        f'face="{" ".join(map(str, faces.ravel().tolist()))}"/>'
    )


def _area(corners: Array) -> float:
    """Return the total area of triangles (m, 3, 3) [m^2]."""
    sides = corners[:, 1:] - corners[:, :1]
    return float(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum()) / 2


def _cells(taxels: LinkTaxels) -> Iterator[str]:
    """Yield a thin box or disc for each taxel, with its upper side at the taxel."""
    depth = np.minimum(GEOM_THICKNESS, taxels.sizes.min(axis=1))
    centres = taxels.positions - depth[:, None] / 2 * taxels.normals
    for row, shape in enumerate(_shapes(taxels, depth / 2)):
        yield f'<geom {shape} pos="{numbers(centres[row])}" {_turn(taxels, row)}/>'


def _sites(taxels: LinkTaxels, ids: list[str]) -> Iterator[str]:
    """Yield the volume in which contacts belong to a taxel: its cell, extended outwards and inwards."""
    for row, shape in enumerate(_shapes(taxels, SITE_HALF_HEIGHT * taxels.sizes.min(axis=1))):
        yield f'<site name={ids[row]} {shape} pos="{numbers(taxels.positions[row])}" {_turn(taxels, row)}/>'


def _shapes(taxels: LinkTaxels, half: Array) -> Iterator[str]:
    """Yield type and size of cells with half heights (n,) [m]: boxes for four corners, else discs."""
    radii = np.sqrt(taxels.areas / np.pi)
    for row, square in enumerate(taxels.square.tolist()):
        if square:
            yield f'type="box" size="{numbers((*taxels.sizes[row] / 2, half[row]))}"'
        else:
            yield f'type="cylinder" size="{numbers((radii[row], half[row]))}"'


def _turn(taxels: LinkTaxels, row: int) -> str:
    return f'xyaxes="{numbers(taxels.axes[row, :, :2].T)}"'


def triangles(taxels: LinkTaxels, rows: IntArray) -> IntArray:
    """Return triangles of neighbouring taxels.

    Neighbours that follow each other around a taxel form one triangle with it if they are neighbours themselves. If
    they are not, but have another common neighbour, the four taxels form two triangles. Taxels without any such
    neighbours form a chain of triangles.

    Parameters
    ----------
    taxels : LinkTaxels
        All taxels of the link.
    rows : array, shape (n,)
        Rows of one patch.

    Returns
    -------
    array, shape (m, 3)
        Positions in ``rows``, counter-clockwise seen from outside.
    """
    position = {taxels.ids[row]: k for k, row in enumerate(rows.tolist())}
    near = [{position[other] for other in taxels.neighbours[row] if other in position} for row in rows.tolist()]
    found: dict[frozenset[int], tuple[int, int, int]] = {}
    for k, row in enumerate(rows.tolist()):
        around = sorted(near[k])
        arms = (taxels.positions[rows[around]] - taxels.positions[row]) @ taxels.axes[row]
        angles = np.arctan2(arms[:, 1], arms[:, 0])
        ring = np.argsort(angles, kind="stable").tolist()
        for i, j in zip(ring, ring[1:] + ring[:1]):
            a, b = around[i], around[j]
            across = min(near[a] & near[b] - {k} - near[k], default=-1)
            if not 0 < (angles[j] - angles[i]) % (2 * np.pi) < np.pi:
                continue  # no triangle: an edge of the patch is between them
            if b in near[a]:
                found.setdefault(frozenset((k, a, b)), (k, a, b))
            elif k < min(across, a, b):
                found[frozenset((k, a, across))] = (k, a, across)
                found[frozenset((k, across, b))] = (k, across, b)
    chain = [(k, k + 1, k + 2) for k in range(len(rows) - 2)]
    return np.array(list(found.values()) or chain, np.int64).reshape(-1, 3)
