"""Write MuJoCo models: a touch sensor for each taxel, and a tactile sensor for each patch."""

from collections.abc import Iterator

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray
from ..model import LinkCalibration
from .link_taxels import LinkTaxels, refuse_repeats, taxels_of
from .xml_text import HEAD, numbers, quoted

MIN_VERTICES = 4  # Format: MuJoCo accepts no smaller mesh
GEOM_THICKNESS = 0.002  # of the cells that make contact [m]. Larger: contacts of deeper bodies are found.
# Width of the cells that make contact, relative to the cells. MuJoCo's contacts are at their rims; there they belong to
# one cell only. Larger: contacts of curved patches count twice or not at all; smaller: wider gaps between cells.
GEOM_FRACTION = 0.95
# Angle between the normal of a cell and the direction to another one from which on both may be in one body [rad].
# Larger: more bodies; smaller: presses that are not along the normal are also reported by cells in front of it.
FACING_ANGLE = np.radians(45.0)
# Area of the triangles of a mesh, as a fraction of its squared size. Larger: narrow patches have no tactile sensor.
MIN_AREA_FRACTION = 1e-6


def write_mjcf(calibration: LinkCalibration, tactile: bool = True) -> bytes:
    """Write a complete model: one body with a thin geom, a site and a touch sensor for each taxel, named after it.

    Each patch has a tactile sensor on a mesh. Vertex i of the mesh is the i-th taxel of the patch in the order of
    channels. The tactile sensor outputs the depth of all vertices, then the slip along and across the tangent. A patch
    with fewer than four taxels, or with taxels on a line, has no mesh and only touch sensors. MuJoCo needs three
    normals for a vertex to compute the slip. Newton refuses more than one: write its models without ``tactile``.
    """
    taxels = taxels_of(calibration)
    patches = [patch.name for patch in calibration.patches]
    refuse_repeats((*patches, *taxels.ids), "MuJoCo")
    meshes = {patch: mesh for patch in patches if tactile and (mesh := _mesh(taxels, patch))}
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
        *_cells(taxels, ids),
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


def _cells(taxels: LinkTaxels, ids: list[str]) -> Iterator[str]:
    """Yield geom and site of each taxel, those of the second and further groups in a body for each.

    The site is the volume in which contacts belong to the taxel: its cell, or the disc in it, extended outwards and
    inwards by half of its smaller side. The geom is a thin box or disc with its upper side at the taxel, and smaller
    than the site, so that a contact at its rim belongs to exactly one taxel. In a thin wall with cells on both
    sides, neither the geom nor the site is beyond the middle of the wall.
    """
    sides, walls = taxels.sizes.min(axis=1), _walls(taxels)
    depths = np.minimum(np.minimum(GEOM_THICKNESS, sides), walls / 2)
    centres = taxels.positions - depths[:, None] / 2 * taxels.normals
    geoms = list(_shapes(GEOM_FRACTION * taxels.sizes, taxels.square, depths / 2))
    sites = list(_shapes(taxels.sizes, taxels.square, np.minimum(sides, walls) / 2))
    groups = _groups(taxels)
    for group in np.unique(groups).tolist():
        body = f"<body name={quoted(f'{taxels.link} {group + 1}')}>" if group else ""
        yield body
        for row in np.flatnonzero(groups == group).tolist():
            turn = f'xyaxes="{numbers(taxels.axes[row, :, :2].T)}"'
            yield f'<geom name={ids[row]} {geoms[row]} pos="{numbers(centres[row])}" {turn}/>'
            yield f'<site name={ids[row]} {sites[row]} pos="{numbers(taxels.positions[row])}" {turn}/>'
        yield "</body>" if body else ""


def _walls(taxels: LinkTaxels) -> Array:
    """Return the thickness of the wall below each cell (n,), up to a cell on its other side [m]; infinite if none."""
    positions, normals = taxels.positions, taxels.normals
    radii, walls = np.linalg.norm(taxels.sizes, axis=1) / 2, np.full(len(positions), np.inf)
    for row, normal in enumerate(normals):
        arms = positions - positions[row]
        depths = -arms @ normal
        aside = np.linalg.norm(arms + depths[:, None] * normal, axis=1)
        behind = (depths > 0) & (aside < radii + radii[row]) & (normals @ normal < -np.cos(FACING_ANGLE))
        walls[row] = max(depths[behind].min(initial=np.inf), GEOM_THICKNESS / 20)
    return walls


def _groups(taxels: LinkTaxels) -> IntArray:
    """Return groups (n,) of cells, in none of which a cell is in front of another.

    A touch sensor of MuJoCo also reports contacts of its body that are behind it, however far: those at the other side
    of a slot, or inside a shell. Cells of a convex link are one group.
    """
    positions, normals = taxels.positions, taxels.normals
    groups = np.zeros(len(positions), np.int64)
    for row in range(1, len(positions)):
        arms = positions[:row] - positions[row]
        least = np.cos(FACING_ANGLE) * np.linalg.norm(arms, axis=1)
        facing = (arms @ normals[row] > least) | ((arms * normals[:row]).sum(axis=1) < -least)
        taken = set(groups[:row][facing].tolist())
        groups[row] = next(group for group in range(row + 1) if group not in taken)
    return groups


def _shapes(sizes: Array, square: BoolArray, half: Array) -> Iterator[str]:
    """Yield type and size of cells with extents (n, 2) and half heights (n,) [m]: boxes or discs."""
    for (along, across), is_box, height in zip(sizes / 2, square.tolist(), half):
        if is_box:
            yield f'type="box" size="{numbers((along, across, height))}"'
        else:
            yield f'type="cylinder" size="{numbers((min(along, across), height))}"'


def triangles(taxels: LinkTaxels, rows: IntArray) -> IntArray:
    """Return triangles (m, 3) of neighbouring taxels, positions in ``rows``, counter-clockwise seen from outside.

    Neighbours that follow each other around a taxel form one triangle with it if they are neighbours themselves. If
    they are not, but have another common neighbour, the four taxels form two triangles. Taxels without any such
    neighbours form a chain of triangles.
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
