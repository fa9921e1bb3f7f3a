"""Distances from a mesh on a grid around it: less exact than those to its faces, but fast for very many points."""

import numpy as np
from scipy import ndimage

from ...common.arrays import Array
from .face_points import sample_faces
from .triangle_mesh import TriangleMesh

# [1] cells of a field at which they become larger. Larger: large links are more exact and take longer.
MAX_FIELD_CELLS = 2_000_000
# [cells] distance of the points by which a link fills its cells. Larger: its walls get holes.
FILLING = 0.5


class DistanceField:
    """Distances from a mesh, on a grid of cells around it [m]; 0 inside of closed walls."""

    def __init__(self, mesh: TriangleMesh, cell: float):
        extent = np.ptp(mesh.vertices, axis=0)
        self.cell = max(cell, float(np.cbrt(np.prod(extent + 4 * cell) / MAX_FIELD_CELLS)))
        self.low = mesh.vertices.min(axis=0) - 1.5 * self.cell  # centre of the first cell
        shape = np.ceil(extent / self.cell).astype(int) + 4
        points = sample_faces(mesh, FILLING * self.cell)[0]
        index = np.ravel_multi_index(tuple(np.rint((points - self.low) / self.cell).astype(int).T), tuple(shape))
        count = np.bincount(index, minlength=shape.prod())
        middle = [np.bincount(index, x, shape.prod()) / np.maximum(count, 1) for x in points.T]
        wall = (count > 0).reshape(shape)
        outside, _ = ndimage.label(~wall)
        nearest = ndimage.distance_transform_edt(~wall, return_distances=False, return_indices=True)
        at = np.ravel_multi_index(tuple(nearest), tuple(shape))
        centres = [low + self.cell * np.arange(n) for low, n in zip(self.low, shape)]
        squares = sum((m[at] - c) ** 2 for m, c in zip(middle, np.meshgrid(*centres, indexing="ij", sparse=True)))
        # Closed walls are filled: the first cell is outside. Walls themselves have distances, so that faces stay sharp.
        self.values = np.where(wall | (outside == outside[0, 0, 0]), np.sqrt(squares), 0.0)
        self.centre = self.low + self.cell * (shape - 1) / 2
        self.radius = float(np.linalg.norm(mesh.vertices - self.centre, axis=1).max())

    def __call__(self, points: Array) -> Array:
        """Return the distances of points (k, 3), shape (k,) [m]; far away, a lower bound."""
        position = (points - self.low) / self.cell
        inside = np.clip(position, 0, np.array(self.values.shape) - 1)
        outside = np.einsum("kc,kc->k", position - inside, position - inside) * self.cell**2
        return np.sqrt(ndimage.map_coordinates(self.values, inside.T, order=1, mode="nearest") ** 2 + outside)
