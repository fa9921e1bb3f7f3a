"""From one link's mesh to its taxels: the whole flow on one page."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from time import perf_counter

import numpy as np

from . import __version__
from .calibration.model import LinkCalibration, MeshSource, Patch, SurfaceModel
from .geometry.auto import fit_grid
from .geometry.bspline import BSplineSurface
from .geometry.cover import cut_cover
from .geometry.fit import SurfaceFit
from .geometry.mesh import TriangleMesh, load_mesh
from .plan import Plan
from .plan_skins import BoardSkin, Skin, first_channels
from .skin.board_taxels import board_taxels
from .skin.doubts import sitting_doubts
from .skin.joined import joined
from .skin.layout import lay_boards
from .skin.strain import Closure, closure
from .skin.taxels import sheet_taxels
from .skin.wrap import wrap_sheet

SURFACE = "cover"


@dataclass(frozen=True, eq=False)
class Laid:
    """A patch on the surface, and how it closes round the link if it does."""

    patch: Patch
    closure: Closure | None = None


@dataclass(frozen=True, eq=False)
class Calibrated:
    """A calibration, and what it was made from, for reports and pictures."""

    calibration: LinkCalibration
    cover: TriangleMesh
    fit: SurfaceFit
    laid: tuple[Laid, ...]
    seconds: dict[str, float]  # by stage

    @cached_property
    def doubts(self) -> tuple[str, ...]:
        """What the author should look at: of the fit, and taxels that lie where the mesh has a hole."""
        of_patches = (_untrusted(p.patch, self.fit) + sitting_doubts(p.patch, p.closure) for p in self.laid)
        return self.fit.doubts + tuple(doubt for doubts in of_patches for doubt in doubts)


def calibrate(plan: Plan, mesh: TriangleMesh | None = None) -> Calibrated:
    """Cut the cover, fit the surface, wrap the skins.

    Parameters
    ----------
    plan : Plan
    mesh : TriangleMesh, optional
        The link's mesh where it is at hand, as in a scene; else it is read from the plan's file.

    Raises
    ------
    SkinCalibError
        With what is wrong, where, and what to do.
    """
    seconds: dict[str, float] = {}
    with stage(seconds, "load"):
        mesh = load_mesh(plan.mesh, plan.unit) if mesh is None else mesh
    with stage(seconds, "cut"):
        cover = cut_cover(mesh, plan.cover)
    with stage(seconds, "fit"):
        fit = fit_grid(cover, plan.grid, plan.degree, plan.chords)
    with stage(seconds, "wrap"):
        laid = lay_all(plan.skins, fit)
        patches = tuple(done.patch for done in laid)
    with stage(seconds, "errors"):
        surface = surface_model(fit)
    source = MeshSource(plan.mesh.name, mesh.sha256, len(mesh.vertices), len(mesh.faces))
    calibration = LinkCalibration(
        plan.link, source, (surface,), patches, plan.response, f"skin-calib {__version__}", plan.extra
    )
    return Calibrated(calibration, cover, fit, laid, seconds)


@contextmanager
def stage(seconds: dict[str, float], name: str) -> Iterator[None]:
    """Time a stage into ``seconds``."""
    start = perf_counter()
    yield
    seconds[name] = perf_counter() - start


def lay(skin: Skin, fit: SurfaceFit, first_channel: int) -> Laid:
    """Lay one skin on the surface of a fit."""
    if isinstance(skin, BoardSkin):
        boards, overhang = lay_boards(
            fit.surface, skin.lattice, skin.choice, skin.origin, skin.direction,
            offset=skin.offset, fit=fit, excluded=skin.excluded,
        )  # fmt: skip
        taxels = board_taxels(boards, skin.name, first_channel, overhang)
        columns, rows = (int(k) + 1 for k in np.ptp(boards.cells, axis=0))
        pitch = skin.lattice.pitch
        return Laid(Patch(skin.name, "hexagons", SURFACE, (columns, rows), (pitch, pitch), taxels, offset=skin.offset))
    sheet = wrap_sheet(
        fit.surface, skin.lattice, skin.origin, skin.direction,
        offset=skin.offset, landmarks=skin.landmarks, trim=skin.trim,
    )  # fmt: skip
    taxels = sheet_taxels(sheet, skin.name, first_channel)
    shape = (skin.lattice.rows, skin.lattice.columns)
    patch = Patch(skin.name, "sheet", SURFACE, shape, skin.lattice.pitch, taxels, offset=skin.offset)
    return Laid(patch, closure(sheet))


def lay_all(skins: tuple[Skin, ...], fit: SurfaceFit) -> tuple[Laid, ...]:
    """Lay the skins of a link one after another, and join those that touch."""
    laid: list[Laid] = []
    for k, skin in enumerate(skins):
        counts = [
            len(done.patch.taxels.ids) if other.count is None else other.count for done, other in zip(laid, skins)
        ]
        first = first_channels(skins[: k + 1], [*counts, None])[k]
        assert first is not None  # the numbers of all skins before are known
        laid.append(lay(skin, fit, first))
    first_channels(skins, [skin.count or len(done.patch.taxels.ids) for skin, done in zip(skins, laid)])
    patches = joined(tuple(done.patch for done in laid))
    return tuple(replace(done, patch=patch) for done, patch in zip(laid, patches))


def _untrusted(patch: Patch, fit: SurfaceFit) -> tuple[str, ...]:
    """The taxels of a patch that lie where the surface spans a hole, in a line, if there are any."""
    over = np.flatnonzero(~fit.is_trusted(patch.taxels.uv))
    if len(over) == 0:
        return ()
    ids = ", ".join(str(patch.taxels.ids[i]) for i in over[:5]) + (", ..." if len(over) > 5 else "")
    return (f"{len(over)} taxels of {patch.name} lie over a hole of the mesh, where the surface is a guess: {ids}",)


def surface_model(fit: SurfaceFit) -> SurfaceModel:
    """The fitted surface as the calibration keeps it."""
    s = fit.surface
    return SurfaceModel(SURFACE, s.degree, s.knots_u, s.knots_v, s.control_net, s.closed, fit.errors)


def surface_of(model: SurfaceModel) -> BSplineSurface:
    """A surface kept in a calibration, ready to evaluate."""
    return BSplineSurface(model.control_net, model.knots_u, model.knots_v, model.degree, model.closed)
