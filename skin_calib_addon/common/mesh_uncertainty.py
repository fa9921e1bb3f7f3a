"""How far a part is from its mesh."""

from dataclasses import dataclass

# [m] standard deviation, per axis, of a part from its mesh: printed and moulded covers are 0.1 to 0.3 mm off their CAD
# model, simplified meshes and scans as much. Larger: all taxels are less certain. Contract: the default of a plan.
MESH_DEVIATION = 2e-4
# [m] distance over which this deviation changes: parts warp as a whole. Smaller: normals are less certain. Contract:
# the documented default of a plan.
CORRELATION_LENGTH = 0.05


@dataclass(frozen=True)
class MeshUncertainty:
    r"""The deviation of a part from its mesh: a Gaussian random field along each axis.

    Points at the distance :math:`d` have the covariance :math:`s^2 e^{-d^2 / L^2}`. The slope of the deviation has the
    variance :math:`2 s^2 / L^2` along any direction.
    """

    standard_deviation: float = MESH_DEVIATION  # s, along each axis [m]
    correlation_length: float = CORRELATION_LENGTH  # L [m]

    @property
    def variance(self) -> float:
        """Return the variance of the deviation along each axis [m^2]."""
        return self.standard_deviation**2

    @property
    def slope(self) -> float:
        """Return the variance of the slope of the deviation along any direction [1]."""
        return 2 * self.variance / self.correlation_length**2
