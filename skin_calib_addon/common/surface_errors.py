"""Statistics of the distances between two shapes."""

from dataclasses import dataclass

from .arrays import Array


@dataclass(frozen=True)
class DistanceStatistics:
    """Distances from one shape to another, area-weighted [m]."""

    mean: float
    rms: float
    max: float
    uncertainty: float = 0.0  # half width of a 95 % confidence interval of a mean that was sampled

    @classmethod
    def of(cls, distances: Array, weights: Array) -> "DistanceStatistics":
        """Return the statistics of weighted distances."""
        fraction = weights / weights.sum()  # sums: the last bits of BLAS products depend on its threads
        mean, square = (fraction * distances).sum(), (fraction * distances**2).sum()
        return cls(float(mean), float(square**0.5), float(distances.max()))


@dataclass(frozen=True)
class SurfaceErrors:
    """Distances between mesh and surface in both directions [m]; ``hausdorff`` is the larger maximum."""

    mesh_to_surface: DistanceStatistics
    surface_to_mesh: DistanceStatistics
    hausdorff: float
