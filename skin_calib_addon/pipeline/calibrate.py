"""Calculate the calibration of one link: load, cut, fit, wrap, errors."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from time import perf_counter

import numpy as np
from scipy import ndimage

from .. import __version__
from ..calibration.modality import Modality
from ..calibration.model import LinkCalibration, MeshSource, Patch, SurfaceModel, Trusted
from ..common.errors import PoorFit, SkinCalibError, listed
from ..common.warnings import Warning, worst_first
from ..geometry.blas_threads import one_blas_thread
from ..geometry.fit.auto import fit_grid
from ..geometry.fit.diagnosis import nearest_site
from ..geometry.fit.surface_fit import SurfaceFit
from ..geometry.grid.grids import Grid
from ..geometry.mesh.cover import CoverSpec, cut_cover, inner_parts
from ..geometry.mesh.triangle_mesh import TriangleMesh, joined
from ..geometry.surface.bspline import BSplineSurface
from ..geometry.surface.footpoints import footpoints
from ..plan import Plan
from ..plan.checks import naming_surface
from ..plan.plan import Surface
from ..robot.link_mesh import load_plan_mesh
from ..skin.between import overlap_warnings
from ..skin.warnings import cells_warning, normal_warnings
from .place_skins import PlacedSkin, place_all
from .taxel_sigma import unknown_sigma

OUTDATED_PROPOSAL = Warning(
    "outdated-proposal",
    "warning",
    "The mesh has changed since the plan was proposed.",
    advice="Propose the plan again. In the command line, propose --again replaces it.",
)


@dataclass(frozen=True, eq=False)
class Calibrated:
    """A calibration with its intermediate results, for reports and pictures."""

    calibration: LinkCalibration
    fits: dict[str, SurfaceFit]  # by the name of the surface, in the order of the plan
    covers: dict[str, TriangleMesh]
    placed: tuple[PlacedSkin, ...]
    seconds: dict[str, float]  # by stage

    @property
    def fit(self) -> SurfaceFit:
        """Return the fit of a calibration with only one surface."""
        (only,) = self.fits.values()
        return only

    @cached_property
    def cover(self) -> TriangleMesh:
        """Return the covers of all surfaces as one mesh."""
        first, *others = self.covers.values()
        return joined([first, *others]) if others else first

    @property
    def worst_fit(self) -> SurfaceFit:
        """Return the fit with the largest maximum deviation from its mesh."""
        return max(self.fits.values(), key=lambda fit: fit.errors.surface_to_mesh.max)

    @property
    def taxels(self) -> int:
        """Return the number of taxels of all skins."""
        return sum(len(patch.taxels.ids) for patch in self.calibration.patches)

    @property
    def mean(self) -> float:
        """Return the largest mean distance of a surface from its mesh [m]."""
        return max(fit.errors.surface_to_mesh.mean for fit in self.fits.values())

    @property
    def warnings(self) -> tuple[Warning, ...]:
        """Return the warnings of the fit and of all skins, which the calibration keeps."""
        return self.calibration.warnings

    def calibration_of(self, plan: Plan) -> LinkCalibration:
        """Return the calibration with the mesh file and the warnings of a plan, which can differ from those of the fit.

        Parameters
        ----------
        plan : Plan
            That of the fit, or with another mesh file of the same content, or other warnings.
        """
        mesh = replace(self.calibration.mesh, file=plan.mesh.name)
        return replace(
            self.calibration, mesh=mesh, warnings=tuple(worst_first(dict.fromkeys((*plan.warnings, *self.warnings))))
        )


@one_blas_thread()
def calibrate(
    plan: Plan,
    mesh: TriangleMesh | None = None,
    begin: Callable[[str], None] = lambda stage: None,
    known: Mapping[str, SurfaceFit] | None = None,
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
    known : mapping of str to SurfaceFit, optional
        Fits of surfaces of this plan to this mesh, by their names. The others are fitted.

    Returns
    -------
    Calibrated

    Raises
    ------
    SkinCalibError
        If a step fails; the message states what is wrong, where, and what to do. Also states it if the mesh is not the
        one for which the plan was proposed.
    """
    known = known or {}
    seconds: dict[str, float] = {}

    @contextmanager
    def stage(name: str) -> Iterator[None]:
        begin(name)
        start = perf_counter()
        try:
            yield
        except SkinCalibError as error:
            if mesh is not None and not plan.is_for(mesh):
                error.args = (f"{error} {OUTDATED_PROPOSAL.message} {OUTDATED_PROPOSAL.advice}",)
            raise
        seconds[name] = perf_counter() - start

    with stage("load"):
        mesh = load_plan_mesh(plan) if mesh is None else mesh
    with stage("cut"):
        cut: dict[CoverSpec, TriangleMesh] = {}
        for surface in plan.surfaces:
            if surface.cover not in cut:  # the surfaces of a proposal have the same
                cut[surface.cover] = cut_for(plan, surface, mesh)
        covers = {surface.name: cut[surface.cover] for surface in plan.surfaces}
    with stage("fit"):
        fits = {
            surface.name: known.get(surface.name) or fit_of(plan, surface, mesh, covers[surface.name])
            for surface in plan.surfaces
        }
    with stage("wrap"):
        placed = place_all(plan, fits)
        patches = tuple(done.patch for done in placed)
    with stage("errors"):
        surfaces = tuple(surface_model(surface, fits[surface.name]) for surface in plan.surfaces)
    counts = len(mesh.vertices), len(mesh.faces)
    source = MeshSource(plan.mesh.name, mesh.sha256, *counts, plan.mesh_uncertainty)
    calibration = LinkCalibration(
        plan.link,
        source,
        surfaces,
        patches,
        plan.response,
        f"skin-calib {__version__}",
        plan.extra,
        warnings=(*(() if plan.is_for(mesh) else (OUTDATED_PROPOSAL,)), *warnings_of(fits, placed)),
        modalities=tuple(_without_disabled(modality, placed) for modality in plan.modalities),
    )
    return Calibrated(calibration, fits, covers, placed, seconds)


