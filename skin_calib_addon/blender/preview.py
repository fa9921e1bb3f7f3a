# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn of a plan before it is fitted with all its errors, as quickly as it can be had."""

from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..errors import SkinCalibError
from ..geometry import cut_cover
from ..laying import lay_all
from ..pipeline import fit_grid
from ..plan import Plan, plan_document
from .facets import Facets
from .layers import Layer, layers_of
from .sketch import HandPlanes, Sketch, sketch_of


@dataclass(frozen=True)
class Told:
    """What the panel says of a preview."""

    mean: float  # distance along the rays of the fit [m]
    seconds: float
    problem: str = ""


@dataclass(eq=False)
class Kept:
    """What the steps of a link's last preview gave, and what each was made from."""

    steps: dict[str, tuple[Any, Any]] = field(default_factory=dict)

    def step(self, name: str, asked: Any, same: Callable[[Any, Any], bool], make: Callable[[], Any]) -> Any:
        """What a step gave before if the same was asked of it, else what it gives now."""
        if name not in self.steps or not same(asked, self.steps[name][0]):
            self.steps[name] = asked, make()
        return self.steps[name][1]


@dataclass(frozen=True, eq=False)
class Look:
    """A preview."""

    sketch: Sketch
    layers: tuple[Layer, ...] = ()
    told: Told | None = None


def look(kept: Kept, start: float, facets: Facets, planes: HandPlanes, plan: Plan | None, problem: str) -> Look:
    """Sketch the planes; where there is a plan, fit and lay without the exact errors."""
    mesh = kept.step("mesh", facets, Facets.is_same, facets.mesh)
    sketch = sketch_of(mesh, planes) if planes.are_there else Sketch()
    if plan is None:
        return Look(sketch, told=Told(0.0, 0.0, problem) if problem else None)
    asked = plan_document(plan)
    grid = asked["grid"], asked["degree"], plan.chords
    try:
        cover = kept.step("cover", (mesh, asked["cover"]), _equal, lambda: cut_cover(mesh, plan.cover))
        fit = kept.step("fit", (cover, *grid), _equal, lambda: fit_grid(cover, plan.grid, plan.degree, plan.chords))
        patches = tuple(done.patch for done in lay_all(plan.skins, fit))
    except SkinCalibError as error:
        return Look(sketch, told=Told(0.0, 0.0, str(error)))
    drawn = SimpleNamespace(fit=fit, calibration=SimpleNamespace(patches=patches))
    mean = float(np.nanmean(np.abs(fit.residuals)))
    return Look(sketch, layers_of(drawn), Told(mean, perf_counter() - start))


def _equal(asked: tuple[Any, ...], before: tuple[Any, ...]) -> bool:
    """Whether the same mesh, by identity, was asked the same."""
    return asked[0] is before[0] and asked[1:] == before[1:]
