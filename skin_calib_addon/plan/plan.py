"""The plan of one link: everything that turns its mesh into its calibration."""

import os.path
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..calibration.modality import Modality
from ..calibration.response import AnyResponse, Response
from ..common.mesh_uncertainty import MeshUncertainty
from ..common.warnings import Warning
from ..geometry.fit.diagnosis import MAX_DEVIATION
from ..geometry.grid.grids import Grid, PlanesGrid
from ..geometry.mesh.cover import CoverSpec
from ..geometry.mesh.triangle_mesh import TriangleMesh
from .skins import ImportedSkin, Skin

PROPOSAL_MESH = "x_proposal_mesh"  # Format: member of a proposed plan, the hash of the mesh for which it was proposed
SURFACE = "cover"  # name of the surface of a plan of version 1


@dataclass(frozen=True)
class Surface:
    """A surface that is fitted to a part of the mesh; skins are placed on it."""

    cover: CoverSpec
    grid: Grid | PlanesGrid
    degree: tuple[int, int] = (3, 3)
    chords: bool = False  # whether the mesh's facets are chords of the true surface
    max_deviation: float = MAX_DEVIATION  # of the surface from the mesh; above, the fit is refused [m]
    name: str = SURFACE


@dataclass(frozen=True)
class Plan:
    """Everything that turns one link's mesh into its calibration."""

    link: str
    mesh: Path
    unit: str
    surfaces: tuple[Surface, ...]
    skins: tuple[Skin, ...]
    response: AnyResponse = Response()
    extra: dict[str, Any] = field(default_factory=dict)  # ``x_`` members, kept as they came
    modalities: tuple[Modality, ...] = ()  # further quantities that taxels measure
    mesh_uncertainty: MeshUncertainty = MeshUncertainty()  # of the part from its mesh
    warnings: tuple[Warning, ...] = ()  # about the scene that it was read from; a plan file has none

    @property
    def surface(self) -> Surface:
        """Return the surface of a plan that has only one."""
        (only,) = self.surfaces
        return only

    def surface_of(self, skin: Skin) -> str:
        """Return the name of the surface that a skin of this plan is on."""
        return self.surfaces[0].name if skin.surface is None else skin.surface

    def is_for(self, mesh: TriangleMesh) -> bool:
        """Return whether a mesh [m] is that of the proposal of this plan; True for any mesh if no proposal made it."""
        return PROPOSAL_MESH not in self.extra or self.extra[PROPOSAL_MESH] == mesh.sha256


def named_from(plan: Plan, folder: Path) -> Plan:
    """Return the plan with its files named from a folder, as a plan file in that folder has them.

    Parameters
    ----------
    plan : Plan
        Its files have absolute paths, or paths from the current folder.
    folder : Path
        Start of the relative paths.

    Returns
    -------
    Plan
        Its files have paths from ``folder``, or absolute paths if they are on another drive.
    """

    def named(path: Path) -> Path:
        try:
            return Path(os.path.relpath(path, folder))
        except ValueError:  # on another drive
            return path.absolute()

    skins = tuple(replace(s, file=named(s.file)) if isinstance(s, ImportedSkin) else s for s in plan.skins)
    return replace(plan, mesh=named(plan.mesh), skins=skins)