def _without_disabled(modality: Modality, placed: tuple[PlacedSkin, ...]) -> Modality:
    """Return a modality without the channels of disabled taxels."""
    disabled = {id for done in placed if done.disabled for id in done.disabled.taxels.ids}
    if modality.channels is None or not disabled:
        return modality
    return replace(modality, channels={id: k for id, k in modality.channels.items() if id not in disabled})


def cut_for(plan: Plan, surface: Surface, mesh: TriangleMesh) -> TriangleMesh:
    """Return the cover of one surface of a plan; errors name the surface if there are several."""
    with naming_surface(plan, surface.name):
        return cut_cover(mesh, surface.cover)


def fit_of(plan: Plan, surface: Surface, mesh: TriangleMesh, cover: TriangleMesh) -> SurfaceFit:
    """Fit one surface of a plan to its cover of the mesh; errors name the surface if there are several."""
    with naming_surface(plan, surface.name):
        fit = fit_grid(cover, surface.grid, surface.degree, surface.chords, surface.max_deviation)
        if (inner := inner_parts(mesh, surface.cover)) is not None:  # a new fit does not know what this one computed
            fit = replace(fit, inner=inner)
        refuse_errors(fit.warnings)
    return fit


def refuse_errors(warnings: Iterable[Warning]) -> None:
    """Raise the first error among the warnings of a fit."""
    for warning in warnings:
        if warning.severity == "error":
            raise PoorFit(f"{warning.message} {warning.advice}", code=warning.code, place=warning.where)


def warnings_of(fits: Mapping[str, SurfaceFit], placed: tuple[PlacedSkin, ...]) -> tuple[Warning, ...]:
    """Return the warnings of all fits and of the skins on them; they name the surfaces if there are several.

    What is wrong with the mesh itself is the same for many surfaces: one warning names all of these.
    """
    surfaces: dict[Warning, list[str]] = {}
    for name, fit in fits.items():
        for warning in fit.warnings:
            surfaces.setdefault(warning, []).append(name)
    found = [warning if len(fits) == 1 else _naming(names, warning) for warning, names in surfaces.items()]
    for skin in placed:
        fit = fits[skin.patch.surface]
        found += (*_untrusted(skin.patch, fit), *skin.warnings, *normal_warnings(skin.patch, fit.given_mesh))
        found += unknown_sigma(skin.patch, fit)
    found += overlap_warnings([skin.patch for skin in placed])
    return tuple(worst_first(found))


def _naming(names: list[str], warning: Warning) -> Warning:
    """Return a warning about one or more surfaces with their names at the start of its message."""
    message = f"Surface{'s' * (len(names) > 1)} {listed([repr(name) for name in names])}: {warning.message}"
    return replace(warning, message=message, where=replace(warning.where, surface=names[0]))


def _untrusted(patch: Patch, fit: SurfaceFit) -> Iterator[Warning]:
    """Yield a warning if taxels of a patch are where the surface does not follow the mesh."""
    over = np.flatnonzero(~fit.is_trusted(patch.taxels.uv))
    if len(over):
        past = ndimage.binary_dilation(fit.samples.outside_outline(fit.lines.closed))
        are_outside = np.array([past[nearest_site(fit.samples, uv, fit.lines.closed)] for uv in patch.taxels.uv[over]])
        region = fit.lines.region
        are_out = region is not None and ~region(fit.surface.points(patch.taxels.uv[over]))
        kinds = np.where(
            are_out,
            "outside the boundary",
            np.where(are_outside, "outside of the outline of the mesh", "over a hole of the mesh"),
        )
        message = (
            f"{len(over)} of {len(patch.taxels.ids)} taxels of {patch.name} are {' or '.join(np.unique(kinds))}, "
            f"where the surface is extrapolated: {listed([patch.taxels.ids[i] for i in over])}."
        )
        advice = "Close the hole, or move the skin." if "a hole" in message else "Move the skin, or trim it."
        yield cells_warning("over-hole", patch, over, message, float(len(over)), advice)


def surface_model(surface: Surface, fit: SurfaceFit) -> SurfaceModel:
    """Convert a fitted surface of a plan to the record of a calibration."""
    s, trusted = fit.surface, trusted_of(surface, fit)
    shape = s.degree, s.knots_u, s.knots_v, s.control_net, s.closed
    return SurfaceModel(surface.name, *shape, fit.errors, trusted=trusted)


def trusted_of(surface: Surface, fit: SurfaceFit) -> Trusted:
    """Return where a fitted surface follows its mesh: as `SurfaceFit.is_trusted`, with straight edges in (u, v)."""
    loops = surface.grid.region.boundary if isinstance(surface.grid, Grid) else ()
    boundary = tuple(np.clip(footpoints(fit.surface, np.array(loop))[0], 0, 1) for loop in loops)
    met = ~np.isnan(fit.residuals)
    letters = np.where(met, "1", np.where(fit.samples.missed, "0", "-"))
    return Trusted(boundary, () if met.all() else tuple("".join(row) for row in letters.tolist()))


def surface_of(model: SurfaceModel) -> BSplineSurface:
    """Convert the record of a calibration to a surface that can be evaluated."""
    return BSplineSurface(model.control_net, model.knots_u, model.knots_v, model.degree, model.closed)
