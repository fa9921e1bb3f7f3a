"""Mesh to cover to sections to fitted surface."""

from .fit.auto import fit_grid, fit_to_count, fit_to_tolerance
from .fit.fitting import fit_surface, leave_one_out
from .fit.surface_fit import SurfaceFit
from .grid.axis import Axis
from .grid.grids import (
    Across,
    AcrossGrid,
    AutoGrid,
    Grid,
    PlanesGrid,
    Sector,
    SectorGrid,
    Size,
    Tolerance,
    Tube,
    TubeGrid,
)
from .mesh.cover import CoverSpec, Cut, cut_cover
from .mesh.triangle_mesh import TriangleMesh, load_mesh, weld
from .sampling.planes import Planes
from .surface.bspline import BSplineSurface

__all__ = [
    "Across",
    "AcrossGrid",
    "AutoGrid",
    "Axis",
    "BSplineSurface",
    "CoverSpec",
    "Cut",
    "Grid",
    "Planes",
    "PlanesGrid",
    "Sector",
    "SectorGrid",
    "Size",
    "SurfaceFit",
    "Tolerance",
    "TriangleMesh",
    "Tube",
    "TubeGrid",
    "cut_cover",
    "fit_grid",
    "fit_surface",
    "fit_to_count",
    "fit_to_tolerance",
    "leave_one_out",
    "load_mesh",
    "weld",
]
