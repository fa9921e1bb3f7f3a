"""Mesh to cover to sections to fitted surface."""

from .axis import Axis
from .bspline import BSplineSurface
from .cover import CoverSpec, Cut, cut_cover
from .fit import SurfaceFit, fit_surface
from .grids import AcrossGrid, Grid, PlanesGrid, SectorGrid, TubeGrid
from .mesh import TriangleMesh, load_mesh, weld
from .planes import Planes

__all__ = [
    "AcrossGrid",
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
    "fit_surface",
    "load_mesh",
    "weld",
]
