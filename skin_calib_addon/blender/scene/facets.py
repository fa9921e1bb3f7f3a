# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh of the scene as arrays that are independent of Blender, so that another thread can use them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...common.arrays import Array, IntArray
from ...common.errors import InvalidMesh
from ...geometry.mesh.triangle_mesh import MAX_MESH_SIZE, MIN_MESH_SIZE, TriangleMesh, weld, without_gaps


@dataclass(frozen=True, eq=False)
class Facets:
    """Triangles of an object as Blender has them, and their transformation into the link frame."""

    name: str  # of the object
    vertices: Array  # (v, 3) float32, in the object's own axes and units
    faces: IntArray  # (f, 3) int32
    placed: Array  # (3, 4) from there into metres in the link frame
    corners: IntArray  # (c,) int32, the vertices around each polygon, one polygon after another
    polygons: IntArray  # (f,) int32, the polygon of each face: one of k corners has k - 2 faces

    def is_same(self, other: "Facets | None") -> bool:
        """Return whether other facets make the same mesh: Blender divides the same polygons equally."""
        if self is other:
            return True
        pairs = ((getattr(self, n), getattr(other, n, None)) for n in ("placed", "vertices", "corners", "polygons"))
        return all(np.array_equal(one, another) for one, another in pairs)

    def triangles(self) -> tuple[Array, IntArray]:
        """Return all vertices (v, 3) in metres in the link frame, and all faces (f, 3), with outward orientation."""
        points, faces = self.vertices.astype(float), self.faces
        if not np.array_equal(self.placed, np.eye(3, 4)):  # times one plus zero is exact only for finite numbers
            points = points @ self.placed[:, :3].T + self.placed[:, 3]
        if np.linalg.det(self.placed[:, :3]) < 0:  # mirrored by its scale, which reverses the faces
            faces = faces[:, ::-1]
        return points, faces

    def welded(self) -> TriangleMesh:
        """Return the mesh in metres in the link frame, of any size."""
        try:
            return without_gaps(weld(*self.triangles()))
        except InvalidMesh as error:
            raise InvalidMesh(f"{self.name}: {error}", **error.numbers) from error

    @cached_property
    def sha256(self) -> str:
        """Return the hash of the mesh; empty if it is invalid."""
        try:
            return self.welded().sha256
        except InvalidMesh:
            return ""

    def mesh(self) -> TriangleMesh:
        """Return the same mesh, which must have the size of a link."""
        mesh = self.welded()
        if not MIN_MESH_SIZE <= mesh.size <= MAX_MESH_SIZE:
            raise InvalidMesh(
                f"{self.name} is {mesh.size:.4g} m across in this scene; set the object's scale, or the scene's unit "
                "scale, to the link's real size",
                size=mesh.size,
            )
        return mesh
