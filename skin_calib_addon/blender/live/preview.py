# SPDX-License-Identifier: GPL-3.0-or-later
"""Compute a preview of a plan: sketch, surface and skin without exact errors, as fast as possible."""

from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter
from types import SimpleNamespace
from typing import Any

import numpy as np

from ...common.errors import SkinCalibError
from ...common.file_hash import file_hash
from ...geometry import cut_cover, fit_grid
from ...pipeline.place_skins import PlacedSkin, place_all
from ...pipeline.sources import taxel_files
from ...plan import Plan
from ..overlay.layers import Layers, layers_of
from ..scene.facets import Facets
from ..scene.skins import in_window
from .sketch import HandPlanes, Sketch, sketch_of


@dataclass(frozen=True)
class PreviewReport:
    """What the panel shows of a preview."""

    mean: float = 0.0  # distance along the rays of the fit [m]
    seconds: float = 0.0  # from the change to the preview [s]
    problem: str = ""  # why there is no preview; the other values are then invalid


@dataclass(eq=False)
class StepCache:
    """The results of the steps of a link's last preview, with their inputs."""

    steps: dict[str, tuple[Any, Any]] = field(default_factory=dict)

    def step(self, name: str, given: Any, same: Callable[[Any, Any], bool], make: Callable[[], Any]) -> Any:
        """Return the result of a step: the last one if its input is the same, else a new one.

        Parameters
        ----------
        name : str
            Of the step.
        given : object
            Input.
        same : function
            Returns whether two inputs are the same.
        make : function
            Computes the result.
        """
        if name not in self.steps or not same(given, self.steps[name][0]):
            self.steps[name] = given, make()
        return self.steps[name][1]

    def placed(self, skins: Any) -> tuple[PlacedSkin, ...]:
        """Return the placements of these skins on the last surface; empty if the skins were different."""
        before, placed = self.steps.get("placed", ((None, None), ()))
        return placed if before[1] == skins else ()


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
    problem: str  # what is wrong with the plan
    shown: set[str]  # names of the layers that are switched on


def compute_preview(cache: StepCache, given: PreviewInput) -> Preview:
    """Sketch the planes; if there is a plan, fit the surface and place the skins, without exact errors.

    Parameters
    ----------
    cache : StepCache
        Of the link.
    given : PreviewInput
        From the scene.
    """
    mesh = cache.step("mesh", given.facets, Facets.is_same, given.facets.mesh)
    sketch = cache.step("sketch", (mesh, given.planes), _same_planes, lambda: sketch_of(mesh, given.planes))
    plan = given.plan
    if plan is None:
        return Preview(sketch, report=PreviewReport(problem=given.problem) if given.problem else None)
    skins = plan.skins, [file_hash(path) for path in taxel_files(plan)]
    grid = plan.grid, plan.degree, plan.chords, plan.max_deviation
    try:
        cover = cache.step("cover", (mesh, plan.cover), _equal, lambda: cut_cover(mesh, plan.cover))
        fit = cache.step("fit", (cover, *grid), _equal, lambda: fit_grid(cover, *grid))
        near = cache.placed(skins)
        placed = cache.step("placed", (fit, skins), _equal, lambda: place_all(plan.skins, fit, near))
    except SkinCalibError as error:
        return Preview(sketch, report=PreviewReport(problem=in_window(error)))
    patches = tuple(done.patch for done in placed)
    layers = layers_of(SimpleNamespace(fit=fit, calibration=SimpleNamespace(patches=patches)))
    for _ in layers.shown(given.shown):  # computed here, in the thread
        pass
    mean = float(np.nanmean(np.abs(fit.residuals)))
    return Preview(sketch, layers, PreviewReport(mean, perf_counter() - given.start))


def _equal(given: tuple[Any, ...], before: tuple[Any, ...]) -> bool:
    """Return whether mesh (by identity) and parameters are the same."""
    return given[0] is before[0] and given[1:] == before[1:]


def _same_planes(given: tuple[Any, HandPlanes], before: tuple[Any, HandPlanes]) -> bool:
    """Return whether mesh (by identity) and planes are the same."""
    return given[0] is before[0] and given[1].is_same(before[1])
