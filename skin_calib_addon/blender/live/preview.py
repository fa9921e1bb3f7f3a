# SPDX-License-Identifier: GPL-3.0-or-later
"""Compute a preview of a plan: sketch, surface and skin without exact errors, as fast as possible."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from time import perf_counter
from types import SimpleNamespace
from typing import Any

import numpy as np

from ...common.errors import SkinCalibError
from ...common.file_hash import file_hash
from ...common.warnings import Warning
from ...geometry import SurfaceFit, cut_cover, fit_grid, fit_surface
from ...geometry.grid.grids import Grid, Size
from ...geometry.mesh.clustering import COARSE_FACES, coarse_cover
from ...geometry.mesh.outliers import without_outliers
from ...geometry.mesh.triangle_mesh import TriangleMesh
from ...pipeline.place_skins import Draft, PlacedSkin, place_all
from ...pipeline.sources import taxel_files
from ...plan import Plan
from ...plan.checks import naming_surface
from ...plan.plan import Surface
from ...plan.skins import BoardSkin, Skin
from ..overlay.layers import Layers, layers_of
from ..scene.facets import Facets
from ..scene.warnings import refusal_of
from .sketch import HandPlanes, Sketch, sketch_of

# [1] faces of a mesh up to which a preview fits as exactly as the complete fit. Larger: more previews are exact, and
# take longer.
MAX_EXACT_FACES = 50_000
# [1] planes of a grid up to which it does. With twice as many the spacing "auto" takes four times as long.
MAX_EXACT_PLANES = 24


@dataclass(frozen=True)
class PreviewReport:
    """What the panel shows of a preview."""

    mean: float = 0.0  # distance along the rays of the fit [m]
    seconds: float = 0.0  # from the change to the preview [s]
    interpolated: bool = False  # whether cells are between others that have been placed
    coarse: bool = False  # whether a surface was fitted fast and not exactly: large mesh or grid, or cuts move
    left_out: bool = False  # whether skins are left out, because the search for boards takes long
    refusal: Warning | None = None  # why there is no preview or fit; the other values are then invalid

    @property
    def problem(self) -> str:
        """Return the text of the refusal; empty without one."""
        return self.refusal.message if self.refusal else ""


@dataclass(eq=False)
class StepCache:
    """The results of the steps of a link's last preview, with their inputs: meshes and fits compare by identity."""

    steps: dict[str, tuple[Any, Any]] = field(default_factory=dict)

    def step(self, name: str, given: Any, make: Callable[[], Any]) -> Any:
        """Return the result of a step: the last one if its input is the same, else a new one."""
        if name not in self.steps or given != self.steps[name][0]:
            self.steps[name] = given, make()
        return self.steps[name][1]

    @property
    def placed(self) -> dict[str, PlacedSkin]:
        """Return the last placements of the skins by their names; empty without one."""
        return {done.patch.name: done for done in self.steps.get("placed", (None, ()))[1]}


@dataclass(frozen=True, eq=False)
class Preview:
    """A preview."""

    sketch: Sketch
    layers: Layers | None = None
    report: PreviewReport | None = None


@dataclass(frozen=True, eq=False)
class PreviewInput:
    """The input of a preview, read from the scene."""

    start: float  # time at the start [s]
    facets: Facets
    planes: HandPlanes
    plan: Plan | None  # None if Live is off, or if the plan is wrong
    refusal: Warning | None  # what is wrong with the plan
    shown: set[str]  # names of the layers that are switched on


