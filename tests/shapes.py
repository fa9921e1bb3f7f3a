"""Meshes for tests, built from formulas, in metres."""

from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from sample_scenes import shapes
from skin_calib_addon.geometry import (
    Axis,
    BSplineSurface,
    Planes,
    PlanesGrid,
    TriangleMesh,
    TubeGrid,
    fit_surface,
    weld,
)
from skin_calib_addon.geometry.surface.bspline import clamped_knots, greville, periodic_knots

RADIUS, LENGTH = 0.035, 0.1
TURN = 2 * np.pi
Z_AXIS = Axis((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))


@cache
def cylinder(radius=RADIUS, length=LENGTH, around=96, along=26):
    """Return a tube about z from 0 to ``length``; its first vertices are in the x-z plane."""
    return cone(radius, radius, length, around, along)


@cache
def cone(bottom=0.045, top=0.030, length=LENGTH, around=96, along=26):
    """Return a tube about z whose radius changes from ``bottom`` to ``top``."""

    return round_tube(lambda angle, height: bottom + (top - bottom) * height, around, along, length)


@cache
def wrist():
    """Return the sample of a tapered, bent, irregular tube."""
    return welded(shapes.wrist())


def round_tube(radius, around=96, along=26, length=LENGTH):
    """Return a tube about z with a radius by angle and fraction of its length [m]."""

    def point(angle, fraction):
        r = radius(angle, fraction)
        return np.column_stack((r * np.cos(angle), r * np.sin(angle), length * fraction))

    return welded(shapes.tube_mesh(point, around, along))


def swept(section, along=2, length=LENGTH):
    """Return a tube along z with an outline (n, 2) that runs counter-clockwise [m]."""

    def point(angle, fraction):
        return np.column_stack(
            (section[np.rint(angle / TURN * len(section)).astype(int) % len(section)], length * fraction)
        )

    return welded(shapes.tube_mesh(point, len(section), along))


def revolved(profile, sides):
    """Return a body about z with a row of vertices at each radius and height of a profile (n, 2) [m]."""

    def point(angle, fraction):
        radius, z = profile[np.rint(fraction * (len(profile) - 1)).astype(int)].T
        return np.column_stack((radius * np.cos(angle), radius * np.sin(angle), z))

    return welded(shapes.tube_mesh(point, sides, len(profile)))


@cache
def lobed(swing):
    """Return a tube with five lobes that lean over where ``swing`` is above one."""

    def point(angle, height):
        phi, radius = angle + swing / 5 * np.sin(5 * angle), 0.035 + 0.004 * np.cos(5 * angle + 1.2)
        return np.column_stack((radius * np.cos(phi), radius * np.sin(phi), LENGTH * height))

    return welded(shapes.tube_mesh(point, 240, 6))


def welded(mesh):
    """Return a trimesh in the canonical order."""
    return weld(mesh.vertices, mesh.faces)


def sheet(height, size=(0.1, 0.08), cells=(20, 16)):
    """Return the graph z = height(x, y) over a rectangle that starts at the origin; normals point up."""
    i, j = np.indices((cells[0] + 1, cells[1] + 1))
    x, y = size[0] * i / cells[0], size[1] * j / cells[1]
    return quads(np.stack((x, y, height(x, y)), axis=-1))


def quads(points, closed=(False, False)):
    """Return two triangles for each cell of a grid of points (n, m, 3); normals are (next row) x (next column)."""
    k = np.arange(points[..., 0].size).reshape(points.shape[:2])
    n, m = (size - (not c) for size, c in zip(k.shape, closed))
    p, q, r, s = (np.roll(k, turn, (0, 1))[:n, :m].ravel() for turn in ((0, 0), (-1, 0), (-1, -1), (0, -1)))
    faces = np.concatenate((np.column_stack((p, q, r)), np.column_stack((p, r, s))))
    return weld(points.reshape(-1, 3), faces)


def dome():
    """Return a sheet bent upwards at the centre; normals point up."""
    return sheet(lambda x, y: 0.02 - 2 * ((x - 0.05) ** 2 + (y - 0.04) ** 2))


def box(low, high):
    """Return a closed box; normals point outward."""
    corners = np.array(np.meshgrid(*zip(low, high), indexing="ij")).reshape(3, -1).T
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return weld(corners, [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))])


