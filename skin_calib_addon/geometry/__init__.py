"""Mesh to cover to sections to fitted surface."""

from .auto import AutoGrid, fit_grid, fit_to_count, fit_to_tolerance
from .axis import Axis
from .bspline import BSplineSurface
from .cover import CoverSpec, Cut, cut_cover
from .fit import SurfaceFit, fit_surface
from .grids import AcrossGrid, Grid, PlanesGrid, SectorGrid, TubeGrid
from .mesh import TriangleMesh, load_mesh, weld
from .planes import Planes

__all__ = [
    "AcrossGrid",
    "AutoGrid",
    "Axis",
    "BSplineSurface",
    "CoverSpec",
    "Cut",
    "Grid",
    "Planes",
    "PlanesGrid",
    "SectorGrid",
    "SurfaceFit",
    "TriangleMesh",
    "TubeGrid",
    "cut_cover",
    "fit_grid",
    "fit_surface",
    "fit_to_count",
    "fit_to_tolerance",
    "load_mesh",
    "weld",
]
