# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn of a plan before it is fitted with all its errors, as quickly as it can be had."""

from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter
from types import SimpleNamespace
from typing import Any

import numpy as np

from ...common.errors import SkinCalibError
from ...geometry import cut_cover, fit_grid
from ...pipeline.place_skins import PlacedSkin, place_all
from ...pipeline.sources import file_hash, taxel_files
from ...plan import Plan, plan_document
from ..overlay.layers import Layers, layers_of
from ..scene.facets import Facets
from ..scene.skins import in_window
from .sketch import HandPlanes, Sketch, sketch_of


@dataclass(frozen=True)
class Told:
    """What the panel says of a preview."""

    mean: float = 0.0  # distance along the rays of the fit [m]
    seconds: float = 0.0  # from the change to the preview
    problem: str = ""  # why there is no preview; then the others say nothing


@dataclass(eq=False)
class Kept:
    """What the steps of a link's last preview gave, and what each was made from."""

    steps: dict[str, tuple[Any, Any]] = field(default_factory=dict)

    def step(self, name: str, asked: Any, same: Callable[[Any, Any], bool], make: Callable[[], Any]) -> Any:
        """What a step gave before if the same was asked of it, else what it gives now."""
        if name not in self.steps or not same(asked, self.steps[name][0]):
            self.steps[name] = asked, make()
        return self.steps[name][1]

    def placed(self, skins: Any) -> tuple[PlacedSkin, ...]:
        """How the same skins lay on the last surface; nothing if they were others."""
        before, placed = self.steps.get("placed", ((None, None), ()))
        return placed if before[1] == skins else ()


@dataclass(frozen=True, eq=False)
class Look:
    """A preview."""

    sketch: Sketch
    layers: Layers | None = None
    told: Told | None = None


@dataclass(frozen=True, eq=False)
class Asked:
    """What a preview is made from, read from the scene."""

    start: float  # when that began [s]
    facets: Facets
    planes: HandPlanes
    plan: Plan | None  # None where the author does not want surface and skin to follow
    problem: str  # or why there is none
    shown: set[str]  # names of the layers that are switched on


def look(kept: Kept, asked: Asked) -> Look:
    """Sketch the planes; where there is a plan, fit and lay without the exact errors."""
    mesh = kept.step("mesh", asked.facets, Facets.is_same, asked.facets.mesh)
    sketch = kept.step("sketch", (mesh, asked.planes), _same_planes, lambda: sketch_of(mesh, asked.planes))
    plan = asked.plan
    if plan is None:
        return Look(sketch, told=Told(problem=asked.problem) if asked.problem else None)
    doc = plan_document(plan)
    skins = doc["skins"], [file_hash(path) for path in taxel_files(plan)]
    grid = doc["grid"], doc["degree"], plan.chords
    try:
        cover = kept.step("cover", (mesh, doc["cover"]), _equal, lambda: cut_cover(mesh, plan.cover))
        fit = kept.step("fit", (cover, *grid), _equal, lambda: fit_grid(cover, plan.grid, plan.degree, plan.chords))
        near = kept.placed(skins)
        placed = kept.step("placed", (fit, skins), _equal, lambda: place_all(plan.skins, fit, near))
    except SkinCalibError as error:
        return Look(sketch, told=Told(problem=in_window(error)))
    patches = tuple(done.patch for done in placed)
    layers = layers_of(SimpleNamespace(fit=fit, calibration=SimpleNamespace(patches=patches)))
    for _ in layers.shown(asked.shown):  # made here, beside the main thread
        pass
    mean = float(np.nanmean(np.abs(fit.residuals)))
    return Look(sketch, layers, Told(mean, perf_counter() - asked.start))


def _equal(asked: tuple[Any, ...], before: tuple[Any, ...]) -> bool:
    """Whether the same mesh, by identity, was asked the same."""
    return asked[0] is before[0] and asked[1:] == before[1:]


def _same_planes(asked: tuple[Any, HandPlanes], before: tuple[Any, HandPlanes]) -> bool:
    """Whether the same mesh, by identity, was asked the same planes."""
    return asked[0] is before[0] and asked[1].is_same(before[1])