def together(*meshes):
    """Return several meshes as one."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts)])
    return weld(np.concatenate([mesh.vertices for mesh in meshes]), faces)


def keep(mesh, wanted):
    """Return the faces whose centre is ``wanted(centres)``."""
    return weld(mesh.vertices, mesh.faces[wanted(mesh.triangles.mean(axis=1))])


def with_hole(mesh, centre, radius):
    """Return the mesh without the faces near a point."""
    return keep(mesh, lambda centres: np.linalg.norm(centres - centre, axis=1) > radius)


def turned(mesh, chosen):
    """Return the mesh with some faces wound in reverse."""
    return weld(mesh.vertices, np.where(np.asarray(chosen)[:, None], mesh.faces[:, ::-1], mesh.faces))


class Motion:
    """A rotation, a translation and a scale of meshes, points and directions."""

    def __init__(self, seed, scale=1.0):
        self.rotation = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
        self.shift = np.random.default_rng(seed + 1).uniform(-1, 1, 3)
        self.scale = scale

    @classmethod
    def none(cls, scale=1.0):
        """Return a scale alone."""
        motion = cls(0, scale)
        motion.rotation, motion.shift = np.eye(3), np.zeros(3)
        return motion

    def points(self, points):
        """Return the moved points."""
        return self.scale * np.asarray(points) @ self.rotation.T + self.shift

    def directions(self, directions):
        """Return the rotated directions."""
        return np.asarray(directions) @ self.rotation.T

    def mesh(self, mesh):
        """Return the moved mesh."""
        return weld(self.points(mesh.vertices), mesh.faces)

    def axis(self, axis):
        """Return the moved axis."""
        return axis and Axis(tuple(self.points(axis.point)), tuple(self.directions(axis.direction)))


def shuffled(mesh, seed):
    """Return the same triangles in another order, with other first corners."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(mesh.vertices))
    faces = np.argsort(order)[mesh.faces[rng.permutation(len(mesh.faces))]]
    turn = (rng.integers(0, 3, len(faces))[:, None] + np.arange(3)) % 3
    return mesh.vertices[order], np.take_along_axis(faces, turn, axis=1)


def subdivided(mesh):
    """Return the mesh with each face divided into four."""
    corners = mesh.triangles
    middles = (corners + np.roll(corners, -1, axis=1)) / 2
    (a, b, c), (ab, bc, ca) = np.swapaxes(corners, 0, 1), np.swapaxes(middles, 0, 1)
    parts = [np.stack(part, axis=1) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    points = np.concatenate(parts).reshape(-1, 3)
    return weld(points, np.arange(len(points)).reshape(-1, 3))


def unevenly_divided(mesh):
    """Return the mesh with the faces of one half of it in three each, so that vertices crowd there."""
    centres = mesh.triangles.mean(axis=1)
    chosen = centres[:, 0] > np.median(mesh.vertices[:, 0])
    a, b, c = mesh.faces[chosen].T
    new = len(mesh.vertices) + np.arange(len(a))
    parts = [np.column_stack(part) for part in ((a, b, new), (b, c, new), (c, a, new))]
    return weld(np.concatenate((mesh.vertices, centres[chosen])), np.concatenate((mesh.faces[~chosen], *parts)))


def same_mesh(a: TriangleMesh, b: TriangleMesh):
    """Return whether two meshes are equal to the bit."""
    return a.vertices.tobytes() == b.vertices.tobytes() and a.faces.tobytes() == b.faces.tobytes()


@cache
def cone_surface(bottom=0.045, top=0.030, length=LENGTH, lines=64):
    """Return a closed cubic surface with an error of ten nanometres on a cone about z, like a perfect fit."""
    knots_u, knots_v = clamped_knots(4, 3), periodic_knots(lines, 3)
    height = greville(knots_u, 3)
    # Through a point at each knot, a uniform cubic's own angles; the net is a ring of one radius by symmetry.
    angle = TURN * (np.arange(lines + 3) % lines) / lines
    swell = 6 / (4 + 2 * np.cos(TURN / lines))
    radius = (bottom + (top - bottom) * height) * swell
    ring = np.column_stack((np.cos(angle), -np.sin(angle)))  # clockwise, so that r_u x r_v points outward
    z = np.broadcast_to((length * height)[:, None, None], (4, lines + 3, 1))
    net = np.concatenate((radius[:, None, None] * ring, z), axis=2)
    return BSplineSurface(net, knots_u, knots_v, (3, 3), (False, True))


@cache
def plane_surface(width=0.1, depth=0.08):
    """Return the surface z = 0 over a rectangle at the origin, with x and y linear in u and v; normals point up."""
    knots = clamped_knots(6, 3)
    place = greville(knots, 3)
    x, y = np.meshgrid(width * place, depth * place, indexing="ij")
    return BSplineSurface(np.stack((x, y, 0 * x), axis=-1), knots, knots, (3, 3))


@cache
def wrist_surface():
    """Return a fit of the wrist sample: doubly curved."""
    return fit_surface(wrist(), TubeGrid(10, 20, margin=0.002, spacing="uniform")).surface


def even_spans(start, stop, count):
    """Return positions of the control points of a cubic with even spans: those next to an end are nearer to it."""
    return np.interp(greville(clamped_knots(count, 3), 3), (0, 1), (start, stop))


def u_planes(stations, tilts=0.0):
    """Return planes across z, tilted about the y axis."""
    stations, tilts = np.broadcast_arrays(np.asarray(stations, float), tilts)
    return Planes(stations[:, None] * (0, 0, 1.0), np.column_stack((np.sin(tilts), 0 * tilts, np.cos(tilts))))


def v_planes(count, first=0.0):
    """Return full planes through z, at even angles."""
    angle = first + np.arange(count) * np.pi / count
    return Planes(np.zeros((count, 3)), np.column_stack((-np.sin(angle), np.cos(angle), 0 * angle)))


def hinged_planes(x, tilts):
    """Return u-planes that all pass through the line (x, y, 50 mm), and 16 half-planes about z."""
    normals = u_planes(0 * tilts, tilts).normals[:: 1 if x > 0 else -1]
    return PlanesGrid(Planes(np.tile((x, 0, 0.05), (len(tilts), 1)), normals), v_planes(8), True)
