"""Calculate the calibration of one link: load, cut, fit, wrap, errors."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from .. import __version__
from ..calibration.model import LinkCalibration, MeshSource, Patch, SurfaceModel
from ..common.errors import PoorFit, listed
from ..common.warnings import Place, Warning, point_of
from ..geometry.fit.auto import fit_grid
from ..geometry.fit.surface_fit import SurfaceFit
from ..geometry.mesh.cover import cut_cover
from ..geometry.mesh.triangle_mesh import TriangleMesh, load_mesh
from ..geometry.surface.bspline import BSplineSurface
from ..plan import Plan
from .place_skins import SURFACE, PlacedSkin, place_all
from .taxel_sigma import unknown_sigma


@dataclass(frozen=True, eq=False)
class Calibrated:
    """A calibration with its intermediate results, for reports and pictures."""

    calibration: LinkCalibration
    cover: TriangleMesh
    fit: SurfaceFit
    placed: tuple[PlacedSkin, ...]
    seconds: dict[str, float]  # by stage

    @property
    def warnings(self) -> tuple[Warning, ...]:
        """Return the warnings of the fit and of all skins, which the calibration keeps."""
        return self.calibration.warnings


def calibrate(
    plan: Plan, mesh: TriangleMesh | None = None, begin: Callable[[str], None] = lambda stage: None
) -> Calibrated:
    """Cut the cover, fit the surface, and place the skins.

    Parameters
    ----------
    plan : Plan
        Planes, skins and options.
    mesh : TriangleMesh, optional
        The mesh of the link. Default: read from the file of the plan.
    begin : function, optional
        Called with the name of each stage. An exception aborts the calibration.

    Returns
    -------
    Calibrated

    Raises
    ------
    SkinCalibError
        If a step fails; the message states what is wrong, where, and what to do.
    """
    seconds: dict[str, float] = {}

    @contextmanager
    def stage(name: str) -> Iterator[None]:
        begin(name)
        start = perf_counter()
        yield
        seconds[name] = perf_counter() - start

    with stage("load"):
        mesh = load_mesh(plan.mesh, plan.unit) if mesh is None else mesh
    with stage("cut"):
        cover = cut_cover(mesh, plan.cover)
    with stage("fit"):
        fit = fit_grid(cover, plan.grid, plan.degree, plan.chords, plan.max_deviation)
        refuse_errors(fit.warnings)
    with stage("wrap"):
        placed = place_all(plan.skins, fit)
        patches = tuple(done.patch for done in placed)
    with stage("errors"):
        surface = surface_model(fit)
    source = MeshSource(plan.mesh.name, mesh.sha256, len(mesh.vertices), len(mesh.faces))
    calibration = LinkCalibration(
        plan.link,
        source,
        (surface,),
        patches,
        plan.response,
        f"skin-calib {__version__}",
        plan.extra,
        warnings=warnings_of(fit, placed),
        modalities=plan.modalities,
    )
    return Calibrated(calibration, cover, fit, placed, seconds)


def refuse_errors(warnings: Iterable[Warning]) -> None:
    """Raise the first error among the warnings of a fit.

    Raises
    ------
    PoorFit
        If there is one, because the surface cannot be used.
    """
    for warning in warnings:
        if warning.severity == "error":
            raise PoorFit(f"{warning.message} {warning.advice}", place=warning.where)


def warnings_of(fit: SurfaceFit, placed: tuple[PlacedSkin, ...]) -> tuple[Warning, ...]:
    """Return the warnings of a fit and of the skins on it.

    Parameters
    ----------
    fit : SurfaceFit
        The surface.
    placed : tuple of PlacedSkin
        The skins.

    Returns
    -------
    tuple of Warning
    """
    of_skins = ((*_over_holes(skin.patch, fit), *skin.warnings, *unknown_sigma(skin.patch, fit)) for skin in placed)
    return fit.warnings + tuple(warning for warnings in of_skins for warning in warnings)


def _over_holes(patch: Patch, fit: SurfaceFit) -> tuple[Warning, ...]:
    """Return a warning if taxels of a patch are over a hole of the mesh."""
    over = np.flatnonzero(~fit.is_trusted(patch.taxels.uv))
    if len(over) == 0:
        return ()
    taxels = tuple(patch.taxels.ids[i] for i in over)
    ids = listed(taxels)
    return (
        Warning(
            "over-hole",
            "warning",
            f"{len(over)} taxels of {patch.name} are over a hole of the mesh, where the surface is extrapolated: "
            f"{ids}.",
            Place(point_of(patch.taxels.positions_link[over[0]]), skin=patch.name, taxels=taxels),
            float(len(over)),
            "Close the hole, or move the skin.",
        ),
    )


def surface_model(fit: SurfaceFit) -> SurfaceModel:
    """Convert a fitted surface to the record of a calibration."""
    s = fit.surface
    return SurfaceModel(SURFACE, s.degree, s.knots_u, s.knots_v, s.control_net, s.closed, fit.errors)


def surface_of(model: SurfaceModel) -> BSplineSurface:
    """Convert the record of a calibration to a surface that can be evaluated."""
    return BSplineSurface(model.control_net, model.knots_u, model.knots_v, model.degree, model.closed)