def compute_preview(cache: StepCache, given: PreviewInput) -> Preview:
    """Sketch the planes; if there is a plan, fit the surface and place the skins, without exact errors."""
    mesh = cache.step("mesh", given.facets, given.facets.mesh)
    plan = given.plan
    moving = {surface.name for surface in plan.surfaces if _cuts_move(cache, mesh, surface)} if plan else set()
    drawn = mesh, given.planes, bool(moving)
    sketch = cache.step("sketch", drawn, lambda: sketch_of(*drawn))
    if plan is None:
        return Preview(sketch, report=PreviewReport(refusal=given.refusal) if given.refusal else None)
    given_skins, plan = plan.skins, replace(plan, skins=placed_at_once(plan.skins))
    skins = plan.skins, [file_hash(path) for path in taxel_files(plan)]
    judged = "TILT" in given.shown, "UNCERTAINTY" in given.shown
    is_fine = len(mesh.faces) > COARSE_FACES  # also where cuts move: then the fit is to a mesh of about as many
    draft = Draft(cache.placed, *judged, on_facets=is_fine)
    stated = *judged, plan.mesh_uncertainty

    def placed_on(coarse: bool, moving: set[str]) -> tuple[dict[str, SurfaceFit], tuple[PlacedSkin, ...], bool]:
        found = {s.name: _fit(cache, mesh, plan, s, coarse, s.name in moving) for s in plan.surfaces}
        fits = {name: fit for name, (fit, _) in found.items()}
        placed = cache.step("placed", (fits, skins, stated), lambda: place_all(plan, fits, draft))
        return fits, placed, coarse or any(moved for _, moved in found.values())

    sizes = [surface.grid.size for surface in plan.surfaces if isinstance(surface.grid, Grid)]
    planes = max((size.n for size in sizes if isinstance(size, Size)), default=0)
    coarse = len(mesh.faces) > MAX_EXACT_FACES or planes > MAX_EXACT_PLANES
    try:
        try:
            fits, placed, coarse = placed_on(coarse, moving)
        except SkinCalibError:
            if not coarse and not moving:
                raise
            fits, placed, coarse = placed_on(False, set())  # only what cannot be fitted exactly is refused
    except SkinCalibError as error:
        return Preview(sketch, report=PreviewReport(refusal=refusal_of(error)))
    layers = layers_of(SimpleNamespace(fits=fits, placed=placed), is_preview=True)
    for _ in layers.shown(given.shown):  # computed here, in the thread
        pass
    interpolated = any(done.sheet is not None and done.sheet.interpolated for done in placed)
    mean = max(float(np.nanmean(np.abs(fit.residuals))) for fit in fits.values())
    left_out = len(plan.skins) < len(given_skins)
    return Preview(sketch, layers, PreviewReport(mean, perf_counter() - given.start, interpolated, coarse, left_out))


def placed_at_once(skins: tuple[Skin, ...]) -> tuple[Skin, ...]:
    """Return the skins that a preview has: none for whose boards a search is needed, and none with unknown channels.

    The search takes up to two seconds. The channels of a skin can follow those of the boards before it.
    """
    kept, is_known = [], True
    for skin in skins:
        is_known = is_known or skin.first_channel is not None
        if isinstance(skin, BoardSkin) and isinstance(skin.choice, str):
            is_known = False
        elif is_known:
            kept.append(skin)
    return tuple(kept)


def _cuts_move(cache: StepCache, mesh: TriangleMesh, surface: Surface) -> bool:
    """Return whether other cuts than in the last preview are applied to the same mesh, and the lines can follow them.

    Another mesh may have another axis.
    """
    last = cache.steps.get(f"fit {surface.name}")
    is_followed = isinstance(surface.grid, Grid) and isinstance(surface.grid.size, Size)
    if last is None or not is_followed:
        return False
    (of, cover, *_), _ = last
    return of is mesh and cover.shell == surface.cover.shell and cover.cuts != surface.cover.cuts


def _fit(
    cache: StepCache, mesh: TriangleMesh, plan: Plan, surface: Surface, coarse: bool, is_moving: bool
) -> tuple[SurfaceFit, bool]:
    """Return the fit of one surface of a plan, from the cache where nothing has changed, and whether its lines moved.

    While cuts move, the lines of the last fit move with them, on a coarse mesh, if the rest is the same.
    """
    settings = surface.grid, surface.degree, surface.chords, surface.max_deviation, coarse
    step = f"fit {surface.name}"
    given_before, before = cache.steps.get(step, (None, None))
    is_moved = is_moving and given_before is not None and given_before[2:-1] == settings

    def fitted() -> SurfaceFit:
        if not is_moved:
            given = mesh, surface.cover
            cover = cache.step(f"cover {surface.name}", given, lambda: cut_cover(*given))
            return fit_grid(cover, *settings)
        cover = coarse_cover(mesh, surface.cover)
        lines = surface.grid.moved_lines(before.lines, without_outliers(cover)[0])
        return fit_surface(cover, lines, *settings[1:], before.offsets)

    with naming_surface(plan, surface.name):
        fit: SurfaceFit = cache.step(step, (mesh, surface.cover, *settings, is_moved), fitted)
    return fit, is_moved
