"""How far two shapes are apart, in numbers."""

from dataclasses import dataclass

from .arrays import Array


@dataclass(frozen=True)
class DistanceStatistics:
    """Distances from one shape to another, area-weighted [m]."""

    mean: float
    rms: float
    max: float

    @classmethod
    def of(cls, distances: Array, weights: Array) -> "DistanceStatistics":
        """Statistics of distances [m], shape (k,), each standing for the area in ``weights``."""
        fraction = weights / weights.sum()  # sums, not products of BLAS, whose last bits depend on its threads
        mean, square = (fraction * distances).sum(), (fraction * distances**2).sum()
        return cls(float(mean), float(square**0.5), float(distances.max()))


@dataclass(frozen=True)
class SurfaceErrors:
    """Distances between mesh and surface, both ways [m]; ``hausdorff`` is the larger maximum."""

    mesh_to_surface: DistanceStatistics
    surface_to_mesh: DistanceStatistics
    hausdorff: float
